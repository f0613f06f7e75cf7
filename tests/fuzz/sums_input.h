// How inputs of the sums target stand for files: 'R' and a file whose checksums and length are made right, so that what
// is bent is what they guard; or the file as it is. Called by fuzz_sums and write_seeds. Plain function.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace shoal::fuzz {

/// What is repaired has at most 1 MiB.
std::vector<std::byte> sums_file_of(std::span<const std::byte> input);

}  // namespace shoal::fuzz
