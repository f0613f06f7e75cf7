// bench/check_cache_model: the model of the caches against cachegrind. The same rays through a small terrain in
// memory, by the kernels of an order: under `valgrind --tool=cachegrind` with two levels,
// and told to the model of the same two levels. Exit code 1 where the misses of either level differ by more than
// --tolerance, 77 where there is no valgrind. docs/measuring.md "Traffic at each level".
//
//   bench/check_cache_model [--triangles N] [--rays N] [--workload W] [--order depth-first] [--d1 48K:12]
//       [--ll 256K:16] [--scalar] [--tolerance 0.05] [--folder DIR] [--json F]
//
// The program starts itself under valgrind: once with --model-into, which leaves what the model says of a pass, and
// for two numbers of passes with --passes, whose difference is what cachegrind says of one. Both under valgrind, so
// that addresses are alike and kernels are for the same instruction set.
#include <fmt/format.h>
#include <hwy/targets.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "bench/given_scene.h"
#include "bench/ray_workloads.h"
#include "engine/cache_levels.h"
#include "engine/touch_recorder.h"
#include "treelets/scene_traversal.h"

namespace {

using namespace shoal;
using namespace shoal::bench;
namespace fs = std::filesystem;

constexpr int kNoValgrind = 77;
constexpr uint32_t kFewPasses = 1, kManyPasses = 3;

struct Arguments {
  GivenScene scene{.path = "", .triangles = 20'000};
  uint64_t rays = 10'000;
  std::string workload = "scene-random", order = "depth-first", d1 = "48K:12", ll = "256K:16", json;
  std::string folder = fs::temp_directory_path().string();
  double tolerance = 0.05;
  bool scalar = false;
  uint32_t passes = 0;     ///< inside valgrind: so many, and no model
  std::string model_into;  ///< inside valgrind: where the model's figures go
};

/// Of one pass over the rays.
struct Misses {
  double d1 = 0, ll = 0;
};

/// One way of tracing all rays that are given, again and again.
class Passes {
 public:
  virtual ~Passes() = default;
  virtual void run() = 0;
};

/// As engine/render_depth_first sends them, without paths and shading.
class DepthFirstPasses final : public Passes {
 public:
  DepthFirstPasses(const MemoryScene& scene, const RaySet& set, InnerLoop loop, TouchLog* touches)
      : scene_(scene), set_(set), answers_(set.rays.size()), loop_(loop), touches_(touches) {}

  void run() override {
    const auto decide = [&](uint32_t, const GroupRay& member, TreeletId treelet) -> const std::byte* {
      if (treelet == kNoIndex) {
        RayAnswer& answer = answers_[member.ray.path & ~Ray::kAnyHitBit];
        answer = answer_of(member.ray);
        if (touches_ != nullptr) touches_->write(answer, TouchKind::kAnswers);
        return nullptr;
      }
      if (touches_ != nullptr) touches_->read(scene_.pages[treelet], TouchKind::kTopTree);
      return scene_.pages[treelet].data();
    };
    for (uint32_t next = 0;;) {
      for (; next < set_.rays.size() && !group_.full(); ++next) {
        if (touches_ != nullptr) touches_->read(set_.rays[next], TouchKind::kGivenRays);
        group_.add(begin_ray(set_.rays[next], next, set_.any_hit), nullptr);
      }
      if (group_.size() == 0) return;
      group_.address(scene_.top_tree(), touches_);
      group_.send(scene_.top_tree(), decide);
      group_.trace(scene_.top_tree(), counters_, TriangleTest::kWatertight, loop_, touches_);
    }
  }

