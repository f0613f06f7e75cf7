#include "engine/build_scene.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <new>

#include "engine/build_chunks.h"
#include "engine/build_record.h"
#include "engine/consume_source.h"
#include "engine/emitters.h"
#include "engine/measure_images.h"
#include "engine/motion_keys.h"
#include "engine/place_instances.h"
#include "engine/plan_objects.h"
#include "engine/process_memory.h"
#include "engine/scene_writer.h"
#include "engine/tile_textures.h"
#include "io/decompress_document.h"

namespace shoal {

namespace {

constexpr size_t kMaxWarnings = 100;

class SceneBuilder {
 public:
  SceneBuilder(FileSystem& fs, const std::string& path, const SceneBuildOptions& options)
      : fs_(fs), path_(path), options_(options), sources_(fs) {}

  /// Whether what was built is of one source; also where reading it failed for no other reason than that.
  Status check_source() const { return sources_.check_unchanged(!options_.consume); }

  /// What was taken from the source so far, which no error gives back.
  uint64_t consumed_bytes() const { return consumer_ ? consumer_->released_bytes() : 0; }

  Result<SceneBuildReport> run(const std::string& output) {
    const auto start = std::chrono::steady_clock::now();
    give_back_when_freed();
    scratch_folder_ = options_.scratch_folder;
    if (scratch_folder_.empty()) scratch_folder_ = std::filesystem::path(output).parent_path().string();
    if (scratch_folder_.empty()) scratch_folder_.push_back('.');
    SHOAL_RETURN_IF_ERROR(read_document());
    SHOAL_RETURN_IF_ERROR(decompress_document());
    gltf::BufferFiles files(fs_, document_);
    if (pose_ && pose_->has_shutter()) {
      SHOAL_ASSIGN_OR_RETURN(motion_, find_motion(files, document_, *pose_, most_motion_rows(cap_bytes())));
      note(motion_.warnings);
    }
    SHOAL_RETURN_IF_ERROR(pose_document(files, document_, pose_, report_.warnings));
    SHOAL_RETURN_IF_ERROR(plan(files, true));
    note(flat_.warnings);
    note(geometry_.warnings);
    note(materials_.warnings);
    if (options_.planned) options_.planned(memory_);
    tbb::task_arena planned_threads(static_cast<int>(memory_.threads));
    SHOAL_RETURN_IF_ERROR(planned_threads.execute([&] { return build(files, output); }));
    report_.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return std::move(report_);
  }

 private:
  Status build(gltf::BufferFiles& files, const std::string& output) {
    if (options_.consume) {
      SHOAL_ASSIGN_OR_RETURN(consumer_,
                             SourceConsumer::plan(fs_, document_, geometry_, output, report_.warnings));
    }
    SHOAL_ASSIGN_OR_RETURN(PageFileWriter writer, PageFileWriter::create(fs_, output));
    CoverageTextures coverage(materials_.textures.size());
    SHOAL_RETURN_IF_ERROR(store_textures(files, writer, coverage));
    TreeletPageSink sink(writer, options_.stop);
    SHOAL_RETURN_IF_ERROR(build_objects(coverage, sink));
    SHOAL_RETURN_IF_ERROR(place_objects());
    report_.source_read_bytes += files.read_bytes();
    SHOAL_RETURN_IF_ERROR(write_tables(writer, sink, output));
    SHOAL_RETURN_IF_ERROR(check_source());
    SHOAL_RETURN_IF_ERROR(writer.finish());
    report_.file_bytes = writer.bytes_written();
    report_.consumed_bytes = consumed_bytes();
    progress("writing", 1);
    return {};
  }

  void progress(const char* stage, double fraction) const {
    if (options_.progress) options_.progress({stage, fraction});
  }

  void note(const std::vector<std::string>& warnings) {
    report_.warnings.insert(report_.warnings.end(), warnings.begin(), warnings.end());
  }

