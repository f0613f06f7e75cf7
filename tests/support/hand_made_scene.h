// Scenes packed by hand for tests of traversal: median splits into 8-wide nodes, pages in the layout of
// treelets/treelet_layout.h, written independently of the product's builder. Also the brute force that
// traversal is compared with. Header only, so that every test target may include it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <memory>
#include <random>
#include <vector>

#include "treelets/leaf_test.h"
#include "treelets/ray_space.h"
#include "treelets/top_tree.h"
#include "treelets/trace_treelet.h"
#include "treelets/treelet_layout.h"
#include "treelets/triangle_test.h"

namespace shoal::testing {

struct TestTriangle {
  Vec3 p[3];
  uint32_t primitive = 0;
  bool operator==(const TestTriangle&) const = default;
};

inline Bounds3 bounds_of(const TestTriangle& t) {
  Bounds3 b;
  for (const Vec3& p : t.p) b.include(p);
  return b;
}
inline Bounds3 bounds_of(std::span<const TestTriangle> triangles) {
  Bounds3 b;
  for (const TestTriangle& t : triangles) b.include(bounds_of(t));
  return b;
}
inline float max_abs_of(const Bounds3& b) { return std::max(max_abs(&b.lo.x), max_abs(&b.hi.x)); }

/// A page of bytes aligned to 64 with 64 readable bytes after its end, as the page cache gives them.
class AlignedPage {
 public:
  explicit AlignedPage(std::span<const std::byte> bytes) : size_(bytes.size()), lines_((bytes.size() + 127) / 64) {
    if (size_ > 0) std::memcpy(lines_.data(), bytes.data(), size_);
  }
  std::span<const std::byte> bytes() const { return {reinterpret_cast<const std::byte*>(lines_.data()), size_}; }
  std::span<std::byte> mutable_bytes() { return {reinterpret_cast<std::byte*>(lines_.data()), size_}; }

 private:
  struct alignas(64) Line {
    std::byte bytes[64] = {};
  };
  size_t size_;
  std::vector<Line> lines_;
};

/// Splits [0, n) at the median of the centroids' longest axis into up to 8 parts.
inline std::vector<std::span<TestTriangle>> split_in_eight(std::span<TestTriangle> all, size_t leaf_size) {
  std::vector<std::span<TestTriangle>> parts{all};
  while (parts.size() < 8) {
    const auto largest = std::max_element(parts.begin(), parts.end(),
                                          [](const auto& a, const auto& b) { return a.size() < b.size(); });
    if (largest->size() <= leaf_size) break;
    const std::span<TestTriangle> part = *largest;
    const Vec3 e = bounds_of(part).extent();
    const int axis = e.x > e.y ? (e.x > e.z ? 0 : 2) : (e.y > e.z ? 1 : 2);
    const size_t half = part.size() / 2;
    std::nth_element(part.begin(), part.begin() + static_cast<long>(half), part.end(), [axis](const auto& a, const auto& b) {
      return a.p[0][axis] + a.p[1][axis] + a.p[2][axis] < b.p[0][axis] + b.p[1][axis] + b.p[2][axis];
    });
    *largest = part.first(half);
    parts.push_back(part.subspan(half));
  }
  return parts;
}

class PagePacker {
 public:
  explicit PagePacker(size_t leaf_size) : leaf_size_(leaf_size) {}

  /// Packs `triangles` and returns the root. Several roots may share the page.
  NodeRef add(std::span<TestTriangle> triangles) {
    if (triangles.size() <= leaf_size_) return add_leaf(triangles);
    const uint32_t index = static_cast<uint32_t>(nodes_.size());
    nodes_.push_back({});
    const auto parts = split_in_eight(triangles, leaf_size_);
    QuantizedNode node = quantize(parts);
    for (size_t slot = 0; slot < parts.size(); ++slot) node.child[slot] = add(parts[slot]);
    nodes_[index] = node;
    return index;
  }

