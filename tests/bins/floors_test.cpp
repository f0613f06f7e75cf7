// The rules of the house, read from the sources themselves: who may include whom, where third-party headers may
// stand, how long a file may be, and who may speak or leave. Every breach is one line: file, line number, what.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace shoal {
namespace {

constexpr std::array<const char*, 6> kFloors = {"io", "treelets", "queues", "engine", "api", "bins"};
/// Headers that are installed, beside the floors: they include each other and the standard library, nothing else.
constexpr const char* kPublic = "include/shoal";
constexpr size_t kMaxLines = 450;

struct SourceFile {
  std::string name;  ///< relative to the repository, such as "io/file.h"
  size_t floor = 0;
  std::vector<std::string> lines;
};

std::vector<SourceFile> read_sources() {
  std::vector<SourceFile> files;
  for (size_t floor = 0; floor < kFloors.size(); ++floor) {
    const std::filesystem::path folder = std::filesystem::path(SHOAL_SOURCE) / kFloors[floor];
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".h" && extension != ".cpp") continue;
      SourceFile file{std::filesystem::relative(entry.path(), SHOAL_SOURCE).string(), floor, {}};
      std::ifstream stream(entry.path());
      for (std::string line; std::getline(stream, line);) file.lines.push_back(line);
      files.push_back(std::move(file));
    }
  }
  return files;
}

const std::vector<SourceFile>& sources() {
  static const std::vector<SourceFile> files = read_sources();
  return files;
}

std::string place(const SourceFile& file, size_t index) {
  return file.name + ":" + std::to_string(index + 1) + ": ";
}

/// What an #include line names, with its quotes or brackets; empty for other lines.
std::string included(const std::string& line) {
  static const std::regex kInclude(R"(^\s*#\s*include\s*(["<][^">]+[">]).*)");
  std::smatch match;
  return std::regex_match(line, match, kInclude) ? match[1].str() : std::string();
}

/// The line without comments and without the text of string literals. Raw strings and /* */ are not used here.
std::string code_of(const std::string& line) {
  std::string code;
  bool quoted = false;
  for (size_t i = 0; i < line.size(); ++i) {
    const bool character = !quoted && line.compare(i, 3, "'\"'") == 0;
    if (character)
      i += 2;
    else if (quoted && line[i] == '\\')
      ++i;
    else if (line[i] == '"')
      quoted = !quoted;
    else if (!quoted && line.compare(i, 2, "//") == 0)
      break;
    else if (!quoted)
      code += line[i];
  }
  return code;
}

/// Third-party headers by the start of their name, and the files that may include them; "floor/" allows a floor.
const std::map<std::string, std::set<std::string>>& third_party() {
  static const std::map<std::string, std::set<std::string>> kAllowed = {
      {"lz4", {"io/page_codec.cpp"}},
      {"xxh", {"io/page_codec.cpp", "io/content_hash.cpp", "io/gltf_document.cpp", "engine/build_record.cpp"}},
      {"png", {"io/png_image.cpp", "io/png_reader.h", "io/png_thumbnail.cpp", "io/png_writer.cpp"}},
      {"jpeglib", {"io/jpeg_image.cpp"}},
      {"jerror", {"io/jpeg_image.cpp"}},
      {"webp", {"io/webp_image.cpp"}},
      {"meshoptimizer", {"io/meshopt_codec.cpp"}},
      {"draco", {"io/draco_mesh.cpp"}},
      {"Imf", {"io/exr_image.cpp", "io/exr_stream.h"}},
      {"Iex", {"io/exr_image.cpp", "io/exr_stream.h"}},
      {"Imath", {"io/exr_image.cpp"}},
      {"half", {"io/exr_image.cpp"}},
      {"OpenEXR", {}},
      {"tiny_gltf", {}},
      {"tinygltf", {}},
      {"embree", {}},
      {"gtest", {}},
      {"benchmark", {}},
      {"nlohmann", {"io/gltf_json.cpp", "engine/", "bins/"}},
      {"CLI", {"bins/"}},
      {"hwy", {"treelets/"}},
      {"tbb", {"treelets/", "engine/"}},
      {"oneapi", {"treelets/", "engine/"}},
  };
  return kAllowed;
}

bool may_include(const std::string& name, const std::set<std::string>& allowed) {
  const std::string floor = name.substr(0, name.find('/') + 1);
  return allowed.contains(name) || allowed.contains(floor);
}

TEST(Floors, SourcesAreFoundOnEveryFloor) {
  std::array<size_t, kFloors.size()> counts{};
  for (const SourceFile& file : sources()) counts[file.floor] += file.lines.empty() ? 0 : 1;
  for (size_t floor = 0; floor < kFloors.size(); ++floor) EXPECT_GT(counts[floor], 2u) << kFloors[floor];
}

