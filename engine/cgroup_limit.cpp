#include "engine/cgroup_limit.h"

#include <algorithm>
#include <fstream>
#include <sstream>
#include <string_view>
#include <vector>

namespace shoal {
namespace {

/// A hierarchy of groups that knows memory.
struct Mount {
  bool version2;
  std::string folder;  ///< where it is mounted
  std::string top;     ///< the group that is seen there; "" is the root group
};

std::string without_last_slash(std::string path) {
  while (path.ends_with('/')) path.pop_back();
  return path;
}

/// mountinfo writes space, tab, newline and backslash as \ and three octal digits (proc_pid_mountinfo(5)).
std::string unescaped(std::string_view text) {
  const auto octal = [](char c) { return c >= '0' && c <= '7'; };
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '\\' && i + 3 < text.size() && octal(text[i + 1]) && octal(text[i + 2]) && octal(text[i + 3])) {
      out += static_cast<char>((text[i + 1] - '0') * 64 + (text[i + 2] - '0') * 8 + (text[i + 3] - '0'));
      i += 3;
    } else {
      out += text[i];
    }
  }
  return out;
}

/// Whether `name` is one of the words between commas.
bool lists(const std::string& words, std::string_view name) {
  std::istringstream stream(words);
  for (std::string word; std::getline(stream, word, ',');) {
    if (word == name) return true;
  }
  return false;
}

/// Fields: id, parent, device, root, mount point, options, optional fields, "-", type, source, super options.
std::vector<Mount> mounts_of(const std::string& root) {
  std::vector<Mount> mounts;
  std::ifstream file(root + "/proc/self/mountinfo");
  for (std::string line; std::getline(file, line);) {
    std::istringstream stream(line);
    std::string skipped, top, folder, type, options;
    stream >> skipped >> skipped >> skipped >> top >> folder;
    while (stream >> skipped && skipped != "-") {
    }
    stream >> type >> skipped >> options;
    const bool version2 = type == "cgroup2";
    if (!version2 && !(type == "cgroup" && lists(options, "memory"))) continue;
    mounts.push_back({version2, without_last_slash(unescaped(folder)), without_last_slash(unescaped(top))});
  }
  if (mounts.empty()) {
    mounts = {{true, "/sys/fs/cgroup", ""}, {true, "/sys/fs/cgroup/unified", ""}, {false, "/sys/fs/cgroup/memory", ""}};
  }
  return mounts;
}

/// This process's group in the hierarchy of version 2, or in that of version 1 which has memory.
std::string group_in(const std::string& root, bool version2) {
  std::ifstream file(root + "/proc/self/cgroup");
  for (std::string line; std::getline(file, line);) {  // hierarchy:controllers:path
    const size_t first = line.find(':');
    const size_t second = first == std::string::npos ? first : line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    if (version2 ? controllers.empty() : lists(controllers, "memory")) return without_last_slash(line.substr(second + 1));
  }
  return "";
}

/// The number in a file such as memory.max; "max" and files that cannot be read mean no limit.
uint64_t limit_in(const std::string& path) {
  std::ifstream file(path);
  uint64_t value = 0;
  return file >> value ? value : kNoLimit;
}

/// Version 1: the smallest limit up to the root of the hierarchy, also of groups that cannot be seen from here.
uint64_t hierarchical_limit_in(const std::string& path) {
  std::ifstream file(path);
  std::string name;
  for (uint64_t value = 0; file >> name >> value;) {
    if (name == "hierarchical_memory_limit") return value;
  }
  return kNoLimit;
}

uint64_t limit_of_folder(const std::string& folder, bool version2) {
  if (version2) return std::min(limit_in(folder + "/memory.max"), limit_in(folder + "/memory.high"));
  return std::min(limit_in(folder + "/memory.limit_in_bytes"), hierarchical_limit_in(folder + "/memory.stat"));
}

/// The part of `group` below the group that the mount shows; "" when it is that one, or not below it.
std::string below(const std::string& top, const std::string& group) {
  if (!group.starts_with(top) || group.find("/..") != std::string::npos) return "";
  const std::string rest = group.substr(top.size());
  return rest.starts_with('/') ? rest : "";
}

}  // namespace

uint64_t cgroup_limit_bytes(const std::string& root) {
  uint64_t limit = kNoLimit;
  for (const Mount& mount : mounts_of(root)) {
    std::string group = below(mount.top, group_in(root, mount.version2));
    while (true) {
      limit = std::min(limit, limit_of_folder(root + mount.folder + group, mount.version2));
      if (group.empty()) break;
      group.resize(group.rfind('/'));
    }
  }
  return limit;
}

}  // namespace shoal
