// Children start without a shell, hear signals, are counted and never outlive their starter; locks go with their holders.
#include "io/child_process.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <thread>

#include "io/file.h"
#include "io/file_lock.h"
#include "tests/support/temporary_folder.h"

namespace shoal::testing {
namespace {

using std::chrono::milliseconds;

ChildEnd wait_for(ChildProcess& child) {
  const ChildWatch watch;
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (std::chrono::steady_clock::now() < deadline) {
    if (const auto end = child.ended()) return *end;
    watch.wait(milliseconds(100));
  }
  ADD_FAILURE() << "the child did not end";
  return {};
}

ChildProcess started(const ChildCommand& command) {
  auto child = ChildProcess::start(command);
  EXPECT_TRUE(child.ok()) << child.error().message;
  return std::move(child).value();
}

std::string text_of(const std::string& path) {
  const auto text = read_whole_file(posix_file_system(), path, 1 << 20);
  return text.ok() ? text.value() : text.error().message;
}

TEST(ChildProcess, SaysHowItEndedAndWritesWhereItIsTold) {
  const TemporaryFolder folder;
  auto child = started({{"/bin/sh", "-c", "echo out; echo err >&2; exit 7"}, folder / "log"});
  const ChildEnd end = wait_for(child);
  EXPECT_EQ(end.exit_code, 7);
  EXPECT_EQ(end.signal, 0);
  EXPECT_GT(end.peak_rss_bytes, 0u);
  EXPECT_EQ(text_of(folder / "log"), "out\nerr\n");
  EXPECT_FALSE(child.ended().has_value()) << "told once";
}

TEST(ChildProcess, PassesWordsOnAsTheyAre) {
  const TemporaryFolder folder;
  auto child = started({{"/bin/echo", "two words", "$HOME", "a\nb", "*", "'"}, folder / "log"});
  EXPECT_EQ(wait_for(child).exit_code, 0);
  EXPECT_EQ(text_of(folder / "log"), "two words $HOME a\nb * '\n");
}

TEST(ChildProcess, HearsSignals) {
  const TemporaryFolder folder;
  auto child = started({{"/bin/sleep", "100"}, folder / "log"});
  child.tell(SIGTERM);
  const ChildEnd end = wait_for(child);
  EXPECT_EQ(end.signal, SIGTERM);
  EXPECT_EQ(end.exit_code, -1);
}

TEST(ChildProcess, IsGoneWhenItsOwnerIs) {
  const TemporaryFolder folder;
  pid_t id = 0;
  {
    const auto child = started({{"/bin/sleep", "100"}, folder / "log"});
    id = child.id();
    EXPECT_EQ(::kill(id, 0), 0);
  }
  EXPECT_NE(::kill(id, 0), 0);
}

TEST(ChildProcess, WhatCannotBeStartedIsNamed) {
  const TemporaryFolder folder;
  const auto missing = ChildProcess::start({{folder / "nothing"}, folder / "log"});
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::kStorage);
  EXPECT_NE(missing.error().message.find("nothing"), std::string::npos);
  EXPECT_FALSE(ChildProcess::start({{"/bin/true"}, folder / "no/log"}).ok());
}

TEST(ChildProcess, KeepsOnlyTheDescriptorThatItIsGiven) {
  const TemporaryFolder folder;
  auto lock = FileLock::acquire(folder / "lock", milliseconds(0), nullptr);
  ASSERT_TRUE(lock.ok());
  auto with = started({{"/bin/ls", "/proc/self/fd"}, folder / "with", lock.value().descriptor()});
  auto without = started({{"/bin/ls", "/proc/self/fd"}, folder / "without"});
  wait_for(with), wait_for(without);
  const std::string mine = std::to_string(lock.value().descriptor()) + "\n";
  EXPECT_NE(text_of(folder / "with").find(mine), std::string::npos) << text_of(folder / "with");
  EXPECT_LT(text_of(folder / "without").size(), text_of(folder / "with").size());
}

TEST(ChildProcess, IsToldItsParent) {
  const TemporaryFolder folder;
  auto child = started({{"/bin/sh", "-c", "echo $SHOAL_PARENT"}, folder / "log"});
  wait_for(child);
  EXPECT_EQ(text_of(folder / "log"), std::to_string(::getpid()) + "\n");
}

TEST(ChildProcess, EndsWithItsParent) {
  const TemporaryFolder folder;
  int pipe_ends[2];
  ASSERT_EQ(::pipe(pipe_ends), 0);
  const pid_t parent = ::fork();
  if (parent == 0) {
    const std::string name = std::to_string(::getpid());
    if (::fork() == 0) {
      ::setenv("SHOAL_PARENT", name.c_str(), 1);
      const char ready = end_with_parent() ? '1' : '0';
      (void)!::write(pipe_ends[1], &ready, 1);
      while (true) ::pause();
    }
    while (true) ::pause();
  }
  ::close(pipe_ends[1]);
  char ready = 0;
  ASSERT_EQ(::read(pipe_ends[0], &ready, 1), 1);
  EXPECT_EQ(ready, '1');
  ::kill(parent, SIGKILL);
  ::waitpid(parent, nullptr, 0);
  EXPECT_EQ(::read(pipe_ends[0], &ready, 1), 0) << "the pipe is closed by its end";
  ::close(pipe_ends[0]);
}

TEST(ChildProcess, AParentThatIsGoneIsNoticed) {
  ::setenv("SHOAL_PARENT", "1", 1);
  EXPECT_EQ(end_with_parent(), ::getppid() == 1);
  EXPECT_EQ(::getenv("SHOAL_PARENT"), nullptr);
  EXPECT_TRUE(end_with_parent()) << "nobody asked";
  ::prctl(PR_SET_PDEATHSIG, 0);
}

TEST(ChildProcess, KnowsItsOwnProgram) {
  EXPECT_TRUE(std::filesystem::equivalent(own_program(), "/proc/self/exe"));
}

TEST(FileLock, RefusesASecondHolderAndNamesTheFirst) {
  const TemporaryFolder folder;
  {
    const auto first = FileLock::acquire(folder / "lock", milliseconds(0), nullptr);
    ASSERT_TRUE(first.ok());
    const auto second = FileLock::acquire(folder / "lock", std::chrono::hours(1), nullptr);
    ASSERT_FALSE(second.ok());
    EXPECT_EQ(second.error().code, ErrorCode::kStorage);
    EXPECT_NE(second.error().message.find("process " + std::to_string(::getpid())), std::string::npos);
  }
  EXPECT_TRUE(FileLock::acquire(folder / "lock", milliseconds(0), nullptr).ok());
}

/// Takes the lock in a process that ends at once, and leaves it to a child that runs for so long.
void leave_lock_to_child(const TemporaryFolder& folder, const std::string& seconds) {
  const pid_t between = ::fork();
  if (between == 0) {
    auto lock = FileLock::acquire(folder / "lock", milliseconds(0), nullptr);
    auto child = ChildProcess::start({{"/bin/sleep", seconds}, folder / "log", lock.value().descriptor()});
    ::_exit(child.ok() ? 0 : 1);
  }
  int status = 0;
  ::waitpid(between, &status, 0);
  ASSERT_EQ(status, 0);
}

TEST(FileLock, WaitsForWhatAHolderThatIsGoneHasStarted) {
  const TemporaryFolder folder;
  leave_lock_to_child(folder, "0.5");
  EXPECT_TRUE(FileLock::acquire(folder / "lock", std::chrono::seconds(60), nullptr).ok());
}

TEST(FileLock, DoesNotWaitForEverNorWhenStopped) {
  const TemporaryFolder folder;
  leave_lock_to_child(folder, "5");
  const auto refused = FileLock::acquire(folder / "lock", milliseconds(0), nullptr);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("still at work"), std::string::npos);
  const std::atomic<bool> stop{true};
  const auto stopped = FileLock::acquire(folder / "lock", std::chrono::hours(1), &stop);
  ASSERT_FALSE(stopped.ok());
  EXPECT_EQ(stopped.error().code, ErrorCode::kStopped);
}

}  // namespace
}  // namespace shoal::testing
