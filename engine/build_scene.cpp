#include "engine/build_scene.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <new>

#include "engine/build_record.h"
#include "engine/emitters.h"
#include "engine/place_instances.h"
#include "engine/plan_objects.h"
#include "engine/scene_writer.h"
#include "engine/tile_textures.h"

namespace shoal {

namespace {

/// Scratch of treelets/build_object a triangle, from its header.
constexpr uint64_t kBuilderBytesPerTriangle = 150;
/// Code, tables, page buffers and the allocator, beside what is counted.
constexpr uint64_t kFixedBuildBytes = 64u << 20;
constexpr size_t kMaxWarnings = 100;

class SceneBuilder {
 public:
  SceneBuilder(FileSystem& fs, const std::string& path, const SceneBuildOptions& options)
      : fs_(fs), path_(path), options_(options) {}

  Result<SceneBuildReport> run(const std::string& output) {
    const auto start = std::chrono::steady_clock::now();
    SHOAL_RETURN_IF_ERROR(read_document());
    gltf::BufferFiles files(fs_, document_);
    SHOAL_ASSIGN_OR_RETURN(geometry_, plan_geometry(files, document_, flat_));
    SHOAL_ASSIGN_OR_RETURN(materials_, plan_materials(document_, geometry_.uses));
    note(geometry_.warnings);
    note(materials_.warnings);
    SHOAL_RETURN_IF_ERROR(check_memory());
    SHOAL_ASSIGN_OR_RETURN(PageFileWriter writer, PageFileWriter::create(fs_, output));
    CoverageTextures coverage(materials_.textures.size());
    SHOAL_RETURN_IF_ERROR(store_textures(files, writer, coverage));
    TreeletPageSink sink(writer, options_.stop);
    SHOAL_RETURN_IF_ERROR(build_objects(files, coverage, sink));
    SHOAL_RETURN_IF_ERROR(place_objects());
    report_.source_read_bytes += files.read_bytes();
    SHOAL_RETURN_IF_ERROR(write_tables(writer, sink));
    SHOAL_RETURN_IF_ERROR(writer.finish());
    report_.file_bytes = writer.bytes_written();
    progress("writing", 1);
    report_.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return std::move(report_);
  }

 private:
  Status check_stop() const {
    if (options_.stop == nullptr || !options_.stop->load(std::memory_order_relaxed)) return {};
    return Error{ErrorCode::kStopped, fmt::format("{}: the build was stopped before it was complete", path_)};
  }

  void progress(const char* stage, double fraction) const {
    if (options_.progress) options_.progress({stage, fraction});
  }

  void note(const std::vector<std::string>& warnings) {
    report_.warnings.insert(report_.warnings.end(), warnings.begin(), warnings.end());
  }

  Status read_document() {
    progress("reading", 0);
    SHOAL_ASSIGN_OR_RETURN(document_, gltf::load_document(fs_, path_, options_.limits));
    note(document_.warnings);
    SHOAL_ASSIGN_OR_RETURN(flat_, flatten_nodes(document_, options_.limits));
    note(flat_.warnings);
    progress("reading", 1);
    return {};
  }

  /// Refuses a scene whose largest object does not fit, before anything is read. One object is in memory at a time.
  Status check_memory() const {
    if (options_.max_memory_bytes == 0) return {};
    uint64_t largest = 0;
    for (const ObjectPlan& object : geometry_.objects) {
      const CornerLayout layout = object_layout(document_, geometry_, object, materials_);
      const uint64_t soup_bytes = 36 + 8 + uint64_t{12} * layout.floats();
      largest = std::max(largest, object_triangles(geometry_, object) * (soup_bytes + kBuilderBytesPerTriangle));
    }
    const uint64_t needed = largest + kFixedBuildBytes;
    if (needed <= options_.max_memory_bytes) return {};
    return Error{ErrorCode::kMemoryCap, fmt::format("{}: building needs {} MiB at least, the memory cap is {} MiB",
                                                    path_, (needed >> 20) + 1, options_.max_memory_bytes >> 20)};
  }