  Status read_document() {
    progress("reading", 0);
    SHOAL_RETURN_IF_ERROR(sources_.add_document(path_));
    SHOAL_ASSIGN_OR_RETURN(document_bytes_, document_bytes(fs_, path_));
    SHOAL_RETURN_IF_ERROR(check_document(document_bytes_, cap_bytes(), path_));
    SHOAL_ASSIGN_OR_RETURN(document_, gltf::load_document(fs_, path_, options_.limits));
    if (!options_.variant.empty()) SHOAL_RETURN_IF_ERROR(gltf::select_variant(document_, options_.variant));
    gltf::forget_variants(document_);
    SHOAL_RETURN_IF_ERROR(sources_.add_parts(document_));
    note(document_.warnings);
    SHOAL_ASSIGN_OR_RETURN(pose_, choose_pose(document_, options_.pose));
    SHOAL_RETURN_IF_ERROR(check_instances(count_placed_meshes(document_), document_bytes_, cap_bytes(), path_));
    pose_bytes_ = pose_bytes(document_);
    SHOAL_RETURN_IF_ERROR(check_document(document_bytes_ + pose_bytes_, cap_bytes(), path_));
    progress("reading", 1);
    return {};
  }

  /// What is where, made of what, and how the cap is shared out; before anything of size is read. `readable`: nothing is
  /// compressed, and instances have their places.
  Status plan(gltf::BufferFiles& files, bool readable) {
    SHOAL_ASSIGN_OR_RETURN(flat_, flatten_nodes(document_, options_.limits));
    if (readable) SHOAL_RETURN_IF_ERROR(place_instancings(files, document_, flat_));
    for (PlacedItem& item : flat_.meshes) item.moves = motion_.meshes.contains(item.node);
    SHOAL_ASSIGN_OR_RETURN(geometry_, plan_geometry(readable ? &files : nullptr, document_, flat_));
    SHOAL_ASSIGN_OR_RETURN(materials_, plan_materials(document_, geometry_.uses));
    return plan_memory(files);
  }

  /// Decodes what the document holds compressed, once a plan says that there is memory for it and for what follows.
  Status decompress_document() {
    const gltf::CompressionNeeds needs = gltf::compression_needs(document_, animation());
    if (needs.memory_bytes == 0) return {};
    decompress_bytes_ = needs.memory_bytes;
    gltf::BufferFiles files(fs_, document_);
    SHOAL_RETURN_IF_ERROR(plan(files, false));
    progress("decompressing", 0);
    SHOAL_RETURN_IF_ERROR(gltf::decompress(fs_, scratch_folder_, options_.stop, document_, animation()));
    give_back_freed_memory();
    progress("decompressing", 1);
    return {};
  }

  std::optional<uint32_t> animation() const {
    return pose_ ? std::optional(pose_->animation) : std::nullopt;
  }

  uint64_t cap_bytes() const {
    return options_.max_memory_bytes > 0 ? options_.max_memory_bytes : default_cap_bytes();
  }

  /// Shares the cap out.
  Status plan_memory(gltf::BufferFiles& files) {
    BuildMemoryNeeds needs;
    SHOAL_ASSIGN_OR_RETURN(const ImageNeeds images, measure_images(fs_, files, document_, materials_.textures, options_.limits.image_pixels));
    needs.image_bytes = images.largest_bytes;
    needs.coverage_bytes = images.coverage_bytes;
    needs.document_bytes = document_bytes_;
    needs.decompress_bytes = decompress_bytes_;
    needs.pose_bytes = pose_bytes_;
    needs.pose_windows = most_pose_windows(document_, geometry_);
    for (const ObjectPlan& object : geometry_.objects) {
      needs.objects.push_back(
          {object_triangles(geometry_, object), object_layout(document_, geometry_, object, materials_)});
      const uint64_t emitters = emitting_triangles(object);
      const uint64_t shown = object.baked ? 1 : geometry_.meshes[object.meshes[0]].placements.size();
      needs.instances += shown;
      needs.emitters += emitters * (1 + 2 * shown);
    }
    needs.instances += (motion_.meshes.size() + motion_.cameras.size()) * motion_.key_count;
    needs.treelet_bytes = options_.treelet_bytes;
    needs.positions_on_grid = options_.positions != PositionPrecision::kExact;
    needs.builder = options_.builder;
    needs.threads = static_cast<unsigned>(tbb::this_task_arena::max_concurrency());
    needs.forced_chunk_triangles = options_.chunk_triangles;
    SHOAL_ASSIGN_OR_RETURN(memory_, plan_build_memory(needs, cap_bytes(), path_));
    return {};
  }

