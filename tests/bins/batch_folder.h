// A folder of tiny scenes and batches over it. Used by tests/bins/batch_*.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/bins/small_scene.h"

namespace shoal::testing {

class BatchFolder {
 public:
  /// Scenes one.gltf, "two words.gltf" and deep/er/three.gltf, each of a triangle of another size.
  BatchFolder();

  std::string scenes() const { return folder / "scenes"; }
  std::string out(const std::string& inside = "") const { return folder / ("out" + inside); }
  void add_scene(const std::string& name, float size, bool binary = false) const;
  /// Words of the command line: a tiny picture of each, then `more`.
  std::vector<std::string> command(const std::vector<std::string>& more = {}) const;
  ProgramRun run(const std::vector<std::string>& more = {}) const { return run_shoal(folder, command(more)); }
  nlohmann::json summary() const;
  /// Of the scene in the summary.
  nlohmann::json entry(const std::string& scene) const;
  /// Every file below the output, from there, but for what the batch keeps for itself.
  std::vector<std::string> outputs() const;

  TemporaryFolder folder;
};

/// Bytes of every PNG below a folder, by path from there.
std::map<std::string, std::string> pictures_in(const std::string& folder);
/// Every file under a final name is whole, and of pictures the bits are those of the same name in `reference`.
void expect_whole_files(const std::string& out, const std::string& reference);
/// No temporary file anywhere.
void expect_no_temporaries(const std::string& folder);

}  // namespace shoal::testing
