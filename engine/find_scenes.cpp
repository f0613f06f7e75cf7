#include "engine/find_scenes.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <set>
#include <system_error>
#include <utility>

#include "engine/batch_text.h"
#include "engine/glob.h"

namespace shoal {
namespace {

namespace stdfs = std::filesystem;

/// Tells folders apart, whatever they are called.
using FolderId = std::pair<dev_t, ino_t>;

bool is_scene_name(const std::string& name) {
  if (is_shoal_path(name)) return true;
  const size_t dot = name.rfind('.');
  if (dot == std::string::npos || dot == 0) return false;
  std::string extension = name.substr(dot + 1);
  for (char& c : extension) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return extension == "gltf" || extension == "glb";
}

class Search {
 public:
  explicit Search(const SceneSearch& asked) : asked_(asked) {
    struct stat info {};
    if (!asked.skipped_folder.empty() && ::stat(asked.skipped_folder.c_str(), &info) == 0) {
      visited_.insert({info.st_dev, info.st_ino});
    }
  }

  Result<FoundScenes> run() {
    waiting_.push_back("");
    while (!waiting_.empty() || !linked_.empty()) {
      // Real folders first, so that what lies below the folder is known by its own name and not by that of a link.
      std::vector<std::string>& list = waiting_.empty() ? linked_ : waiting_;
      const std::string folder = std::move(list.back());
      list.pop_back();
      SHOAL_RETURN_IF_ERROR(visit(folder));
    }
    std::sort(found_.scenes.begin(), found_.scenes.end(),
              [](const FoundScene& a, const FoundScene& b) { return a.path < b.path; });
    std::sort(found_.unreadable.begin(), found_.unreadable.end());
    return std::move(found_);
  }

 private:
  std::string whole(const std::string& path) const { return path.empty() ? asked_.folder : asked_.folder + "/" + path; }

  Status unreadable(const std::string& folder, int error) {
    const std::string sentence =
        fmt::format("cannot read folder {}: {}", escape_name(whole(folder)), std::generic_category().message(error));
    if (folder.empty()) return Error{ErrorCode::kInput, sentence};
    found_.unreadable.push_back(sentence);
    return {};
  }

  Status visit(const std::string& folder) {
    struct stat info {};
    if (::stat(whole(folder).c_str(), &info) != 0) return unreadable(folder, errno);
    if (!visited_.insert({info.st_dev, info.st_ino}).second) return {};
    std::error_code error;
    std::vector<std::pair<std::string, stdfs::file_type>> entries;
    for (stdfs::directory_iterator at(whole(folder), error), end; !error && at != end; at.increment(error)) {
      std::error_code unknown;
      entries.emplace_back(at->path().filename().string(), at->symlink_status(unknown).type());
    }
    if (error) return unreadable(folder, error.value());
    std::sort(entries.rbegin(), entries.rend());  // the lists are taken from their ends
    for (const auto& [name, type] : entries) note(folder, name, type);
    return {};
  }

  void note(const std::string& folder, const std::string& name, stdfs::file_type type) {
    if (name.starts_with('.')) return;
    const std::string path = folder.empty() ? name : folder + "/" + name;
    const bool link = type == stdfs::file_type::symlink;
    if (link) {
      std::error_code error;
      const stdfs::file_status target = stdfs::status(whole(path), error);
      // A link that leads nowhere is a scene that cannot be read, if its name says that it is one.
      type = error || target.type() == stdfs::file_type::not_found ? stdfs::file_type::regular : target.type();
    }
    if (type == stdfs::file_type::directory) {
      if (!any_matches(asked_.exclude, path)) (link ? linked_ : waiting_).push_back(path);
    } else if (type == stdfs::file_type::regular && is_scene_name(name)) {
      const bool wanted = asked_.include.empty() || any_matches(asked_.include, path);
      found_.scenes.push_back({path, wanted && !any_matches(asked_.exclude, path)});
    }
  }

  const SceneSearch& asked_;
  std::set<FolderId> visited_;
  std::vector<std::string> waiting_, linked_;  ///< folders
  FoundScenes found_;
};

}  // namespace

bool is_shoal_path(const std::string& path) { return path.ends_with(".shoal"); }

Result<FoundScenes> find_scenes(const SceneSearch& search) {
  for (const auto* patterns : {&search.include, &search.exclude}) {
    for (const std::string& pattern : *patterns) SHOAL_RETURN_IF_ERROR(check_pattern(pattern));
  }
  return Search(search).run();
}

}  // namespace shoal
