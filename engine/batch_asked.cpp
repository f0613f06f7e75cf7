#include "engine/batch_asked.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "engine/batch_text.h"

namespace shoal {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kSchemaVersion = 1;
constexpr uint64_t kMaxAskedBytes = 16u << 20;

Json texts_json(const std::vector<std::string>& texts) {
  Json json = Json::array();
  for (const std::string& text : texts) json.push_back(escape_name(text));
  return json;
}

std::vector<std::string> texts_of(const Json& json) {
  std::vector<std::string> texts;
  for (const Json& text : json) texts.push_back(unescape_name(text.get<std::string>()));
  return texts;
}

Json options_json(const RenderOptions& options) {
  Json json = Json::object();
  for (const auto& [name, value] : options) json[escape_name(name)] = escape_name(value);
  return json;
}

RenderOptions options_of(const Json& json) {
  RenderOptions options;
  for (const auto& [name, value] : json.items()) options[unescape_name(name)] = unescape_name(value.get<std::string>());
  return options;
}

}  // namespace

Status write_asked(FileSystem& fs, const BatchOptions& options) {
  const Json json = {{"schema_version", kSchemaVersion},
                     {"folder", escape_name(options.folder)},
                     {"include", texts_json(options.include)},
                     {"exclude", texts_json(options.exclude)},
                     {"common", options_json(options.common)},
                     {"forced", options_json(options.forced)},
                     {"max_memory_bytes", options.max_memory_bytes},
                     {"jobs_count", options.jobs},
                     {"threads_count", options.threads},
                     {"keep_built", options.keep_built},
                     {"cache_folder", escape_name(options.cache_folder)}};
  const std::string text = json.dump(1) + "\n";
  return write_whole_file(fs, BatchPaths(options.out).asked(), std::as_bytes(std::span(text)));
}

Result<BatchOptions> read_asked(FileSystem& fs, const std::string& out) {
  const std::string path = BatchPaths(out).asked();
  auto text = read_whole_file(fs, path, kMaxAskedBytes);
  if (!text.ok()) {
    return Error{text.error().code, fmt::format("--resume: no batch is known in {}: {}", escape_name(out),
                                                text.error().message)};
  }
  try {
    const Json json = Json::parse(text.value());
    if (json.at("schema_version") != kSchemaVersion) {
      return Error{ErrorCode::kInput, fmt::format("{}: expected schema version {}", path, kSchemaVersion)};
    }
    BatchOptions options;
    options.out = out;
    options.folder = unescape_name(json.at("folder").get<std::string>());
    options.include = texts_of(json.at("include"));
    options.exclude = texts_of(json.at("exclude"));
    options.common = options_of(json.at("common"));
    options.forced = options_of(json.at("forced"));
    options.max_memory_bytes = json.at("max_memory_bytes").get<uint64_t>();
    options.jobs = json.at("jobs_count").get<unsigned>();
    options.threads = json.at("threads_count").get<unsigned>();
    options.keep_built = json.at("keep_built").get<bool>();
    options.cache_folder = unescape_name(json.at("cache_folder").get<std::string>());
    return options;
  } catch (const Json::exception& error) {
    return Error{ErrorCode::kInput, fmt::format("{}: expected what a batch was asked for, found: {}", path,
                                                escape_name(error.what()))};
  }
}

}  // namespace shoal
