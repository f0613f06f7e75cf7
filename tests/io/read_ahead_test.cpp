#include "io/read_ahead.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/support/memory_file_system.h"
#include "tests/support/paged_file.h"

namespace shoal {
namespace {

using Bytes = std::vector<std::byte>;

/// Counts what is asked of the file below.
class CountedFile final : public ReadableFile {
 public:
  explicit CountedFile(Bytes bytes) : bytes_(std::move(bytes)) {}
  Status read_at(uint64_t offset, std::span<std::byte> out) override {
    if (failing) return Error{ErrorCode::kStorage, "out of order"};
    if (offset > bytes_.size() || out.size() > bytes_.size() - offset) return Error{ErrorCode::kStorage, "end"};
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(offset), out.size(), out.begin());
    ++reads;
    read_bytes += out.size();
    return {};
  }
  uint64_t size_bytes() const override { return bytes_.size(); }
  const std::string& path() const override { return path_; }

  bool failing = false;
  uint64_t reads = 0, read_bytes = 0;

 private:
  const std::string path_ = "counted";
  const Bytes bytes_;
};

constexpr uint64_t kPiece = 60000;

Bytes slice(const Bytes& all, uint64_t offset, uint64_t size) {
  return Bytes(all.begin() + static_cast<std::ptrdiff_t>(offset), all.begin() + static_cast<std::ptrdiff_t>(offset + size));
}

TEST(ReadAhead, GivesTheSameBytesInAnyOrder) {
  const Bytes all = pattern_bytes(5000001, 3, 0), others = pattern_bytes(700000, 4, 0);
  CountedFile file(all), other(others);
  ReadAhead ahead;
  std::mt19937 random(1);
  for (int i = 0; i < 3000; ++i) {
    const bool first = random() % 4 != 0;
    const Bytes& bytes = first ? all : others;
    const uint64_t size = random() % (i % 50 == 0 ? 600000 : 3 * kPiece), offset = random() % (bytes.size() - size + 1);
    Bytes out(size);
    ASSERT_TRUE(ahead.read(first ? file : other, first ? 0 : 1, offset, out).ok());
    ASSERT_EQ(out, slice(bytes, offset, size)) << offset << " " << size;
  }
  Bytes past(10);
  EXPECT_FALSE(ahead.read(file, 0, all.size() - 9, past).ok());
  EXPECT_FALSE(ahead.read(file, 0, ~0ull - 3, past).ok());
}

TEST(ReadAhead, StreamsInSequenceAreReadOnceInLargeReads) {
  const uint64_t streams = 7, stream_bytes = 100 * kPiece;
  const Bytes all = pattern_bytes(streams * stream_bytes, 3, 0);
  CountedFile file(all);
  ReadAhead ahead;
  Bytes out(kPiece);
  for (uint64_t i = 0; i < 100; ++i) {
    for (uint64_t s = 0; s < streams; ++s) {
      ASSERT_TRUE(ahead.read(file, 0, s * stream_bytes + i * kPiece, out).ok());
      ASSERT_EQ(out, slice(all, s * stream_bytes + i * kPiece, kPiece));
    }
  }
  EXPECT_LT(file.read_bytes, all.size() + streams * 2 * ReadAhead::kWindowBytes);
  EXPECT_LT(file.reads, streams * (stream_bytes / ReadAhead::kWindowBytes + 6));
}

TEST(ReadAhead, ScatteredPiecesReadNoMoreThanTheirBlocks) {
  CountedFile file(pattern_bytes(20000000, 3, 0));
  ReadAhead ahead;
  Bytes out(kPiece);
  uint64_t count = 0;
  for (uint64_t offset = 19900000; offset >= 3 * kPiece; offset -= 3 * kPiece, ++count) {
    ASSERT_TRUE(ahead.read(file, 0, offset, out).ok());
  }
  EXPECT_LE(file.read_bytes, count * (kPiece + 2 * kBlockBytes));
}

TEST(ReadAhead, AFailedReadIsForgotten) {
  const Bytes all = pattern_bytes(1000000, 3, 0);
  CountedFile file(all);
  ReadAhead ahead;
  Bytes out(kPiece);
  ASSERT_TRUE(ahead.read(file, 0, 0, out).ok());
  file.failing = true;
  EXPECT_EQ(ahead.read(file, 0, 2 * kPiece, out).error().code, ErrorCode::kStorage);
  file.failing = false;
  for (const uint64_t offset : {uint64_t{0}, kPiece, 2 * kPiece, 3 * kPiece}) {
    ASSERT_TRUE(ahead.read(file, 0, offset, out).ok());
    EXPECT_EQ(out, slice(all, offset, kPiece));
  }
}

}  // namespace
}  // namespace shoal
