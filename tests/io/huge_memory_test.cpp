#include "io/huge_memory.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <new>

namespace shoal {
namespace {

constexpr size_t kHuge = 2u << 20;

TEST(HugeMemory, EverySizeIsAlignedZeroedAndWritableToItsLastByte) {
  for (const size_t bytes : {size_t{0}, size_t{1}, size_t{4096}, kHuge - 1, kHuge, kHuge + 1, 3 * kHuge + 12345}) {
    const HugeMemory memory = map_huge_memory(bytes);
    ASSERT_NE(memory, nullptr) << bytes;
    EXPECT_EQ(reinterpret_cast<uintptr_t>(memory.get()) % (bytes >= kHuge ? kHuge : 4096), 0u) << bytes;
    EXPECT_TRUE(std::all_of(memory.get(), memory.get() + bytes, [](std::byte b) { return b == std::byte{0}; }));
    std::fill_n(memory.get(), bytes, std::byte{7});
  }
}

TEST(HugeMemory, TwoArraysShareNothing) {
  const HugeArray<uint64_t> a(kHuge), b(kHuge);
  for (size_t i = 0; i < kHuge; i += 511) a[i] = i;
  for (size_t i = 0; i < kHuge; i += 511) b[i] = ~i;
  for (size_t i = 0; i < kHuge; i += 511) ASSERT_EQ(a[i], ~b[i]);
}

TEST(HugeMemory, MoreThanThereIsThrows) {
  EXPECT_THROW(map_huge_memory(std::numeric_limits<size_t>::max()), std::bad_alloc);
  EXPECT_THROW(map_huge_memory(std::numeric_limits<size_t>::max() - 4095), std::bad_alloc);
  EXPECT_THROW(map_huge_memory(size_t{1} << 60), std::bad_alloc);
}

}  // namespace
}  // namespace shoal