TEST(Floors, IncludeTheirOwnFloorOrALowerOne) {
  size_t includes = 0;
  for (const SourceFile& file : sources()) {
    for (size_t i = 0; i < file.lines.size(); ++i) {
      const std::string name = included(file.lines[i]);
      if (name.empty() || name.front() != '"') continue;
      const std::string floor = name.substr(1, name.find('/') - 1);
      if (floor == "shoal" && file.name.starts_with("api/")) continue;  // the headers that it implements
      const auto at = std::find(kFloors.begin(), kFloors.end(), floor);
      ++includes;
      EXPECT_NE(at, kFloors.end()) << place(file, i) << name << " is on no floor";
      EXPECT_LE(static_cast<size_t>(at - kFloors.begin()), file.floor) << place(file, i) << name << " is higher";
      EXPECT_TRUE(std::filesystem::exists(std::filesystem::path(SHOAL_SOURCE) / name.substr(1, name.size() - 2)))
          << place(file, i) << name << " does not exist";
    }
  }
  EXPECT_GT(includes, 200u);
}

TEST(Floors, InstalledHeadersIncludeEachOtherAndTheStandardLibraryOnly) {
  static const std::regex kStandard("<[a-z_]+>");
  size_t includes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(SHOAL_SOURCE) / kPublic)) {
    std::ifstream stream(entry.path());
    for (std::string line; std::getline(stream, line);) {
      const std::string name = included(line);
      if (name.empty()) continue;
      ++includes;
      const bool ours = name.starts_with("\"shoal/") &&
                        std::filesystem::exists(std::filesystem::path(SHOAL_SOURCE) / "include" / name.substr(1, name.size() - 2));
      EXPECT_TRUE(ours || std::regex_match(name, kStandard)) << entry.path() << ": " << name;
    }
  }
  EXPECT_GT(includes, 5u);
}

TEST(Floors, ThirdPartyHeadersStayInTheirAdapters) {
  for (const SourceFile& file : sources()) {
    for (size_t i = 0; i < file.lines.size(); ++i) {
      const std::string name = included(file.lines[i]);
      if (name.empty()) continue;
      for (const auto& [prefix, allowed] : third_party()) {
        if (name.compare(1, prefix.size(), prefix) != 0) continue;
        EXPECT_TRUE(may_include(file.name, allowed)) << place(file, i) << name << " belongs in its adapter";
      }
    }
  }
}

TEST(Floors, HeadersKeepJsonAndThreadsToThemselves) {
  for (const SourceFile& file : sources()) {
    if (!file.name.ends_with(".h")) continue;
    for (size_t i = 0; i < file.lines.size(); ++i) {
      const std::string name = included(file.lines[i]);
      for (const char* prefix : {"<nlohmann", "<tbb", "<oneapi"}) {
        EXPECT_FALSE(name.starts_with(prefix)) << place(file, i) << name << " belongs in a .cpp";
      }
    }
  }
}

TEST(Floors, FilesStayShortAndHoldNoDeadCode) {
  static const std::regex kDead(R"(^\s*#\s*if\s+(0|false)\b.*)");
  for (const SourceFile& file : sources()) {
    EXPECT_LE(file.lines.size(), kMaxLines) << file.name;
    for (size_t i = 0; i < file.lines.size(); ++i) {
      EXPECT_FALSE(std::regex_match(file.lines[i], kDead)) << place(file, i) << file.lines[i];
    }
  }
}

TEST(Floors, OnlyBinsPrintAndExit) {
  static const std::regex kSpeaks(
      R"((^|[^\w.>])(exit|_exit|quick_exit|abort|terminate|printf|fprintf|vprintf|puts|fputs|putchar|perror)\s*\()"
      R"(|\bstd::(cout|cerr|clog)\b|\bfmt::print\b|\b(stdout|stderr)\b|\bassert\s*\()");
  size_t allowed = 0;
  for (const SourceFile& file : sources()) {
    if (file.name.starts_with("bins/")) continue;
    for (size_t i = 0; i < file.lines.size(); ++i) {
      if (!std::regex_search(code_of(file.lines[i]), kSpeaks)) continue;
      const bool check_failed = file.name == "io/result.cpp";
      allowed += check_failed;
      EXPECT_TRUE(check_failed) << place(file, i) << file.lines[i];
    }
  }
  EXPECT_EQ(allowed, 2u) << "io/result.cpp prints once and aborts once";
}

}  // namespace
}  // namespace shoal