  /// Appends coverage: `record_of` a triangle's primitive (kNoIndex: opaque). Call before add().
  void set_coverage(std::vector<CoverageRecord> records, std::vector<uint8_t> texels,
                    std::function<uint32_t(uint32_t)> record_of) {
    records_ = std::move(records), texels_ = std::move(texels), record_of_ = std::move(record_of);
  }

  std::vector<std::byte> finish() const {
    TreeletHeader h{};
    h.magic = kTreeletMagic;
    h.node_count = static_cast<uint32_t>(nodes_.size());
    h.leaves_offset = static_cast<uint32_t>(sizeof h + nodes_.size() * sizeof(QuantizedNode));
    h.leaves_bytes = static_cast<uint32_t>(leaves_.size());
    h.triangle_count = static_cast<uint32_t>(primitives_.size());
    h.primitives_offset = h.leaves_offset + h.leaves_bytes;
    std::vector<std::byte> page;
    append(page, &h, 1);
    append(page, nodes_.data(), nodes_.size());
    append(page, leaves_.data(), leaves_.size());
    append(page, primitives_.data(), primitives_.size());
    if (!record_of_) return page;
    h.coverage_offset = static_cast<uint32_t>(page.size());
    h.coverage_record_count = static_cast<uint32_t>(records_.size());
    h.coverage_texel_bytes = static_cast<uint32_t>(texels_.size());
    std::memcpy(page.data(), &h, sizeof h);
    for (const uint32_t primitive : primitives_) {
      const uint32_t record = record_of_(primitive);
      append(page, &record, 1);
    }
    append(page, records_.data(), records_.size());
    append(page, texels_.data(), texels_.size());
    return page;
  }

 private:
  template <class T>
  static void append(std::vector<std::byte>& out, const T* values, size_t count) {
    const size_t at = out.size();
    out.resize(at + count * sizeof(T));
    if (count > 0) std::memcpy(out.data() + at, values, count * sizeof(T));
  }

  NodeRef add_leaf(std::span<const TestTriangle> triangles) {
    const uint32_t offset = static_cast<uint32_t>(leaves_.size() / 4);
    std::vector<Vec3> vertices;
    std::vector<uint8_t> corner[3];
    LeafHeader header{};
    header.triangle_count = static_cast<uint8_t>(triangles.size());
    header.first_ordinal = static_cast<uint32_t>(primitives_.size());
    for (const TestTriangle& t : triangles) {
      for (int k = 0; k < 3; ++k) {
        const auto same_bits = [&](const Vec3& v) { return std::memcmp(&v, &t.p[k], sizeof v) == 0; };
        const auto found = std::find_if(vertices.begin(), vertices.end(), same_bits);
        corner[k].push_back(static_cast<uint8_t>(found - vertices.begin()));
        if (found == vertices.end()) vertices.push_back(t.p[k]);
      }
      primitives_.push_back(t.primitive);
      if (record_of_ && record_of_(t.primitive) != kNoIndex) header.has_coverage = 1;
    }
    header.vertex_count = static_cast<uint8_t>(vertices.size());
    append(leaves_, &header, 1);
    for (int axis = 0; axis < 3; ++axis) {
      for (const Vec3& v : vertices) append(leaves_, &v[axis], 1);
    }
    for (const auto& c : corner) append(leaves_, c.data(), c.size());
    leaves_.resize((leaves_.size() + 3) / 4 * 4);
    return kLeafBit | offset;
  }

  static QuantizedNode quantize(const std::vector<std::span<TestTriangle>>& parts) {
    QuantizedNode node{};
    node.child_count = static_cast<uint8_t>(parts.size());
    std::fill(std::begin(node.child), std::end(node.child), kEmptyRef);
    std::fill(&node.lo[0][0], &node.lo[0][0] + 24, uint8_t{255});
    Bounds3 all;
    for (const auto& part : parts) all.include(bounds_of(part));
    for (int axis = 0; axis < 3; ++axis) {
      node.origin[axis] = all.lo[axis];
      int e = -126;
      while (dequantize(all.lo[axis], std::ldexp(1.0f, e), 255) < all.hi[axis]) ++e;
      node.exponent[axis] = static_cast<int8_t>(e);
      for (size_t slot = 0; slot < parts.size(); ++slot) {
        const Bounds3 b = bounds_of(parts[slot]);
        uint8_t lo = 255, hi = 0;
        while (lo > 0 && dequantize(node.origin[axis], std::ldexp(1.0f, e), lo) > b.lo[axis]) --lo;
        while (hi < 255 && dequantize(node.origin[axis], std::ldexp(1.0f, e), hi) < b.hi[axis]) ++hi;
        node.lo[axis][slot] = lo, node.hi[axis][slot] = hi;
      }
    }
    return node;
  }

