// Which scenes a batch finds, what options it reads for them, which files it takes for theirs, and what it remembers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <random>

#include "engine/batch_asked.h"
#include "engine/batch_plan.h"
#include "engine/batch_record.h"
#include "engine/batch_sweep.h"
#include "engine/find_scenes.h"
#include "engine/named_files.h"
#include "engine/scene_content.h"
#include "tests/support/memory_file_system.h"
#include "tests/support/temporary_folder.h"

namespace shoal::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
namespace stdfs = std::filesystem;

void put(const std::string& path, const std::string& text = "{}") {
  stdfs::create_directories(stdfs::path(path).parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

std::vector<std::string> chosen(const SceneSearch& search) {
  const auto found = find_scenes(search);
  EXPECT_TRUE(found.ok()) << found.error().message;
  std::vector<std::string> paths;
  for (const FoundScene& scene : found.value().scenes) {
    if (scene.chosen) paths.push_back(scene.path);
  }
  return paths;
}

TEST(FindScenes, EveryFolderAndNoHiddenFileAndNotTheOutput) {
  const TemporaryFolder folder;
  for (const char* name : {"b.gltf", "a/x.GLB", "a/b/c.shoal", "a/readme.txt", ".hidden/y.gltf", "a/.z.gltf", "out/o.gltf",
                           "folder.gltf/in.glb", "two words/line\nbreak.gltf", "\xff.gltf"}) {
    put(folder / name);
  }
  EXPECT_THAT(chosen({folder.path(), {}, {}, folder / "out"}),
              ElementsAre("a/b/c.shoal", "a/x.GLB", "b.gltf", "folder.gltf/in.glb", "two words/line\nbreak.gltf",
                          "\xff.gltf"));
  EXPECT_THAT(chosen({folder.path(), {"a", "*.gltf"}, {"**/b/*", "two*"}, folder / "out"}),
              ElementsAre("a/x.GLB", "b.gltf", "folder.gltf/in.glb", "\xff.gltf"));
}

TEST(FindScenes, LinksInCirclesEndAndRealNamesWin) {
  const TemporaryFolder folder;
  put(folder / "scenes/real/x.gltf");
  put(folder / "elsewhere/y.gltf");
  stdfs::create_directory_symlink(folder / "scenes", folder / "scenes/real/up");
  stdfs::create_directory_symlink(".", folder / "scenes/self");
  stdfs::create_directory_symlink(folder / "scenes/real", folder / "scenes/alias");
  stdfs::create_directory_symlink(folder / "elsewhere", folder / "scenes/other");
  stdfs::create_symlink(folder / "elsewhere/y.gltf", folder / "scenes/file.gltf");
  stdfs::create_symlink(folder / "nowhere.gltf", folder / "scenes/broken.gltf");
  EXPECT_THAT(chosen({folder / "scenes", {}, {}, ""}),
              ElementsAre("broken.gltf", "file.gltf", "other/y.gltf", "real/x.gltf"));
}

TEST(FindScenes, WhatCannotBeReadIsSaid) {
  const TemporaryFolder folder;
  const auto missing = find_scenes({folder / "missing", {}, {}, ""});
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::kInput);
  put(folder / "scenes/closed/x.gltf");
  put(folder / "scenes/y.gltf");
  ASSERT_EQ(::mkfifo((folder / "scenes/pipe.gltf").c_str(), 0600), 0);
  ASSERT_EQ(::chmod((folder / "scenes/closed").c_str(), 0), 0);
  ASSERT_EQ(::chmod(folder.path().c_str(), 0755), 0);
  const uid_t user = ::geteuid();
  constexpr uid_t kNobody = 65534;  // root reads every folder
  ASSERT_EQ(user == 0 ? ::seteuid(kNobody) : 0, 0);
  const auto found = find_scenes({folder / "scenes", {}, {}, ""});
  ASSERT_EQ(user == 0 ? ::seteuid(user) : 0, 0);
  ::chmod((folder / "scenes/closed").c_str(), 0700);
  ASSERT_TRUE(found.ok()) << found.error().message;
  ASSERT_EQ(found.value().scenes.size(), 1u);
  ASSERT_EQ(found.value().unreadable.size(), 1u);
  EXPECT_THAT(found.value().unreadable[0], HasSubstr("closed"));
}

RenderOptionRules some_rules() {
  RenderOptionRules rules;
  rules.takes_value = {{"spp", true}, {"width", true}, {"environment", true}, {"aov", true}, {"flag", false}};
  rules.check = [](const std::string& name, const std::string& value) -> Status {
    if (name == "spp" && value.find_first_not_of("0123456789") != std::string::npos) {
      return Error{ErrorCode::kUsage, "not a number: " + value};
    }
    return {};
  };
  return rules;
}

TEST(FolderOptions, AreReadAsTheyWouldStandOnTheCommandLine) {
  const auto options = parse_folder_options(
      R"({"defaults": {"spp": 4, "environment": "sky.hdr", "flag": true},
          "scenes": {"a.gltf": {"aov": ["albedo", "depth"], "width": "64", "flag": false, "environment": "constant:1,1,1"}}})",
      "/scenes/shoal.json", some_rules());
  ASSERT_TRUE(options.ok()) << options.error().message;
  EXPECT_THAT(option_words(options.value().defaults, some_rules()),
              ElementsAre("--environment=/scenes/sky.hdr", "--flag", "--spp=4"));
  const RenderOptions merged = merge_options(options.value().defaults, options.value().scenes.at("a.gltf"));
  EXPECT_THAT(option_words(merged, some_rules()),
              ElementsAre("--aov=albedo,depth", "--environment=constant:1,1,1", "--spp=4", "--width=64"));
  EXPECT_EQ(environment_file(merged), "");
  EXPECT_EQ(environment_file(options.value().defaults), "/scenes/sky.hdr");
}