 private:
  const MemoryScene& scene_;
  const RaySet& set_;
  LargeVector<RayAnswer> answers_;
  InnerLoop loop_;
  TouchLog* touches_;
  RayGroup group_;
  TraceCounters counters_;
};

/// As engine/path_stream does: from their start to their end.
class StreamedPasses final : public Passes, private RayStream {
 public:
  StreamedPasses(const MemoryScene& scene, const RaySet& set, const std::string& order, TouchLog* touches)
      : set_(set),
        answers_(set.rays.size()),
        pages_(scene.pages.size()),
        rays_(kSlots),
        free_(kSlots),
        touches_(touches) {
    for (size_t i = 0; i < pages_.size(); ++i) pages_[i] = scene.pages[i].data();
    for (uint32_t slot = 0; slot < kSlots; ++slot) free_[slot] = slot;
    const TopTree& tree = scene.top_tree();
    constexpr auto kTest = TriangleTest::kWatertight;
    constexpr uint32_t kPacketRays = 64;
    if (order == "packet") traversal_ = make_packet_traversal(tree, pages_.data(), kTest, kPacketRays, touches);
    if (order == "packet-reorder")
      traversal_ = make_reordering_traversal(tree, pages_.data(), kTest, kPacketRays, touches);
    if (order == "stream") traversal_ = make_stream_traversal(tree, pages_.data(), kTest, touches);
    if (!traversal_) tracer_.emplace(tree, pages_.data(), RayGrouping::kAuto);
  }

  void run() override {
    next_ = 0;
    traversal_ ? traversal_->trace(*this, counters_) : tracer_->trace(*this, counters_, touches_);
  }

 private:
  static constexpr uint32_t kSlots = 4096;

  Ray* next() override {
    if (next_ == set_.rays.size() || free_.empty()) return nullptr;
    Ray& ray = rays_[free_.back()];
    if (touches_ != nullptr) {
      touches_->read(set_.rays[next_], TouchKind::kGivenRays);
      touches_->read(free_.back(), TouchKind::kInHand);
      touches_->write(ray, TouchKind::kInHand);
    }
    free_.pop_back();
    ray = begin_ray(set_.rays[next_], next_, set_.any_hit);
    ++next_;
    return &ray;
  }
  void done(Ray& ray, const RayWork&) override {
    RayAnswer& answer = answers_[ray.path & ~Ray::kAnyHitBit];
    answer = answer_of(ray);
    free_.push_back(static_cast<uint32_t>(&ray - rays_.data()));
    if (touches_ == nullptr) return;
    touches_->write(answer, TouchKind::kAnswers);
    touches_->write(free_.back(), TouchKind::kInHand);
  }
  const std::byte* bring(TreeletId) override { return nullptr; }

