#include "tests/support/temporary_folder.h"

#include <stdlib.h>

#include <algorithm>
#include <stdexcept>

namespace shoal::testing {

TemporaryFolder::TemporaryFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "shoal-test-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder: " + name);
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code code;
  std::filesystem::remove_all(path_, code);
}

std::vector<std::string> TemporaryFolder::names(const std::string& inside) const {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(path_ / inside)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(".output-")) names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

}  // namespace shoal::testing
