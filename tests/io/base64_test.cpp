#include "io/base64.h"

#include <gtest/gtest.h>

#include <cstring>

namespace shoal {
namespace {

std::string encoded(const std::string& text) { return encode_base64(std::as_bytes(std::span(text))); }

TEST(Base64, EncodesTheExamplesOfTheStandard) {
  const std::pair<const char*, const char*> examples[] = {{"", ""},         {"f", "Zg=="},         {"fo", "Zm8="},
                                                          {"foo", "Zm9v"},  {"foob", "Zm9vYg=="},  {"fooba", "Zm9vYmE="},
                                                          {"foobar", "Zm9vYmFy"}};
  for (const auto& [text, code] : examples) EXPECT_EQ(encoded(text), code);
}

TEST(Base64, DecodesWhatItEncodes) {
  std::string bytes;
  for (int i = 0; i < 700; ++i) {
    bytes += static_cast<char>(i * 37 % 256);
    const auto decoded = decode_base64(encoded(bytes));
    ASSERT_TRUE(decoded.has_value());
    ASSERT_EQ(decoded->size(), bytes.size());
    ASSERT_EQ(std::memcmp(decoded->data(), bytes.data(), bytes.size()), 0);
  }
}

}  // namespace
}  // namespace shoal
