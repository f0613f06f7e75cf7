// shoal.json from strangers: it stands in directories of scenes that are handed over as they are.
#include <fmt/format.h>

#include <string_view>

#include "engine/batch_options.h"
#include "engine/batch_text.h"
#include "tests/fuzz/fuzz_target.h"

namespace shoal::fuzz {
namespace {

RenderOptionRules some_rules() {
  RenderOptionRules rules;
  rules.takes_value = {{"spp", true}, {"environment", true}, {"camera", true}, {"quiet", false}};
  rules.check = [](const std::string& name, const std::string& value) -> Status {
    if (name != "spp" || value.find_first_not_of("0123456789") == std::string::npos) return {};
    return Error{ErrorCode::kUsage, fmt::format("--{}: expected a number, found {}", name, value)};
  };
  return rules;
}

/// What goes to a command line comes back from it, and names are told from each other.
void pass_on(const RenderOptions& options, const RenderOptionRules& rules) {
  const auto again = parse_option_words(option_words(options, rules), rules);
  require(again.ok());
  RenderOptions asked = options;  // a flag that is off is not said
  std::erase_if(
      asked, [&](const auto& option) { return !rules.takes_value.at(option.first) && option.second == "false"; });
  require(again.value() == asked);
  RenderOptions resolved = options;
  resolve_option_paths(resolved, "/scenes");
  (void)environment_file(resolved);
  require(shell_line(option_words(options, rules)).find('\n') == std::string::npos);
}

}  // namespace
}  // namespace shoal::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace shoal;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  fuzz::require(unescape_name(escape_name(text)) == text);
  fuzz::require(html_escape(text).find('<') == std::string::npos);
  const RenderOptionRules rules = fuzz::some_rules();
  const auto options = parse_folder_options(text, "scenes/shoal.json", rules);
  if (!options.ok()) {
    fuzz::require(options.error().code == ErrorCode::kInput &&
                  options.error().message.starts_with("scenes/shoal.json"));
    return 0;
  }
  fuzz::pass_on(options.value().defaults, rules);
  for (const auto& [name, scene] : options.value().scenes) {
    fuzz::pass_on(merge_options(options.value().defaults, scene), rules);
  }
  return 0;
}
