// glTF primitives to a soup of triangles: corners with the attributes that their material calls for, moved to world
// space where a mesh is baked. Reads in bounded pieces.
// Called by engine/stream_object. Cost: one pass over the accessors that are needed.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/affine_double.h"
#include "engine/convert_materials.h"
#include "io/gltf_accessor.h"
#include "treelets/triangle_soup.h"

namespace shoal {

/// A set of triangles to read: one primitive of a mesh, with the global id of its first triangle.
struct PrimitiveSource {
  uint32_t mesh = 0, primitive = 0;
  uint64_t triangle_count = 0;
  uint32_t first_id = 0;
};

/// What the corners of a primitive have to carry: NORMAL when there, TANGENT when there and a normal map uses it,
/// COLOR_0 when there, the UV sets of the material's textures.
CornerLayout layout_of(const gltf::Primitive& primitive, const MaterialPlan& plan);
/// All that either carries.
CornerLayout united(const CornerLayout& a, const CornerLayout& b);

/// Triangles of one primitive, decoded. Kept from read to read, so that its memory is.
struct TriangleBlock {
  TriangleSoup soup;
  uint64_t degenerate_count = 0;  ///< left out: a corner not finite, or two corners in one place
  uint64_t zero_area_count = 0;   ///< in the soup: three corners in a line

  void clear(CornerLayout layout, uint64_t expected);
};

/// One primitive, read in any pieces. Thread rule: as its BufferFiles.
class PrimitiveReader {
 public:
  /// `layout` says which attributes are read (none: positions only). `bake` moves the triangles (null: object space is
  /// kept). A map that mirrors swaps the last two corners, so that the front stays where corners run counter-clockwise
  /// (glTF 2.0, section 3.7.4); normals go by the inverse transpose, a tangent's handedness turns with the mirror. A
  /// skinned primitive goes by its joints alone (engine/vertex_pose).
  /// Fails with: kInput (an attribute of the wrong type or too short), kStorage.
  static Result<PrimitiveReader> open(gltf::BufferFiles& files, const gltf::Document& document,
                                      const MaterialPlan& plan, const PrimitiveSource& source, CornerLayout layout,
                                      const AffineDouble* bake);
  PrimitiveReader(PrimitiveReader&&) noexcept;
  PrimitiveReader& operator=(PrimitiveReader&&) noexcept;
  ~PrimitiveReader();

  /// Triangles [first, first + count) of the primitive. Fails with: kInput (an index out of range), kStorage.
  Status read(uint64_t first, uint64_t count, TriangleBlock& block);

  /// At most, for such a layout and so many windows of morph targets, joints and weights.
  static uint64_t memory_bytes(CornerLayout layout, uint32_t pose_windows);

 private:
  struct State;
  explicit PrimitiveReader(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// A warning for each set of texture coordinates that the primitive's material uses and it has not.
void note_missing_uv_sets(const gltf::Document& document, const MaterialPlan& plan, const PrimitiveSource& source,
                          std::vector<std::string>& warnings);

}  // namespace shoal
