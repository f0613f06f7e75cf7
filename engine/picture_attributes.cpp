#include "engine/picture_attributes.h"

#include <bit>
#include <nlohmann/json.hpp>

namespace shoal {
namespace {

using Json = nlohmann::json;

/// Fails with: Json::exception.
float float_of(const Json& bits) {
  const auto word = bits.is_number_unsigned() ? bits.get<uint64_t>() : UINT64_MAX;
  if (word > UINT32_MAX) throw Json::other_error::create(501, "no 32 bits", &bits);
  return std::bit_cast<float>(static_cast<uint32_t>(word));
}

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
      image.numbers[name] = float_of(bits);
    }
    for (const auto& [name, words] : json.at("matrices").items()) {
      for (size_t i = 0; i < 16; ++i) image.matrices[name][i] = float_of(words.at(i));
    }
  } catch (const Json::exception&) {
    return damaged;
  }
  return {};
}

}  // namespace shoal
