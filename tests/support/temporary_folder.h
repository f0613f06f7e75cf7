// A folder of its own under the system's temporary one, removed with all it holds when the test ends.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace shoal::testing {

class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  std::string operator/(const std::string& name) const { return (path_ / name).string(); }
  std::string path() const { return path_.string(); }
  /// Names of what lies in it, hidden files too (but for `.output-*`, which tests of the program write), sorted; of a
  /// folder in it when `inside` names one.
  std::vector<std::string> names(const std::string& inside = "") const;

 private:
  std::filesystem::path path_;
};

}  // namespace shoal::testing
