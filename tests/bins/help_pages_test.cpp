// What `shoal help` writes for installing: the manual page, and completions that a shell runs.
#include <regex>
#include <set>

#include "tests/bins/small_scene.h"

namespace shoal::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::string page(const TemporaryFolder& folder, const std::vector<std::string>& options) {
  const ProgramRun run = run_shoal(folder, join({"help"}, options));
  expect_exit(run, 0);
  EXPECT_EQ(run.err, "");
  return run.out;
}

std::set<std::string> matches(const std::string& text, const char* pattern) {
  const std::regex regex(pattern);
  std::set<std::string> found;
  for (std::sregex_iterator at(text.begin(), text.end(), regex), end; at != end; ++at) found.insert((*at)[1]);
  return found;
}

/// As --help lists them.
std::set<std::string> commands(const TemporaryFolder& folder) {
  const ProgramRun help = run_shoal(folder, {"--help"});
  expect_exit(help, 0);
  const auto found = matches(help.out.substr(help.out.find("Subcommands:")), "\\n  ([a-z]+) ");
  EXPECT_GE(found.size(), 9u);
  return found;
}

/// Long names of options, as --help prints them.
std::set<std::string> options_of(const TemporaryFolder& folder, const std::string& command) {
  const ProgramRun help = run_shoal(folder, {command, "--help"});
  expect_exit(help, 0);
  return matches(help.out, "\\n  (?:-[a-z],)?--([a-z0-9-]+)");
}

std::string escaped(std::string name) { return "\\-\\-" + std::regex_replace(name, std::regex("-"), "\\-"); }

bool has_program(const TemporaryFolder& folder, const std::string& name) {
  return run_shell(folder, "command -v " + name).exit_code == 0;
}

TEST(HelpPages, TheManualNamesEveryCommandAndOption) {
  const TemporaryFolder folder;
  const std::string manual = page(folder, {"--man"});
  for (const std::string& command : commands(folder)) {
    const size_t begin = manual.find(".SS \\fBshoal " + command + "\\fR\n");
    ASSERT_NE(begin, std::string::npos) << command;
    const std::string section = manual.substr(begin, manual.find(".S", begin + 3) - begin);
    const std::set<std::string> options = options_of(folder, command);
    EXPECT_GE(options.size(), 4u);
    for (const std::string& option : options)
      EXPECT_THAT(section, HasSubstr("\\fB" + escaped(option) + "\\fR")) << command;
  }
  EXPECT_THAT(manual, HasSubstr("a corrupt .shoal"));
}

TEST(HelpPages, TheManualIsSoundRoff) {
  const TemporaryFolder folder;
  if (!has_program(folder, "groff")) GTEST_SKIP() << "no groff";
  put_file(folder / "shoal.1", page(folder, {"--man"}));
  const ProgramRun run = run_shell(folder, "groff -man -Tascii -ww -P-cbou shoal.1");
  expect_exit(run, 0);
  EXPECT_EQ(run.err, "");
  EXPECT_THAT(run.out, HasSubstr("--max-memory TEXT"));
  EXPECT_THAT(run.out, HasSubstr("--aperture DIAMETER|f/STOP"));
}

/// What bash offers at the end of `words`, the last of which is being typed.
std::vector<std::string> bash_offers(const TemporaryFolder& folder, const std::vector<std::string>& words) {
  std::string line;
  for (const std::string& word : words) line += " '" + word + "'";
  put_file(folder / "complete.sh", page(folder, {"--completion", "bash"}));
  put_file(folder / "ask.sh", "set -u\nsource ./complete.sh\nCOMP_WORDS=(" + line +
                                  " )\nCOMP_CWORD=" + std::to_string(words.size() - 1) +
                                  "\n_shoal\n[ ${#COMPREPLY[@]} -eq 0 ] || printf '%s\\n' \"${COMPREPLY[@]}\"\n");
  const ProgramRun run = run_shell(folder, "bash ask.sh");
  expect_exit(run, 0);
  EXPECT_EQ(run.err, "");
  std::vector<std::string> offers;
  for (size_t at = 0; at < run.out.size(); at = run.out.find('\n', at) + 1) {
    offers.push_back(run.out.substr(at, run.out.find('\n', at) - at));
  }
  return offers;
}

TEST(HelpPages, BashCompletesCommandsOptionsAndChoices) {
  const TemporaryFolder folder;
  put_file(folder / "reef one.gltf", "");
  EXPECT_THAT(bash_offers(folder, {"shoal", "ren"}), ElementsAre("render"));
  EXPECT_THAT(bash_offers(folder, {"shoal", "render", "a.shoal", "--max-m"}), ElementsAre("--max-memory"));
  EXPECT_THAT(bash_offers(folder, {"shoal", "render", "--order", ""}),
              ElementsAre("auto", "queued", "depth-first", "sorted", "hybrid", "packet", "packet-reorder", "stream",
                          "depth-first-while-while", "depth-first-if-if"));
  EXPECT_THAT(bash_offers(folder, {"shoal", "render", "--order", "=", "qu"}), ElementsAre("queued"));
  EXPECT_THAT(bash_offers(folder, {"shoal", "render", "--order", "="}).size(), 10u);
  EXPECT_THAT(bash_offers(folder, {"shoal", "render", "--policy", "res"}), ElementsAre("resident-first"));
  EXPECT_THAT(bash_offers(folder, {"shoal", "batch", "scenes", "--sampl"}), ElementsAre("--sampler"));
  EXPECT_THAT(bash_offers(folder, {"shoal", "render", "re"}), ElementsAre("reef one.gltf"));
  EXPECT_THAT(bash_offers(folder, {"shoal", "render", "--quiet", "re"}), ElementsAre("reef one.gltf"));
  EXPECT_THAT(bash_offers(folder, {"shoal", "render", "-o", "re"}), ElementsAre("reef one.gltf"));
  EXPECT_THAT(bash_offers(folder, {"shoal", "render", "--spp", ""}), IsEmpty());
}

TEST(HelpPages, BashKnowsEveryOption) {
  const TemporaryFolder folder;
  for (const std::string& command : commands(folder)) {
    const auto offers = bash_offers(folder, {"shoal", command, "--"});
    std::set<std::string> names;
    for (const std::string& offer : offers) names.insert(offer.substr(2));
    EXPECT_EQ(names, options_of(folder, command)) << command;
  }
}

TEST(HelpPages, ZshReadsItsCompletion) {
  const TemporaryFolder folder;
  const std::string script = page(folder, {"--completion", "zsh"});
  EXPECT_THAT(script, ::testing::StartsWith("#compdef shoal\n"));
  for (const std::string& command : commands(folder)) {
    EXPECT_THAT(script, HasSubstr("\n        " + command + ")\n"));
    for (const std::string& option : options_of(folder, command)) EXPECT_THAT(script, HasSubstr("--" + option));
  }
  if (!has_program(folder, "zsh")) GTEST_SKIP() << "no zsh: the script was not run";
  put_file(folder / "_shoal", script);
  const ProgramRun run = run_shell(folder, "zsh -n _shoal");
  expect_exit(run, 0);
  EXPECT_EQ(run.err, "");
}

TEST(HelpPages, AnotherShellIsRefused) {
  const TemporaryFolder folder;
  expect_error(run_shoal(folder, {"help", "--completion", "fish"}), 2, {"fish", "bash or zsh"});
}

}  // namespace
}  // namespace shoal::testing