  Status store_textures(gltf::BufferFiles& files, PageFileWriter& writer, CoverageTextures& coverage) {
    gltf::Limits limits = options_.limits;
    if (options_.max_memory_bytes > 0) {
      limits.image_pixels = std::min(limits.image_pixels, options_.max_memory_bytes / kImageScratchBytesPerPixel);
    }
    SHOAL_ASSIGN_OR_RETURN(textures_,
                           tile_textures(fs_, files, document_, materials_.textures, limits, writer, coverage,
                                         [this](double fraction) { progress("textures", fraction); }));
    finish_materials(materials_, textures_.facts, geometry_.uses);
    coverage.set_materials(materials_.materials, textures_.textures);
    report_.source_read_bytes += textures_.source_bytes;
    return {};
  }

  Status build_objects(gltf::BufferFiles& files, const CoverageTextures& coverage, TreeletSink& sink) {
    for (const ObjectPlan& object : geometry_.objects) total_triangles_ += object_triangles(geometry_, object);
    for (const ObjectPlan& object : geometry_.objects) {
      SHOAL_ASSIGN_OR_RETURN(TriangleSoup soup, read_object(files, object));
      emitters_of_.push_back(collect_emitters(soup, materials_.materials));
      progress("building", static_cast<double>(read_triangles_) / static_cast<double>(total_triangles_));
      SHOAL_RETURN_IF_ERROR(check_stop());
      BuiltObject built;
      if (soup.size() > 0) {
        SHOAL_ASSIGN_OR_RETURN(built, build_object(std::move(soup), {options_.treelet_bytes}, &coverage, sink));
      }
      report_.triangles_count += built.triangles_count;
      report_.degenerate_count += built.degenerate_count;
      report_.sah_cost += built.sah_cost;
      built_.push_back(std::move(built));
    }
    return {};
  }

  Result<TriangleSoup> read_object(gltf::BufferFiles& files, const ObjectPlan& object) {
    TriangleSoup soup;
    soup.layout = object_layout(document_, geometry_, object, materials_);
    const size_t count = object_triangles(geometry_, object);
    soup.positions.reserve(9 * count);
    soup.primitive.reserve(count);
    soup.material.reserve(count);
    soup.corners.reserve(3 * count * soup.layout.floats());
    ReadCounts counts;
    for (const uint32_t m : object.meshes) {
      const MeshPlan& mesh = geometry_.meshes[m];
      const AffineDouble* bake = object.baked ? &flat_.meshes[mesh.placements[0]].to_world : nullptr;
      for (const PrimitiveSource& source : mesh.primitives) {
        SHOAL_RETURN_IF_ERROR(append_primitive(files, document_, materials_, source, bake, soup, counts));
        read_triangles_ += source.triangle_count;
        progress("reading", static_cast<double>(read_triangles_) / static_cast<double>(total_triangles_));
        SHOAL_RETURN_IF_ERROR(check_stop());
      }
    }
    report_.degenerate_count += counts.degenerate_count;
    note(counts.warnings);
    return soup;
  }

  Status place(uint32_t object, const AffineDouble& to_world, const std::string& name) {
    const auto placed = place_instance(object, built_[object].bounds, to_world);
    if (!placed) {
      report_.warnings.push_back(fmt::format("an instance of {} is left out: its matrix has no inverse", name));
      return {};
    }
    SHOAL_RETURN_IF_ERROR(
        append_emitters(emitters_of_[object], placed->instance, static_cast<uint32_t>(placed_.size()), emitters_));
    report_.instanced_triangles_count += built_[object].triangles_count;
    placed_.push_back(*placed);
    return {};
  }

  Status place_objects() {
    for (uint32_t i = 0; i < built_.size(); ++i) {
      if (built_[i].nodes.empty()) continue;
      if (geometry_.objects[i].baked) {
        SHOAL_RETURN_IF_ERROR(place(i, AffineDouble{}, "the world object"));
        continue;
      }
      const uint32_t mesh = geometry_.objects[i].meshes[0];
      for (const uint32_t p : geometry_.meshes[mesh].placements) {
        SHOAL_RETURN_IF_ERROR(place(i, flat_.meshes[p].to_world, fmt::format("meshes[{}]", mesh)));
      }
    }
    if (placed_.empty()) {
      return Error{ErrorCode::kInput,
                   fmt::format("{}: expected triangles to draw, found none in the scene", path_)};
    }
    report_.instances_count = placed_.size();
    report_.objects_count = built_.size();
    return {};
  }

