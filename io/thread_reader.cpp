#include <condition_variable>
#include <deque>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "io/async_reader.h"

namespace shoal {
namespace {

class ThreadReader final : public AsyncReader {
 public:
  ThreadReader(unsigned depth, unsigned threads) : depth_(depth) {
    try {
      for (unsigned i = 0; i < threads; ++i) threads_.emplace_back([this] { serve(); });
    } catch (const std::system_error&) {  // no more threads: those that there are serve
      if (threads_.empty()) throw;
    }
  }
  ~ThreadReader() override {
    {
      const std::lock_guard lock(mutex_);
      ended_ = true;
    }
    submitted_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

  void submit(const ReadRequest& request) override {
    {
      const std::lock_guard lock(mutex_);
      waiting_.push_back(request);
    }
    submitted_.notify_one();
  }

  void wake() override {
    {
      const std::lock_guard lock(mutex_);
      done_.emplace_back(std::nullopt);
    }
    completed_.notify_one();
  }

  std::optional<ReadCompletion> wait() override {
    std::unique_lock lock(mutex_);
    completed_.wait(lock, [&] { return !done_.empty(); });
    std::optional<ReadCompletion> completion = std::move(done_.front());
    done_.pop_front();
    return completion;
  }

  unsigned depth() const override { return depth_; }
  const char* name() const override { return "threads"; }

 private:
  void serve() {
    std::unique_lock lock(mutex_);
    for (;;) {
      submitted_.wait(lock, [&] { return ended_ || !waiting_.empty(); });
      if (waiting_.empty()) return;
      const ReadRequest request = waiting_.front();
      waiting_.pop_front();
      lock.unlock();
      ReadCompletion completion{request.tag, request.file->read_at(request.offset, request.out)};
      lock.lock();
      done_.emplace_back(std::move(completion));
      completed_.notify_one();
    }
  }

  const unsigned depth_;
  std::mutex mutex_;
  std::condition_variable submitted_, completed_;
  std::deque<ReadRequest> waiting_;
  std::deque<std::optional<ReadCompletion>> done_;
  bool ended_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace

std::unique_ptr<AsyncReader> make_thread_reader(unsigned depth, unsigned threads) {
  return std::make_unique<ThreadReader>(depth, threads);
}

}  // namespace shoal