  const RaySet& set_;
  LargeVector<RayAnswer> answers_;
  std::vector<const std::byte*> pages_;
  std::vector<Ray> rays_;
  std::vector<uint32_t> free_;
  TouchLog* touches_;
  std::unique_ptr<SceneTraversal> traversal_;
  std::optional<SceneTracer> tracer_;
  TraceCounters counters_;
  uint32_t next_ = 0;
};

std::unique_ptr<Passes> make_passes(const std::string& order, const MemoryScene& scene, const RaySet& set,
                                    TouchLog* touches) {
  if (!order.starts_with("depth-first")) return std::make_unique<StreamedPasses>(scene, set, order, touches);
  const InnerLoop loop = order == "depth-first-while-while" ? InnerLoop::kWhileWhile
                         : order == "depth-first-if-if"     ? InnerLoop::kIfIf
                                                            : InnerLoop::kMoreNumerous;
  return std::make_unique<DepthFirstPasses>(scene, set, loop, touches);
}

Result<CacheShape> one_level(const std::string& text) {
  SHOAL_ASSIGN_OR_RETURN(const std::vector<CacheShape> shapes, parse_cache_levels(text));
  return shapes[0];
}

/// What runs under valgrind.
Status trace(const Arguments& arguments) {
  if (arguments.scalar) hwy::DisableTargets(~static_cast<int64_t>(HWY_EMU128 | HWY_SCALAR));
  SHOAL_ASSIGN_OR_RETURN(const MemoryScene scene, load_into_memory(arguments.scene.path));
  SHOAL_ASSIGN_OR_RETURN(const WorldMesh mesh, take_mesh(scene));
  SHOAL_ASSIGN_OR_RETURN(const RaySet set, RayWorkloads(scene, mesh, arguments.rays, 1).make(arguments.workload));
  if (arguments.model_into.empty()) {
    const auto passes = make_passes(arguments.order, scene, set, nullptr);
    for (uint32_t i = 0; i < arguments.passes; ++i) passes->run();
    return {};
  }
  CacheModel::Options options;
  SHOAL_ASSIGN_OR_RETURN(const CacheShape d1, one_level(arguments.d1));
  SHOAL_ASSIGN_OR_RETURN(const CacheShape ll, one_level(arguments.ll));
  options.levels = {d1, ll};
  TouchRecorder recorder(options, false);  // cachegrind knows no prefetches
  const auto passes = make_passes(arguments.order, scene, set, &recorder.log(0));
  std::vector<LevelCounts> before;
  for (uint32_t i = 0; i < kManyPasses; ++i) {
    passes->run();
    if (i + 1 == kFewPasses) before = recorder.levels_so_far();
  }
  const std::vector<LevelCounts> after = recorder.levels_so_far();
  std::ofstream file(arguments.model_into);
  for (size_t i = 0; i < after.size(); ++i) {
    file << static_cast<double>(after[i].misses - before[i].misses) / (kManyPasses - kFewPasses) << "\n";
  }
  file.close();
  if (!file) return Error{ErrorCode::kStorage, arguments.model_into + ": cannot be written"};
  return {};
}

std::string quoted(const std::string& word) { return "'" + word + "'"; }

/// This program again under a tool of valgrind. Fails with: kInternal (it failed).
Status run_under(const std::string& tool, const Arguments& arguments, const std::string& scene,
                 const std::string& more) {
  std::string command = fmt::format(
      "valgrind -q {} {} --scene {} --rays {} --workload {} --order {} --d1 {} --ll {} {} {}", tool,
      quoted(fs::read_symlink("/proc/self/exe").string()), quoted(scene), arguments.rays, arguments.workload,
      arguments.order, arguments.d1, arguments.ll, arguments.scalar ? "--scalar" : "", more);
  const int status = std::system(command.c_str());
  if (status == 0) return {};
  return Error{ErrorCode::kInternal, fmt::format("status {} of {}", status, command)};
}

/// The sum of a run from cachegrind's file: "events: Ir ... D1mr DLmr ..." names the numbers of "summary: ...".
Result<Misses> read_summary(const std::string& path) {
  std::ifstream file(path);
  std::vector<std::string> names;
  Misses misses;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string first, word;
    words >> first;
    if (first == "events:") {
      while (words >> word) names.push_back(word);
    }
    if (first != "summary:") continue;
    for (size_t i = 0; words >> word && i < names.size(); ++i) {
      const double count = std::stod(word);
      if (names[i] == "D1mr" || names[i] == "D1mw") misses.d1 += count;
      if (names[i] == "DLmr" || names[i] == "DLmw") misses.ll += count;
    }
    return misses;
  }
  return Error{ErrorCode::kInternal, path + ": no summary"};
}

Result<Misses> cachegrind_pass(const Arguments& arguments, const std::string& scene, const WorkFolder& folder) {
  SHOAL_ASSIGN_OR_RETURN(const CacheShape d1, one_level(arguments.d1));
  SHOAL_ASSIGN_OR_RETURN(const CacheShape ll, one_level(arguments.ll));
  Misses misses[2];
  const uint32_t passes[2] = {kFewPasses, kManyPasses};
  for (int i = 0; i < 2; ++i) {
    const std::string out = folder / fmt::format("cachegrind.{}", i);
    const std::string tool = fmt::format(
        "--tool=cachegrind --cache-sim=yes --I1=32768,8,64 --D1={},{},64 --LL={},{},64 "
        "--cachegrind-out-file={}",
        d1.bytes, d1.ways, ll.bytes, ll.ways, quoted(out));
    SHOAL_RETURN_IF_ERROR(run_under(tool, arguments, scene, fmt::format("--passes {}", passes[i])));
    SHOAL_ASSIGN_OR_RETURN(misses[i], read_summary(out));
  }
  const double between = kManyPasses - kFewPasses;
  return Misses{(misses[1].d1 - misses[0].d1) / between, (misses[1].ll - misses[0].ll) / between};
}

Result<Misses> model_pass(const Arguments& arguments, const std::string& scene, const WorkFolder& folder) {
  const std::string out = folder / "model";
  SHOAL_RETURN_IF_ERROR(run_under("--tool=none", arguments, scene, "--model-into " + quoted(out)));
  std::ifstream file(out);
  Misses misses;
  if (file >> misses.d1 >> misses.ll) return misses;
  return Error{ErrorCode::kInternal, out + ": no figures"};
}

/// Compares. Fails with: kInternal (they differ by more than the tolerance).
Status check(const Arguments& arguments) {
  const WorkFolder folder(arguments.folder, "check-cache-model");
  folder.make();
  SHOAL_ASSIGN_OR_RETURN(const std::string scene, scene_file(arguments.scene, folder));
  SHOAL_ASSIGN_OR_RETURN(const Misses model, model_pass(arguments, scene, folder));
  SHOAL_ASSIGN_OR_RETURN(const Misses grind, cachegrind_pass(arguments, scene, folder));
  const struct {
    const char* name;
    double model, grind;
    double apart() const { return model / grind - 1; }
  } rows[] = {{"D1", model.d1, grind.d1}, {"LL", model.ll, grind.ll}};
  fmt::print("{} rays of {}, {}, D1 {}, LL {}, {} kernels; misses of one pass\n", arguments.rays,
             arguments.workload, arguments.order, arguments.d1, arguments.ll,
             arguments.scalar ? "scalar" : "vector");
  nlohmann::ordered_json json;
  bool near = true;
  for (const auto& row : rows) {
    fmt::print("{}: model {:.0f}, cachegrind {:.0f}: {:+.2f} %\n", row.name, row.model, row.grind,
               100 * row.apart());
    json[row.name] = {{"model_misses_count", row.model}, {"cachegrind_misses_count", row.grind}};
    near = near && row.grind > 0 && std::abs(row.apart()) <= arguments.tolerance;
  }
  if (!arguments.json.empty()) std::ofstream(arguments.json) << json.dump(1) << "\n";
  if (near) return {};
  return Error{ErrorCode::kInternal, fmt::format("further apart than {} %", 100 * arguments.tolerance)};
}

bool has_valgrind() { return std::system("valgrind --version > /dev/null 2>&1") == 0; }

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app{"The model of the caches against cachegrind", "check_cache_model"};
  app.add_option("--scene", arguments.scene.path, "a .shoal of one instance, or a .gltf (default: a terrain)");
  app.add_option("--triangles", arguments.scene.triangles, "of the terrain")->capture_default_str();
  app.add_option("--rays", arguments.rays, "of a pass")->capture_default_str();
  app.add_option("--workload", arguments.workload, "as of against_embree")->capture_default_str();
  app.add_option("--order", arguments.order, "of one thread, in memory")
      ->check(CLI::IsMember({"depth-first", "depth-first-while-while", "depth-first-if-if", "hybrid", "packet",
                             "packet-reorder", "stream"}))
      ->capture_default_str();
  app.add_option("--d1", arguments.d1, "SIZE:WAYS of the first level")->capture_default_str();
  app.add_option("--ll", arguments.ll, "SIZE:WAYS of the last level")->capture_default_str();
  app.add_option("--tolerance", arguments.tolerance, "share that misses may differ by")->capture_default_str();
  app.add_flag("--scalar", arguments.scalar, "the kernels without vectors");
  app.add_option("--folder", arguments.folder, "for what is generated and built")->capture_default_str();
  app.add_option("--json", arguments.json, "the figures as JSON");
  app.add_option("--passes", arguments.passes, "under valgrind: trace so many passes");
  app.add_option("--model-into", arguments.model_into, "under valgrind: the model's figures");
  CLI11_PARSE(app, argc, argv);
  const bool inside = arguments.passes > 0 || !arguments.model_into.empty();
  if (!inside && !has_valgrind()) {
    fmt::print("no valgrind here: nothing was compared\n");
    return kNoValgrind;
  }
  const Status status = inside ? trace(arguments) : check(arguments);
  if (status.ok()) return 0;
  fmt::print(stderr, "check_cache_model: {}\n", status.error().message);
  return 1;
}
