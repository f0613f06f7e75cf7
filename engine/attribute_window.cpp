#include "engine/attribute_window.h"

#include <fmt/format.h>

namespace shoal {

std::optional<uint32_t> find_attribute(const gltf::Primitive& primitive, const std::string& name) {
  const auto found = primitive.attributes.find(name);
  if (found == primitive.attributes.end()) return std::nullopt;
  return found->second;
}

Result<AttributeWindow> AttributeWindow::open(gltf::BufferFiles& files, const gltf::Document& document,
                                              uint32_t accessor, const std::string& place, uint32_t min_components,
                                              uint32_t max_components, uint64_t vertex_count) {
  AttributeWindow window;
  SHOAL_ASSIGN_OR_RETURN(gltf::AccessorReader reader, gltf::AccessorReader::open(files, document, accessor));
  window.width_ = reader.components();
  if (window.width_ < min_components || window.width_ > max_components || document.accessors[accessor].matrix) {
    return Error{ErrorCode::kInput, fmt::format("{}: {}: expected {} to {} components, found {}", document.path, place,
                                                min_components, max_components, window.width_)};
  }
  if (reader.count() < vertex_count) {
    return Error{ErrorCode::kInput, fmt::format("{}: {}: expected {} vertices as in POSITION, found {}", document.path,
                                                place, vertex_count, reader.count())};
  }
  window.reader_.emplace(std::move(reader));
  return window;
}

}  // namespace shoal
