// shoal info, verify, diff: look inside a file, scrub its checksums, compare two pictures.
#include <fmt/format.h>

#include <memory>

#include "bins/command.h"
#include "engine/describe_scene.h"
#include "engine/image_diff.h"
#include "engine/scene.h"
#include "io/image.h"

namespace shoal {
namespace {

constexpr uint64_t kMaxPixels = 1ull << 28;

struct InspectArguments {
  std::string file, other, json;
  bool as_json = false, cost_maps = false, flip = false;
};

int run_info(const InspectArguments& arguments, Console& console) {
  const auto scene = open_scene(posix_file_system(), arguments.file, ReadMode::kBuffered, {});
  if (!scene.ok()) return console.error(scene.error());
  fmt::print("{}\n", arguments.as_json ? scene_description_json(scene.value())
                                     : scene_description_text(scene.value()));
  return 0;
}

int run_verify(const InspectArguments& arguments, Console& console) {
  const auto scene = open_scene(posix_file_system(), arguments.file, ReadMode::kDirect, {});
  if (!scene.ok()) return console.error(scene.error());
  const Status verified = verify_scene(scene.value());
  if (!verified.ok()) return console.error(verified.error());
  fmt::print("{}: every one of its {} bytes in {} pages is as it was written\n", arguments.file,
             scene.value().file->file_bytes(), scene.value().file->page_count());
  return 0;
}

int run_diff(const InspectArguments& arguments, Console& console) {
  const auto a = read_exr(posix_file_system(), arguments.file, kMaxPixels);
  if (!a.ok()) return console.error(a.error());
  const auto b = read_exr(posix_file_system(), arguments.other, kMaxPixels);
  if (!b.ok()) return console.error(b.error());
  const ImageDiff diff = diff_images(a.value(), b.value(), {arguments.cost_maps, arguments.flip});
  fmt::print("{}\n", arguments.as_json ? diff_json(diff) : diff_text(diff));
  return diff.identical ? 0 : kExitPicturesDiffer;
}

}  // namespace

void declare_info(CLI::App& app, Console& console, Command& command) {
  auto arguments = std::make_shared<InspectArguments>();
  CLI::App* sub = app.add_subcommand("info", "what is in a .shoal file");
  sub->add_option("file", arguments->file, "a .shoal")->required();
  sub->add_flag("--json", arguments->as_json, "as JSON");
  sub->callback([arguments, &console, &command] {
    command = [arguments, &console] { return run_info(*arguments, console); };
  });
}

void declare_verify(CLI::App& app, Console& console, Command& command) {
  auto arguments = std::make_shared<InspectArguments>();
  CLI::App* sub = app.add_subcommand("verify", "check every byte of a .shoal file");
  sub->add_option("file", arguments->file, "a .shoal")->required();
  sub->callback([arguments, &console, &command] {
    command = [arguments, &console] { return run_verify(*arguments, console); };
  });
}

void declare_diff(CLI::App& app, Console& console, Command& command) {
  auto arguments = std::make_shared<InspectArguments>();
  CLI::App* sub = app.add_subcommand("diff", "whether two pictures are identical (exit 0), or by how much not (exit 10)");
  sub->add_option("a", arguments->file, "an .exr")->required();
  sub->add_option("b", arguments->other, "the reference, an .exr")->required();
  sub->add_flag("--json", arguments->as_json, "as JSON");
  sub->add_flag("--cost-maps", arguments->cost_maps, "compare heat maps of cost too");
  sub->add_flag("--flip", arguments->flip, "mean HDR-FLIP too: how different they look, 0 to 1 (docs/accuracy.md)");
  sub->callback([arguments, &console, &command] {
    command = [arguments, &console] { return run_diff(*arguments, console); };
  });
}

}  // namespace shoal
