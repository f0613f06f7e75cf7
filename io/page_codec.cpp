#include "io/page_codec.h"

#include <lz4.h>
#include <lz4hc.h>
#define XXH_STATIC_LINKING_ONLY  // the size of the state of a piecewise hash
#include <xxhash.h>

#include <cstring>

#include "io/aligned_buffer.h"

namespace shoal {
namespace {

// LZ4 takes sizes as int.
static_assert(kMaxPageBytes <= LZ4_MAX_INPUT_SIZE);

/// What the fast way leaves above three quarters of its size is tried by the thorough one: 14.4 bytes a triangle became
/// 13.1 in the coffee scene. For all pages it would take 1.4 times the processor time of a build, and make that 12.4 and
/// terrain 12 % smaller.
constexpr uint64_t kPoorNumerator = 3, kPoorDenominator = 4;
constexpr int kThoroughLevel = 3;  // of LZ4 HC; the least

char* chars(std::byte* p) { return reinterpret_cast<char*>(p); }
const char* chars(const std::byte* p) { return reinterpret_cast<const char*>(p); }

}  // namespace

uint64_t compressed_bound_bytes(uint64_t raw_bytes) {
  return static_cast<uint64_t>(LZ4_compressBound(static_cast<int>(raw_bytes)));
}

uint32_t compress_page(std::span<const std::byte> raw, std::span<std::byte> out) {
  if (raw.size() <= kPageAlignment) return 0;
  const int raw_size = static_cast<int>(raw.size()), room = static_cast<int>(out.size());
  int size = LZ4_compress_default(chars(raw.data()), chars(out.data()), raw_size, room);
  if (size <= 0 || static_cast<uint64_t>(size) * kPoorDenominator > raw.size() * kPoorNumerator) {
    size = LZ4_compress_HC(chars(raw.data()), chars(out.data()), raw_size, room, kThoroughLevel);
  }
  if (size <= 0) return 0;
  const auto stored = static_cast<uint64_t>(size);
  return align_up(stored, kPageAlignment) < align_up(raw.size(), kPageAlignment) ? static_cast<uint32_t>(stored)
                                                                                 : 0;
}

bool decompress_page(std::span<const std::byte> stored, std::span<std::byte> out) {
  const int size = LZ4_decompress_safe(chars(stored.data()), chars(out.data()), static_cast<int>(stored.size()),
                                       static_cast<int>(out.size()));
  return size >= 0 && static_cast<size_t>(size) == out.size();
}

uint64_t page_checksum(const PageRecord& record, std::span<const std::byte> payload) {
  std::byte head[16];
  std::memcpy(head, &record.id, 4);
  std::memcpy(head + 4, &record.raw_bytes, 4);
  std::memcpy(head + 8, &record.stored_bytes, 4);
  head[12] = static_cast<std::byte>(record.codec);
  head[13] = static_cast<std::byte>(record.kind);
  std::memcpy(head + 14, &record.table, 2);
  XXH3_state_t state;
  XXH3_INITSTATE(&state);
  XXH3_64bits_reset(&state);
  XXH3_64bits_update(&state, head, sizeof(head));
  XXH3_64bits_update(&state, payload.data(), payload.size());
  return XXH3_64bits_digest(&state);
}

uint64_t hash_bytes(std::span<const std::byte> bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }

struct PieceHash::State {
  XXH3_state_t xxh3;
};

PieceHash::PieceHash() : state_(std::make_unique<State>()) {
  XXH3_INITSTATE(&state_->xxh3);
  XXH3_64bits_reset(&state_->xxh3);
}

PieceHash::~PieceHash() = default;

void PieceHash::add(std::span<const std::byte> bytes) {
  XXH3_64bits_update(&state_->xxh3, bytes.data(), bytes.size());
}

uint64_t PieceHash::value() const { return XXH3_64bits_digest(&state_->xxh3); }

}  // namespace shoal
