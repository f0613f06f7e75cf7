#include "engine/source_files.h"

#include <fmt/format.h>

#include <charconv>
#include <filesystem>
#include <optional>
#include <set>

#include "engine/scene.h"

namespace shoal {
namespace {

namespace stdfs = std::filesystem;

/// In front of the paths, so that a table of another kind is not taken for this one.
constexpr std::string_view kTableName = "sources 1";

std::string folder_of(const std::string& path) {
  std::error_code code;
  const stdfs::path parent = stdfs::path(path).parent_path();
  const stdfs::path whole = stdfs::weakly_canonical(parent.empty() ? stdfs::path(".") : parent, code);
  return (code ? parent : whole).string();
}

/// One field of the table: it ends with a zero byte, which no path holds.
std::optional<std::string_view> next_field(std::string_view& table) {
  const size_t end = table.find('\0');
  if (end == std::string_view::npos) return std::nullopt;
  const std::string_view field = table.substr(0, end);
  table.remove_prefix(end + 1);
  return field;
}

std::optional<uint64_t> next_number(std::string_view& table, int base) {
  const auto field = next_field(table);
  uint64_t value = 0;
  if (!field) return std::nullopt;
  const auto [rest, error] = std::from_chars(field->data(), field->data() + field->size(), value, base);
  if (error != std::errc() || rest != field->data() + field->size()) return std::nullopt;
  return value;
}

Error changed_since(const std::string& scene, const std::string& file, const std::string& how) {
  return {ErrorCode::kInput, fmt::format("{} is out of date: {} changed since it was built: {}; build again, or render "
                                         "it as it is with --allow-stale", scene, file, how)};
}

Result<SourceFile> look_at(FileSystem& fs, const std::string& path) {
  const auto file = fs.open(path, ReadMode::kBuffered);
  if (file.ok()) return SourceFile{path, false, file.value()->size_bytes(), file.value()->modified_ns()};
  if (file.error().code != ErrorCode::kInput) return file.error();
  return SourceFile{path, true, 0, 0};
}

}  // namespace

Status SourceFiles::add(const std::string& path) {
  SHOAL_ASSIGN_OR_RETURN(SourceFile file, look_at(*fs_, path));
  files_.push_back(std::move(file));
  return {};
}

Status SourceFiles::add_parts(const gltf::Document& document) {
  json_hash_ = document.content_hash;
  std::set<std::string> seen{document.path};
  for (const gltf::Buffer& buffer : document.buffers) {
    if (!buffer.path.empty() && seen.insert(buffer.path).second) SHOAL_RETURN_IF_ERROR(add(buffer.path));
  }
  for (const gltf::Image& image : document.images) {
    if (!image.path.empty() && seen.insert(image.path).second) SHOAL_RETURN_IF_ERROR(add(image.path));
  }
  return {};
}

Status SourceFiles::check_unchanged(bool times) const {
  for (const SourceFile& before : files_) {
    if (before.missing) continue;
    SHOAL_ASSIGN_OR_RETURN(const SourceFile now, look_at(*fs_, before.path));
    std::string how;
    if (now.missing) {
      how = "it is gone";
    } else if (now.bytes != before.bytes) {
      how = fmt::format("expected {} bytes, found {}", before.bytes, now.bytes);
    } else if (times && now.modified_ns != before.modified_ns) {
      how = "it was written to";
    } else {
      continue;
    }
    return Error{ErrorCode::kInput,
                 fmt::format("{} changed while the scene was built: {}; build again", before.path, how)};
  }
  return {};
}

std::string SourceFiles::table(const std::string& output) const {
  std::string text = fmt::format("{}{}{:016x}{}", kTableName, '\0', json_hash_, '\0');
  const stdfs::path from = folder_of(output);
  for (const SourceFile& file : files_) {
    if (file.missing) continue;
    const stdfs::path folder = stdfs::path(folder_of(file.path)).lexically_relative(from);
    const stdfs::path name = stdfs::path(file.path).filename();
    text += fmt::format("{}{}{}{}", file.bytes, '\0', (folder / name).lexically_normal().generic_string(), '\0');
  }
  return text;
}

Status check_source_is_unchanged(FileSystem& fs, const Scene& scene) {
  std::string_view table = scene.source_files;
  if (next_field(table) != kTableName) return {};
  const auto json_hash = next_number(table, 16);
  if (!json_hash) return {};
  const std::string& path = scene.file->path();
  const stdfs::path folder = stdfs::path(path).parent_path();
  std::string document;
  while (!table.empty()) {
    const auto bytes = next_number(table, 10);
    const auto name = bytes ? next_field(table) : std::nullopt;
    if (!name) return {};
    const std::string file = (folder / stdfs::path(*name)).string();
    SHOAL_ASSIGN_OR_RETURN(const SourceFile found, look_at(fs, file));
    if (document.empty() && found.missing) return {};  // moved away: what lies there now is another scene's
    if (document.empty()) document = file;
    if (!found.missing && found.bytes != *bytes) {
      return changed_since(path, file, fmt::format("expected {} bytes, found {}", *bytes, found.bytes));
    }
  }
  if (document.empty()) return {};
  SHOAL_ASSIGN_OR_RETURN(const uint64_t hash, gltf::json_hash(fs, document));
  if (hash == *json_hash) return {};
  return changed_since(path, document, fmt::format("expected JSON of hash {:016x}, found {:016x}", *json_hash, hash));
}

}  // namespace shoal
