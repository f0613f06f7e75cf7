// Names of any bytes as text, patterns over them, and the names of outputs.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <memory>
#include <random>
#include <set>

#include "engine/batch_plan.h"
#include "engine/batch_text.h"
#include "engine/glob.h"

namespace shoal::testing {
namespace {

std::string random_name(std::mt19937& random, size_t bytes) {
  std::string name;
  for (size_t i = 0; i < bytes; ++i) name += static_cast<char>(random() % 255 + 1);
  return name;
}

bool is_utf8_line(const std::string& text) {
  // escape_name() leaves what is UTF-8 and no control character alone: a second time only '%' may change.
  std::string plain = text;
  std::erase(plain, '%');
  return escape_name(plain) == plain;
}

TEST(BatchText, EveryNameComesBackFromItsEscapedForm) {
  std::mt19937 random(7);
  for (int n = 0; n < 2000; ++n) {
    const std::string name = random_name(random, random() % 24);
    const std::string text = escape_name(name);
    EXPECT_EQ(unescape_name(text), name);
    EXPECT_TRUE(is_utf8_line(text)) << text;
  }
}

TEST(BatchText, OnlyWhatMustBeIsEscaped) {
  EXPECT_EQ(escape_name("a b/ä.gltf"), "a b/ä.gltf");
  EXPECT_EQ(escape_name("50%\n\xff"), "50%25%0A%FF");
  EXPECT_EQ(escape_name("\xed\xa0\x80"), "%ED%A0%80") << "a surrogate";
  EXPECT_EQ(escape_name("\xc0\xaf"), "%C0%AF") << "longer than it must be";
  EXPECT_EQ(escape_name("\xe2\x82"), "%E2%82") << "cut";
  EXPECT_EQ(unescape_name("100%"), "100%");
  EXPECT_EQ(unescape_name("%zz%4"), "%zz%4");
}

std::string shell_output(const std::string& command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(::popen(command.c_str(), "r"), ::pclose);
  std::string out;
  std::array<char, 4096> block;
  for (size_t n = 0; (n = std::fread(block.data(), 1, block.size(), pipe.get())) > 0;) out.append(block.data(), n);
  return out;
}

TEST(BatchText, AShellReadsQuotedWordsAsTheyWere) {
  std::mt19937 random(3);
  std::vector<std::string> words = {"plain", "two words", "it's", "$HOME `id` \\ \"", "a\nb", "-n", "*", "", "%s", "\\n\n'x"};
  for (int n = 0; n < 40; ++n) words.push_back(random_name(random, 12) + ".gltf");
  const std::string line = "printf '%s|' " + shell_line(words);
  EXPECT_EQ(line.find('\n'), std::string::npos);
  std::string expected;
  for (const std::string& word : words) expected += word + "|";
  EXPECT_EQ(shell_output(line), expected);
}

TEST(BatchText, HtmlHoldsNoMarkupOfNames) {
  EXPECT_EQ(html_escape("<b a='1' c=\"2\">&"), "&lt;b a=&#39;1&#39; c=&quot;2&quot;&gt;&amp;");
  EXPECT_EQ(html_address("javascript:x/a b#c?.png"), "./javascript%3Ax/a%20b%23c%3F.png");
}

TEST(Glob, TokensMeanWhatTheyShould) {
  const auto expect = [](const char* pattern, const char* text, bool matches) {
    EXPECT_EQ(pattern_matches(pattern, text), matches) << pattern << " on " << text;
  };
  expect("*.gltf", "a.gltf", true), expect("*.gltf", "a/b.gltf", false), expect("*.gltf", "a.glb", false);
  expect("**.gltf", "a/b.gltf", true), expect("**/b", "b", true), expect("**/b", "x/y/b", true);
  expect("**/b", "xb", false), expect("a/**/b", "a/b", true), expect("a/**/b", "a/x/y/b", true);
  expect("a/**/b", "ab", false), expect("?", "x", true), expect("?", "/", false), expect("?", "", false);
  expect("[a-c]x", "bx", true), expect("[a-c]x", "dx", false), expect("[!a-c]x", "dx", true);
  expect("[!a]", "/", false), expect("[]]", "]", true), expect("\\*", "*", true), expect("\\*", "x", false);
  expect("*a*b*", "xxaxxbxx", true), expect("*a*b*", "xxbxxaxx", false), expect("", "", true);
}

TEST(Glob, StarsWithoutEndTakeNoTimeWithoutEnd) {
  const std::string text(4000, 'a');
  std::string pattern;
  for (int n = 0; n < 40; ++n) pattern += "*a";
  EXPECT_TRUE(pattern_matches(pattern, text));
  EXPECT_FALSE(pattern_matches(pattern + "b", text));
}

TEST(Glob, FoldersStandForAllInThem) {
  EXPECT_TRUE(any_matches({"old"}, "x/old/y/a.gltf"));
  EXPECT_TRUE(any_matches({"x/o*"}, "x/old/y/a.gltf"));
  EXPECT_FALSE(any_matches({"o*/y"}, "x/old/y/a.gltf"));
  EXPECT_FALSE(any_matches({"ol"}, "x/old/a.gltf"));
  EXPECT_TRUE(any_matches({"nothing", "a.*"}, "x/a.gltf"));
  EXPECT_FALSE(any_matches({}, "a"));
}

TEST(Glob, WhatIsNoPatternIsRefused) {
  for (const char* pattern : {"", "[", "[a", "a\\", "[]"}) {
    const Status status = check_pattern(pattern);
    ASSERT_FALSE(status.ok()) << pattern;
    EXPECT_EQ(status.error().code, ErrorCode::kUsage);
  }
  EXPECT_TRUE(check_pattern("[a-]**/\\[").ok());
}

TEST(BatchPlan, OutputsAreDistinctAndAsShortAsTheyCanBe) {
  using Names = std::vector<std::string>;
  EXPECT_EQ(output_names({"a.gltf", "b/a.gltf", "c.d.glb"}), (Names{"a", "b/a", "c.d"}));
  EXPECT_EQ(output_names({"a.glb", "a.gltf", "b.glb"}), (Names{"a.glb", "a.gltf", "b"}));
  // The long name of one is the short name of another.
  EXPECT_EQ(output_names({"a.glb", "a.glb.gltf", "a.gltf"}), (Names{"a.glb", "a.glb.gltf", "a.gltf"}));
  std::mt19937 random(5);
  for (int n = 0; n < 300; ++n) {
    std::set<std::string> scenes;
    for (int k = 0; k < 8; ++k) {
      std::string name = "a";
      for (uint32_t dots = random() % 3 + 1; dots > 0; --dots) {
        name += std::array{".gltf", ".glb", ".shoal"}[random() % 3];
      }
      scenes.insert(name);
    }
    const Names names = output_names({scenes.begin(), scenes.end()});
    EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), scenes.size());
  }
}

TEST(BatchPlan, TheBudgetIsNeverExceededByItsShares) {
  BatchShare left{1000, 4};
  const BatchShare first = next_share(left, 3);
  EXPECT_EQ(first.memory_bytes, 333u);
  EXPECT_EQ(first.threads, 1u);
  left = {left.memory_bytes - first.memory_bytes, left.threads - first.threads};
  const BatchShare second = next_share(left, 2);
  const BatchShare third = next_share({left.memory_bytes - second.memory_bytes, left.threads - second.threads}, 1);
  EXPECT_EQ(first.memory_bytes + second.memory_bytes + third.memory_bytes, 1000u);
  EXPECT_EQ(first.threads + second.threads + third.threads, 4u);
  EXPECT_EQ(next_share({1000, 0}, 1).threads, 1u) << "each has one";
}

}  // namespace
}  // namespace shoal::testing
