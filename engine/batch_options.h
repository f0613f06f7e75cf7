// Options of `shoal render` as a batch passes them on: by name, from the command line and from a shoal.json beside the
// scenes (docs/batch.md), of which every byte may come from a stranger. What options there are and what they take is told
// by bins. Called by engine/batch_plan and bins/command_batch. Thread rule: plain values. Cost: nothing.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "io/result.h"

namespace shoal {

/// Without the dashes; the value as the command line has it, "true" or "false" where there is none.
using RenderOptions = std::map<std::string, std::string>;

struct RenderOptionRules {
  std::map<std::string, bool> takes_value;  ///< of every option that may be passed on
  /// Whether `render` would take the value. Fails with: kUsage. May be empty.
  std::function<Status(const std::string& name, const std::string& value)> check;
};

/// Those of `over` take the place of those of `under`.
RenderOptions merge_options(const RenderOptions& under, const RenderOptions& over);
/// "--name=value": what stands on a command line.
std::vector<std::string> option_words(const RenderOptions& options, const RenderOptionRules& rules);
/// Words of a command line: "--name value", "--name=value", "--flag". Fails with: kUsage.
Result<RenderOptions> parse_option_words(const std::vector<std::string>& words, const RenderOptionRules& rules);
/// Files that options name, made absolute: relative ones begin at `folder`.
void resolve_option_paths(RenderOptions& options, const std::string& folder);
/// The environment picture; empty when there is none.
std::string environment_file(const RenderOptions& options);

/// A shoal.json.
struct FolderOptions {
  RenderOptions defaults;                       ///< of all scenes in the folder
  std::map<std::string, RenderOptions> scenes;  ///< by name of the file
};
inline constexpr const char* kFolderOptionsName = "shoal.json";
inline constexpr uint64_t kMaxFolderOptionsBytes = 4u << 20;

/// `file` is for messages, its folder for relative paths. Fails with: kInput (not JSON, a key that is unknown or there
/// twice, a value of the wrong kind; the message names file and place).
Result<FolderOptions> parse_folder_options(std::string_view text, const std::string& file,
                                           const RenderOptionRules& rules);

}  // namespace shoal
