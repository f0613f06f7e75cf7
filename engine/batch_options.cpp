#include "engine/batch_options.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "engine/batch_text.h"
#include "io/gltf_json.h"

namespace shoal {
namespace {

using Json = nlohmann::json;

constexpr const char* kPathOptions[] = {"environment", "scratch"};
constexpr std::string_view kConstantEnvironment = "constant:";
constexpr int kMaxDepth = 8;  ///< scenes, a scene, an array of values: 4

std::string key_place(const std::string& place, const std::string& key) {
  return fmt::format("{}[\"{}\"]", place, gltf::printable(escape_name(key)));
}

/// What a file says, once it is known to be JSON.
class FolderOptionsReader {
 public:
  FolderOptionsReader(const std::string& file, const RenderOptionRules& rules) : file_(file), rules_(rules) {}

  Result<FolderOptions> read(const Json& root) {
    FolderOptions options;
    if (!root.is_object()) return wrong("the document", "an object", root);
    for (const auto& [key, value] : root.items()) {
      if (key == "defaults") {
        SHOAL_ASSIGN_OR_RETURN(options.defaults, read_options("defaults", value));
      } else if (key == "scenes") {
        if (!value.is_object()) return wrong("scenes", "an object", value);
        for (const auto& [name, scene] : value.items()) {
          SHOAL_ASSIGN_OR_RETURN(options.scenes[name], read_options(key_place("scenes", name), scene));
        }
      } else {
        return Error{ErrorCode::kInput, fmt::format("{}: the document: unknown key \"{}\": expected defaults or scenes",
                                                    file_, gltf::printable(escape_name(key)))};
      }
    }
    return options;
  }

 private:
  Error wrong(const std::string& place, const std::string& expected, const Json& found) const {
    const std::string text = found.is_structured() ? found.type_name() : found.dump(-1, ' ', true);
    return {ErrorCode::kInput,
            fmt::format("{}: {}: expected {}, found {}", file_, place, expected, gltf::printable(text))};
  }

  Result<RenderOptions> read_options(const std::string& place, const Json& json) const {
    if (!json.is_object()) return wrong(place, "an object", json);
    RenderOptions options;
    for (const auto& [name, value] : json.items()) {
      const auto rule = rules_.takes_value.find(name);
      if (rule == rules_.takes_value.end()) {
        return Error{ErrorCode::kInput,
                     fmt::format("{}: {}: unknown key \"{}\": expected an option of `shoal render`, without the dashes, "
                                 "that is not the batch's to choose", file_, place, gltf::printable(escape_name(name)))};
      }
      SHOAL_ASSIGN_OR_RETURN(std::string text, read_value(key_place(place, name), value, rule->second));
      if (rule->second && rules_.check) {
        if (const Status status = rules_.check(name, text); !status.ok()) {
          return Error{ErrorCode::kInput,
                       fmt::format("{}: {}: {}", file_, key_place(place, name), gltf::printable(status.error().message))};
        }
      }
      options[name] = std::move(text);
    }
    return options;
  }

  Result<std::string> read_value(const std::string& place, const Json& value, bool takes_value) const {
    if (!takes_value) {
      if (!value.is_boolean()) return wrong(place, "true or false", value);
      return std::string(value.get<bool>() ? "true" : "false");
    }
    if (!value.is_array()) return read_word(place, value);
    std::string list;
    for (size_t i = 0; i < value.size(); ++i) {
      SHOAL_ASSIGN_OR_RETURN(const std::string word, read_word(fmt::format("{}[{}]", place, i), value[i]));
      list += (i == 0 ? "" : ",") + word;
    }
    return list;
  }

  Result<std::string> read_word(const std::string& place, const Json& value) const {
    if (value.is_string()) {
      const auto& text = value.get_ref<const std::string&>();
      if (text.find('\0') == std::string::npos) return text;
    } else if (value.is_number_unsigned()) {
      return std::to_string(value.get<uint64_t>());
    } else if (value.is_number_integer()) {
      return std::to_string(value.get<int64_t>());
    } else if (value.is_number()) {
      return fmt::format("{}", value.get<double>());
    }
    return wrong(place, "a number or a string", value);
  }

