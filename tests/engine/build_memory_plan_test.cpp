#include "engine/build_memory_plan.h"

#include <gtest/gtest.h>

#include "engine/measure_images.h"
#include "io/aligned_buffer.h"
#include "tests/support/written_scene.h"
#include "treelets/build_forest.h"

namespace shoal {
namespace {

constexpr uint64_t kMiB = 1u << 20;

BuildMemoryNeeds needs_of(uint64_t triangles, unsigned threads = 2) {
  BuildMemoryNeeds needs;
  needs.objects = {{triangles, {}}};
  needs.instances = 1;
  needs.treelet_bytes = 256u << 10;
  needs.threads = threads;
  return needs;
}

uint64_t smallest_mib(const BuildMemoryNeeds& needs) {
  const auto plan = plan_build_memory(needs, 1, "scene.gltf");
  EXPECT_FALSE(plan.ok());
  EXPECT_EQ(plan.error().code, ErrorCode::kMemoryCap);
  const size_t at = plan.error().message.find("needs ");
  return std::stoull(plan.error().message.substr(at + 6));
}

void expect_within_cap(const BuildMemoryPlan& plan) {
  const uint64_t resident = plan.process_bytes + plan.threads_bytes + plan.document_bytes + plan.tables_bytes + plan.coverage_bytes +
                            plan.writing_bytes;
  EXPECT_LE(resident + plan.chunk_bytes + plan.pages_bytes, plan.cap_bytes);
  EXPECT_LE(resident + plan.reading_bytes + plan.buffers_bytes, plan.cap_bytes);
  EXPECT_GE(plan.lanes, 1u);
  EXPECT_GE(plan.pages_in_flight, 2u);
}

TEST(BuildMemoryPlan, TheSmallestCapThatIsNamedWorksAndOneLessDoesNot) {
  for (const uint64_t triangles : {1ull, 100'000ull, 20'000'000ull, 1'000'000'000ull, 4'000'000'000ull}) {
    for (const unsigned threads : {1u, 64u}) {
      const BuildMemoryNeeds needs = needs_of(triangles, threads);
      const uint64_t mib = smallest_mib(needs);
      const auto plan = plan_build_memory(needs, mib * kMiB, "scene.gltf");
      ASSERT_TRUE(plan.ok()) << plan.error().message;
      expect_within_cap(plan.value());
      EXPECT_FALSE(plan_build_memory(needs, (mib - 1) * kMiB, "scene.gltf").ok());
    }
  }
}

TEST(BuildMemoryPlan, ChunksDependOnTheCapAndNotOnTheThreads) {
  for (const uint64_t cap : {100 * kMiB, 330 * kMiB, 4096 * kMiB}) {
    const auto one = plan_build_memory(needs_of(200'000'000, 1), cap, "scene.gltf");
    const auto many = plan_build_memory(needs_of(200'000'000, 96), cap, "scene.gltf");
    ASSERT_TRUE(one.ok() && many.ok());
    EXPECT_EQ(one.value().chunk_triangles({}), many.value().chunk_triangles({}));
    EXPECT_EQ(one.value().grid_cells(1000), many.value().grid_cells(1000));
    expect_within_cap(one.value());
    expect_within_cap(many.value());
  }
}

TEST(BuildMemoryPlan, BuildersThatTakeMoreGetSmallerChunks) {
  BuildMemoryNeeds needs = needs_of(200'000'000);
  const auto sah = plan_build_memory(needs, 330 * kMiB, "scene.gltf");
  needs.builder = BvhBuilder::kKarras;
  const auto karras = plan_build_memory(needs, 330 * kMiB, "scene.gltf");
  ASSERT_TRUE(sah.ok() && karras.ok());
  expect_within_cap(karras.value());
  EXPECT_LT(karras.value().chunk_triangles({}), sah.value().chunk_triangles({}));
  EXPECT_LE(karras.value().chunk_triangles({}) * forest_bytes(1, {}, needs.builder), karras.value().chunk_bytes);
}

TEST(BuildMemoryPlan, ABillionTrianglesFitAQuarterOfTheirBytes) {
  const auto plan = plan_build_memory(needs_of(1'000'000'000), 6'600'000'000ull / 4, "scene.gltf");
  ASSERT_TRUE(plan.ok()) << plan.error().message;
  EXPECT_GT(plan.value().chunk_triangles({}), 1'000'000u);
  EXPECT_GE(plan.value().write_buffer_bytes(2000), kBlockBytes);
  EXPECT_EQ(plan.value().write_buffer_bytes(2000) % kBlockBytes, 0u);
}

TEST(BuildMemoryPlan, ChargesWhatHasToBeResident) {
  const uint64_t least = smallest_mib(needs_of(1'000'000));
  BuildMemoryNeeds needs = needs_of(1'000'000);
  needs.coverage_bytes = 100 * kMiB;
  EXPECT_EQ(smallest_mib(needs), least + 100);
  needs.document_bytes = 50 * kMiB;
  EXPECT_EQ(smallest_mib(needs), least + 150);
  needs.instances = 1'000'000;
  EXPECT_GT(smallest_mib(needs), least + 150 + 400);
  needs = needs_of(1'000'000);
  needs.emitters = 2'000'000;
  EXPECT_GE(smallest_mib(needs), least + 137);
  needs = needs_of(1'000'000);
  needs.image_bytes = 900 * kMiB;  // in turn with the rest
  EXPECT_GT(smallest_mib(needs), 900u);
  EXPECT_LT(smallest_mib(needs), 900u + least);
}

TEST(BuildMemoryPlan, CountsADocumentByItsObjects) {
  MemoryFileSystem fs;
  const std::string json = R"({"asset":{"version":"2.0"},"nodes":[{},{},{}]})";
  ASSERT_TRUE(write_whole_file(fs, "scene.gltf", std::as_bytes(std::span(json))).ok());
  const auto bytes = document_bytes(fs, "scene.gltf");
  ASSERT_TRUE(bytes.ok());
  EXPECT_GT(bytes.value(), 5 * 300u);
  EXPECT_FALSE(document_bytes(fs, "missing.gltf").ok());
  EXPECT_TRUE(check_document(bytes.value(), 1, "scene.gltf").ok());  // the plan names the cap
  const Status refused = check_document(1000 * kMiB, 500 * kMiB, "scene.gltf");
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kMemoryCap);
  EXPECT_TRUE(check_document(400 * kMiB, 500 * kMiB, "scene.gltf").ok());
}

TEST(MeasureImages, ReadsTheSizeFromTheHeader) {
  const std::string png = testing::png_bytes(3, 5, std::vector<uint8_t>(60, 7));
  const ImageHeader header = read_image_header(std::as_bytes(std::span(png)));
  EXPECT_EQ(header.width, 3u);
  EXPECT_EQ(header.height, 5u);
  EXPECT_TRUE(header.may_have_alpha);
  const unsigned char jpeg[] = {0xff, 0xd8, 0xff, 0xe0, 0, 4, 1, 2, 0xff, 0xff, 0xc2, 0, 11, 8, 0x01, 0x02, 0x03, 0x04, 1, 1};
  const ImageHeader frame = read_image_header(std::as_bytes(std::span(jpeg)));
  EXPECT_EQ(frame.height, 0x102u);
  EXPECT_EQ(frame.width, 0x304u);
  EXPECT_FALSE(frame.may_have_alpha);
  for (size_t n = 0; n < sizeof jpeg - 5; ++n) {
    EXPECT_EQ(read_image_header(std::as_bytes(std::span(jpeg).first(n))).width, 0u) << n;
  }
}

}  // namespace
}  // namespace shoal
