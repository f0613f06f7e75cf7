#include <liburing.h>

#include <mutex>
#include <vector>

#include "io/async_reader.h"
#include "io/sanitizer_order.h"

namespace shoal {
namespace {

constexpr uint64_t kWakeTag = ~0ull;

class UringReader final : public AsyncReader {
 public:
  explicit UringReader(unsigned depth) : requests_(depth) {}
  ~UringReader() override {
    if (ready_) io_uring_queue_exit(&ring_);
  }

  bool start() {
    // Room for every read and for wakes beside them.
    ready_ = io_uring_queue_init(2 * static_cast<unsigned>(requests_.size()) + 16, &ring_, 0) == 0;
    return ready_;
  }

  void submit(const ReadRequest& request) override {
    SHOAL_CHECK(request.tag < requests_.size() && request.file->descriptor() >= 0);
    requests_[request.tag] = request;
    tell_sanitizer_before(&requests_[request.tag]);
    const std::lock_guard lock(submit_mutex_);
    io_uring_sqe* entry = next_entry();
    io_uring_prep_read(entry, request.file->descriptor(), request.out.data(),
                       static_cast<unsigned>(request.out.size()), request.offset);
    io_uring_sqe_set_data64(entry, request.tag);
    flush();
  }

  void wake() override {
    const std::lock_guard lock(submit_mutex_);
    io_uring_sqe* entry = next_entry();
    io_uring_prep_nop(entry);
    io_uring_sqe_set_data64(entry, kWakeTag);
    flush();
  }

  std::optional<ReadCompletion> wait() override {
    uint64_t tag = 0;
    int result = 0;
    {
      const std::lock_guard lock(wait_mutex_);
      io_uring_cqe* entry = nullptr;
      int code = 0;
      while ((code = io_uring_wait_cqe(&ring_, &entry)) == -EINTR) {
      }
      SHOAL_CHECK(code == 0);
      tag = io_uring_cqe_get_data64(entry);
      result = entry->res;
      io_uring_cqe_seen(&ring_, entry);
    }
    if (tag == kWakeTag) return std::nullopt;
    const ReadRequest& request = requests_[tag];
    tell_sanitizer_after(&request);
    ReadCompletion completion{request.tag, {}};
    if (result < 0 || static_cast<size_t>(result) != request.out.size()) {
      completion.status = request.file->read_at(request.offset, request.out);
    }
    return completion;
  }

  unsigned depth() const override { return static_cast<unsigned>(requests_.size()); }
  const char* name() const override { return "io_uring"; }

 private:
  io_uring_sqe* next_entry() {
    io_uring_sqe* entry = io_uring_get_sqe(&ring_);
    while (entry == nullptr) {  // earlier ones have not been taken by the kernel yet
      flush();
      entry = io_uring_get_sqe(&ring_);
    }
    return entry;
  }

  void flush() {
    int code = 0;
    while ((code = io_uring_submit(&ring_)) == -EINTR || code == -EAGAIN || code == -EBUSY) {
    }
    SHOAL_CHECK(code >= 0);
  }

  io_uring ring_{};
  bool ready_ = false;
  std::mutex submit_mutex_, wait_mutex_;
  std::vector<ReadRequest> requests_;  // by tag
};

}  // namespace

std::unique_ptr<AsyncReader> make_uring_reader(unsigned depth) {
  auto reader = std::make_unique<UringReader>(depth);
  if (!reader->start()) return nullptr;
  return reader;
}

}  // namespace shoal