TEST(FolderOptions, EveryMistakeIsNamedWithItsPlace) {
  const auto refused = [](const std::string& text, const std::string& part) {
    const auto options = parse_folder_options(text, "d/shoal.json", some_rules());
    ASSERT_FALSE(options.ok()) << text;
    EXPECT_EQ(options.error().code, ErrorCode::kInput);
    EXPECT_THAT(options.error().message, ::testing::StartsWith("d/shoal.json: ")) << text;
    EXPECT_THAT(options.error().message, HasSubstr(part)) << text;
    EXPECT_LT(options.error().message.size(), 600u);
    EXPECT_EQ(options.error().message.find('\n'), std::string::npos);
  };
  refused("", "expected JSON"), refused("{", "expected JSON"), refused("[1]", "the document: expected an object");
  refused("{} x", "expected JSON"), refused("\xff", "expected JSON"), refused("{\"a\xff\": 1}", "expected JSON");
  refused(R"({"default": {}})", "unknown key \"default\"");
  refused(R"({"defaults": {"sp": 4}})", "defaults: unknown key \"sp\"");
  refused(R"({"defaults": {"width": 4, "spp": 1, "width": 5}})", "\"width\" is there twice");
  refused(R"({"defaults": []})", "defaults: expected an object");
  refused(R"({"scenes": 5})", "scenes: expected an object, found 5");
  refused(R"({"scenes": {"a.gltf": 5}})", "scenes[\"a.gltf\"]: expected an object");
  refused(R"({"scenes": {"a.gltf": {"spp": null}}})", "scenes[\"a.gltf\"][\"spp\"]: expected a number or a string");
  refused(R"({"scenes": {"a.gltf": {"spp": "many"}}})", "scenes[\"a.gltf\"][\"spp\"]: not a number: many");
  refused(R"({"defaults": {"spp": {}}})", "expected a number or a string");
  refused(R"({"defaults": {"aov": ["albedo", []]}})", "[1]: expected a number or a string");
  refused(R"({"defaults": {"flag": 1}})", "expected true or false");
  refused(R"({"defaults": {"width": true}})", "expected a number or a string");
  refused(R"({"defaults": {"environment": "a\u0000b"}})", "expected a number or a string");
  refused("{\"defaults\": {\"" + std::string(5000, 'x') + "\\n\": 1}}", "unknown key");
  refused("{\"defaults\": " + std::string(100000, '[') + std::string(100000, ']') + "}", "nested at most");
}