  /// At most, before textures are read: a black one makes its material dark.
  uint64_t emitting_triangles(const ObjectPlan& object) const {
    uint64_t count = 0;
    for (const uint32_t mesh : object.meshes) {
      for (const PrimitiveSource& source : geometry_.meshes[mesh].primitives) {
        const gltf::Primitive& primitive = document_.meshes[source.mesh].primitives[source.primitive];
        const float* emissive = materials_.materials[materials_.material_of(primitive)].emissive;
        if (emissive[0] > 0 || emissive[1] > 0 || emissive[2] > 0) count += source.triangle_count;
      }
    }
    return count;
  }

  Status store_textures(gltf::BufferFiles& files, PageFileWriter& writer, CoverageTextures& coverage) {
    gltf::Limits limits = options_.limits;
    limits.image_pixels = std::min(limits.image_pixels, memory_.image_bytes() / kImageScratchBytesPerPixel);
    SHOAL_ASSIGN_OR_RETURN(textures_,
                           tile_textures(fs_, files, document_, materials_.textures, limits, writer, coverage,
                                         [this](double fraction) { progress("textures", fraction); }));
    finish_materials(materials_, textures_.facts, geometry_.uses);
    coverage.set_materials(materials_.materials, textures_.textures, materials_.transforms);
    report_.source_read_bytes += textures_.source_bytes;
    return {};
  }

  Status build_objects(const CoverageTextures& coverage, TreeletSink& sink) {
    for (const ObjectPlan& object : geometry_.objects) total_triangles_ += object_triangles(geometry_, object);
    const StreamInput stream{fs_, document_, flat_, geometry_, materials_, options_.stop, memory_.lanes};
    const ObjectBuildInput input{
        fs_, path_, scratch_folder_, options_.stop, {options_.treelet_bytes, memory_.pages_in_flight, options_.builder},
        options_.positions, memory_, coverage, materials_.materials, sink,
        [this](const char* stage, uint64_t triangles) { count_progress(stage, triangles); },
        [this](const PrimitiveSource& source) { return consumer_ ? consumer_->source_done(source) : Status(); }};
    for (const ObjectPlan& object : geometry_.objects) SHOAL_RETURN_IF_ERROR(build(object, stream, input));
    return {};
  }

  Status build(const ObjectPlan& object, const StreamInput& stream, const ObjectBuildInput& input) {
    for (const uint32_t mesh : object.meshes) {
      for (const PrimitiveSource& source : geometry_.meshes[mesh].primitives) {
        note_missing_uv_sets(document_, materials_, source, report_.warnings);
      }
    }
    const uint64_t triangles = object_triangles(geometry_, object);
    ObjectSource source(stream, object, object_layout(document_, geometry_, object, materials_));
    const MaterialLookup lookup(document_, geometry_, materials_, object);
    const bool fits = triangles <= memory_.chunk_triangles(source.layout());
    SHOAL_ASSIGN_OR_RETURN(ObjectBuildOutput built, fits ? build_at_once(source, triangles, input)
                                                         : build_in_chunks(source, triangles, lookup, input));
    report_.source_read_bytes += source.read_bytes();
    report_.triangles_count += built.object.triangles_count;
    report_.degenerate_count += built.degenerate_count + built.object.degenerate_count;
    report_.zero_area_count += built.zero_area_count;
    report_.sah_cost += built.object.sah_cost;
    report_.chunks_count += built.chunks_count;
    report_.scratch_written_bytes += built.scratch_written_bytes;
    report_.scratch_read_bytes += built.scratch_read_bytes;
    if (built.grid.far_out) far_out_step_ = std::max(far_out_step_, built.grid.step);
    report_.position_step = std::max(report_.position_step, built.grid.step);
    if (!built.object.nodes.empty()) {
      steps_.push_back(built.grid.step);
      emitters_of_.push_back(std::move(built.emitters));
      built_.push_back(std::move(built.object));
      built_plans_.push_back(&object);
    }
    give_back_freed_memory();
    return {};
  }

