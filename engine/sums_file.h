// The file that raw sums of a picture go to: a checkpoint of a render that is not complete, or a part that `shoal merge`
// joins with others. docs/file_format.md is the byte-level document. Written by engine/checkpoint, read by that and by
// engine/merge_sums.
//
// Properties and assumptions
//   atomic     a file appears whole, under its name, or not at all; one that was there before stays until then.
//   checked    sizes follow from the header, which has a checksum, and must be those of the file; all bytes have another.
//              What is read is used by nobody before finish() has seen that.
//   memory     sums are written from where they are and read to where they go; beside them one block.
//   threads    one owner.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "engine/adaptive_sampling.h"
#include "engine/aov_film.h"
#include "engine/film.h"
#include "engine/pass_plan.h"
#include "engine/pause_gate.h"
#include "io/content_hash.h"
#include "io/file.h"

namespace shoal {

enum class SumsKind : uint32_t { kCheckpoint = 1, kPart = 2 };

/// CR LF and Ctrl-Z after the name, as in a .shoal.
inline constexpr std::array<char, 8> kSumsMagic = {'S', 'H', 'S', 'U', 'M', '\r', '\n', '\x1a'};
inline constexpr uint32_t kSumsVersion = 1;

/// The first 256 bytes.
struct SumsHeader {
  std::array<char, 8> magic = kSumsMagic;      //   0
  uint32_t version = kSumsVersion;             //   8
  uint32_t endian_mark = 0x01020304u;          //  12
  SumsKind kind = SumsKind::kCheckpoint;       //  16
  uint32_t halves = 1;                         //  20  of the film: 2 with a target for noise
  uint32_t width = 0, height = 0;              //  24
  uint32_t aovs = 0;                           //  32  AovSet::bits
  uint32_t samples = 0;                        //  36  a pixel, that were asked for
  SampleSpan range;                            //  40  of those, what this render is to bring
  uint32_t identity_bytes = 0;                 //  48  text: engine/picture_identity.h
  uint32_t attributes_bytes = 0;               //  52  text, of parts: attributes of the picture
  PassPlan::State pass;                        //  56  checkpoints: the pass under way
  uint32_t coarse_levels = 0;                  //  88  ... of its order of samples
  uint32_t reserved = 0;                       //  92
  uint64_t next_sample = 0;                    //  96  ... the first in that order that was not begun
  uint64_t unfinished_count = 0;               // 104  ... of those before, how many are not in the sums
  uint64_t samples_before = 0;                 // 112  drawn in earlier passes, all pixels together
  double seconds = 0;                          // 120  of rendering
  AdaptiveSampling::Numbers adaptive;          // 128
  std::byte zero[80] = {};                     // 160
  uint64_t identity_hash = 0;                  // 240  XXH3-64 of the text
  uint64_t checksum = 0;                       // 248  XXH3-64 of bytes 0..247

  bool is_adaptive() const { return halves == 2; }
};
static_assert(sizeof(SumsHeader) == 256);

/// Of the whole file. Requires: a header whose members are within their bounds.
uint64_t sums_file_bytes(const SumsHeader& header);

/// Where the sums of a picture are.
struct PictureSums {
  Film& film;
  AovFilm* aovs = nullptr;               ///< or none
  AdaptiveSampling* adaptive = nullptr;  ///< or none
};

/// Writes all of it. `unfinished`: null in a part. Of the header, what tells
/// of sizes and the checksums are filled in here. Fails with: kStorage.
Status write_sums(FileSystem& fs, const std::string& path, SumsHeader header, const std::string& identity,
                  const std::string& attributes, const PictureSums& sums,
                  const UnfinishedPaths* unfinished);

class SumsFile {
 public:
  /// Reads and checks header and texts. Fails with: kInput (missing, no such file, another version), kCorrupt, kStorage.
  static Result<std::unique_ptr<SumsFile>> open(FileSystem& fs, const std::string& path);

  const SumsHeader& header() const { return header_; }
  /// Of a checkpoint: samples of its pass that are in the sums.
  uint64_t done_in_pass() const { return header_.next_sample - header_.unfinished_count; }
  const std::string& path() const { return path_; }
  const std::string& identity() const { return identity_; }
  const std::string& attributes() const { return attributes_; }

  // Then, each once and in this order. All fail with: kStorage, kCorrupt.
  /// Requires: sums of the header's size, halves and AOVs.
  Status read_sums(const PictureSums& sums);
  /// Instead of read_sums(): of a part, adds its sums.
  Status add_sums(const PictureSums& sums);
  /// Requires: as many as header().unfinished_count.
  Status read_unfinished(std::span<UnfinishedSample> samples);
  /// Whether all of that was what was written.
  Status finish();

 private:
  SumsFile(std::unique_ptr<ReadableFile> file, std::string path);
  Status check_header() const;
  Status read(std::span<std::byte> out);
  template <class Add>
  Status read_in_blocks(uint64_t bytes, uint64_t whole, const Add& add);
  Error damaged(const std::string& what) const;

  std::unique_ptr<ReadableFile> file_;
  std::string path_;
  SumsHeader header_;
  std::string identity_, attributes_;
  ContentHash hash_;
  uint64_t at_ = 0;  ///< read so far
};

/// How many samples a checkpoint says are to be begun again: what resuming takes memory for, beside the plan of a render.
/// Fails with: as SumsFile::open().
Result<uint64_t> unfinished_in(FileSystem& fs, const std::string& path);

}  // namespace shoal
