// What a batch was asked for, remembered beside its pictures so that --resume need not be told again. Called by
// engine/batch_run and bins/command_batch. Plain functions. Cost: one small file.
#pragma once

#include <string>

#include "engine/batch_plan.h"
#include "io/file.h"
#include "io/result.h"

namespace shoal {

/// Fails with: kStorage.
Status write_asked(FileSystem& fs, const BatchOptions& options);
/// Of the batch that `out` is of; without what is of one run only (force, program). Fails with: kInput (there was none, or
/// what is remembered cannot be read), kStorage.
Result<BatchOptions> read_asked(FileSystem& fs, const std::string& out);

}  // namespace shoal
