// Checkpoints of a render, written while it runs, and going on from one (docs/checkpoints.md). Called by engine/render and
// by the worker that finds one due.
//
// A checkpoint holds the sums of the film and the layers, what adaptive sampling has judged, the pass under way with the
// first sample of it that nobody began, and the samples that were begun and are not in the sums: those begin again. Sums
// are whole numbers, so the picture that comes of it has the bits of one that was never interrupted.
//
// Properties and assumptions
//   threads    all wait at safe points (engine/pause_gate.h) while one of them writes.
//   memory     a block of 1 MiB; going on: 12 bytes a sample that begins again.
//   failure    one that cannot be written is said once, and the render goes on; the one before stays. When the render
//              is to stop, it ends the render with its error.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "engine/render_worker.h"
#include "engine/sums_file.h"

namespace shoal {

class Checkpoints {
 public:
  /// What is passed must outlive it; `warning` may be empty. Of `header`, what does not change while the render runs.
  Checkpoints(FileSystem& fs, const CheckpointOptions& options, std::string identity, const SumsHeader& header,
              const PassPlan& passes, const PictureSums& sums,
              const std::function<void(const std::string&)>& warning);

  /// Writes one when that is due, and when the render is to stop, which ends it with kStopped then. Requires: the caller is
  /// at a safe point. Any number of threads.
  void write_when_due(RenderContext& context, bool stop);

 private:
  Status write(const RenderContext& context) const;

  FileSystem& fs_;
  const CheckpointOptions& options_;
  const std::string identity_;
  const SumsHeader header_;
  const PassPlan& passes_;
  const PictureSums sums_;
  const std::function<void(const std::string&)>& warning_;
  std::atomic<double> due_seconds_;
  bool warned_ = false;
};

/// The samples that `picture` asks for.
SampleSpan asked_range(const PictureOptions& picture);
/// With a target for noise both halves have as many.
uint32_t most_samples(const PictureOptions& picture);

/// The header of whatever sums of the picture are written.
SumsHeader sums_header(const PictureOptions& picture, SumsKind kind);

/// Opens the checkpoint that is to be gone on with. Fails with: kInput (it is of another picture: the message says what
/// differs), kUsage (it has more samples than are asked for, or more cannot be added), and as SumsFile::open().
Result<std::unique_ptr<SumsFile>> open_checkpoint(FileSystem& fs, const std::string& path, const std::string& identity,
                                                  const PictureOptions& picture);

/// Sets context to go on where the checkpoint ends, and reads the last of it. Requires: sums were read, context.samples
/// are those of its pass. Fails with: kCorrupt, kStorage.
Status resume_cursor(SumsFile& file, RenderContext& context);

}  // namespace shoal
