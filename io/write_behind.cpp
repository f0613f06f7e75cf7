#include "io/write_behind.h"

#include <algorithm>
#include <cstring>
#include <system_error>

namespace shoal {

Result<std::unique_ptr<WriteBehind>> WriteBehind::create(WritableFile& file) {
  std::unique_ptr<WriteBehind> behind(new WriteBehind(file));
  SHOAL_ASSIGN_OR_RETURN(behind->gathering_, behind->memory_[0].reserve(kWriteBehindBufferBytes));
  SHOAL_ASSIGN_OR_RETURN(behind->spare_, behind->memory_[1].reserve(kWriteBehindBufferBytes));
  try {
    behind->thread_ = std::thread([raw = behind.get()] { raw->write_buffers(); });
  } catch (const std::system_error& error) {
    return Error{ErrorCode::kMemoryCap, std::string("cannot start a thread that writes: ") + error.what()};
  }
  return behind;
}

WriteBehind::~WriteBehind() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void WriteBehind::write_buffers() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] { return stopping_ || !pending_.empty(); });
    if (stopping_) return;
    lock.unlock();
    Status status = file_.write_at(pending_offset_, pending_);
    lock.lock();
    if (!status.ok() && !failure_) failure_ = std::move(status).error();
    pending_ = {};
    changed_.notify_all();
  }
}

Status WriteBehind::wait_until_idle() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return pending_.empty(); });
  return failure_ ? Status(*failure_) : Status();
}

Status WriteBehind::hand_over() {
  SHOAL_RETURN_IF_ERROR(wait_until_idle());
  if (gathered_bytes_ == 0) return {};
  {
    const std::lock_guard lock(mutex_);
    pending_ = gathering_.first(gathered_bytes_);
    pending_offset_ = gathering_offset_;
  }
  changed_.notify_all();
  std::swap(gathering_, spare_);
  gathering_offset_ += gathered_bytes_;
  gathered_bytes_ = 0;
  return {};
}

Status WriteBehind::append(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const auto piece = bytes.first(std::min<uint64_t>(bytes.size(), gathering_.size() - gathered_bytes_));
    std::memcpy(gathering_.data() + gathered_bytes_, piece.data(), piece.size());
    gathered_bytes_ += piece.size();
    bytes = bytes.subspan(piece.size());
    if (gathered_bytes_ == gathering_.size()) SHOAL_RETURN_IF_ERROR(hand_over());
  }
  const std::lock_guard lock(mutex_);
  return failure_ ? Status(*failure_) : Status();
}

Status WriteBehind::overwrite(uint64_t offset, std::span<const std::byte> bytes) {
  SHOAL_CHECK(offset + bytes.size() <= gathering_offset_ + gathered_bytes_);
  const uint64_t before = offset < gathering_offset_ ? gathering_offset_ - offset : 0;
  const auto gone = bytes.first(std::min<uint64_t>(before, bytes.size()));
  const auto held = bytes.subspan(gone.size());
  if (!held.empty()) std::memcpy(gathering_.data() + (offset + gone.size() - gathering_offset_), held.data(), held.size());
  SHOAL_RETURN_IF_ERROR(wait_until_idle());
  return gone.empty() ? Status() : file_.write_at(offset, gone);
}

Status WriteBehind::flush() {
  SHOAL_RETURN_IF_ERROR(hand_over());
  return wait_until_idle();
}

}  // namespace shoal
