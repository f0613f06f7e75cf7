// The frames of a packet: rays laid out in rows, which of them a test found, and how what they find in one frame reaches
// the frame around it. What treelets/packet_walk-inl.h moves through the scene. Included once a target
// (foreach_target.h).
#if defined(SHOAL_TREELETS_PACKET_FRAMES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef SHOAL_TREELETS_PACKET_FRAMES_INL_H
#undef SHOAL_TREELETS_PACKET_FRAMES_INL_H
#else
#define SHOAL_TREELETS_PACKET_FRAMES_INL_H
#endif

#include <hwy/highway.h>

#include "treelets/row_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace shoal {
namespace HWY_NAMESPACE {

class PacketFrames {
 protected:
  using Frame = PacketFrame;
  using Row = PacketRow;

  explicit PacketFrames(PacketWalkState& state) : s_(state) {}

  HWY_INLINE Row& row(const Frame& frame, uint32_t r) { return s_.rows[frame.first_row + r]; }

  HWY_INLINE Frame& open_frame() {
    Frame& frame = s_.frames[s_.frame_count++];
    frame.first_row = s_.row_count;
    frame.row_count = frame.ray_count = frame.live = 0;
    return frame;
  }

  /// The next lane of the frame.
  HWY_INLINE uint32_t add_lane(Frame& frame, uint32_t ray, uint32_t outer) {
    const uint32_t lane = frame.ray_count++ % kRowRays;
    if (lane == 0) {
      Row& fresh = s_.rows[s_.row_count++];
      fresh.alive = fresh.box_tests = 0;
      ++frame.row_count;
    }
    Row& at = row(frame, frame.row_count - 1);
    at.ray[lane] = static_cast<uint16_t>(ray), at.outer[lane] = static_cast<uint16_t>(outer);
    at.alive |= 1u << lane;
    at.t[lane] = s_.rays[ray]->t;
    return lane;
  }

  /// False: it has no ray, and is gone.
  HWY_INLINE bool close_frame(Frame& frame) {
    if (frame.ray_count == 0) {
      --s_.frame_count;
      return false;
    }
    Row& last = row(frame, frame.row_count - 1);
    for (uint32_t lane = (frame.ray_count - 1) % kRowRays + 1; lane < kRowRays; ++lane)
      copy_lane(last, 0, last, lane);
    frame.live = (1u << frame.row_count) - 1;
    bound_rays(frame, &row(frame, 0));
    return true;
  }

  static HWY_INLINE void copy_lane(const Row& from, uint32_t from_lane, Row& to, uint32_t to_lane) {
    for (uint32_t axis = 0; axis < 3; ++axis) {
      to.slope[axis][to_lane] = from.slope[axis][from_lane];
      to.near_bias[axis][to_lane] = from.near_bias[axis][from_lane];
      to.far_bias[axis][to_lane] = from.far_bias[axis][from_lane];
    }
    to.t[to_lane] = from.t[from_lane];
  }

  /// `visit(row number, row, lane, ray)` for each lane in the masks of `rows`.
  template <class Visit>
  HWY_INLINE void each_masked(const Frame& frame, uint32_t rows, const Visit& visit) {
    for (; rows != 0; rows &= rows - 1) {
      const auto r = static_cast<uint32_t>(std::countr_zero(rows));
      Row& at = row(frame, r);
      for (uint32_t lanes = masks_[r]; lanes != 0; lanes &= lanes - 1) {
        const auto lane = static_cast<uint32_t>(std::countr_zero(lanes));
        visit(r, at, lane, at.ray[lane]);
      }
    }
  }

  /// As if a test had found every ray.
  HWY_INLINE void mask_all(const Frame& frame) {
    for (uint32_t r = 0; r < frame.row_count; ++r) masks_[r] = row(frame, r).alive;
  }

  /// The ray has been in another frame meanwhile.
  HWY_INLINE void update(Frame& frame, uint32_t place, uint32_t ray) {
    Row& at = row(frame, place >> 4);
    at.t[place & 15] = s_.rays[ray]->t;
    if (s_.gone[ray]) remove(frame, place >> 4, place & 15);
  }

  /// The ray in the lane has nothing more to find.
  HWY_INLINE void remove(Frame& frame, uint32_t r, uint32_t lane) {
    Row& at = row(frame, r);
    at.alive &= ~(1u << lane);
    if (at.alive == 0) frame.live &= ~(1u << r);
  }

  /// Rays in the masks of `rows`.
  HWY_INLINE uint32_t ray_count(uint32_t rows) const {
    uint32_t count = 0;
    for (; rows != 0; rows &= rows - 1)
      count += static_cast<uint32_t>(std::popcount(masks_[std::countr_zero(rows)]));
    return count;
  }

  PacketWalkState& s_;
  uint32_t masks_[kMostPacketRays / kRowRays];  ///< of the rows that the last test found: lanes that enter
};

}  // namespace HWY_NAMESPACE
}  // namespace shoal
HWY_AFTER_NAMESPACE();

#endif
