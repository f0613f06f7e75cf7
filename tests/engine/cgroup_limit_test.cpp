// Memory limits of control groups, read from folders that play the root of a file system.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "engine/cgroup_limit.h"

namespace shoal {
namespace {

constexpr uint64_t kMiB = 1ull << 20;
/// What version 1 shows for "no limit": the largest multiple of a page.
constexpr const char* kUnlimited1 = "9223372036854771712\n";

class CgroupLimit : public ::testing::Test {
 protected:
  void SetUp() override {
    root_ = std::filesystem::temp_directory_path() / ("shoal-cgroup-" + std::to_string(::getpid()));
    std::filesystem::remove_all(root_);
    std::filesystem::create_directories(root_);
  }
  void TearDown() override {
    std::error_code code;
    std::filesystem::remove_all(root_, code);
  }
  void put(const std::string& path, const std::string& text) const {
    std::filesystem::create_directories((root_ / path).parent_path());
    std::ofstream(root_ / path) << text;
  }
  void put_limit(const std::string& path, uint64_t mib) const { put(path, std::to_string(mib * kMiB) + "\n"); }
  uint64_t limit_mib() const { return cgroup_limit_bytes(root_.string()) / kMiB; }
  bool unlimited() const { return cgroup_limit_bytes(root_.string()) == kNoLimit; }

  std::filesystem::path root_;
};

constexpr const char* kMount1 = "35 31 0:32 / /sys/fs/cgroup/memory rw,relatime - cgroup cgroup rw,memory\n";
constexpr const char* kMount2 = "41 31 0:38 / /sys/fs/cgroup rw,relatime shared:9 - cgroup2 cgroup2 rw,nsdelegate\n";
constexpr const char* kHybrid2 = "41 31 0:38 / /sys/fs/cgroup/unified rw,relatime - cgroup2 cgroup2 rw\n";

TEST_F(CgroupLimit, IsNoneWhereNothingCanBeRead) { EXPECT_TRUE(unlimited()); }

TEST_F(CgroupLimit, OfVersion2IsTheSmallestOfTheGroupAndThoseAboveIt) {
  put("proc/self/mountinfo", kMount2);
  put("proc/self/cgroup", "0::/user.slice/job.scope\n");
  put("sys/fs/cgroup/user.slice/job.scope/memory.max", "max\n");
  EXPECT_TRUE(unlimited()) << "the root of version 2 has no file, and 'max' is no limit";
  put_limit("sys/fs/cgroup/user.slice/memory.max", 700);
  EXPECT_EQ(limit_mib(), 700u);
  put_limit("sys/fs/cgroup/user.slice/job.scope/memory.max", 900);
  EXPECT_EQ(limit_mib(), 700u);
  put_limit("sys/fs/cgroup/user.slice/job.scope/memory.max", 300);
  EXPECT_EQ(limit_mib(), 300u);
  put_limit("sys/fs/cgroup/user.slice/job.scope/memory.high", 200);
  EXPECT_EQ(limit_mib(), 200u) << "above memory.high the process is slowed down";
  put_limit("sys/fs/cgroup/other/memory.max", 1);
  EXPECT_EQ(limit_mib(), 200u) << "not above this process";
}

TEST_F(CgroupLimit, OfVersion1IsTheSmallestOfTheGroupAndThoseAboveIt) {
  put("proc/self/mountinfo", kMount1);
  put("proc/self/cgroup", "9:name=systemd:/\n4:cpu,memory:/batch/7\n1:cpuset,memory_pressure:/x\n");
  put("sys/fs/cgroup/memory/memory.limit_in_bytes", kUnlimited1);
  put("sys/fs/cgroup/memory/batch/memory.limit_in_bytes", kUnlimited1);
  put_limit("sys/fs/cgroup/memory/batch/7/memory.limit_in_bytes", 512);
  EXPECT_EQ(limit_mib(), 512u);
  put_limit("sys/fs/cgroup/memory/batch/memory.limit_in_bytes", 400);
  EXPECT_EQ(limit_mib(), 400u);
  put("sys/fs/cgroup/memory/batch/7/memory.stat",
      "cache 10\nhierarchical_memory_limit " + std::to_string(100 * kMiB) + "\ntotal_cache 5\n");
  EXPECT_EQ(limit_mib(), 100u) << "a limit further up than can be seen";
}

TEST_F(CgroupLimit, IsFoundWhereAContainerSeesOnlyItsOwnGroup) {
  // The mount shows the container's group as its root.
  put("proc/self/mountinfo", "35 31 0:32 /docker/abc /sys/fs/cgroup/memory ro - cgroup cgroup rw,memory\n");
  put("proc/self/cgroup", "4:memory:/docker/abc/inner\n");
  put_limit("sys/fs/cgroup/memory/memory.limit_in_bytes", 256);
  EXPECT_EQ(limit_mib(), 256u);
  put_limit("sys/fs/cgroup/memory/inner/memory.limit_in_bytes", 128);
  EXPECT_EQ(limit_mib(), 128u);
  // The path is the host's and means nothing here.
  put("proc/self/cgroup", "4:memory:/elsewhere/on/the/host\n");
  EXPECT_EQ(limit_mib(), 256u);
  put("proc/self/cgroup", "4:memory:/docker/abcdef\n");
  EXPECT_EQ(limit_mib(), 256u);
  put("proc/self/cgroup", "4:memory:/../inner\n");
  EXPECT_EQ(limit_mib(), 256u);
}

TEST_F(CgroupLimit, OfAHybridMountIsTheSmallerOfBothVersions) {
  put("proc/self/mountinfo", std::string(kMount1) + kHybrid2);
  put("proc/self/cgroup", "4:memory:/a\n0::/b\n");
  put_limit("sys/fs/cgroup/memory/a/memory.limit_in_bytes", 300);
  EXPECT_EQ(limit_mib(), 300u);
  put_limit("sys/fs/cgroup/unified/b/memory.max", 200);
  EXPECT_EQ(limit_mib(), 200u);
  put_limit("sys/fs/cgroup/unified/a/memory.max", 10);
  EXPECT_EQ(limit_mib(), 200u) << "the group of version 1 is none of version 2";
}

TEST_F(CgroupLimit, IsLookedForInTheUsualPlacesWithoutAListOfMounts) {
  put("proc/self/cgroup", "4:memory:/a\n0::/b\n");
  put_limit("sys/fs/cgroup/memory/a/memory.limit_in_bytes", 300);
  EXPECT_EQ(limit_mib(), 300u);
  put_limit("sys/fs/cgroup/b/memory.max", 250);
  EXPECT_EQ(limit_mib(), 250u);
}

TEST_F(CgroupLimit, IsFoundUnderAMountPointWithASpace) {
  put("proc/self/mountinfo", "41 31 0:38 / /sys/my\\040groups rw - cgroup2 cgroup2 rw\n");
  put("proc/self/cgroup", "0::/job\n");
  put_limit("sys/my groups/job/memory.max", 64);
  EXPECT_EQ(limit_mib(), 64u);
}

TEST_F(CgroupLimit, PassesOverLinesThatAreNotUnderstood) {
  put("proc/self/mountinfo", "\nnonsense\n1 2 3\n35 31 0:32 / /proc rw - proc proc rw\n" + std::string(kMount2));
  put("proc/self/cgroup", "\n:\nx\n0:\n0::/job\n");
  put("sys/fs/cgroup/memory.max", "not a number\n");
  EXPECT_TRUE(unlimited());
  put_limit("sys/fs/cgroup/job/memory.max", 32);
  EXPECT_EQ(limit_mib(), 32u);
}

}  // namespace
}  // namespace shoal
