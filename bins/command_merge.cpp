// shoal merge: a picture of parts that were rendered anywhere.
#include <fmt/format.h>

#include <cmath>
#include <memory>

#include "bins/command.h"
#include "bins/render_options.h"
#include "engine/merge_sums.h"
#include "engine/tonemap.h"

namespace shoal {
namespace {

struct Arguments {
  std::vector<std::string> parts;
  std::string output, png, tonemap = "pbr-neutral";
  float exposure = 0;
};

Status merge(const Arguments& arguments, Console& console) {
  SHOAL_ASSIGN_OR_RETURN(const ToneCurve curve, parse_tone_curve(arguments.tonemap));
  if (!std::isfinite(arguments.exposure)) {
    return Error{ErrorCode::kUsage,
                 fmt::format("an exposure of {} stops: must be a finite number", arguments.exposure)};
  }
  for (const std::string& path : {arguments.output, arguments.png}) {
    if (!path.empty()) SHOAL_RETURN_IF_ERROR(check_output(path));
  }
  SHOAL_ASSIGN_OR_RETURN(const MergedPicture merged, merge_parts(posix_file_system(), arguments.parts));
  const ExrImage& image = merged.image;
  SHOAL_RETURN_IF_ERROR(write_exr(posix_file_system(), arguments.output, image));
  if (!arguments.png.empty()) {
    const std::vector<uint8_t> rgb = tone_map_image(image.channels[0].values, image.channels[1].values,
                                                    image.channels[2].values, {curve, arguments.exposure});
    SHOAL_RETURN_IF_ERROR(write_png(posix_file_system(), arguments.png, image.width, image.height, rgb));
  }
  console.info(fmt::format("{} written: {} parts, {} samples a pixel, rendered in {:.2f} s altogether",
                           arguments.output, arguments.parts.size(), merged.samples, merged.seconds));
  return {};
}

}  // namespace

void declare_merge(CLI::App& app, Console& console, Command& command) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* sub = app.add_subcommand("merge", "parts of a picture (render --sample-range) to the picture");
  sub->add_option("parts", arguments->parts, "all parts, in any order: together every sample once")->required();
  sub->add_option("-o,--output", arguments->output, "the picture, .exr")->required();
  sub->add_option("--png", arguments->png, "the picture as 8-bit sRGB PNG as well");
  sub->add_option("--tonemap", arguments->tonemap, "of --png: pbr-neutral, none")->capture_default_str();
  sub->add_option("--exposure", arguments->exposure, "of --png, in stops")->capture_default_str();
  sub->callback([arguments, &console, &command] {
    command = [arguments, &console] {
      const Status status = merge(*arguments, console);
      return status.ok() ? 0 : console.error(status.error());
    };
  });
}

}  // namespace shoal
