#include "engine/ray_recorder.h"

#include <algorithm>

namespace shoal {

std::vector<RecordedKind> RayRecorder::take() {
  size_t kinds = 0;
  for (const Thread& thread : threads_) kinds = std::max(kinds, thread.kinds.size());
  std::vector<RecordedKind> taken;
  std::vector<Record> records;
  for (size_t birth = 0; birth < kRayBirthNames.size(); ++birth) {
    for (size_t kind = birth; kind < kinds; kind += kRayBirthNames.size()) {
      records.clear();
      for (Thread& thread : threads_) {
        if (kind >= thread.kinds.size()) continue;
        std::deque<Record>& list = thread.kinds[kind];
        records.insert(records.end(), list.begin(), list.end());
        std::deque<Record>().swap(list);
      }
      if (records.empty()) continue;
      std::sort(records.begin(), records.end(), [](const Record& a, const Record& b) { return a.key < b.key; });
      RecordedKind& row = taken.emplace_back();
      row.birth = static_cast<RayBirth>(birth);
      row.bounce = static_cast<uint32_t>(kind / kRayBirthNames.size());
      row.rays.reserve(records.size());
      for (const Record& r : records) row.rays.push_back({r.origin, 0, r.direction, r.t, r.seed});
    }
  }
  return taken;
}

}  // namespace shoal
