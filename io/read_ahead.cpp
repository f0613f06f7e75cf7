#include "io/read_ahead.h"

#include <algorithm>
#include <cstring>

namespace shoal {

/// The window that holds the byte, or ends there: a stream that goes on.
ReadAhead::Window* ReadAhead::find(uint32_t key, uint64_t offset) {
  Window* continued = nullptr;
  for (Window& window : windows_) {
    if (window.key != key || window.begin == window.end) continue;
    if (offset >= window.begin && offset < window.end) return &window;
    if (offset == window.end) continued = &window;
  }
  return continued;
}

Status ReadAhead::fill(Window& window, ReadableFile& file, uint64_t offset, uint64_t wanted_bytes) {
  const uint64_t begin = align_down(offset, kBlockBytes);
  const uint64_t end = std::min(align_up(offset + wanted_bytes, kBlockBytes), file.size_bytes());
  window.begin = window.end = 0;  // nothing, should the read fail
  SHOAL_ASSIGN_OR_RETURN(const auto bytes, window.memory.reserve(end - begin));
  SHOAL_RETURN_IF_ERROR(file.read_at(begin, bytes));
  window.bytes = bytes;
  window.begin = begin;
  window.end = end;
  return {};
}

Status ReadAhead::read(ReadableFile& file, uint32_t key, uint64_t offset, std::span<std::byte> out) {
  const uint64_t size = file.size_bytes();
  // Large reads need no help; what reaches past the end must fail as the file itself says it.
  if (out.size() > kWindowBytes || offset > size || out.size() > size - offset) return file.read_at(offset, out);
  while (!out.empty()) {
    Window* window = find(key, offset);
    if (window == nullptr) {
      window = &*std::min_element(windows_.begin(), windows_.end(),
                                  [](const Window& a, const Window& b) { return a.last_used < b.last_used; });
      window->key = key;
      window->next_bytes = 2 * out.size();
      SHOAL_RETURN_IF_ERROR(fill(*window, file, offset, out.size()));
    } else if (offset == window->end) {
      const uint64_t bytes = std::clamp<uint64_t>(window->next_bytes, out.size(), kWindowBytes);
      window->next_bytes = 2 * bytes;
      SHOAL_RETURN_IF_ERROR(fill(*window, file, offset, bytes));
    }
    window->last_used = ++clock_;
    const uint64_t there = std::min<uint64_t>(out.size(), window->end - offset);
    std::memcpy(out.data(), window->bytes.data() + (offset - window->begin), there);
    offset += there;
    out = out.subspan(there);
  }
  return {};
}

}  // namespace shoal
