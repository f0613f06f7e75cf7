// A picture to look at while the render goes on: drawn from what the film holds by now, and written over and over
// under one name. Costs no ray: with a preview, samples begin coarse first (engine/sample_order.h), and nothing but
// the first lattice begins before that one is complete. Called by engine/render and engine/render_worker.
//
// Properties and assumptions
//   content    a pixel with samples shows their mean; one without shows the nearest pixel of the finest lattice that
//              has some there; black where there is none.
//   when       as soon as the first lattice is complete, then after 2, 4, 8, 16 and every 30 s, but so seldom that
//              drawing and writing take at most 2 % of the time of all threads.
//   threads    any number; one of them draws and writes, the others pass by.
//   cost       a picture shown: one thread, about 50 ns a pixel for the tone curve, and zlib; memory: bytes().
//   failure    a preview that cannot be written is said once; the render goes on and later ones are tried. The file is
//              the last one that was whole (io/file.h, AtomicFile).
#pragma once

#include <atomic>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "engine/film.h"
#include "engine/render.h"
#include "engine/sample_order.h"

namespace shoal {

class Preview {
 public:
  /// `warning` may be empty. What is passed must outlive it. `start_seconds`: now_seconds() when the render began, from
  /// which the time of the first picture counts.
  Preview(FileSystem& fs, const PreviewOptions& options, const Film& film, const SampleOrder& samples, unsigned threads,
          double start_seconds, const std::function<void(const std::string&)>& warning);
  /// Memory it takes for a picture of this size, at most: its pixels, and the file before it is written.
  static uint64_t bytes(uint32_t width, uint32_t height);

  /// Shows what the film holds, when that is due and no other thread is at it.
  void show_when_due(uint64_t samples_done);
  /// Shows it now, unless one was shown before: a render that was too short for the first.
  void show_if_none();

  std::optional<FirstPicture> first() const;
  /// To be asked at the end. Pictures written, and seconds spent drawing and writing, summed over threads.
  uint32_t shown_count() const { return shown_count_; }
  double seconds() const { return seconds_; }

 private:
  void show();
  /// Returns how many pixels have samples of their own.
  uint64_t draw();
  void draw_row(uint32_t y, uint64_t& known);
  void fill_row(uint32_t y);

  FileSystem& fs_;
  const PreviewOptions& options_;
  const Film& film_;
  const SampleOrder& samples_;
  const unsigned threads_;
  const double start_seconds_;
  const std::function<void(const std::string&)>& warning_;

  std::atomic<double> due_seconds_{0};
  std::mutex mutex_;  ///< of whoever shows: guards all below but the first picture
  uint64_t shown_samples_ = 0;
  double interval_seconds_;
  bool warned_ = false;
  uint32_t shown_count_ = 0;
  double seconds_ = 0;
  std::vector<uint8_t> rgb_;
  std::vector<uint8_t> known_;  ///< pixels with samples: 1
  std::vector<float> row_[3];   ///< of a row, the pixels with samples
  std::vector<uint32_t> row_x_;

  mutable std::mutex first_mutex_;
  std::optional<FirstPicture> first_;
};

}  // namespace shoal
