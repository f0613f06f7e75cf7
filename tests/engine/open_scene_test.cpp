#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <random>

#include "engine/describe_scene.h"
#include "io/page_cache.h"
#include "tests/engine/built_scene.h"
#include "treelets/attribute_layout.h"
#include "treelets/treelet_layout.h"

namespace shoal::testing {
namespace {

/// A built file taken apart, to be bent and written again with checksums that fit.
struct OpenedFile {
  struct Page {
    PageKind kind;
    std::vector<std::byte> bytes;
  };
  std::vector<Page> pages;
  std::map<TableId, std::vector<std::byte>> tables;

  explicit OpenedFile(const PageFile& file) {
    for (const PageRecord& record : file.records()) {
      if (record.kind == PageKind::kTable) {
        tables[record.table] = {};
        continue;
      }
      pages.push_back({record.kind, std::vector<std::byte>(record.raw_bytes)});
      uint64_t read_bytes = 0;
      EXPECT_TRUE(file.read_page(record.id, pages.back().bytes, &read_bytes).ok());
    }
    for (auto& [id, bytes] : tables) bytes = file.read_table(id, 1u << 30).value();
  }

  void write(FileSystem& fs, const std::string& path) const {
    auto writer = PageFileWriter::create(fs, path);
    ASSERT_TRUE(writer.ok());
    for (const Page& page : pages) ASSERT_TRUE(writer.value().append(page.kind, page.bytes).ok());
    for (const auto& [id, bytes] : tables) ASSERT_TRUE(writer.value().append_table(id, bytes).ok());
    ASSERT_TRUE(writer.value().finish().ok());
  }

