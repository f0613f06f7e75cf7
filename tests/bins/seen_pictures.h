// A scene that moves, and pictures of it by the program, channel by channel. Used by tests/bins.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "io/image.h"
#include "tests/bins/small_scene.h"

namespace shoal::testing {

/// A triangle with a camera before it, and an animation that moves the triangle out of the picture.
inline WrittenScene seen_triangle() {
  WrittenScene scene = one_triangle();
  scene.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 0.6}, {"znear", 0.1}}}}};
  scene.add_node({{"camera", 0}, {"translation", {0.3, 0.3, 3}}});
  const uint32_t input = scene.add_floats(1, {0, 1}), output = scene.add_floats(3, {0, 0, 0, 100, 0, 0});
  scene.json["animations"] = {{{"name", "leave"},
                               {"channels", {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "translation"}}}}}},
                               {"samplers", {{{"input", input}, {"output", output}}}}}};
  return scene;
}

/// A folder with seen_triangle() as scene/scene.gltf, and pictures of that or of other scenes in it.
struct Pictures {
  Pictures() { save(seen_triangle(), folder / "scene"); }

  ProgramRun run(const std::string& name, const std::vector<std::string>& options,
                 const std::string& scene = "scene/scene.gltf") const {
    std::vector<std::string> all = join({"render", folder / scene, "-o", folder / (name + ".exr"), "--width", "48",
                                         "--height", "32", "--cache-dir", folder / "cache", "--quiet"},
                                        options);
    const auto unless_asked = [&](const std::string& option, const std::string& value) {
      if (std::find(all.begin(), all.end(), option) == all.end()) all = join(all, {option, value});
    };
    unless_asked("--spp", "2"), unless_asked("--environment", "constant:1,1,1");
    return run_shoal(folder, all);
  }
  /// Channels by name: A, B, G, R.
  std::vector<float> render(const std::string& name, const std::vector<std::string>& options,
                            const std::string& scene = "scene/scene.gltf") const {
    expect_exit(run(name, options, scene), 0);
    const auto image = read_exr(posix_file_system(), folder / (name + ".exr"), 1 << 20);
    if (!image.ok()) {
      ADD_FAILURE() << image.error().message;
      return {};
    }
    std::vector<float> values;
    for (const ExrChannel& channel : image.value().channels) {
      values.insert(values.end(), channel.values.begin(), channel.values.end());
    }
    return values;
  }

  TemporaryFolder folder;
};

}  // namespace shoal::testing
