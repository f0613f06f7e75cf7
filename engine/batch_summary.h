// How a batch stands, for programs (summary.json) and people (summary.html, one file that needs no other but for the
// pictures it leads to). Called by engine/batch_run. Thread rule: plain functions. Cost: writes all of both; the page goes
// to disk row by row.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/batch_plan.h"
#include "engine/batch_record.h"

namespace shoal {

struct BatchEntry {
  BatchScene scene;
  SceneRecord record;
  bool skipped = false;  ///< done before
};

struct BatchCounts {
  uint64_t scenes = 0, done = 0, skipped = 0, failed = 0, left = 0;  ///< the last four sum to the first
};

struct BatchStanding {
  const BatchOptions* options = nullptr;
  std::vector<BatchEntry> entries;
  std::vector<std::string> unreadable;
  std::string state = "running";  ///< then "finished" or "stopped"
  double seconds = 0;
  uint64_t max_memory_bytes = 0;
  unsigned threads = 0;

  BatchCounts counts() const;
};

/// Both, each atomically. Fails with: kStorage.
Status write_summary(FileSystem& fs, const BatchStanding& standing);

/// summary.html alone (engine/batch_page.cpp).
Status write_summary_page(FileSystem& fs, const BatchStanding& standing);

}  // namespace shoal
