// The codecs of EXT_meshopt_compression for io/decompress_document; meshoptimizer stays inside the .cpp. Pure. Cost:
// about a nanosecond a byte.
#pragma once

#include <span>
#include <string>

#include "io/gltf_document.h"

namespace shoal::gltf {

/// Fills `out`, of count * byte_stride bytes, from the compressed bytes. `place` is for messages.
/// Requires: a stride and count that load_document() let pass. Fails with: kInput.
Status decode_meshopt(const MeshoptView& view, std::span<const std::byte> packed, std::span<std::byte> out,
                      const std::string& place);

}  // namespace shoal::gltf
