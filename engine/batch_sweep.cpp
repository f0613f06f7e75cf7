#include "engine/batch_sweep.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <string_view>
#include <system_error>

namespace shoal {
namespace {

namespace stdfs = std::filesystem;

/// NAME of ".NAME.tmp-PID-N"; empty for other names.
std::string final_name(const std::string& name) {
  constexpr std::string_view kMark = ".tmp-";
  const size_t mark = name.rfind(kMark);
  if (!name.starts_with('.') || mark == std::string::npos || mark < 2) return "";
  const std::string numbers = name.substr(mark + kMark.size());
  const bool ours = !numbers.empty() && std::count(numbers.begin(), numbers.end(), '-') == 1 &&
                    numbers.find_first_not_of("0123456789-") == std::string::npos;
  return ours ? name.substr(1, mark - 1) : "";
}

}  // namespace

void remove_temporaries(const std::vector<std::string>& files) {
  std::map<std::string, std::set<std::string>> names;  // by folder
  for (const std::string& file : files) {
    const size_t slash = file.rfind('/');
    names[slash == std::string::npos ? "." : file.substr(0, slash)].insert(file.substr(slash + 1));
  }
  for (const auto& [folder, expected] : names) {
    std::error_code error;
    std::vector<stdfs::path> found;
    for (stdfs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
      if (expected.contains(final_name(at->path().filename().string()))) found.push_back(at->path());
    }
    for (const stdfs::path& path : found) stdfs::remove(path, error);
  }
}

void remove_all_temporaries(const std::string& folder) {
  std::error_code error;
  std::vector<stdfs::path> found;
  for (stdfs::recursive_directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    if (!final_name(at->path().filename().string()).empty()) found.push_back(at->path());
  }
  for (const stdfs::path& path : found) stdfs::remove(path, error);
}

void remove_folder(const std::string& folder) {
  std::error_code error;
  stdfs::remove_all(folder, error);
}

}  // namespace shoal
