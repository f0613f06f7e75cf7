// What a document holds compressed (EXT_meshopt_compression, KHR_draco_mesh_compression), decoded once, a view or a mesh
// at a time, into a scratch file: after that the document is one without compression, whose accessors are read in any
// pieces and as often as a build out of core wants. Only what the scene shows is decoded.
// Called by engine/build_scene. Thread rule: one thread. Cost: the codecs', and one write of what they give.
#pragma once

#include <atomic>
#include <string>

#include "io/gltf_accessor.h"

namespace shoal::gltf {

struct CompressionNeeds {
  uint64_t memory_bytes = 0;   ///< for the view or mesh that takes most, while it is decoded; 0: nothing is compressed
  uint64_t scratch_bytes = 0;  ///< of the scratch file
};
/// `animation`: the one that will be read, if any.
CompressionNeeds compression_needs(const Document& document, std::optional<uint32_t> animation = {});

/// Puts what is compressed into a scratch file in `folder` and points the document there. Fails with: kInput (what does
/// not decode, or to other sizes than the document says), kStorage, kMemoryCap, kStopped.
Status decompress(FileSystem& fs, const std::string& folder, const std::atomic<bool>* stop, Document& document,
                  std::optional<uint32_t> animation = {});

}  // namespace shoal::gltf
