// What fuzzers begin with: small sound files of every kind, one folder a target. Usage: fuzz_seeds FOLDER
#include <png.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>

#include "engine/build_scene.h"
#include "engine/picture_attributes.h"
#include "engine/scene.h"
#include "engine/sums_file.h"
#include "io/image.h"
#include "tests/fuzz/shoal_input.h"
#include "tests/fuzz/sums_input.h"
#include "tests/io/gltf_scene.h"
#include "tests/io/image_samples.h"
#include "tests/support/packed_meshes.h"
#include "tests/support/written_scene.h"

namespace shoal::fuzz {
namespace {

using Bytes = std::vector<std::byte>;
using gltf::GltfScene;
using nlohmann::json;

class SeedFolder {
 public:
  SeedFolder(const std::filesystem::path& root, const std::string& target) : folder_(root / target) {
    std::filesystem::create_directories(folder_);
  }
  void put(const std::string& name, const Bytes& bytes) const {
    std::ofstream out(folder_ / name, std::ios::binary);
    out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }

 private:
  std::filesystem::path folder_;
};

void stop(const std::string& message) {
  std::fprintf(stderr, "fuzz_seeds: %s\n", message.c_str());
  std::exit(1);
}

std::vector<uint8_t> noise(size_t count) {
  std::mt19937 random(3);
  std::vector<uint8_t> bytes(count);
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random() % 40 + count % 100);
  return bytes;
}

// ---- pictures

Bytes radiance() {
  std::string text = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 3 +X 9\n";
  for (int y = 0; y < 2; ++y) text += std::string("\2\2\0\x09\x89\1\x83\1\6\1\2\3\4\5\6\x89\0\x89\x81", 19);
  text += std::string("\x80\1\2\x81\1\1\1\x08", 8);
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

void write_images(const SeedFolder& folder) {
  folder.put("rgba.png", make_png(8, 8, PNG_COLOR_TYPE_RGB_ALPHA, 8, true, noise(256)));
  folder.put("rgb16.png", make_png(4, 4, PNG_COLOR_TYPE_RGB, 16, false, noise(96), {}, {1}));
  folder.put("grey1.png", make_png(16, 4, PNG_COLOR_TYPE_GRAY, 1, false, noise(8)));
  folder.put("palette.png", make_png(16, 16, PNG_COLOR_TYPE_PALETTE, 4, false, std::vector<uint8_t>(128, 0x12),
                                     {1, 2, 3, 4, 5, 6, 7, 8, 9}, {5}));
  folder.put("rgb.jpg", make_jpeg(24, 24, 3, false, noise(1728)));
  folder.put("progressive.jpg", make_jpeg(24, 24, 3, true, noise(1728)));
  folder.put("grey.jpg", make_jpeg(24, 24, 1, false, noise(576)));
  folder.put("cmyk.jpg", make_jpeg(16, 16, 4, false, noise(1024)));
  folder.put("lossless.webp", make_webp(8, 8, true, noise(256)));
  folder.put("lossy.webp", make_webp(16, 16, false, noise(1024)));
  folder.put("rle.hdr", radiance());
  const std::string flat = "#?RGBE\nEXPOSURE=2\n\n-Y 2 +X 2\n\1\2\3\4\1\2\3\4\5\6\7\x80\1\1\1\1";
  const auto bytes = std::as_bytes(std::span(flat));
  folder.put("flat.hdr", {bytes.begin(), bytes.end()});
}

void write_exrs(const SeedFolder& folder) {
  const auto put = [&](const std::string& name, const std::vector<std::string>& channels, bool half,
                       uint32_t width) {
    ExrImage image;
    image.width = width;
    image.height = 20;
    for (const std::string& channel : channels) {
      image.channels.push_back({channel, half, {}});
      for (const uint8_t value : noise(20 * width)) image.channels.back().values.push_back(value);
    }
    image.text["software"] = "shoal";
    image.numbers["samplesPerPixel"] = 4;
    image.matrices["worldToCamera"] = {1, 0, 0, 0, 0, 1};
    MemoryFileSystem fs;
    if (const Status status = write_exr(fs, "a.exr", image); !status.ok()) stop(status.error().message);
    folder.put(name, fs.contents("a.exr"));
  };
  put("rgb.exr", {"R", "G", "B"}, false, 12);
  put("layers.exr", {"R", "G", "B", "A", "Z", "normal.X"}, true, 6);
  put("grey.exr", {"Y"}, false, 1);
}

// ---- glTF

/// One file: the JSON, a zero byte, and the file scene.bin beside it.
Bytes with_buffer(const GltfScene& scene) {
  MemoryFileSystem fs;
  Bytes bytes = fs.contents(scene.put(fs));
  bytes = fs.contents("dir/scene.gltf");
  bytes.push_back(std::byte{0});
  bytes.insert(bytes.end(), scene.binary.begin(), scene.binary.end());
  return bytes;
}

Bytes as_glb(const GltfScene& scene) {
  MemoryFileSystem fs;
  return fs.contents(scene.put_glb(fs));
}

GltfScene rich_scene() {
  GltfScene scene = gltf::triangle_scene();
  const uint32_t indices = scene.add_view<uint16_t>({0, 2}), values = scene.add_view<float>({1, 2, 3, 4, 5, 6});
  scene.root["accessors"][0]["sparse"] = {
      {"count", 2},
      {"indices", {{"bufferView", indices}, {"componentType", gltf::kUnsignedShort}}},
      {"values", {{"bufferView", values}}}};
  json& primitives = scene.root["meshes"][0]["primitives"];
  primitives.push_back({{"attributes", {{"POSITION", 1}}}, {"mode", 5}});
  scene.root["images"].push_back({{"uri", "data:image/png;base64,iVBORw0KGgo="}});
  const uint32_t picture = scene.add_view_bytes(make_png(2, 2, PNG_COLOR_TYPE_RGB, 8, false, noise(12)), 0);
  scene.root["images"].push_back({{"bufferView", picture}, {"mimeType", "image/png"}});
  const uint32_t times = scene.add_accessor<float>({0, 1}, "SCALAR", gltf::kFloat, 2);
  const uint32_t moves = scene.add_accessor<float>({0, 0, 0, 1, 1, 1}, "VEC3", gltf::kFloat, 2);
  scene.root["skins"] = {{{"joints", {1, 0}}}};
  primitives[0]["targets"] = {{{"POSITION", 0}}};
  primitives[1]["targets"] = {{{"POSITION", 1}}};
  scene.root["meshes"][0]["weights"] = {0.5};
  scene.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", moves}};
  scene.root["animations"] = {{{"channels", {{{"sampler", 0}, {"target", {{"node", 1}, {"path", "translation"}}}}}},
                               {"samplers", {{{"input", times}, {"output", moves}}}}}};
  scene.root["extensions"]["KHR_materials_variants"]["variants"] = {{{"name", "red"}}};
  primitives[0]["extensions"]["KHR_materials_variants"]["mappings"] = {{{"material", 0}, {"variants", {0}}}};
  scene.root["extensions"]["KHR_lights_punctual"]["lights"] = {
      {{"type", "spot"}, {"spot", {{"outerConeAngle", 0.5}}}}};
  scene.root["nodes"][1]["extensions"]["KHR_lights_punctual"]["light"] = 0;
  return scene;
}

const std::vector<float> kPositions = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 1};
const std::vector<uint32_t> kIndices = {0, 1, 2, 1, 3, 2};

GltfScene meshopt_scene() {
  GltfScene scene;
  const auto add = [&](const std::string& packed, uint64_t count, uint32_t stride, const char* mode) {
    const uint32_t raw = scene.add_view_bytes(std::as_bytes(std::span(packed)), 0);
    json compressed = scene.root["bufferViews"][raw];
    compressed.update({{"byteStride", stride}, {"count", count}, {"mode", mode}, {"filter", "NONE"}});
    scene.root["bufferViews"][raw] = {{"buffer", 1}, {"byteOffset", 0}, {"byteLength", count * stride}};
    if (std::string(mode) == "ATTRIBUTES") scene.root["bufferViews"][raw]["byteStride"] = stride;
    scene.root["bufferViews"][raw]["extensions"]["EXT_meshopt_compression"] = compressed;
    return raw;
  };
  const uint32_t positions = add(testing::pack_vertices(kPositions.data(), 4, 12), 4, 12, "ATTRIBUTES");
  const uint32_t indices = add(testing::pack_triangles(kIndices, 4), 6, 4, "TRIANGLES");
  const uint32_t sequence = add(testing::pack_sequence(kIndices, 4), 6, 4, "INDICES");
  scene.add_accessor({{"bufferView", positions}, {"type", "VEC3"}, {"componentType", gltf::kFloat}, {"count", 4}});
  for (const uint32_t view : {indices, sequence}) {
    const uint32_t accessor = scene.add_accessor(
        {{"bufferView", view}, {"type", "SCALAR"}, {"componentType", gltf::kUnsignedInt}, {"count", 6}});
    scene.add_mesh({{"attributes", {{"POSITION", 0}}}, {"indices", accessor}});
  }
  scene.root["buffers"] = {
      {{"uri", "scene.bin"}, {"byteLength", scene.binary.size()}},
      {{"byteLength", 4096}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
  scene.root["extensionsRequired"] = {"EXT_meshopt_compression"};
  return scene;
}

GltfScene draco_scene(bool sequential) {
  testing::DracoSource source;
  source.positions = kPositions;
  source.indices = kIndices;
  source.uvs = {0, 0, 1, 0, 0, 1, 1, 1};
  source.sequential = sequential;
  source.quantization_bits = sequential ? 0 : 11;
  const testing::PackedDraco packed = testing::pack_draco(source);
  GltfScene scene;
  const uint32_t view = scene.add_view_bytes(std::as_bytes(std::span(packed.bytes)), 0);
  const size_t vertices = packed.positions.size() / 3;
  scene.add_accessor({{"type", "VEC3"}, {"componentType", gltf::kFloat}, {"count", vertices}});
  scene.add_accessor({{"type", "VEC2"}, {"componentType", gltf::kFloat}, {"count", vertices}});
  scene.add_accessor(
      {{"type", "SCALAR"}, {"componentType", gltf::kUnsignedShort}, {"count", packed.indices.size()}});
  const json ids = {{"POSITION", packed.position_id}, {"TEXCOORD_0", packed.uv_id}};
  scene.add_mesh({{"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}}},
                  {"indices", 2},
                  {"extensions", {{"KHR_draco_mesh_compression", {{"bufferView", view}, {"attributes", ids}}}}}});
  scene.root["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  return scene;
}

void write_gltfs(const SeedFolder& folder) {
  folder.put("triangle.gltf", with_buffer(gltf::triangle_scene()));
  folder.put("triangle.glb", as_glb(gltf::triangle_scene()));
  folder.put("rich.gltf", with_buffer(rich_scene()));
  folder.put("rich.glb", as_glb(rich_scene()));
  folder.put("meshopt.gltf", with_buffer(meshopt_scene()));
  folder.put("draco.glb", as_glb(draco_scene(false)));
  folder.put("draco_sequential.glb", as_glb(draco_scene(true)));
}

// ---- .shoal

/// As parts, and where asked as a file, with its checksums to be kept and to be repaired.
void put_built(const SeedFolder& folder, MemoryFileSystem& fs, const std::string& name, SceneBuildOptions options,
               bool as_file) {
  options.threads = 1;
  options.treelet_bytes = 4u << 10;
  const auto report = build_scene(fs, "scene.gltf", "a.shoal", options);
  if (!report.ok()) stop(report.error().message);
  const auto scene = open_scene(fs, "a.shoal", ReadMode::kBuffered, {});
  if (!scene.ok()) stop(scene.error().message);
  const auto parts = parts_of(*scene.value().file);
  if (!parts.ok()) stop(parts.error().message);
  fs.put("b.shoal", shoal_file_of(parts.value()));
  const auto again = open_scene(fs, "b.shoal", ReadMode::kBuffered, {});
  if (!again.ok()) stop(again.error().message);
  if (const Status sound = verify_scene(again.value()); !sound.ok()) stop(sound.error().message);
  folder.put(name + ".parts", parts.value());
  if (!as_file) return;
  Bytes file = fs.contents("a.shoal");
  folder.put(name + ".shoal", file);
  file.insert(file.begin(), std::byte{'R'});
  folder.put(name + ".repaired", file);
}

/// Coverage, emission, layers, instances, lights, two cameras: something in every table.
testing::WrittenScene full_scene(MemoryFileSystem& fs) {
  testing::WrittenScene scene;
  std::vector<uint8_t> texels = noise(12);
  texels.resize(24, 200);  // a row of one colour: the tile goes on with it
  const uint32_t texture = scene.add_texture(fs, 3, 2, texels);
  const json slot = {{"index", texture}, {"extensions", {{"KHR_texture_transform", {{"rotation", 1}}}}}};
  scene.json["materials"] = {
      {{"alphaMode", "MASK"}, {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}}}},
      {{"emissiveFactor", {1, 1, 1}}},
      {{"extensions", {{"KHR_materials_sheen", {{"sheenColorFactor", {1, 1, 1}}, {"sheenColorTexture", slot}}}}}},
      {{"alphaMode", "BLEND"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 1, 1, 0.5}}}}}};
  scene.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 1.0}, {"znear", 0.1}}}}};
  scene.json["extensionsUsed"] = {"KHR_lights_punctual"};
  scene.json["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}}};
  std::vector<float> positions, uvs;
  for (int i = 0; i < 60; ++i) {
    positions.insert(positions.end(), {float(i % 9), float(i * i % 17), float(i % 5)});
    uvs.insert(uvs.end(), {float(i % 4), float(i % 3)});
  }
  const json attributes = {{"POSITION", scene.add_floats(3, positions)}, {"TEXCOORD_0", scene.add_floats(2, uvs)}};
  const uint32_t shared = scene.add_mesh({{"attributes", attributes}, {"material", 0}});
  scene.json["meshes"][shared]["primitives"].push_back({{"attributes", attributes}, {"material", 1}});
  scene.add_node({{"mesh", shared}});
  scene.add_node({{"mesh", shared}, {"translation", {30, 0, 0}}, {"scale", {1, 2, 1}}});
  for (const int material : {2, 3}) {
    const uint32_t mesh = scene.add_triangle_mesh(float(material), 5);
    scene.json["meshes"][mesh]["primitives"][0]["material"] = material;
    scene.add_node({{"mesh", mesh}});
  }
  scene.add_node({{"camera", 0}});
  scene.add_node({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
  return scene;
}

void write_shoals(const SeedFolder& folder) {
  const auto put = [&](const std::string& name, const auto& change, const SceneBuildOptions& options,
                       bool as_file) {
    MemoryFileSystem fs;
    testing::WrittenScene scene;
    change(fs, scene);
    scene.save(fs);
    put_built(folder, fs, name, options, as_file);
  };
  put(
      "triangle",
      [](auto&, auto& scene) {
        scene.add_node({{"mesh", scene.add_triangle_mesh(0, 1)}});
      },
      {}, true);
  const auto full = [](auto& fs, auto& scene) { scene = full_scene(fs); };
  put("full", full, {}, false);
  SceneBuildOptions coarse;
  coarse.positions = PositionPrecision::k16;
  put("coarse", full, coarse, false);
  SceneBuildOptions moving;
  moving.pose.shutter = {0, 1};
  const auto moves = [](auto&, auto& scene) {
    scene.add_node({{"mesh", scene.add_triangle_mesh(0, 1)}});
    scene.add_node({{"mesh", scene.add_triangle_mesh(5, 1)}});
    const uint32_t times = scene.add_floats(1, {0, 4}), values = scene.add_floats(3, {0, 0, 0, 8, 0, 0});
    scene.json["animations"] = {
        {{"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}},
         {"samplers", {{{"input", times}, {"output", values}}}}}};
  };
  put("moving", moves, moving, false);
}

// ---- sums of pictures

class SomeUnfinished final : public UnfinishedPaths {
 public:
  void each_unfinished(const VisitUnfinished& visit) const override { visit({1, 17, 0}), visit({5, 16, 1}); }
};

/// As they are, and to be repaired.
void put_sums(const SeedFolder& folder, const std::string& name, SumsKind kind, uint32_t aovs, bool adaptive) {
  constexpr uint32_t kWidth = 19, kHeight = 3;
  Film film(kWidth, kHeight, adaptive ? 2 : 1);
  AovFilm layers({aovs}, kWidth, kHeight);
  AdaptiveSampling judged(kWidth, kHeight, {0.1f, 0.3f}, 1);
  for (uint32_t pixel = 0; pixel < kWidth * kHeight; ++pixel) {
    for (uint32_t sample = 0; sample < 16; ++sample) {
      const Vec3 radiance(static_cast<float>(sample % (pixel + 1)), 0.5f, 0.25f);
      film.add(pixel, radiance, pixel % 4 != 0, adaptive ? AdaptiveSampling::half_of(sample) : 0);
      if (adaptive) judged.add(pixel, sample, radiance, pixel % 4 != 0);
    }
  }
  if (adaptive) judged.end_pass(film, 16);
  SumsHeader header;
  header.kind = kind;
  header.samples = 64, header.range = {0, 64}, header.next_sample = 7, header.seconds = 1;
  header.pass.span = {16, 32}, header.pass.passes_count = 2;
  ExrImage image;
  image.text["software"] = "shoal", image.numbers["samplesPerPixel"] = 64, image.matrices["worldToCamera"] = {1};
  const bool part = kind == SumsKind::kPart;
  const SomeUnfinished unfinished;
  MemoryFileSystem fs;
  const Status written = write_sums(fs, "a", header, "scene 1\nsampler sobol\n", part ? attributes_text(image) : "",
                                    {film, aovs != 0 ? &layers : nullptr, adaptive ? &judged : nullptr},
                                    part ? nullptr : &unfinished);
  if (!written.ok()) stop(written.error().message);
  Bytes file = fs.contents("a");
  folder.put(name, file);
  file.insert(file.begin(), std::byte{'R'});
  if (sums_file_of(file) != fs.contents("a")) stop("repairing sums changes them");
  folder.put(name + ".repaired", file);
}

void write_all_sums(const SeedFolder& folder) {
  put_sums(folder, "checkpoint", SumsKind::kCheckpoint, 0, false);
  put_sums(folder, "layers", SumsKind::kCheckpoint, (1u << kAovCount) - 1, false);
  put_sums(folder, "adaptive", SumsKind::kCheckpoint, 0, true);
  put_sums(folder, "part", SumsKind::kPart, 3, false);
}

// ---- shoal.json

void write_options(const SeedFolder& folder) {
  const auto put = [&](const std::string& name, const std::string& text) {
    const auto bytes = std::as_bytes(std::span(text));
    folder.put(name, {bytes.begin(), bytes.end()});
  };
  put("defaults.json", R"({"defaults": {"spp": 16, "environment": "sky.hdr", "camera": [0.5, -1e9, "x"]}})");
  put("scenes.json", R"({"defaults": {}, "scenes": {"a.gltf": {"quiet": true}, "%41\u00e9.glb": {"spp": "2"}}})");
}

}  // namespace
}  // namespace shoal::fuzz

int main(int argc, char** argv) {
  if (argc != 2) shoal::fuzz::stop("usage: fuzz_seeds FOLDER");
  const std::filesystem::path root = argv[1];
  shoal::fuzz::write_images({root, "image"});
  shoal::fuzz::write_exrs({root, "exr"});
  shoal::fuzz::write_gltfs({root, "gltf"});
  shoal::fuzz::write_shoals({root, "shoal"});
  shoal::fuzz::write_all_sums({root, "sums"});
  shoal::fuzz::write_options({root, "options"});
  return 0;
}
