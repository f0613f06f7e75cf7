// What a part of a picture says of it: the attributes of its image, as text. Written by engine/render, read by
// engine/merge_sums. Plain functions.
#pragma once

#include <string>

#include "io/image.h"
#include "io/result.h"

namespace shoal {

/// The attributes of an image without its channels, and back. Fails with: kCorrupt (it was not written by that).
std::string attributes_text(const ExrImage& image);
Status read_attributes(const std::string& text, ExrImage& image);

}  // namespace shoal
