// URIs of a glTF file: either data: with base64, or a relative path that stays inside the scene's folder.
// Called by the glTF reader. Thread rule: plain functions.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "io/result.h"

namespace shoal {

bool is_data_uri(std::string_view uri);
/// Fails with: kInput (not base64). Messages do not name the file; the caller does.
Result<std::vector<std::byte>> decode_data_uri(std::string_view uri);

/// `folder` joined with the percent-decoded uri. Fails with: kInput for a scheme, an absolute path, a `..`, a NUL
/// or a broken percent escape. Symbolic links inside the folder are the owner's business.
Result<std::string> resolve_uri(std::string_view folder, std::string_view uri);

}  // namespace shoal