  /// Stages go over all triangles of the scene, an object at a time.
  void count_progress(const char* stage, uint64_t triangles) {
    auto done = std::find_if(stages_.begin(), stages_.end(), [&](const auto& s) { return s.first == stage; });
    if (done == stages_.end()) done = stages_.insert(stages_.end(), {stage, 0});
    done->second += triangles;
    progress(stage, static_cast<double>(done->second) / static_cast<double>(total_triangles_));
  }

  Status place(uint32_t object, const PlacedItem& item, const std::string& name) {
    std::optional<PlacedInstance> placed;
    if (item.moves) {
      placed = place_moving_instance(object, built_[object].bounds, motion_.meshes.at(item.node));
      if (!placed) {
        report_.warnings.push_back(fmt::format("an instance of {} is not blurred: it vanishes on its way", name));
      }
    }
    if (!placed) placed = place_instance(object, built_[object].bounds, item.to_world);
    if (!placed) {
      report_.warnings.push_back(fmt::format("an instance of {} is left out: its matrix has no inverse", name));
      return {};
    }
    Instance shown = placed->instance;
    if (!placed->keys.empty()) shown.identity = 1;  // lights that move are stored as their object has them
    SHOAL_RETURN_IF_ERROR(
        append_emitters(emitters_of_[object], shown, static_cast<uint32_t>(placed_.size()), emitters_));
    report_.instanced_triangles_count += built_[object].triangles_count;
    const auto note_shift = [&](const Instance& there) {
      report_.position_error =
          std::max(report_.position_error, farthest_shift(steps_[object], there.object_to_world));
    };
    note_shift(placed->instance);
    for (const Instance& key : placed->keys) note_shift(key);  // between two keys no point is moved by more
    placed_.push_back(*placed);
    return {};
  }

