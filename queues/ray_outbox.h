// What a thread sends to the queues, put together: rays for one treelet gather in a buffer of the thread's own and go
// to its queue a buffer at a time, so that a queue is locked once for several rays and its memory is written in runs.
//
// Properties and assumptions
//   visible    a ray is in its queue (counted as waiting, taken by a drain) once its buffer is full, another treelet
//              wants the buffer, or flush() was called. Whoever sends must flush() before it looks for other work.
//   capacity   rays in an outbox occupy no block, so the proof in queues/treelet_queues.h holds as it is.
//   memory     fixed: 64 buffers of 8 rays (33 KiB).
//   threads    one. Its queues may be used by any number.
#pragma once

#include <bit>
#include <cstdint>

#include "queues/treelet_queues.h"
#include "treelets/touch_log.h"

namespace shoal {

class RayOutbox {
 public:
  /// `touches`: told where rays are written, when somebody measures.
  explicit RayOutbox(TreeletQueues& queues, TouchLog* touches = nullptr) : queues_(queues), touches_(touches) {}

  void push(TreeletId treelet, const Ray& ray) {
    // Treelets are numbered along their storage order: those around the one in hand have buffers of their own.
    const uint32_t place = treelet % kBuffers;
    Buffer& buffer = buffers_[place];
    if (buffer.treelet != treelet && buffer.count > 0) send(place);
    buffer.treelet = treelet;
    Ray& to = rays_[place][buffer.count++];
    to = ray;
    if (touches_ != nullptr) [[unlikely]] touches_->write(to, TouchKind::kQueues);
    filled_ |= uint64_t{1} << place;
    if (buffer.count == kRaysPerBuffer) send(place);
  }

  /// Everything goes to its queue. Cost: one lock a buffer that holds something.
  void flush() {
    while (filled_ != 0) send(static_cast<uint32_t>(std::countr_zero(filled_)));
  }

  /// Forgets the rays: for a render that ended early.
  void clear() {
    for (Buffer& buffer : buffers_) buffer.count = 0;
    filled_ = 0;
  }

 private:
  static constexpr uint32_t kBuffers = 64, kRaysPerBuffer = 8;
  struct Buffer {
    TreeletId treelet = kNoIndex;
    uint32_t count = 0;
  };

  void send(uint32_t place) {
    Buffer& buffer = buffers_[place];
    if (touches_ != nullptr) [[unlikely]] {
      touches_->read(rays_[place], buffer.count * sizeof(Ray), TouchKind::kQueues);
    }
    queues_.push(buffer.treelet, {rays_[place], buffer.count}, touches_);
    buffer.count = 0;
    filled_ &= ~(uint64_t{1} << place);
  }

  TreeletQueues& queues_;
  TouchLog* touches_;
  uint64_t filled_ = 0;  ///< a bit a buffer: it holds rays
  Buffer buffers_[kBuffers];
  Ray rays_[kBuffers][kRaysPerBuffer];
};

}  // namespace shoal
