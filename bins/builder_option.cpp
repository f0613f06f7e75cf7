#include "bins/builder_option.h"

#include <fmt/format.h>

namespace shoal {

Result<BvhBuilder> parse_builder(const std::string& name) {
  if (const auto builder = find_bvh_builder(name)) return *builder;
  return Error{ErrorCode::kUsage, fmt::format("unknown builder '{}': expected sah, lbvh or karras", name)};
}

CLI::Option* declare_builder(CLI::App& app, std::optional<BvhBuilder>& builder) {
  return app
      .add_option_function<std::string>(
          "--builder",
          [&builder](const std::string& name) {
            const auto parsed = parse_builder(name);
            if (!parsed.ok()) throw CLI::ValidationError("--builder", parsed.error().message);
            builder = parsed.value();
          },
          "sah, lbvh, karras: how the trees of a glTF are built: binned SAH, along a Morton curve, or that "
          "restructured "
          "(default sah); pictures are the same, how fast they are made is not")
      ->type_name("NAME");
}

Status check_builder(const Scene& scene, std::optional<BvhBuilder> asked) {
  const auto built = static_cast<BvhBuilder>(scene.header.bvh_builder);
  if (!asked || *asked == built) return {};
  return Error{ErrorCode::kUsage,
               fmt::format("{} was built with --builder {}: leave the option out, or build it again "
                           "with {}",
                           scene.file->path(), bvh_builder_name(built), bvh_builder_name(*asked))};
}

}  // namespace shoal