  SceneHeader make_header(const TreeletPageSink& sink) const {
    SceneHeader header = {};
    header.version = kSceneVersion;
    header.treelet_bytes = options_.treelet_bytes;
    header.triangles_count = report_.triangles_count;
    header.instanced_triangles_count = report_.instanced_triangles_count;
    header.degenerate_count = report_.degenerate_count;
    header.texture_bytes = textures_.pages_bytes;
    header.content_hash = source_hash(fs_, document_, false);
    sink.fill(header);
    Bounds3 bounds;
    for (const PlacedInstance& placed : placed_) bounds.include(placed.bounds);
    for (int i = 0; i < 3; ++i) header.bounds_lo[i] = bounds.lo[i], header.bounds_hi[i] = bounds.hi[i];
    return header;
  }

  Status write_tables(PageFileWriter& writer, const TreeletPageSink& sink) {
    progress("writing", 0);
    const SceneHeader header = make_header(sink);
    report_.treelets_count = sink.treelets().size();
    report_.geometry_bytes = header.geometry_bytes;
    if (report_.warnings.size() > kMaxWarnings) {
      const size_t more = report_.warnings.size() - kMaxWarnings;
      report_.warnings.resize(kMaxWarnings);
      report_.warnings.push_back(fmt::format("and {} more warnings", more));
    }
    SHOAL_ASSIGN_OR_RETURN(const TopTables top, assemble_top_tree(built_, std::move(placed_)));
    const std::string record = build_record_json(document_, header, report_);
    const std::string names = names_json(document_, flat_, materials_.default_material != kNoIndex);
    SHOAL_RETURN_IF_ERROR(writer.append_table(tables::kBuildRecord, std::as_bytes(std::span(record))));
    SHOAL_RETURN_IF_ERROR(append_rows(writer, tables::kSceneHeader, std::vector{header}));
    SHOAL_RETURN_IF_ERROR(append_rows(writer, tables::kTopNodes, top.nodes));
    SHOAL_RETURN_IF_ERROR(append_rows(writer, tables::kEntries, top.entries));
    SHOAL_RETURN_IF_ERROR(append_rows(writer, tables::kInstances, top.instances));
    SHOAL_RETURN_IF_ERROR(append_rows(writer, tables::kTreelets, sink.treelets()));
    SHOAL_RETURN_IF_ERROR(append_rows(writer, tables::kMaterials, materials_.materials));
    SHOAL_RETURN_IF_ERROR(append_rows(writer, tables::kTextures, textures_.textures));
    SHOAL_RETURN_IF_ERROR(append_rows(writer, tables::kEmitters, emitters_));
    SHOAL_RETURN_IF_ERROR(append_rows(writer, tables::kLights, convert_lights(document_, flat_)));
    SHOAL_RETURN_IF_ERROR(append_rows(writer, tables::kCameras, convert_cameras(document_, flat_)));
    return writer.append_table(tables::kNames, std::as_bytes(std::span(names)));
  }

  FileSystem& fs_;
  const std::string& path_;
  const SceneBuildOptions& options_;
  SceneBuildReport report_;
  gltf::Document document_;
  FlatScene flat_;
  GeometryPlan geometry_;
  MaterialPlan materials_;
  TiledTextures textures_;
  std::vector<BuiltObject> built_;                 // parallel to geometry_.objects
  std::vector<std::vector<Emitter>> emitters_of_;  // likewise, object space
  std::vector<PlacedInstance> placed_;
  std::vector<Emitter> emitters_;
  uint64_t total_triangles_ = 0, read_triangles_ = 0;
};

}  // namespace

Result<SceneBuildReport> build_scene(FileSystem& fs, const std::string& gltf_path, const std::string& output,
                                     const SceneBuildOptions& options) {
  const auto run = [&]() -> Result<SceneBuildReport> {
    try {
      return SceneBuilder(fs, gltf_path, options).run(output);
    } catch (const std::bad_alloc&) {
      return Error{ErrorCode::kMemoryCap, fmt::format("{}: the build ran out of memory", gltf_path)};
    }
  };
  if (options.treelet_bytes < kMinTreeletBytes || options.treelet_bytes > kMaxTreeletBytes) {
    return Error{ErrorCode::kUsage, fmt::format("treelet size: expected {} to {} bytes, found {}", kMinTreeletBytes,
                                                kMaxTreeletBytes, options.treelet_bytes)};
  }
  tbb::task_arena arena(options.threads == 0 ? tbb::task_arena::automatic : static_cast<int>(options.threads));
  return arena.execute(run);
}

}  // namespace shoal
