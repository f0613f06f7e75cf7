#include "io/page_loader.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <new>
#include <system_error>
#include <thread>
#include <vector>

#include "io/aligned_buffer.h"
#include "io/async_reader.h"

namespace shoal {
namespace {

/// Threads of the pread pool: enough reads at once to keep one drive busy (docs/design.md, "Numbers to know").
constexpr unsigned kReadThreads = 8;

std::unique_ptr<AsyncReader> make_reader(const PageFile& file, const PagingOptions& options) {
  if (options.backend != ReadBackend::kThreads && file.file().descriptor() >= 0) {
    if (auto reader = make_uring_reader(options.read_depth)) return reader;
  }
  return make_thread_reader(options.read_depth, std::min(options.read_depth, kReadThreads));
}

/// Of a page and the one after it.
uint64_t largest_pair_bytes(const PageFile& file) {
  uint64_t largest = kBlockBytes, before = 0;
  for (const PageRecord& record : file.records()) {
    const uint64_t bytes = record.kind == PageKind::kTable ? 0 : align_up(record.stored_bytes, kBlockBytes);
    largest = std::max(largest, before + bytes);
    before = bytes;
  }
  return largest;
}

}  // namespace

struct PageLoader::State {
  struct Slot {
    PageId page = kNoPage;
    std::byte* out = nullptr;
    std::byte* next_out = nullptr;
    std::span<std::byte> stored;
  };

  State(const PageFile& page_file, const PagingOptions& options, Finished done)
      : file(page_file), finished(std::move(done)), slot_bytes(largest_pair_bytes(page_file)), slots(options.read_depth) {
    for (uint32_t i = options.read_depth; i-- > 0;) free_slots.push_back(i);
    reader = make_reader(file, options);
  }

  /// One thread: verifies and decodes until it is woken at the end.
  void serve() {
    while (auto completion = reader->wait()) {
      const Slot slot = slots[completion->tag];
      const Status& read = completion->status;
      const uint64_t first_bytes = file.stored_range(slot.page).bytes;
      Status first = decode(read, slot.page, slot.stored.first(first_bytes), slot.out);
      Status next;
      if (slot.next_out != nullptr) next = decode(read, slot.page + 1, slot.stored.subspan(first_bytes), slot.next_out);
      {
        const std::lock_guard lock(mutex);
        free_slots.push_back(completion->tag);
      }
      finished(slot.page, slot.out, std::move(first), {first_bytes, 1});
      if (slot.next_out != nullptr) {
        finished(slot.page + 1, slot.next_out, std::move(next), {slot.stored.size() - first_bytes, 0});
      }
      under_way.fetch_sub(1);
      under_way.notify_all();
    }
  }

  Status decode(const Status& read, PageId page, std::span<const std::byte> stored, std::byte* out) const try {
    if (!read.ok()) return read;
    return file.decode_page(page, stored, {out, file.record(page).raw_bytes});
  } catch (const std::bad_alloc&) {
    return Error{ErrorCode::kMemoryCap, "out of memory"};  // short: allocates nothing
  }

  const PageFile& file;
  const Finished finished;
  const uint64_t slot_bytes;
  std::atomic<uint32_t> under_way{0};
  std::mutex mutex;  // guards free_slots
  std::vector<uint32_t> free_slots;
  std::vector<Slot> slots;
  AlignedBuffer buffers;
  std::unique_ptr<AsyncReader> reader;
  std::vector<std::thread> threads;
};

PageLoader::PageLoader(const PageFile& file, const PagingOptions& options, Finished finished)
    : state_(std::make_unique<State>(file, options, std::move(finished))) {
  State& s = *state_;
  const auto memory = s.buffers.reserve(s.slot_bytes * s.slots.size());
  if (!memory.ok()) {  // every page is then read by the thread that wants it
    s.free_slots.clear();
    return;
  }
  for (size_t i = 0; i < s.slots.size(); ++i) s.slots[i].stored = memory.value().subspan(i * s.slot_bytes, s.slot_bytes);
  try {
    for (unsigned i = 0; i < std::max(1u, options.loader_threads); ++i) s.threads.emplace_back([&s] { s.serve(); });
  } catch (const std::system_error&) {  // no more threads: those that there are serve, or nothing is read ahead
    if (s.threads.empty()) s.free_slots.clear();
  }
}

PageLoader::~PageLoader() {
  State& s = *state_;
  finish();
  for (size_t i = 0; i < s.threads.size(); ++i) s.reader->wake();
  for (std::thread& thread : s.threads) thread.join();
}

bool PageLoader::try_start(PageId page, std::byte* out, std::byte* next_out) {
  State& s = *state_;
  uint32_t tag = 0;
  {
    const std::lock_guard lock(s.mutex);
    if (s.free_slots.empty()) return false;
    tag = s.free_slots.back();
    s.free_slots.pop_back();
  }
  s.under_way.fetch_add(1);
  State::Slot& slot = s.slots[tag];
  const StoredRange range = s.file.stored_range(page);
  uint64_t bytes = range.bytes;
  if (next_out != nullptr) {
    const StoredRange next = s.file.stored_range(page + 1);
    SHOAL_CHECK(next.offset == range.offset + range.bytes);
    bytes += next.bytes;
  }
  slot.page = page;
  slot.out = out;
  slot.next_out = next_out;
  slot.stored = {slot.stored.data(), bytes};
  s.reader->submit({&s.file.file(), range.offset, slot.stored, tag});
  return true;
}

void PageLoader::finish() {
  std::atomic<uint32_t>& count = state_->under_way;
  for (uint32_t left = count.load(); left > 0; left = count.load()) count.wait(left);
}

bool PageLoader::full() const {
  const std::lock_guard lock(state_->mutex);
  return state_->free_slots.empty();
}

unsigned PageLoader::under_way() const { return state_->under_way.load(); }
const char* PageLoader::backend() const { return state_->reader->name(); }

uint64_t PageLoader::buffer_bytes(const PageFile& file, const PagingOptions& options) {
  return options.read_depth == 0 ? 0 : largest_pair_bytes(file) * options.read_depth + (1u << 20);
}

}  // namespace shoal
