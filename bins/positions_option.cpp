#include "bins/positions_option.h"

#include <fmt/format.h>

namespace shoal {

void declare_positions(CLI::App& app, std::optional<PositionPrecision>& positions) {
  app.add_option_function<std::string>(
         "--positions",
         [&positions](const std::string& name) {
           const auto precision = parse_position_precision(name);
           if (!precision.ok()) throw CLI::ValidationError("--positions", precision.error().message);
           positions = precision.value();
         },
         "exact, 21, 16: bits of a position along its object's longest side when a glTF is built; fewer take less memory "
         "and fewer reads (default exact; `shoal info` prints by how much points moved)")
      ->type_name("BITS");
}

Status check_positions(const Scene& scene, std::optional<PositionPrecision> asked) {
  const auto built = static_cast<PositionPrecision>(scene.header.position_bits);
  if (!asked || *asked == built) return {};
  return Error{ErrorCode::kUsage, fmt::format("{} was built with --positions {}: leave the option out, or build it again "
                                              "with {}",
                                              scene.file->path(), position_precision_name(built),
                                              position_precision_name(*asked))};
}

}  // namespace shoal
