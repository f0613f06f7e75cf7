#include "tests/fuzz/sums_input.h"

#include <cstring>

#include "engine/sums_file.h"

namespace shoal::fuzz {
namespace {

using Bytes = std::vector<std::byte>;

constexpr uint64_t kMostBytes = 1u << 20;

uint64_t hash_of(std::span<const std::byte> bytes) {
  ContentHash hash;
  hash.add(bytes);
  return hash.value();
}

/// Of the file without the checksum at its end; more than kMostBytes: too much.
uint64_t bytes_before_checksum(const SumsHeader& h) {
  const uint64_t pixels = uint64_t{h.width} * h.height;
  if (pixels > kMostBytes || h.halves > 2 || h.aovs >= 1u << kAovCount || h.unfinished_count > kMostBytes)
    return UINT64_MAX;
  return sums_file_bytes(h) - sizeof(uint64_t);
}

Bytes repaired(Bytes bytes) {
  SumsHeader header;
  if (bytes.size() < sizeof(header)) return bytes;
  std::memcpy(&header, bytes.data(), sizeof(header));
  const uint64_t size = bytes_before_checksum(header);
  if (size > kMostBytes) return bytes;
  bytes.resize(size);
  if (uint64_t{header.identity_bytes} <= size - sizeof(header)) {
    header.identity_hash = hash_of(std::span(bytes).subspan(sizeof(header), header.identity_bytes));
  }
  header.checksum = hash_of(std::as_bytes(std::span(&header, 1)).first(offsetof(SumsHeader, checksum)));
  std::memcpy(bytes.data(), &header, sizeof(header));
  const uint64_t hash = hash_of(bytes);
  bytes.resize(size + sizeof(hash));
  std::memcpy(bytes.data() + size, &hash, sizeof(hash));
  return bytes;
}

}  // namespace

std::vector<std::byte> sums_file_of(std::span<const std::byte> input) {
  if (input.empty()) return {};
  if (input.front() != std::byte{'R'}) return {input.begin(), input.end()};
  return repaired({input.begin() + 1, input.end()});
}

}  // namespace shoal::fuzz
