// A render that is stopped and goes on has the bits of one that was not, in whatever orders, with whatever memory
// and threads; and nothing but its own checkpoint is gone on with.
#include "engine/sums_file.h"
#include "tests/engine/stopped_render.h"

namespace shoal::testing {
namespace {

using Checkpoint = StoppedRender;

/// The bytes with other members in the header, and checksums to match.
std::vector<std::byte> forged(std::vector<std::byte> bytes, const std::function<void(SumsHeader&)>& change) {
  SumsHeader header;
  std::memcpy(&header, bytes.data(), sizeof(header));
  change(header);
  ContentHash of_header;
  of_header.add(std::as_bytes(std::span(&header, 1)).first(offsetof(SumsHeader, checksum)));
  header.checksum = of_header.value();
  std::memcpy(bytes.data(), &header, sizeof(header));
  ContentHash of_file;
  of_file.add(std::span(bytes).first(bytes.size() - sizeof(uint64_t)));
  const uint64_t hash = of_file.value();
  std::memcpy(bytes.data() + bytes.size() - sizeof(hash), &hash, sizeof(hash));
  return bytes;
}

TEST_F(Checkpoint, StoppedAnywhereAndResumedInAnyWayThePictureHasTheSameBits) {
  expect_same_however_stopped(whole(), 16);
}

TEST_F(Checkpoint, StoppedAtOnceWhileThreadsTakeTheirFirstSamplesNothingIsLost) {
  const RenderResult expected = whole();
  for (uint32_t round = 0; round < 24; ++round) {
    const RenderVariation& way = kRenderWays[round % 3 == 0 ? round / 3 % std::size(kRenderWays) : 0];
    files_.remove(kCheckpoint).ok();
    for (int stop = 0; stop < 2; ++stop) ASSERT_FALSE(stopped_after(0, way, files_).ok()) << way.name;
    const auto result = resumed(kRenderWays[3]);
    ASSERT_TRUE(result.ok()) << result.error().message;
    expect_same(result.value(), expected, way.name);
  }
}

TEST_F(Checkpoint, SoItIsWithATargetForNoise) {
  picture_.noise = parse_noise_target("20%").value();
  picture_.samples = 48;
  const RenderResult expected = whole();
  EXPECT_GT(expected.samples.passes_count, 2u);
  EXPECT_LT(expected.samples.least, expected.samples.most) << "a picture of equal samples proves little";
  expect_same_however_stopped(expected, 8);
}

TEST_F(Checkpoint, SoItIsWithTilesLeftOut) {
  picture_.width = 128, picture_.height = 64, picture_.tile_sample = 3, picture_.samples = 3;
  expect_same_however_stopped(whole(), 4);
}

TEST_F(Checkpoint, ATimeLimitCountsWhatWentBefore) {
  time_limit_ = 1e6;
  picture_.samples = 6;
  const RenderResult expected = whole();
  EXPECT_EQ(expected.samples.passes_count, 3u) << "1, 3, 2";
  expect_same_however_stopped(expected, 4);
  picture_.samples = 1u << 20;
  files_.remove(kCheckpoint).ok();
  time_limit_ = 0.2;
  for (double seconds = 0.1; !files_.exists(kCheckpoint); seconds *= 0.5)
    (void)stopped_after(seconds, kRenderWays[0], files_);
  const auto result = resumed();
  ASSERT_TRUE(result.ok()) << result.error().message;
  EXPECT_LT(result.value().seconds, 5);
  time_limit_ = 0;
  picture_.samples = result.value().samples.most;
  expect_same(result.value(), whole(), "a time limit");
}

TEST_F(Checkpoint, CheckpointsWrittenWhileItRunsChangeNothingAndCanBeGoneOnWith) {
  const RenderResult expected = whole();
  for (const RenderVariation& way : kRenderWays) {
    const auto result = rendered(files_, way, {.path = kCheckpoint, .every_seconds = 1e-4});
    ASSERT_TRUE(result.ok()) << result.error().message;
    expect_same(result.value(), expected, way.name);
    ASSERT_TRUE(files_.exists(kCheckpoint)) << way.name;
    const auto again = resumed();
    ASSERT_TRUE(again.ok()) << again.error().message;
    expect_same(again.value(), expected, std::string("resumed after ") + way.name);
    EXPECT_GT(again.value().resumed->seconds, 0);
  }
  EXPECT_TRUE(warnings_.empty());
}

TEST_F(Checkpoint, SamplesCanBeRaisedAndNotLowered) {
  make_checkpoint();
  picture_.samples = 3;
  EXPECT_EQ(resumed().error().code, ErrorCode::kUsage);
  picture_.samples = 11;
  const auto more = resumed(kRenderWays[3]);
  ASSERT_TRUE(more.ok()) << more.error().message;
  expect_same(more.value(), whole(), "11 samples, 4 of them asked for first");
}

TEST_F(Checkpoint, SamplesOfBlueNoiseCanBeRaisedToAPowerOfTwo) {
  picture_.shading.sampler = SamplerKind::kBlueNoise;
  picture_.samples = 5;
  make_checkpoint();
  picture_.samples = 9;
  const auto other = resumed();
  ASSERT_FALSE(other.ok());
  EXPECT_EQ(other.error().code, ErrorCode::kUsage);
  EXPECT_NE(other.error().message.find("blue-noise"), std::string::npos) << other.error().message;
  picture_.samples = 8;
  const auto more = resumed();
  ASSERT_TRUE(more.ok()) << more.error().message;
  expect_same(more.value(), whole(), "8 samples of blue noise");
}

TEST_F(Checkpoint, ThatOfAnotherPictureIsRefusedByName) {
  make_checkpoint();
  const PictureOptions asked = picture_;
  const auto refused = [&](const char* name, const std::function<void(PictureOptions&)>& change) {
    picture_ = asked;
    change(picture_);
    const auto result = resumed();
    ASSERT_FALSE(result.ok()) << name;
    EXPECT_EQ(result.error().code, ErrorCode::kInput) << result.error().message;
    EXPECT_NE(result.error().message.find(name), std::string::npos) << result.error().message;
    EXPECT_NE(result.error().message.find(kCheckpoint), std::string::npos) << result.error().message;
  };
  refused("width is 40, not 48", [](PictureOptions& p) { p.width = 48; });
  refused("height", [](PictureOptions& p) { p.height = 8; });
  refused("seed is 0, not 5", [](PictureOptions& p) { p.shading.seed = 5; });
  refused("bounces", [](PictureOptions& p) { p.shading.bounces = 3; });
  refused("clamp-indirect", [](PictureOptions& p) { p.shading.clamp_indirect = 3; });
  refused("sampler", [](PictureOptions& p) { p.shading.sampler = SamplerKind::kIndependent; });
  refused("environment", [](PictureOptions& p) {
    p.shading.environment = {EnvironmentOptions::Kind::kConstant, Vec3(2), {}};
  });
  refused("effects-off", [](PictureOptions& p) { p.shading.effects.off = kEffectTextures; });
  refused("aperture", [](PictureOptions& p) { p.lens.aperture = 0.1f, p.lens.focus_distance = 1; });
  refused("aov", [](PictureOptions& p) { p.aovs = {}; });
  refused("target-noise", [](PictureOptions& p) { p.noise = parse_noise_target("20%").value(); });
  refused("tile-sample", [](PictureOptions& p) { p.tile_sample = 2; });
  refused("samples from 0 on", [](PictureOptions& p) { p.range = {1, 4}; });
  picture_ = asked;
  SceneBuildOptions build;
  build.treelet_bytes = 32u << 10;
  ASSERT_TRUE(build_scene(posix_file_system(), folder_ / "demo/demo.gltf", folder_ / "scene.shoal", build).ok());
  refused("file", [](PictureOptions&) {});
}

TEST_F(Checkpoint, CutShortOrWithAFlippedBitItIsRefused) {
  make_checkpoint();
  const std::vector<std::byte> bytes = files_.contents(kCheckpoint);
  const auto expect_refused = [&](const std::string& what) {
    const auto result = resumed();
    ASSERT_FALSE(result.ok()) << what;
    EXPECT_TRUE(result.error().code == ErrorCode::kCorrupt || result.error().code == ErrorCode::kInput) << what;
    EXPECT_NE(result.error().message.find(kCheckpoint), std::string::npos) << result.error().message;
  };
  std::mt19937 random(11);
  for (uint32_t n = 0; n < 100; ++n) {
    std::vector<std::byte> bad = bytes;
    const size_t at = n < 32 ? n * 8 : random() % bytes.size();
    bad[at] ^= std::byte(1u << random() % 8);
    files_.put(kCheckpoint, bad);
    expect_refused("a bit of byte " + std::to_string(at));
    bad = bytes;
    bad.resize(n < 8 ? n * 40 : n == 8 ? bytes.size() - 1 : random() % bytes.size());
    files_.put(kCheckpoint, bad);
    expect_refused("the first " + std::to_string(bad.size()) + " bytes");
    if (HasFailure()) return;
  }
  files_.put(kCheckpoint, bytes);
  EXPECT_TRUE(resumed().ok());
}

TEST_F(Checkpoint, HostileSizesAreRefusedBeforeTheyAreUsed) {
  make_checkpoint();
  const std::vector<std::byte> bytes = files_.contents(kCheckpoint);
  const std::pair<const char*, std::function<void(SumsHeader&)>> changes[] = {
      {"width", [](SumsHeader& h) { h.width = 0xffffffff; }},
      {"no width", [](SumsHeader& h) { h.width = 0; }},
      {"area", [](SumsHeader& h) { h.width = h.height = 65536; }},
      {"turned", [](SumsHeader& h) { std::swap(h.width, h.height); }},
      {"halves", [](SumsHeader& h) { h.halves = 3; }},
      {"two halves", [](SumsHeader& h) { h.halves = 2, h.adaptive.drawn_count = 0xffffffff; }},
      {"aovs", [](SumsHeader& h) { h.aovs = 0xffffffff; }},
      {"samples", [](SumsHeader& h) { h.samples = 0xffffffff; }},
      {"range",
       [](SumsHeader& h) {
         h.range = {3, 1};
       }},
      {"span",
       [](SumsHeader& h) {
         h.pass.span = {0, 0xffffffff};
       }},
      {"no span",
       [](SumsHeader& h) {
         h.pass.span = {0, 0};
       }},
      {"pixels", [](SumsHeader& h) { h.pass.pixels = 0; }},
      {"text", [](SumsHeader& h) { h.identity_bytes = 0xfffffff0; }},
      {"attributes", [](SumsHeader& h) { h.attributes_bytes = 0xfffffff0; }},
      {"unfinished", [](SumsHeader& h) { h.unfinished_count = ~0ull / 12; }},
      {"more unfinished than begun", [](SumsHeader& h) { h.next_sample = h.unfinished_count - 1; }},
      {"next sample", [](SumsHeader& h) { h.next_sample = ~0ull; }},
      {"levels", [](SumsHeader& h) { h.coarse_levels = 0x80000000; }},
      {"seconds", [](SumsHeader& h) { h.seconds = -1; }},
      {"kind", [](SumsHeader& h) { h.kind = SumsKind(7); }},
      {"part", [](SumsHeader& h) { h.kind = SumsKind::kPart; }},
      {"version", [](SumsHeader& h) { h.version = 2; }},
  };
  for (const auto& [name, change] : changes) {
    files_.put(kCheckpoint, forged(bytes, change));
    const auto result = resumed();
    ASSERT_FALSE(result.ok()) << name;
    EXPECT_TRUE(result.error().code == ErrorCode::kCorrupt || result.error().code == ErrorCode::kInput)
        << name << ": " << result.error().message;
  }
  // Sums and samples that nobody could have rendered.
  SumsHeader header;
  std::memcpy(&header, bytes.data(), sizeof(header));
  const size_t sums = sizeof(header) + header.identity_bytes;
  ASSERT_GT(header.unfinished_count, 0u);
  for (const size_t at :
       {sums + 7, sums + 48, sums + 52, bytes.size() - 20, bytes.size() - 16, bytes.size() - 12}) {
    std::vector<std::byte> bad = bytes;
    for (size_t i = at; i < at + 4 && i + 8 < bad.size(); ++i) bad[i] = std::byte{0x80};
    files_.put(kCheckpoint, forged(bad, [](SumsHeader&) {}));
    const auto result = resumed();
    ASSERT_FALSE(result.ok()) << "byte " << at << " of " << bytes.size();
    EXPECT_EQ(result.error().code, ErrorCode::kCorrupt) << result.error().message;
  }
}

}  // namespace
}  // namespace shoal::testing