  size_t leaf_size_;
  std::vector<QuantizedNode> nodes_;
  std::vector<std::byte> leaves_;
  std::vector<uint32_t> primitives_;
  std::vector<CoverageRecord> records_;
  std::vector<uint8_t> texels_;
  std::function<uint32_t(uint32_t)> record_of_;
};

/// Objects, instances and their treelets.
struct TestScene {
  std::vector<TopNode> nodes;
  std::vector<TreeletEntry> entries;
  std::vector<Instance> instances;
  std::vector<AlignedPage> pages;
  std::vector<std::vector<TestTriangle>> objects;
};

struct TestSceneOptions {
  size_t treelet_triangles = 1000;  ///< about, a treelet
  size_t leaf_size = 4;
  bool reversed = false;            ///< pack the triangles the other way round
};

inline TopNode empty_top_node(uint32_t parent, uint32_t level) {
  TopNode node{};
  for (int axis = 0; axis < 3; ++axis) {
    for (int slot = 0; slot < 8; ++slot) {
      node.lo[axis][slot] = std::numeric_limits<float>::infinity();
      node.hi[axis][slot] = -std::numeric_limits<float>::infinity();
    }
  }
  node.parent = parent, node.level = level;
  return node;
}

inline void set_child(TopNode& node, uint32_t slot, ChildKind kind, uint32_t child, const Bounds3& b) {
  for (int axis = 0; axis < 3; ++axis) node.lo[axis][slot] = b.lo[axis], node.hi[axis][slot] = b.hi[axis];
  node.kind[slot] = kind, node.child[slot] = child;
}

/// Adds the tree of one object; returns its root.
inline uint32_t add_object_tree(TestScene& scene, std::span<TestTriangle> triangles, uint32_t parent, uint32_t level,
                                const TestSceneOptions& options) {
  const uint32_t index = static_cast<uint32_t>(scene.nodes.size());
  scene.nodes.push_back(empty_top_node(parent, level));
  const auto parts = split_in_eight(triangles, options.treelet_triangles);
  for (uint32_t slot = 0; slot < parts.size(); ++slot) {
    const Bounds3 b = bounds_of(parts[slot]);
    if (parts[slot].size() > options.treelet_triangles) {
      const uint32_t child = add_object_tree(scene, parts[slot], index << 3 | slot, level + 1, options);
      set_child(scene.nodes[index], slot, ChildKind::kNode, child, b);
      continue;
    }
    PagePacker packer(options.leaf_size);
    const NodeRef root = packer.add(parts[slot]);
    set_child(scene.nodes[index], slot, ChildKind::kEntry, static_cast<uint32_t>(scene.entries.size()), b);
    scene.entries.push_back({static_cast<TreeletId>(scene.pages.size()), root});
    scene.pages.emplace_back(packer.finish());
  }
  return index;
}

/// Where an object stands; the inverse is computed in double, rounded once.
struct Placement {
  uint32_t object = 0;
  Affine3 object_to_world;
};

inline Instance make_instance(const Placement& placement, uint32_t root, const Bounds3& object_bounds) {
  Instance instance{};
  instance.object_to_world = placement.object_to_world;
  instance.object = placement.object, instance.root_node = root;
  instance.max_abs_coordinate = max_abs_of(object_bounds);
  instance.identity = placement.object_to_world == Affine3{} ? 1 : 0;
  const Affine3& m = placement.object_to_world;
  const Vec3 columns[4] = {m.column_x, m.column_y, m.column_z, m.translation};
  double a[3][4], inverse[3][4];
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) a[r][c] = columns[c][r];
  }
  const double det = a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) -
                     a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
                     a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
  double error = 0;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      const int r1 = (c + 1) % 3, r2 = (c + 2) % 3, c1 = (r + 1) % 3, c2 = (r + 2) % 3;
      inverse[r][c] = (a[r1][c1] * a[r2][c2] - a[r1][c2] * a[r2][c1]) / det;
    }
    inverse[r][3] = -(inverse[r][0] * a[0][3] + inverse[r][1] * a[1][3] + inverse[r][2] * a[2][3]);
  }
  for (int r = 0; r < 3; ++r) {
    double sum = 0;
    for (int c = 0; c < 3; ++c) {
      for (int k = 0; k < 3; ++k) sum += std::abs(a[r][k]) * std::abs(inverse[k][c]);
    }
    error = std::max(error, sum);
  }
  Vec3* out[4] = {&instance.world_to_object.column_x, &instance.world_to_object.column_y,
                  &instance.world_to_object.column_z, &instance.world_to_object.translation};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) (*out[c])[r] = static_cast<float>(inverse[r][c]);
  }
  instance.transform_error = instance.identity ? 1.0f : static_cast<float>(error * 1.000001);
  return instance;
}

