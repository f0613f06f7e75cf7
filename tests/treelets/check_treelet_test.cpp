// Pages from strangers: what does not fit is rejected; what passes may be traced whatever else is wrong with it.
#include <gtest/gtest.h>

#include "tests/support/built_scene.h"
#include "treelets/attribute_layout.h"
#include "treelets/trace_treelet_scalar.h"

namespace shoal::testing {
namespace {

CoverageRecord plain_record(uint32_t crop_width, uint32_t crop_height) {
  CoverageRecord record{};
  const float uv[6] = {0, 0, 4, 0, 0, 4};
  std::copy(uv, uv + 6, record.uv);
  std::fill(record.vertex_alpha, record.vertex_alpha + 3, 1.0f);
  record.factor = 1, record.cutoff = 0.5f, record.mode = 1;
  record.crop_width = crop_width, record.crop_height = crop_height;
  return record;
}

/// A page of 200 triangles, every third of them covered.
std::vector<std::byte> covered_page(std::mt19937& random, NodeRef* root = nullptr) {
  auto soup = random_soup(random, 200, 0.4f);
  PagePacker packer(5);
  packer.set_coverage({plain_record(4, 4), plain_record(2, 3)}, std::vector<uint8_t>(16, 128),
                      [](uint32_t primitive) { return primitive % 3 == 0 ? primitive % 2 : kNoIndex; });
  const NodeRef r = packer.add(soup);
  if (root) *root = r;
  return packer.finish();
}

TEST(CheckTreelet, AcceptsWhatThePackerWrites) {
  std::mt19937 random(1);
  NodeRef root;
  const AlignedPage page(covered_page(random, &root));
  EXPECT_TRUE(check_treelet(page.bytes()).ok());
  EXPECT_TRUE(check_root(page.bytes(), root).ok());
}

TEST(CheckTreelet, RejectsEveryTruncation) {
  std::mt19937 random(2);
  const std::vector<std::byte> bytes = covered_page(random);
  for (size_t size = 0; size < bytes.size(); size += 1 + size / 64) {
    const AlignedPage page(std::span<const std::byte>(bytes).first(size));
    EXPECT_FALSE(check_treelet(page.bytes()).ok()) << size;
  }
}

TEST(CheckTreelet, RejectsFieldsThatDoNotFit) {
  std::mt19937 random(3);
  const std::vector<std::byte> good = covered_page(random);
  const auto rejects = [&](const char* what, auto&& damage) {
    AlignedPage page(good);
    std::byte* at = page.mutable_bytes().data();
    TreeletHeader& header = *reinterpret_cast<TreeletHeader*>(at);
    QuantizedNode* nodes = reinterpret_cast<QuantizedNode*>(at + sizeof header);
    damage(header, nodes, at + header.leaves_offset, at + header.coverage_offset);
    const Status status = check_treelet(page.bytes());
    ASSERT_FALSE(status.ok()) << what;
    EXPECT_EQ(status.error().code, ErrorCode::kCorrupt) << what;
  };
  using H = TreeletHeader;
  using N = QuantizedNode;
  using B = std::byte;
  rejects("magic", [](H& h, N*, B*, B*) { h.magic = 0; });
  rejects("node count", [](H& h, N*, B*, B*) { h.node_count = 0xffffffffu; });
  rejects("leaves offset", [](H& h, N*, B*, B*) { h.leaves_offset = 64; });
  rejects("leaves bytes", [](H& h, N*, B*, B*) { h.leaves_bytes = 0xfffffffcu; });
  rejects("triangle count", [](H& h, N*, B*, B*) { h.triangle_count = 0x40000001u; });
  rejects("bytes of primitive ids", [](H&, N*, B* leaf, B*) { leaf[3] = B{5}; });
  rejects("high planes of floats", [](H&, N*, B* leaf, B*) { leaf[2] |= B{kLeafHighY}; });
  rejects("a grid of floats", [](H&, N*, B* leaf, B*) { leaf[2] |= B{kLeafGrid}; });
  rejects("unknown flags", [](H&, N*, B* leaf, B*) { leaf[2] |= B{0x80}; });
  rejects("coverage records", [](H& h, N*, B*, B*) { h.coverage_record_count = 1u << 30; });
  rejects("no coverage for covered leaves", [](H& h, N*, B*, B*) { h.coverage_offset = 0; });
  rejects("child of itself", [](H&, N* n, B*, B*) { n[0].child[0] = 0; });
  rejects("child before its parent", [](H&, N* n, B*, B*) { n[3].child[0] = 2; });
  rejects("child past the end", [](H& h, N* n, B*, B*) { n[0].child[0] = h.node_count; });
  rejects("two parents", [](H&, N* n, B*, B*) { n[0].child[1] = n[0].child[0]; });
  rejects("nine children", [](H&, N* n, B*, B*) { n[0].child_count = 9; });
  rejects("an empty child", [](H&, N* n, B*, B*) { n[0].child[0] = kEmptyRef; });
  rejects("leaf past the end", [](H& h, N* n, B*, B*) { n[0].child[0] = kLeafBit | h.leaves_bytes / 4; });
  rejects("origin", [](H&, N* n, B*, B*) { n[0].origin[2] = NAN; });
  rejects("exponent", [](H&, N* n, B*, B*) { n[0].exponent[2] = -128; });
  rejects("17 triangles", [](H&, N*, B* leaf, B*) { leaf[0] = B{17}; });
  rejects("no triangle", [](H&, N*, B* leaf, B*) { leaf[0] = B{0}; });
  rejects("49 vertices", [](H&, N*, B* leaf, B*) { leaf[1] = B{49}; });
  rejects("vertex index", [](H&, N*, B* leaf, B*) { leaf[12 + 12 * std::to_integer<size_t>(leaf[1])] = leaf[1]; });
  rejects("ordinal", [](H&, N*, B* leaf, B*) { reinterpret_cast<LeafHeader*>(leaf)->first_ordinal = 0xffffffffu; });
  rejects("position", [](H&, N*, B* leaf, B*) { reinterpret_cast<float*>(leaf)[3] = INFINITY; });
  rejects("record index", [](H&, N*, B*, B* coverage) { reinterpret_cast<uint32_t*>(coverage)[0] = 2; });
  const auto record = [](H& h, B* coverage) {
    return reinterpret_cast<CoverageRecord*>(coverage + 4 * h.triangle_count);
  };
  rejects("crop", [&](H& h, N*, B*, B* c) { record(h, c)->crop_width = 5; });
  rejects("huge crop", [&](H& h, N*, B*, B* c) { record(h, c)->crop_width = record(h, c)->crop_height = 65536; });
  rejects("texel offset", [&](H& h, N*, B*, B* c) { record(h, c)->texel_offset = 0xffffffffu; });
  rejects("mode", [&](H& h, N*, B*, B* c) { record(h, c)->mode = 3; });
  rejects("wrap", [&](H& h, N*, B*, B* c) { record(h, c)->wrap_v = 3; });
  rejects("uv", [&](H& h, N*, B*, B* c) { record(h, c)->uv[3] = 1e30f; });
}

TEST(CheckTreelet, RejectsRootsOutsideThePage) {
  std::mt19937 random(4);
  const AlignedPage page(covered_page(random));
  const TreeletHeader& header = *reinterpret_cast<const TreeletHeader*>(page.bytes().data());
  EXPECT_FALSE(check_root(page.bytes(), header.node_count).ok());
  EXPECT_FALSE(check_root(page.bytes(), kEmptyRef).ok());
  EXPECT_FALSE(check_root(page.bytes(), kLeafBit | header.leaves_bytes / 4).ok());
  EXPECT_TRUE(check_root(page.bytes(), kLeafBit).ok());
}

/// A page of one leaf, its bytes all `fill` after the header.
AlignedPage one_leaf(const LeafHeader& leaf, uint8_t fill) {
  TreeletHeader h{};
  h.magic = kTreeletMagic, h.triangle_count = leaf.triangle_count;
  h.leaves_offset = sizeof h, h.leaves_bytes = LeafParts::of(leaf).padded_bytes();
  std::vector<std::byte> page(sizeof h + h.leaves_bytes, std::byte{fill});
  std::memcpy(page.data(), &h, sizeof h);
  std::memcpy(page.data() + sizeof h, &leaf, sizeof leaf);
  return AlignedPage(page);
}

TEST(CheckTreelet, TakesEveryShapeOfLeafOrRefusesIt) {
  size_t accepted = 0;
  for (uint32_t triangles = 0; triangles <= 17; ++triangles) {
    for (uint32_t vertices = 0; vertices <= 49; ++vertices) {
      for (uint32_t flags = 0; flags < 64; ++flags) {
        for (const uint32_t primitive_bytes : {0u, 4u, 5u}) {
          const LeafHeader leaf{static_cast<uint8_t>(triangles), static_cast<uint8_t>(vertices),
                                static_cast<uint8_t>(flags), static_cast<uint8_t>(primitive_bytes), 0, 0};
          const AlignedPage page = one_leaf(leaf, 0);
          const bool fits = triangles >= 1 && triangles <= 16 && vertices >= 1 && vertices <= 3 * triangles &&
                            (flags & kLeafCoverage) == 0 && primitive_bytes <= 4 &&
                            !((flags & kLeafFloats) && (flags & (kLeafHighMask | kLeafGrid)));
          ASSERT_EQ(check_root(page.bytes(), kLeafBit).ok(), fits)
              << triangles << " " << vertices << " " << flags << " " << primitive_bytes;
          if (!fits) continue;
          ++accepted;
          Instance instance{};
          instance.identity = 1, instance.max_abs_coordinate = 1;
          Ray ray = make_ray({0.1f, 0.2f, -1}, {0.3f, 0.1f, 1});
          ray.instance = 0;
          TraceCounters counters;
          trace_treelet(page.bytes(), {0, kLeafBit}, instance, ray, counters);  // degenerate: nothing to hit
          EXPECT_FALSE(ray.hit.valid());
        }
      }
    }
  }
  EXPECT_GT(accepted, 5000u);
}

TEST(CheckTreelet, RefusesPackedPositionsThatAreNotFinite) {
  AlignedPage page = one_leaf({1, 3, 0, 0, 0, 0}, 0);
  std::byte* positions = page.mutable_bytes().data() + sizeof(TreeletHeader) + sizeof(LeafHeader);
  const uint32_t largest_float = 0x7f7fffff;
  std::memcpy(positions + 4, &largest_float, sizeof largest_float);  // base of y
  EXPECT_TRUE(check_root(page.bytes(), kLeafBit).ok());
  positions[12 + 2 * 4] = std::byte{1};  // low of the second vertex's y: one step further is infinity
  const Status status = check_root(page.bytes(), kLeafBit);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kCorrupt);
}

TEST(CheckTreelet, RefusesGridPositionsThatAreNotFinite) {
  AlignedPage page = one_leaf({1, 3, kLeafGrid, 0, 0, 0}, 0);
  std::byte* words = page.mutable_bytes().data() + sizeof(TreeletHeader) + sizeof(LeafHeader);
  const auto accepts = [&](uint32_t y_word) {
    std::memcpy(words + 4, &y_word, sizeof y_word);
    return check_root(page.bytes(), kLeafBit).ok();
  };
  EXPECT_TRUE(accepts(0x7fffff00u | 231)) << "the largest base and 2^104";
  EXPECT_FALSE(accepts(0x7fffff00u | 254)) << "more than any float";
  EXPECT_TRUE(accepts(254)) << "zero steps of it";
  EXPECT_FALSE(accepts(255)) << "a step that is none";
  EXPECT_TRUE(accepts(0x80000000u)) << "steps of zero";
}

TEST(CheckTreelet, LeavesAtMostTheAgreedDepth) {
  const auto chain = [](uint32_t nodes) {
    TreeletHeader h{};
    h.magic = kTreeletMagic, h.node_count = nodes, h.triangle_count = 1;
    h.leaves_offset = static_cast<uint32_t>(sizeof h + nodes * sizeof(QuantizedNode));
    const LeafHeader leaf{1, 3, kLeafFloats, 0, 0, 0};
    h.leaves_bytes = LeafParts::of(leaf).padded_bytes();
    std::vector<std::byte> page(h.leaves_offset + h.leaves_bytes);
    std::memcpy(page.data(), &h, sizeof h);
    for (uint32_t i = 0; i < nodes; ++i) {
      QuantizedNode node{};
      node.child_count = 1;
      node.child[0] = i + 1 < nodes ? i + 1 : kLeafBit;
      std::memcpy(page.data() + sizeof h + i * sizeof node, &node, sizeof node);
    }
    std::memcpy(page.data() + h.leaves_offset, &leaf, sizeof leaf);
    return AlignedPage(page);
  };
  EXPECT_TRUE(check_treelet(chain(kMaxTreeletDepth).bytes()).ok());
  EXPECT_FALSE(check_treelet(chain(kMaxTreeletDepth + 1).bytes()).ok());
}

/// Damages `good` and traces what passes. Returns how many pages passed, and how many rays hit.
std::pair<size_t, size_t> trace_damaged(std::mt19937& random, std::span<const std::byte> good, NodeRef root) {
  const Instance instance = make_instance({0, {}}, 1, {{-1, -1, -1}, {1, 1, 1}});
  size_t passed = 0, hits = 0;
  for (int i = 0; i < 20000; ++i) {
    AlignedPage page(good);
    const std::span<std::byte> bytes = page.mutable_bytes();
    for (uint32_t k = random() % 4 + 1; k > 0; --k)
      bytes[random() % bytes.size()] = static_cast<std::byte>(random());
    if (!check_treelet(page.bytes()).ok()) continue;
    const TreeletEntry entry{0, random() % 2 ? root : kLeafBit | static_cast<uint32_t>(random() % 64)};
    if (!check_root(page.bytes(), entry.root).ok()) continue;
    ++passed;
    Ray ray = make_ray(random_vector(random), random_vector(random)), scalar;
    ray.instance = 0, scalar = ray;
    TraceCounters counters;
    trace_treelet(page.bytes(), entry, instance, ray, counters);
    trace_treelet_scalar(page.bytes(), entry, instance, scalar, counters);
    EXPECT_EQ(std::memcmp(&ray, &scalar, sizeof ray), 0);
    if (!ray.hit.valid()) continue;
    ++hits;
    const TreeletTriangle triangle = find_triangle(page.bytes(), ray.hit.slot);
    EXPECT_EQ(intersect_known(ray, instance, triangle).t, ray.t);
  }
  return {passed, hits};
}

TEST(CheckTreelet, WhatPassesMayBeTracedAndFound) {
  std::mt19937 random(5);
  NodeRef root;
  const std::vector<std::byte> good = covered_page(random, &root);
  const auto [passed, hits] = trace_damaged(random, good, root);
  EXPECT_GT(passed, 2000u);
  EXPECT_GT(hits, 500u);
}

TEST(CheckTreelet, WhatPassesOnAGridMayBeTracedAndFound) {
  std::mt19937 random(6);
  auto soup = random_soup(random, 200, 0.4f);
  for (TestTriangle& t : soup) {
    for (Vec3& p : t.p) {
      for (int axis = 0; axis < 3; ++axis) p[axis] = std::nearbyint(p[axis] * 1024) / 1024 + 0.0f;
    }
  }
  const TestScene scene = build_scene({soup}, {{0, {}}}, 64u << 10, 0x1p-10f);
  ASSERT_EQ(scene.pages.size(), 1u);
  const auto [passed, hits] = trace_damaged(random, scene.pages[0].bytes(), scene.entries[0].root);
  EXPECT_GT(passed, 2000u);
  EXPECT_GT(hits, 500u);
}

/// Two triangles, four vertices with everything, a material a triangle.
std::vector<std::byte> attribute_page(uint8_t index_bytes) {
  AttributeHeader h{};
  h.magic = kAttributeMagic, h.triangle_count = 2, h.uniform_material = kNoIndex, h.vertex_count = 4;
  h.has_normal = h.has_tangent = h.has_color = 1, h.uv_count = 2, h.index_bytes = index_bytes;
  h.materials_offset = sizeof h, h.indices_offset = sizeof h + 8;
  h.vertices_offset = h.indices_offset + (6u * index_bytes + 3) / 4 * 4;
  std::vector<std::byte> page(h.vertices_offset + 4 * 15 * 4);
  std::memcpy(page.data(), &h, sizeof h);
  const uint32_t materials[2] = {7, 9};
  std::memcpy(page.data() + h.materials_offset, materials, 8);
  const uint32_t indices[6] = {0, 1, 2, 2, 1, 3};
  for (int i = 0; i < 6; ++i)
    std::memcpy(page.data() + h.indices_offset + i * index_bytes, &indices[i], index_bytes);
  for (int i = 0; i < 60; ++i) {
    const float value = static_cast<float>(i);
    std::memcpy(page.data() + h.vertices_offset + 4 * i, &value, 4);
  }
  return page;
}

TEST(FindAttributes, ReadsWhatThePageHolds) {
  for (const uint8_t index_bytes : {uint8_t{2}, uint8_t{4}}) {
    const AlignedPage page(attribute_page(index_bytes));
    ASSERT_TRUE(check_attributes(page.bytes()).ok());
    const TriangleAttributes found = find_attributes(page.bytes(), 1);
    EXPECT_EQ(found.material, 9u);
    EXPECT_EQ(found.corner[2].normal, Vec3(45, 46, 47));
    EXPECT_EQ(found.corner[2].tangent, Vec4(48, 49, 50, 51));
    EXPECT_EQ(found.corner[2].color, Vec4(52, 53, 54, 55));
    EXPECT_EQ(found.corner[2].uv[1], Vec2(58, 59));
    EXPECT_EQ(found.corner[1].normal, Vec3(15, 16, 17));
    EXPECT_EQ(found.corner[1].uv[3], Vec2(0, 0));
  }
}

TEST(FindAttributes, DefaultsStandInForWhatIsMissing) {
  AttributeHeader h{};
  h.magic = kAttributeMagic, h.triangle_count = 5, h.uniform_material = 3;
  const AlignedPage page(std::as_bytes(std::span(&h, 1)));
  ASSERT_TRUE(check_attributes(page.bytes()).ok());
  const TriangleAttributes found = find_attributes(page.bytes(), 4);
  EXPECT_EQ(found.material, 3u);
  EXPECT_EQ(found.corner[0].color, Vec4(1));
  EXPECT_EQ(found.corner[0].normal, Vec3(0));
}

TEST(CheckAttributes, RejectsDamageOrReadsInside) {
  std::mt19937 random(6);
  const std::vector<std::byte> good = attribute_page(2);
  for (size_t size = 0; size < good.size(); ++size) {
    EXPECT_FALSE(check_attributes(AlignedPage(std::span<const std::byte>(good).first(size)).bytes()).ok()) << size;
  }
  size_t rejected = 0;
  for (int i = 0; i < 20000; ++i) {
    std::vector<std::byte> bad = good;
    for (uint32_t k = random() % 3 + 1; k > 0; --k) bad[random() % bad.size()] = static_cast<std::byte>(random());
    const AlignedPage page(bad);
    const Status status = check_attributes(page.bytes());
    rejected += !status.ok();
    if (!status.ok()) {
      EXPECT_EQ(status.error().code, ErrorCode::kCorrupt);
      continue;
    }
    const uint32_t count = reinterpret_cast<const AttributeHeader*>(page.bytes().data())->triangle_count;
    if (count > 0) find_attributes(page.bytes(), count - 1);
  }
  EXPECT_GT(rejected, 2000u);
}

}  // namespace
}  // namespace shoal::testing
