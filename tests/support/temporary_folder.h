// A folder of its own for a test that needs real files; gone with everything in it when the test ends.
#pragma once

#include <string>
#include <vector>

namespace shoal {

class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::string& path() const { return path_; }
  std::string path(const std::string& name) const { return path_ + "/" + name; }
  /// Names of all that is in it, hidden ones too, sorted.
  std::vector<std::string> names() const;

 private:
  std::string path_;
};

}  // namespace shoal
