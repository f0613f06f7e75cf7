// Is the surface there? Evaluates a triangle's CoverageRecord at the barycentrics of a hit. Called by traversal for
// hits that would count. A pure function of ray, instance, primitive and triangle, so that no order can change it.
// Cost: up to four texel reads from the treelet's own page.
#pragma once

#include "treelets/treelet_layout.h"
#include "treelets/triangle_test.h"

namespace shoal {

/// Uniform in [0, 1), from the upper 24 bits of the first word of pcg3d (Jarzynski & Olano 2020, "Hash Functions
/// for GPU Rendering", JCGT 9(3)) of (alpha_seed, instance, primitive).
float coverage_threshold(uint32_t alpha_seed, uint32_t instance, uint32_t primitive);

/// alpha = factor * vertex alpha * texture alpha; the texture bilinearly, or the texel that holds the point.
float coverage_alpha(const CoverageRecord& record, const uint8_t* texels, float b1, float b2);

/// MASK: alpha >= cutoff. BLEND: alpha > coverage_threshold().
bool is_covered(const CoverageRecord& record, const uint8_t* texels, const TriangleHit& hit, uint32_t alpha_seed,
                uint32_t instance, uint32_t primitive);

}  // namespace shoal