inline Bounds3 world_bounds(const Instance& instance, const Bounds3& b) {
  Bounds3 world;
  for (int corner = 0; corner < 8; ++corner) {
    world.include(instance.object_to_world.point(
        {corner & 1 ? b.hi.x : b.lo.x, corner & 2 ? b.hi.y : b.lo.y, corner & 4 ? b.hi.z : b.lo.z}));
  }
  return world;
}

/// The tree over instances [first, last) below node `index`.
inline void fill_instance_node(TestScene& scene, uint32_t index, uint32_t first, uint32_t last,
                               const std::vector<Bounds3>& bounds) {
  const uint32_t count = last - first;
  const uint32_t parts = std::min(count, 8u);
  for (uint32_t slot = 0; slot < parts; ++slot) {
    const uint32_t begin = first + count * slot / parts, end = first + count * (slot + 1) / parts;
    Bounds3 b;
    for (uint32_t i = begin; i < end; ++i) b.include(bounds[i]);
    if (end - begin == 1) {
      set_child(scene.nodes[index], slot, ChildKind::kInstance, begin, b);
      scene.instances[begin].tree_child = index << 3 | slot;
      continue;
    }
    const uint32_t child = static_cast<uint32_t>(scene.nodes.size());
    scene.nodes.push_back(empty_top_node(index << 3 | slot, scene.nodes[index].level + 1));
    set_child(scene.nodes[index], slot, ChildKind::kNode, child, b);
    fill_instance_node(scene, child, begin, end, bounds);
  }
}

inline TestScene make_scene(std::vector<std::vector<TestTriangle>> objects, const std::vector<Placement>& placements,
                            const TestSceneOptions& options = {}) {
  TestScene scene;
  scene.nodes.push_back(empty_top_node(kNoIndex, 0));
  std::vector<uint32_t> roots;
  std::vector<Bounds3> object_bounds;
  for (auto& object : objects) {
    std::vector<TestTriangle> packed = object;
    if (options.reversed) std::reverse(packed.begin(), packed.end());
    object_bounds.push_back(bounds_of(packed));
    roots.push_back(add_object_tree(scene, packed, kNoIndex, 0, options));
  }
  std::vector<Bounds3> bounds;
  for (const Placement& placement : placements) {
    scene.instances.push_back(make_instance(placement, roots[placement.object], object_bounds[placement.object]));
    bounds.push_back(world_bounds(scene.instances.back(), object_bounds[placement.object]));
  }
  fill_instance_node(scene, 0, 0, static_cast<uint32_t>(placements.size()), bounds);
  scene.objects = std::move(objects);
  return scene;
}

using TraceFunction = void (*)(std::span<const std::byte>, const TreeletEntry&, const Instance&, Ray&, TraceCounters&);

