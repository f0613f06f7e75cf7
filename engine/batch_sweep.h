// What renders that were killed left behind: temporary files beside the names of outputs (io/file.h, AtomicFile). Only
// names that the batch itself writes are looked for, so that nobody else's files go. Called by engine/batch_run under the
// lock of the batch, while no render of it runs in the folders at hand. Cost: reads each folder once.
#pragma once

#include <string>
#include <vector>

namespace shoal {

/// Removes the temporaries of these files. What cannot be removed stays.
void remove_temporaries(const std::vector<std::string>& files);
/// Removes every temporary in a folder of the batch's own and in the folders in it.
void remove_all_temporaries(const std::string& folder);
/// Removes a folder and all in it.
void remove_folder(const std::string& folder);

}  // namespace shoal
