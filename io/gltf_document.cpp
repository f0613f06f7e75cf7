#include "io/gltf_document.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <memory>

#include "io/gltf_json.h"
#include "io/gltf_sections.h"

namespace shoal::gltf {

namespace {

struct Source {
  std::string json;
  std::optional<FileRange> binary;  ///< of a .glb
};

Result<Source> read_source(FileSystem& fs, const std::string& path, const Limits& limits) {
  SHOAL_ASSIGN_OR_RETURN(const auto file, fs.open(path, ReadMode::kDirect));
  SHOAL_ASSIGN_OR_RETURN(const auto chunks, find_glb_chunks(*file));
  const FileRange range = chunks ? chunks->json : FileRange{0, file->size_bytes()};
  if (range.bytes > limits.json_bytes) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected at most {} bytes of JSON, found {}", path,
                                                limits.json_bytes, range.bytes)};
  }
  Source source;
  source.json.resize(range.bytes);
  SHOAL_RETURN_IF_ERROR(file->read_at(range.offset, std::as_writable_bytes(std::span(source.json))));
  if (chunks) source.binary = chunks->binary;
  while (source.json.ends_with('\0')) source.json.pop_back();  // some writers pad the chunk so
  return source;
}

void check_version(const JsonNode& root) {
  const JsonNode asset = root.object("asset");
  const std::string version = asset.text("version");
  if (!version.starts_with("2.")) asset.fail_at("version", "2.x", version.empty() ? "nothing" : printable(version));
}

}  // namespace

uint32_t component_bytes(ComponentType type) {
  switch (type) {
    case ComponentType::kByte:
    case ComponentType::kUnsignedByte:
      return 1;
    case ComponentType::kShort:
    case ComponentType::kUnsignedShort:
      return 2;
    case ComponentType::kUnsignedInt:
    case ComponentType::kFloat:
      return 4;
  }
  return 0;
}

Result<uint64_t> json_hash(FileSystem& fs, const std::string& path) {
  SHOAL_ASSIGN_OR_RETURN(const auto file, fs.open(path, ReadMode::kDirect));
  SHOAL_ASSIGN_OR_RETURN(const auto chunks, find_glb_chunks(*file));
  const FileRange range = chunks ? chunks->json : FileRange{0, file->size_bytes()};
  const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(), &XXH3_freeState);
  if (!state) return Error{ErrorCode::kMemoryCap, "no memory to hash a file"};
  XXH3_64bits_reset(state.get());
  std::vector<char> block(256u << 10);
  uint64_t padding = 0;  // zero bytes seen that are left out if they are the last
  for (uint64_t at = 0; at < range.bytes; at += block.size()) {
    block.resize(std::min<uint64_t>(block.size(), range.bytes - at));
    SHOAL_RETURN_IF_ERROR(file->read_at(range.offset + at, std::as_writable_bytes(std::span(block))));
    const auto last = std::find_if(block.rbegin(), block.rend(), [](char c) { return c != '\0'; });
    const auto used = static_cast<size_t>(block.rend() - last);
    if (used > 0) {
      for (; padding > 0; --padding) XXH3_64bits_update(state.get(), "", 1);
      XXH3_64bits_update(state.get(), block.data(), used);
    }
    padding += block.size() - used;
  }
  return XXH3_64bits_digest(state.get());
}

Result<Document> load_document(FileSystem& fs, const std::string& path, const Limits& limits) {
  Document document;
  document.path = path;
  const size_t slash = path.rfind('/');
  document.folder = slash == std::string::npos ? "" : path.substr(0, slash == 0 ? 1 : slash);
  SHOAL_ASSIGN_OR_RETURN(Source source, read_source(fs, path, limits));
  document.content_hash = XXH3_64bits(source.json.data(), source.json.size());
  SHOAL_ASSIGN_OR_RETURN(JsonText text, JsonText::parse(source.json, path, limits.json_values_count));
  std::string().swap(source.json);

  const JsonNode root = text.root();
  check_version(root);
  read_extensions(root, limits, document);
  SHOAL_RETURN_IF_ERROR(text.status());
  SHOAL_RETURN_IF_ERROR(check_required_extensions(document));
  read_buffers(root, source.binary, limits, document);
  read_accessors(root, limits, document);
  read_textures(root, limits, document);
  read_materials(root, limits, document);
  read_variants(root, limits, document);
  read_meshes(root, limits, document);
  read_cameras_and_lights(root, limits, document);
  read_nodes(root, limits, document);
  read_skins_and_animations(root, limits, document);
  SHOAL_RETURN_IF_ERROR(text.status());
  SHOAL_RETURN_IF_ERROR(check_texture_sources(document));
  SHOAL_RETURN_IF_ERROR(text.status());
  for (std::string& warning : text.take_warnings()) document.warnings.push_back(std::move(warning));
  return document;
}

}  // namespace shoal::gltf