/// Carries one ray through the whole scene, as an engine does.
inline void trace_scene(const TopTree& tree, std::span<const AlignedPage> pages, Ray& ray, TraceFunction trace,
                        std::vector<uint32_t>* visited = nullptr) {
  TraceCounters counters;
  ray.cursor = ray.instance = kNoIndex, ray.more = 0;
  for (;;) {
    const uint32_t entry = tree.next(ray, counters.node_tests_count);
    if (entry == kNoIndex) return;
    if (visited) visited->push_back(entry);
    const TreeletEntry& e = tree.entry(entry);
    trace(pages[e.treelet].bytes(), e, tree.instance(ray.instance), ray, counters);
    if (ray.any_hit() && ray.hit.valid()) return;
  }
}

/// Every triangle of every instance, with the same triangle test.
inline void brute_force(const TestScene& scene, Ray& ray) {
  for (uint32_t i = 0; i < scene.instances.size(); ++i) {
    const RaySpace space = to_object_space(ray, scene.instances[i]);
    for (const TestTriangle& t : scene.objects[scene.instances[i].object]) {
      TriangleHit hit;
      if (!intersect_triangle(space, t.p[0], t.p[1], t.p[2], ray.t, hit)) continue;
      if (ray.any_hit() ? !(hit.t < ray.t) : !comes_before(ray, hit.t, i, t.primitive)) continue;
      ray.hit = {i, t.primitive, 0, 0};
      if (ray.any_hit()) return;
      ray.t = hit.t;
    }
  }
}

inline Vec3 random_vector(std::mt19937& random, float scale = 1) {
  std::uniform_real_distribution<float> uniform(-scale, scale);
  const float x = uniform(random), y = uniform(random), z = uniform(random);
  return {x, y, z};
}

/// `count` triangles about `size` large in [-1, 1]^3.
inline std::vector<TestTriangle> random_soup(std::mt19937& random, size_t count, float size, uint32_t first_primitive = 0) {
  std::vector<TestTriangle> soup(count);
  for (size_t i = 0; i < count; ++i) {
    const Vec3 centre = random_vector(random);
    for (Vec3& p : soup[i].p) p = centre + random_vector(random, size);
    soup[i].primitive = first_primitive + static_cast<uint32_t>(i);
  }
  return soup;
}

/// A closed, connected mesh: a bumpy sphere of 2 * rows * columns triangles or so, vertices shared to the bit.
inline std::vector<TestTriangle> closed_mesh(uint32_t rows, uint32_t columns, float bumps, uint32_t first_primitive = 0) {
  const auto vertex = [&](uint32_t r, uint32_t c) {
    c %= columns;
    if (r == 0 || r == rows) c = 0;
    const double theta = 3.14159265358979 * r / rows, phi = 2 * 3.14159265358979 * c / columns;
    const double radius = 1 + bumps * std::sin(5 * theta) * std::cos(7 * phi);
    return Vec3(radius * std::sin(theta) * std::cos(phi), radius * std::cos(theta), radius * std::sin(theta) * std::sin(phi));
  };
  std::vector<TestTriangle> mesh;
  for (uint32_t r = 0; r < rows; ++r) {
    for (uint32_t c = 0; c < columns; ++c) {
      const Vec3 a = vertex(r, c), b = vertex(r, c + 1), d = vertex(r + 1, c), e = vertex(r + 1, c + 1);
      if (r != 0) mesh.push_back({{a, b, d}, 0});
      if (r + 1 != rows) mesh.push_back({{b, e, d}, 0});
    }
  }
  for (size_t i = 0; i < mesh.size(); ++i) mesh[i].primitive = first_primitive + static_cast<uint32_t>(i);
  return mesh;
}

inline Ray make_ray(const Vec3& origin, const Vec3& direction, float t = kRayInfinity, bool any_hit = false) {
  Ray ray;
  ray.origin = origin, ray.direction = direction, ray.t = t;
  ray.path = any_hit ? Ray::kAnyHitBit : 0;
  return ray;
}

}  // namespace shoal::testing
