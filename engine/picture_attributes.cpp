#include "engine/picture_attributes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <nlohmann/json.hpp>

namespace shoal {
namespace {

using Json = nlohmann::json;

}  // namespace

std::string attributes_text(const ExrImage& image) {
  // Numbers as their bits: JSON has no NaN and no infinity.
  Json numbers = Json::object(), matrices = Json::object();
  for (const auto& [name, value] : image.numbers) numbers[name] = std::bit_cast<uint32_t>(value);
  for (const auto& [name, matrix] : image.matrices) {
    for (const float value : matrix) matrices[name].push_back(std::bit_cast<uint32_t>(value));
  }
  return Json{{"text", image.text}, {"numbers", numbers}, {"matrices", matrices}}.dump();
}

Status read_attributes(const std::string& text, ExrImage& image) {
  const Error damaged{ErrorCode::kCorrupt, "a part is damaged: its attributes are not what is written"};
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object()) return damaged;
  try {
    json.at("text").get_to(image.text);
    for (const auto& [name, bits] : json.at("numbers").items()) {
      image.numbers[name] = std::bit_cast<float>(bits.get<uint32_t>());
    }
    for (const auto& [name, words] : json.at("matrices").items()) {
      const auto bits = words.get<std::array<uint32_t, 16>>();
      std::transform(bits.begin(), bits.end(), image.matrices[name].begin(),
                     [](uint32_t word) { return std::bit_cast<float>(word); });
    }
  } catch (const Json::exception&) {
    return damaged;
  }
  return {};
}

}  // namespace shoal