  Status place_objects() {
    for (uint32_t i = 0; i < built_.size(); ++i) {
      const ObjectPlan& object = *built_plans_[i];
      if (object.baked) {
        SHOAL_RETURN_IF_ERROR(place(i, PlacedItem{}, "the world object"));
        continue;
      }
      const uint32_t mesh = object.meshes[0];
      for (const uint32_t p : geometry_.meshes[mesh].placements) {
        SHOAL_RETURN_IF_ERROR(place(i, flat_.meshes[p], fmt::format("meshes[{}]", mesh)));
      }
    }
    if (placed_.empty()) {
      return Error{ErrorCode::kInput,
                   fmt::format("{}: expected triangles to draw, found none in the scene", path_)};
    }
    if (far_out_step_ > 0) {
      report_.warnings.push_back(fmt::format("positions are rounded to steps of up to {:g}, coarser than {} bits: so far "
                                             "from the origin floats are hardly finer",
                                             far_out_step_, position_precision_name(options_.positions)));
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
    header.content_hash = source_hash(sources_, false);
    header.bvh_builder = static_cast<uint32_t>(options_.builder);
    header.position_bits = static_cast<uint32_t>(options_.positions);
    header.position_step = report_.position_step;
    header.position_error = report_.position_error;
    sink.fill(header);
    Bounds3 bounds;
    for (const PlacedInstance& placed : placed_) bounds.include(placed.bounds);
    for (int i = 0; i < 3; ++i) header.bounds_lo[i] = bounds.lo[i], header.bounds_hi[i] = bounds.hi[i];
    return header;
  }

  Status write_tables(PageFileWriter& writer, const TreeletPageSink& sink, const std::string& output) {
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
    const std::string record = build_record_json(document_, header, report_, pose_, options_.variant);
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
    std::vector<CameraRecord> cameras = convert_cameras(document_, flat_);
    const std::vector<Affine3> camera_keys = add_camera_keys(motion_, flat_, cameras);
    SHOAL_RETURN_IF_ERROR(append_rows(writer, tables::kCameras, cameras));
    const std::string sources = sources_.table(output);
    SHOAL_RETURN_IF_ERROR(writer.append_table(tables::kNames, std::as_bytes(std::span(names))));
    SHOAL_RETURN_IF_ERROR(writer.append_table(tables::kSourceFiles, std::as_bytes(std::span(sources))));
    SHOAL_RETURN_IF_ERROR(append_rows(writer, tables::kMaterialLayers, materials_.layers));
    SHOAL_RETURN_IF_ERROR(append_rows(writer, tables::kTextureTransforms, materials_.transforms));
    SHOAL_RETURN_IF_ERROR(append_rows(writer, tables::kCameraKeys, camera_keys));
    return append_rows(writer, tables::kBakedMeshes, baked_meshes());
  }

  /// The first primitive of each mesh of the world object; none where nothing is left of it.
  std::vector<uint32_t> baked_meshes() const {
    std::vector<uint32_t> first;
    if (built_plans_.empty() || !built_plans_[0]->baked) return first;
    for (const uint32_t mesh : built_plans_[0]->meshes) {
      first.push_back(geometry_.meshes[mesh].primitives.front().first_id);
    }
    return first;
  }

  FileSystem& fs_;
  const std::string& path_;
  const SceneBuildOptions& options_;
  SceneBuildReport report_;
  SourceFiles sources_;
  gltf::Document document_;
  FlatScene flat_;
  GeometryPlan geometry_;
  MaterialPlan materials_;
  TiledTextures textures_;
  std::vector<BuiltObject> built_;                 // without those that have no triangle left
  std::vector<const ObjectPlan*> built_plans_;     // parallel to built_
  std::vector<std::vector<Emitter>> emitters_of_;  // likewise, object space
  std::vector<float> steps_;                       // likewise, PositionGrid::step
  float far_out_step_ = 0;
  std::vector<PlacedInstance> placed_;
  std::vector<Emitter> emitters_;
  std::optional<ChosenPose> pose_;
  MotionKeys motion_;
  BuildMemoryPlan memory_;
  std::optional<SourceConsumer> consumer_;
  std::string scratch_folder_;
  uint64_t document_bytes_ = 0, pose_bytes_ = 0, decompress_bytes_ = 0, total_triangles_ = 0;
  std::vector<std::pair<std::string, uint64_t>> stages_;  // triangles done
};

/// What else there is to say of an error: a source that changes under the build looks damaged or cut short.
Error explain(const SceneBuilder& builder, Error error) {
  if (error.code == ErrorCode::kInput || error.code == ErrorCode::kStorage) {
    const Status source = builder.check_source();
    if (!source.ok() && source.error().code == ErrorCode::kInput) {
      error = {ErrorCode::kInput, fmt::format("{} ({})", source.error().message, error.message)};
    }
  }
  if (builder.consumed_bytes() > 0) error.message += "; the source was consumed in part and is no longer whole";
  return error;
}

}  // namespace

Result<SceneBuildReport> build_scene(FileSystem& fs, const std::string& gltf_path, const std::string& output,
                                     const SceneBuildOptions& options) {
  const auto run = [&]() -> Result<SceneBuildReport> {
    SceneBuilder builder(fs, gltf_path, options);
    try {
      auto result = builder.run(output);
      return result.ok() ? std::move(result) : explain(builder, result.error());
    } catch (const std::bad_alloc&) {
      return explain(builder, {ErrorCode::kMemoryCap, fmt::format("{}: the build ran out of memory", gltf_path)});
    } catch (const std::system_error& error) {  // no more threads
      return explain(builder, {ErrorCode::kMemoryCap, fmt::format("{}: {}", gltf_path, error.what())});
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