TEST(FolderOptions, BytesOfStrangersNeverDoHarm) {
  const std::string good = R"({"defaults": {"spp": 4, "aov": ["x", 2]}, "scenes": {"a.gltf": {"flag": true}}})";
  std::mt19937 random(11);
  for (int n = 0; n < 3000; ++n) {
    std::string text = good;
    for (uint32_t edits = random() % 4 + 1; edits > 0; --edits) {
      const size_t at = random() % text.size();
      if (random() % 2 == 0) text[at] = static_cast<char>(random());
      else text.insert(at, 1, "{}[],:\"\\0"[random() % 9]);
    }
    const auto options = parse_folder_options(text, "shoal.json", some_rules());
    EXPECT_TRUE(options.ok() || options.error().code == ErrorCode::kInput) << text;
  }
}

TEST(OptionWords, BehindDashesAreReadAsRenderWould) {
  const auto options = parse_option_words({"--spp", "3", "--flag", "--environment=x=y"}, some_rules());
  ASSERT_TRUE(options.ok()) << options.error().message;
  EXPECT_EQ(options.value(), (RenderOptions{{"spp", "3"}, {"flag", "true"}, {"environment", "x=y"}}));
  for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
           {"spp"}, {"--spp"}, {"--nope", "1"}, {"-o", "x"}, {"--spp=x"}, {"--flag=3"}, {"--"}, {""}}) {
    const auto refused = parse_option_words(words, some_rules());
    ASSERT_FALSE(refused.ok()) << words[0];
    EXPECT_EQ(refused.error().code, ErrorCode::kUsage);
  }
}

std::vector<std::string> named_in(const std::string& text, size_t piece) {
  NamedFiles names;
  for (size_t at = 0; at < text.size(); at += piece) names.add(std::string_view(text).substr(at, piece));
  return names.uris();
}

TEST(NamedFiles, BuffersAndImagesAreFoundWhateverThePieces) {
  const std::string text = R"({"asset": {"uri": "no", "extras": {"buffers": [{"uri": "no"}]}},
    "images": [{"uri": "a\"b\u00e4\ud83d\ude00.png", "extras": {"uri": "no"}}, {"name": "uri", "bufferView": 1}, {"uri": "data:x"}],
    "nodes": [{"uri": "no", "images": [{"uri": "no"}]}], "uri": "no",
    "buffers": [{"byteLength": 3, "uri": "c\/d.bin", "extensions": {"X": [{"uri": "no"}]}}, {"uri": ["no"]}, ["uri", "no"]]})";
  for (const size_t piece : {1u, 2u, 7u, 5000u}) {
    EXPECT_THAT(named_in(text, piece), ElementsAre("a\"bä😀.png", "c/d.bin")) << piece;
  }
  EXPECT_THAT(named_in("}}]]\"\\u12", 1), IsEmpty());
  EXPECT_THAT(named_in("{\"buffers\":[{\"uri\":\"" + std::string(1 << 20, 'x') + "\"}]}", 4096), IsEmpty());
}

class SceneContentTest : public ::testing::Test {
 protected:
  void SetUp() override {
    put(folder_ / "s/a.gltf", R"({"buffers": [{"uri": "a%20b.bin"}], "images": [{"uri": "../out.png"}, {"uri": "t.png"}]})");
    put(folder_ / "s/a b.bin", "geometry");
    age();
  }
  /// So long ago that times tell.
  void age() {
    for (const auto& entry : stdfs::recursive_directory_iterator(folder_.path())) {
      if (entry.is_regular_file()) stdfs::last_write_time(entry, stdfs::file_time_type::clock::now() - std::chrono::hours(1));
    }
  }
  SceneContent content(const SceneContent* earlier = nullptr) {
    auto content = hash_scene(posix_file_system(), folder_ / "s/a.gltf", {folder_ / "sky.hdr"}, earlier, nullptr);
    EXPECT_TRUE(content.ok()) << content.error().message;
    return std::move(content).value();
  }
  TemporaryFolder folder_;
};

