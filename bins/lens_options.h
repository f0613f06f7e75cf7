// The camera's options of `render` and `compare`: which camera, projection, lens and distortion. Called by
// bins/render_options.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

#include "engine/render.h"

namespace shoal {

/// "k1,k2,..." or "radial:k1,k2,...", up to six; "brown:k1,k2,k3,p1,p2", of which the last may be left out.
/// Fails with: kUsage.
Result<Distortion> parse_distortion(const std::string& text);
/// "0.02": a diameter; "f/2.8": an f-stop. Fails with: kUsage.
Status parse_aperture(const std::string& text, LensOptions& lens);

/// `picture` must outlive the parse.
void declare_lens(CLI::App& app, PictureOptions& picture);

}  // namespace shoal