  const std::string& file_;
  const RenderOptionRules& rules_;
};

/// Notes what the parser would let pass: a key that is there twice, and nesting that no reader here follows.
struct StrictKeys {
  std::vector<std::set<std::string>> open;
  std::string twice;
  bool deep = false;

  bool operator()(int depth, Json::parse_event_t event, Json& parsed) {
    if (event == Json::parse_event_t::object_start) open.emplace_back();
    if (event == Json::parse_event_t::object_end) open.pop_back();
    deep = deep || depth > kMaxDepth;
    if (event == Json::parse_event_t::key) {
      const auto& key = parsed.get_ref<const std::string&>();
      if (!open.back().insert(key).second && twice.empty()) twice = key;
    }
    return true;
  }
};

}  // namespace

RenderOptions merge_options(const RenderOptions& under, const RenderOptions& over) {
  RenderOptions merged = over;
  merged.insert(under.begin(), under.end());
  return merged;
}

std::vector<std::string> option_words(const RenderOptions& options, const RenderOptionRules& rules) {
  std::vector<std::string> words;
  for (const auto& [name, value] : options) {
    const auto rule = rules.takes_value.find(name);
    const bool takes_value = rule == rules.takes_value.end() || rule->second;
    if (takes_value) {
      words.push_back(fmt::format("--{}={}", name, value));
    } else if (value == "true") {
      words.push_back("--" + name);
    }
  }
  return words;
}

Result<RenderOptions> parse_option_words(const std::vector<std::string>& words, const RenderOptionRules& rules) {
  RenderOptions options;
  for (size_t i = 0; i < words.size(); ++i) {
    const size_t equals = words[i].find('=');
    const std::string name = words[i].starts_with("--") ? words[i].substr(2, equals - 2) : "";
    const auto rule = rules.takes_value.find(name);
    if (name.empty() || rule == rules.takes_value.end()) {
      return Error{ErrorCode::kUsage, fmt::format("'{}' behind -- is not an option of `shoal render` that a batch passes on",
                                                  escape_name(words[i]))};
    }
    std::string value = "true";
    if (equals != std::string::npos) {
      value = words[i].substr(equals + 1);
    } else if (rule->second) {
      if (i + 1 == words.size()) return Error{ErrorCode::kUsage, fmt::format("--{} behind --: expected a value", name)};
      value = words[++i];
    }
    if (!rule->second && value != "true" && value != "false") {
      return Error{ErrorCode::kUsage, fmt::format("--{} behind --: expected no value, found '{}'", name, value)};
    }
    if (rule->second && rules.check) SHOAL_RETURN_IF_ERROR(rules.check(name, value));
    options[name] = value;
  }
  return options;
}

void resolve_option_paths(RenderOptions& options, const std::string& folder) {
  for (const char* name : kPathOptions) {
    const auto at = options.find(name);
    if (at == options.end() || at->second.empty() || at->second.starts_with(kConstantEnvironment)) continue;
    std::error_code error;
    const std::filesystem::path whole = std::filesystem::absolute(std::filesystem::path(folder) / at->second, error);
    if (!error) at->second = whole.lexically_normal().string();
  }
}

std::string environment_file(const RenderOptions& options) {
  const auto at = options.find("environment");
  return at == options.end() || at->second.starts_with(kConstantEnvironment) ? "" : at->second;
}

Result<FolderOptions> parse_folder_options(std::string_view text, const std::string& file,
                                           const RenderOptionRules& rules) {
  StrictKeys keys;
  Json root;
  try {
    root = Json::parse(text.begin(), text.end(), std::ref(keys));
  } catch (const Json::exception& error) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected JSON, found: {}", file, gltf::printable(error.what()))};
  }
  if (keys.deep) return Error{ErrorCode::kInput, fmt::format("{}: expected JSON nested at most {} deep", file, kMaxDepth)};
  if (!keys.twice.empty()) {
    return Error{ErrorCode::kInput,
                 fmt::format("{}: the key \"{}\" is there twice", file, gltf::printable(escape_name(keys.twice)))};
  }
  SHOAL_ASSIGN_OR_RETURN(FolderOptions options, FolderOptionsReader(file, rules).read(root));
  const std::string folder = std::filesystem::path(file).parent_path().string();
  resolve_option_paths(options.defaults, folder);
  for (auto& [name, scene] : options.scenes) resolve_option_paths(scene, folder);
  return options;
}

}  // namespace shoal