TEST_F(SceneContentTest, ChangesWithEveryFileThatIsNamed) {
  const SceneContent first = content();
  ASSERT_EQ(first.files.size(), 4u) << "scene, buffer, image that is missing, sky that is missing";
  EXPECT_TRUE(first.files[2].missing);
  EXPECT_EQ(content(&first).hash, first.hash);
  EXPECT_FALSE(content(&first).anew);
  std::set<uint64_t> hashes{first.hash};
  for (const char* name : {"s/a b.bin", "s/t.png", "sky.hdr"}) {
    put(folder_ / name, "another ");
    EXPECT_TRUE(hashes.insert(content(&first).hash).second) << name;
    EXPECT_FALSE(looks_unchanged(posix_file_system(), first));
  }
}

TEST_F(SceneContentTest, ATimeThatCouldNotTellIsNotTrusted) {
  put(folder_ / "s/a b.bin", "geometrx");
  const auto time = stdfs::last_write_time(folder_ / "s/a b.bin");
  const SceneContent first = content();
  put(folder_ / "s/a b.bin", "geometry");
  stdfs::last_write_time(folder_ / "s/a b.bin", time);
  EXPECT_NE(content(&first).hash, first.hash) << "the same size and time, but only just written";
  age();
  const SceneContent old = content();
  const auto long_ago = stdfs::last_write_time(folder_ / "s/a b.bin");
  put(folder_ / "s/a b.bin", "geometrz");
  EXPECT_NE(content(&old).hash, old.hash);
  stdfs::last_write_time(folder_ / "s/a b.bin", long_ago);
  EXPECT_EQ(content(&old).hash, old.hash) << "nobody reads what looks as it did an hour after it was written";
}

TEST_F(SceneContentTest, StopsWhenAskedTo) {
  const std::atomic<bool> stop{true};
  const auto stopped = hash_scene(posix_file_system(), folder_ / "s/a.gltf", {}, nullptr, &stop);
  ASSERT_FALSE(stopped.ok());
  EXPECT_EQ(stopped.error().code, ErrorCode::kStopped);
}

SceneRecord full_record() {
  SceneRecord r;
  r.scene = "a\n\xff/b%.gltf", r.output = "a\n\xff/b%", r.key = 0xfedcba9876543210ull, r.state = SceneState::kFailed;
  r.exit_code = 137, r.message = "no \x01 good: 50%", r.options = {"--spp=4", "--environment=/\xfe"};
  r.seconds = 1.5, r.processor_seconds = 2.25, r.max_memory_bytes = 1ull << 40, r.threads = 3, r.alone = true;
  r.process_peak_rss_bytes = 5, r.process_disk_read_bytes = 6, r.process_disk_written_bytes = 7;
  r.ended_unix_seconds = 8, r.output_bytes = {9, 10, 11};
  r.figures = {0.5, 12, 13, 14, 15, 16, 17, 18, "queued", {"textures"}};
  r.content.hash = 19, r.content.looked_ns = 20;
  r.content.files = {{"/\xff", false, 21, 22, ~0ull}, {"gone", true, 0, 0, 0}};
  return r;
}

