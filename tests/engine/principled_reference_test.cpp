// Where our pictures differ from the reference's, they do because its material is another: with its formulas for diffuse and
// gloss (SHOAL_PRINCIPLED in engine/bsdf.cpp, which only this program is built with) both agree
// (docs/decisions/0026-what-the-reference-adds.md).
#include "tests/engine/reference_picture.h"

namespace shoal {
namespace {

using namespace testing;

constexpr uint32_t kSamples = 64;

class PrincipledReference : public ReferencePicture {};

TEST_F(PrincipledReference, CoffeeAgrees) {
  expect_agreement(render_and_compare("coffee", "coffee", 0, kSamples), 0.01, 0.12);
}
TEST_F(PrincipledReference, KitchenAgrees) {
  expect_agreement(render_and_compare("kitchen", "kitchen", 0, kSamples / 2), 0.01, 0.12);
}
TEST_F(PrincipledReference, MaterialTestballAgrees) {
  expect_agreement(render_and_compare("material-testball", "material-testball", 1, kSamples), 0.025, 0.12);
}
// The bulb is thin glass for us, as glTF has it without a volume, and solid glass for the reference, which magnifies what
// glows in it: a tenth of the picture's light, in 2 % of its pixels.
TEST_F(PrincipledReference, LampAgreesButForTheBulb) {
  expect_agreement(render_and_compare("lamp", "lamp", 0, kSamples), 0.11, 0.15);
}

}  // namespace
}  // namespace shoal
