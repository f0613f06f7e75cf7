// What a worker tells the record of the render: only called where there is one.
#include "engine/render_worker.h"

namespace shoal {

void RenderWorker::record_progress(bool due_only) {
  const uint64_t now = now_ticks();
  if (due_only && !record_->due(now)) return;
  const LiveCounts counts{cache_counters_.disk_read_bytes, cache_counters_.decoded_bytes,
                          counters_.total().rays_traced_count, counters_.samples_started_count,
                          counters_.samples_committed_count};
  record_->note_progress({counts.disk_read_bytes - recorded_.disk_read_bytes,
                          counts.decoded_bytes - recorded_.decoded_bytes,
                          counts.rays_traced_count - recorded_.rays_traced_count,
                          counts.samples_started_count - recorded_.samples_started_count,
                          counts.samples_done_count - recorded_.samples_done_count},
                         phases_, now);
  recorded_ = counts;
}

void RenderWorker::record_begin_hand(TreeletId treelet) {
  if (!record_->traces()) return;
  record_->begin_hand(treelet, now_ticks(), counters_.treelet_visits_count, cache_counters_.decoded_bytes);
}

void RenderWorker::record_end_hand() {
  if (!record_->traces() || in_hand_ == kNoIndex) return;
  record_->end_hand(now_ticks(), geometry_.bytes().size(), counters_.treelet_visits_count, cache_counters_.decoded_bytes);
}

void RenderWorker::record_pin(TreeletId treelet, bool geometry, uint64_t decoded_before, uint64_t waited_before) {
  const uint64_t waited = cache_counters_.waited_ticks - waited_before;
  if (waited == 0) return;
  const uint64_t decoded = cache_counters_.decoded_bytes - decoded_before, now = now_ticks();
  if (decoded > 0) record_->note_load(treelet, geometry, decoded);
  if (record_->traces()) record_->note_wait(treelet, now - waited, now, decoded);
  // Attributes are waited for while shading, which gives that time to paging when it is through: phases are not told of
  // before.
  if (geometry) record_progress(true);
}

}  // namespace shoal