  template <class T>
  T* rows(TableId table) {
    return reinterpret_cast<T*>(tables[table].data());
  }
};

MaterialLayers* layers_of(OpenedFile& file) { return file.rows<MaterialLayers>(tables::kMaterialLayers); }

/// Textures, emission, instances, coverage, attributes, several materials: something in every table.
class OpenScene : public ::testing::Test {
 protected:
  void SetUp() override {
    WrittenScene scene;
    std::vector<uint8_t> rgba(70 * 3 * 4);
    for (size_t i = 0; i < rgba.size(); ++i) rgba[i] = static_cast<uint8_t>(i * 37);
    const uint32_t texture = scene.add_texture(fs_, 70, 3, rgba);
    const nlohmann::json turned = {{"index", texture}, {"extensions", {{"KHR_texture_transform", {{"rotation", 1}}}}}};
    const nlohmann::json sheen = {{"sheenColorFactor", {1, 1, 1}}, {"sheenColorTexture", turned}};
    scene.json["materials"] = {
        {{"alphaMode", "MASK"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}}}},
        {{"emissiveFactor", {1, 1, 1}}},
        {{"extensions", {{"KHR_materials_sheen", sheen}}}}};
    scene.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 1.0}, {"znear", 0.1}}}}};
    scene.json["extensionsUsed"] = {"KHR_lights_punctual"};
    scene.json["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}}};
    std::vector<float> positions, uv;
    for (int i = 0; i < 90; ++i) {
      positions.insert(positions.end(), {float(i % 9), float(i * i % 17), float(i % 5)});
      uv.insert(uv.end(), {float(i % 4), float(i % 3)});
    }
    const nlohmann::json attributes = {{"POSITION", scene.add_floats(3, positions)},
                                       {"TEXCOORD_0", scene.add_floats(2, uv)}};
    const uint32_t shared = scene.add_mesh({{"attributes", attributes}, {"material", 0}});
    scene.json["meshes"][shared]["primitives"].push_back({{"attributes", attributes}, {"material", 1}});
    scene.add_node({{"mesh", shared}});
    scene.add_node({{"mesh", shared}, {"translation", {30, 0, 0}}, {"scale", {1, 2, 1}}});
    const uint32_t velvet = scene.add_triangle_mesh(0, 5);
    scene.json["meshes"][velvet]["primitives"][0]["material"] = 2;
    scene.add_node({{"mesh", velvet}});
    scene.add_node({{"camera", 0}});
    scene.add_node({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
    scene.save(fs_);
    SceneBuildOptions options;
    options.treelet_bytes = kMinTreeletBytes;
    built_ = std::make_unique<BuiltScene>(build_and_open(fs_, options));
  }

  /// Opens the file with a change made to it; the error's message, empty when it still opens.
  std::string opened_with(const std::function<void(OpenedFile&)>& change) {
    OpenedFile file(*built_->scene.file);
    change(file);
    file.write(fs_, "bent.shoal");
    auto scene = open_scene(fs_, "bent.shoal", ReadMode::kBuffered, {});
    if (!scene.ok()) {
      EXPECT_EQ(scene.error().code, ErrorCode::kCorrupt) << scene.error().message;
      return scene.error().message;
    }
    const Status pages = check_all_pages(scene.value());
    return pages.ok() ? "" : pages.error().message;
  }

  MemoryFileSystem fs_;
  std::unique_ptr<BuiltScene> built_;
};

TEST_F(OpenScene, OpensAFileTakenApartAndWrittenAgain) {
  EXPECT_EQ(opened_with([](OpenedFile&) {}), "");
  EXPECT_GT(built_->scene.treelets.size(), 1u);
}

TEST_F(OpenScene, NamesTheTableAndTheRowThatIsWrong) {
  const std::string message =
      opened_with([](OpenedFile& f) { f.rows<Material>(tables::kMaterials)[1].metallic = NAN; });
  EXPECT_NE(message.find("materials, row 1"), std::string::npos) << message;
  EXPECT_NE(message.find("bent.shoal"), std::string::npos) << message;
}

TEST_F(OpenScene, RefusesWhatWouldBeReadOutsideItsTable) {
  const std::vector<std::pair<const char*, std::function<void(OpenedFile&)>>> changes = {
      {"header", [](OpenedFile& f) { f.rows<SceneHeader>(tables::kSceneHeader)->version = 99; }},
      {"precision", [](OpenedFile& f) { f.rows<SceneHeader>(tables::kSceneHeader)->position_bits = 17; }},
      {"precision", [](OpenedFile& f) { f.rows<SceneHeader>(tables::kSceneHeader)->position_error = NAN; }},
      {"builder", [](OpenedFile& f) { f.rows<SceneHeader>(tables::kSceneHeader)->bvh_builder = 3; }},
      {"two headers", [](OpenedFile& f) { f.tables[tables::kSceneHeader].resize(2 * sizeof(SceneHeader)); }},
      {"half a row", [](OpenedFile& f) { f.tables[tables::kMaterials].resize(10); }},
      {"no table", [](OpenedFile& f) { f.tables.erase(tables::kEmitters); }},
      {"texture", [](OpenedFile& f) { f.rows<Material>(tables::kMaterials)[0].base_color_texture.texture = 1; }},
      {"uv set", [](OpenedFile& f) { f.rows<Material>(tables::kMaterials)[0].normal_texture.uv_set = 4; }},
      {"coverage", [](OpenedFile& f) { f.rows<Material>(tables::kMaterials)[0].coverage = CoverageMode{7}; }},
      {"effects", [](OpenedFile& f) { f.rows<Material>(tables::kMaterials)[0].effects = 1u << 20; }},
      {"layers row", [](OpenedFile& f) { f.rows<Material>(tables::kMaterials)[2].layers = 1; }},
      {"transform", [](OpenedFile& f) { f.rows<Material>(tables::kMaterials)[0].base_color_texture.transform = 9; }},
      {"layer texture", [](OpenedFile& f) { layers_of(f)->sheen_color_texture.texture = 5; }},
      {"layer factor", [](OpenedFile& f) { layers_of(f)->clearcoat = 1.5f; }},
      {"layer index", [](OpenedFile& f) { layers_of(f)->ior = 0.5f; }},
      {"layer absorption", [](OpenedFile& f) { layers_of(f)->absorption[1] = 1; }},
      {"layer volume", [](OpenedFile& f) { layers_of(f)->volume = 2; }},
      {"layer rotation", [](OpenedFile& f) { layers_of(f)->anisotropy_sin = NAN; }},
      {"no layers", [](OpenedFile& f) { f.tables[tables::kMaterialLayers].clear(); }},
      {"transform number", [](OpenedFile& f) { f.rows<TextureTransform>(tables::kTextureTransforms)->m[2] = INFINITY; }},
      {"no transforms", [](OpenedFile& f) { f.tables[tables::kTextureTransforms].clear(); }},
      {"width", [](OpenedFile& f) { f.rows<Texture>(tables::kTextures)->width = 1u << 20; }},
      {"levels", [](OpenedFile& f) { f.rows<Texture>(tables::kTextures)->level_count = 17; }},
      {"tile", [](OpenedFile& f) { f.rows<Texture>(tables::kTextures)->first_page[0] = 0xfffffff0u; }},
      {"tile kind", [](OpenedFile& f) { f.rows<Texture>(tables::kTextures)->first_page[2] = 12; }},
      {"wrap", [](OpenedFile& f) { f.rows<Texture>(tables::kTextures)->wrap_u = WrapMode{3}; }},
      {"emitter material", [](OpenedFile& f) { f.rows<Emitter>(tables::kEmitters)->material = 77; }},
      {"emitter instance", [](OpenedFile& f) { f.rows<Emitter>(tables::kEmitters)->instance = 77; }},
      {"emitter order", [](OpenedFile& f) { f.rows<Emitter>(tables::kEmitters)[1].primitive = 0; }},
      {"emitter position", [](OpenedFile& f) { f.rows<Emitter>(tables::kEmitters)->position[4] = INFINITY; }},
      {"light", [](OpenedFile& f) { f.rows<PunctualLight>(tables::kLights)->type = PunctualType{9}; }},
      {"camera", [](OpenedFile& f) { f.rows<CameraRecord>(tables::kCameras)->tan_half_yfov = NAN; }},
      {"camera keys", [](OpenedFile& f) { f.rows<CameraRecord>(tables::kCameras)->key_count = 2; }},
      {"first camera key", [](OpenedFile& f) { f.rows<CameraRecord>(tables::kCameras)->first_key = 1; }},
      {"geometry page", [](OpenedFile& f) { f.rows<TreeletPages>(tables::kTreelets)->geometry = 0; }},
      {"no attributes", [](OpenedFile& f) { f.rows<TreeletPages>(tables::kTreelets)[1].attributes = kNoPage; }},
      {"triangles", [](OpenedFile& f) { f.rows<TreeletPages>(tables::kTreelets)->triangle_count ^= 1; }},
      {"fewer treelets", [](OpenedFile& f) { f.tables[tables::kTreelets].resize(sizeof(TreeletPages)); }},
      {"entry treelet", [](OpenedFile& f) { f.rows<TreeletEntry>(tables::kEntries)->treelet = 1u << 30; }},
      {"entry root", [](OpenedFile& f) { f.rows<TreeletEntry>(tables::kEntries)->root = 0x7fffffffu; }},
      {"entry leaf", [](OpenedFile& f) { f.rows<TreeletEntry>(tables::kEntries)->root = kLeafBit | 0xfffff; }},
      {"instance root", [](OpenedFile& f) { f.rows<Instance>(tables::kInstances)->root_node = 1u << 30; }},
      {"top node", [](OpenedFile& f) { f.rows<TopNode>(tables::kTopNodes)->child[0] = 1u << 30; }},
      {"fewer materials", [](OpenedFile& f) { f.tables[tables::kMaterials].resize(sizeof(Material)); }},
  };
  for (const auto& [name, change] : changes) EXPECT_NE(opened_with(change), "") << name;
}

TEST_F(OpenScene, RefusesPagesThatDoNotFitTheTables) {
  const auto each_page = [](OpenedFile& f, PageKind kind,
                            const std::function<void(std::vector<std::byte>&)>& change) {
    for (auto& page : f.pages) {
      if (page.kind == kind) change(page.bytes);
    }
  };
  EXPECT_NE(opened_with([&](OpenedFile& f) {
              each_page(f, PageKind::kTreelet,
                        [](auto& bytes) { reinterpret_cast<TreeletHeader*>(bytes.data())->uniform_material = 50; });
            }),
            "");
  EXPECT_NE(opened_with([&](OpenedFile& f) {
              each_page(f, PageKind::kAttributes, [](auto& bytes) {
                auto* header = reinterpret_cast<AttributeHeader*>(bytes.data());
                if (header->uniform_material != kNoIndex) header->uniform_material = 50;
                if (header->materials_offset == 0) return;
                reinterpret_cast<uint32_t*>(bytes.data() + header->materials_offset)[header->triangle_count - 1] =
                    50;
              });
            }),
            "");
  EXPECT_NE(
      opened_with([&](OpenedFile& f) { each_page(f, PageKind::kTexture, [](auto& bytes) { bytes.resize(100); }); }),
      "");
}

TEST_F(OpenScene, SurvivesRandomBytesInEveryTableAndPage) {
  std::mt19937 random(3);
  const OpenedFile original(*built_->scene.file);
  int opened = 0;
  for (int round = 0; round < 400; ++round) {
    OpenedFile file = original;
    std::vector<std::vector<std::byte>*> parts;
    for (auto& [id, bytes] : file.tables) parts.push_back(&bytes);
    for (auto& page : file.pages) parts.push_back(&page.bytes);
    std::vector<std::byte>& part = *parts[random() % parts.size()];
    for (uint32_t n = random() % 4 + 1; n > 0 && !part.empty(); --n) {
      const uint32_t pattern = random();
      const size_t at = random() % part.size();
      part[at] = static_cast<std::byte>(pattern & 1 ? 0xff : pattern >> 8);
    }
    if (random() % 8 == 0) part.resize(random() % (part.size() + 1));
    if (part.empty()) part.resize(1);
    file.write(fs_, "bent.shoal");
    auto scene = open_scene(fs_, "bent.shoal", ReadMode::kBuffered, {});
    if (!scene.ok()) continue;
    ++opened;
    (void)check_all_pages(scene.value());
    (void)scene_description_json(scene.value());
  }
  EXPECT_GT(opened, 10);  // pages are checked when they are decoded, so many still open
}

TEST_F(OpenScene, ChecksPagesOnTheirWayIntoTheCache) {
  const Scene& scene = built_->scene;
  PageCache cache(*scene.file, 16u << 20, [&](const PageRecord& record, std::span<const std::byte> bytes) {
    return check_page(scene, record, bytes);
  });
  CacheCounters counters;
  for (const TreeletPages& pages : scene.treelets) EXPECT_TRUE(cache.pin(pages.geometry, counters).ok());
}

TEST_F(OpenScene, DescribesBytesATriangle) {
  const SceneDescription d = describe_scene(built_->scene);
  EXPECT_EQ(d.triangles_count, built_->report.triangles_count);
  EXPECT_EQ(d.geometry_bytes, built_->scene.header.geometry_bytes);
  EXPECT_EQ(d.attribute_bytes, built_->scene.header.attribute_bytes);
  EXPECT_EQ(d.texture_bytes, built_->scene.header.texture_bytes);
  EXPECT_DOUBLE_EQ(d.geometry_bytes_per_triangle * double(d.triangles_count), double(d.geometry_bytes));
  const auto json = nlohmann::json::parse(scene_description_json(built_->scene));
  EXPECT_EQ(json["instances_count"], 3);
  EXPECT_EQ(json["build"]["source"], "scene.gltf");
  EXPECT_NE(scene_description_text(built_->scene).find("bytes a triangle"), std::string::npos);
}

}  // namespace
}  // namespace shoal::testing