TEST(BatchRecord, ComesBackAsItWasWritten) {
  MemoryFileSystem fs;
  const SceneRecord r = full_record();
  ASSERT_TRUE(write_record(fs, "r.json", r).ok());
  const auto read = read_record(fs, "r.json");
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->scene, r.scene);
  EXPECT_EQ(read->output, r.output);
  EXPECT_EQ(read->key, r.key);
  EXPECT_EQ(read->state, r.state);
  EXPECT_EQ(read->exit_code, r.exit_code);
  EXPECT_EQ(read->message, r.message);
  EXPECT_EQ(read->options, r.options);
  EXPECT_EQ(read->output_bytes, r.output_bytes);
  EXPECT_EQ(read->figures.effects, r.figures.effects);
  EXPECT_EQ(read->figures.samples, 17u);
  ASSERT_EQ(read->content.files.size(), 2u);
  EXPECT_EQ(read->content.files[0].path, "/\xff");
  EXPECT_EQ(read->content.files[0].hash, ~0ull);
  // Written once more it is the same text: nothing was lost.
  ASSERT_TRUE(write_record(fs, "again.json", *read).ok());
  EXPECT_EQ(fs.contents("again.json"), fs.contents("r.json"));
}

TEST(BatchRecord, OneThatIsDamagedIsNone) {
  MemoryFileSystem fs;
  ASSERT_TRUE(write_record(fs, "r.json", full_record()).ok());
  const std::vector<std::byte> whole = fs.contents("r.json");
  for (size_t bytes = 0; bytes + 2 < whole.size(); bytes += 13) {
    ASSERT_TRUE(write_whole_file(fs, "cut.json", std::span(whole).first(bytes)).ok());
    EXPECT_FALSE(read_record(fs, "cut.json").has_value()) << bytes;
  }
  EXPECT_FALSE(read_record(fs, "missing.json").has_value());
}

TEST(BatchAsked, ComesBackAsItWasWritten) {
  const TemporaryFolder folder;
  BatchOptions options;
  options.folder = "/scenes/\xff\n", options.out = folder.path(), options.include = {"*.glb"}, options.exclude = {"\xfe"};
  options.common = {{"spp", "4"}}, options.forced = {{"environment", "/\xff.hdr"}};
  options.jobs = 3, options.threads = 2, options.max_memory_bytes = 1ull << 33, options.keep_built = true;
  EXPECT_FALSE(read_asked(posix_file_system(), folder.path()).ok());
  stdfs::create_directory(folder / ".batch");
  ASSERT_TRUE(write_asked(posix_file_system(), options).ok());
  const auto read = read_asked(posix_file_system(), folder.path());
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read.value().folder, options.folder);
  EXPECT_EQ(read.value().exclude, options.exclude);
  EXPECT_EQ(read.value().common, options.common);
  EXPECT_EQ(read.value().forced, options.forced);
  EXPECT_EQ(read.value().jobs, 3u);
  EXPECT_EQ(read.value().max_memory_bytes, 1ull << 33);
  put(folder / ".batch/batch.json", "{\"schema_version\": 1}");
  EXPECT_FALSE(read_asked(posix_file_system(), folder.path()).ok());
}

TEST(BatchSweep, InItsOwnFoldersEveryTemporaryGoes) {
  const TemporaryFolder folder;
  for (const char* name : {"a/.x.shoal.tmp-1-0", "a/x.shoal", "b/.y.tmp"}) put(folder / name);
  remove_all_temporaries(folder.path());
  EXPECT_THAT(folder.names("a"), ElementsAre("x.shoal"));
  EXPECT_THAT(folder.names("b"), ElementsAre(".y.tmp"));
}

TEST(BatchSweep, OnlyTemporariesOfTheNamedFilesGo) {
  const TemporaryFolder folder;
  for (const char* name : {"a.exr", ".a.exr.tmp-12-0", ".a.exr.tmp-12-x", ".b.exr.tmp-12-0", ".a.exr.tmp-", "a.exr.tmp-1-2",
                           ".tmp-1-2"}) {
    put(folder / name);
  }
  remove_temporaries({folder / "a.exr", folder / "missing/c.exr"});
  EXPECT_THAT(folder.names(), ElementsAre(".a.exr.tmp-", ".a.exr.tmp-12-x", ".b.exr.tmp-12-0", ".tmp-1-2", "a.exr",
                                          "a.exr.tmp-1-2"));
}

}  // namespace
}  // namespace shoal::testing
