// What a run has read, told by its content: so that one that is resumed notices files that have changed.
#pragma once

#include <string>
#include <vector>

#include "pipelines/input/clip.h"

namespace hsi4d {

/// A line a file, "HASH NAME", where a file that is not there has no hash (text_hash; against mistakes, not against
/// attacks). Throws UserError naming a file that cannot be read.
std::string input_hashes(const std::vector<ClipFile>& files);

/// Compares what was read with what is there now. Throws DataError, a line a file, for those that have changed.
///
/// @param before      input_hashes of then
/// @param files       the same files, in the same order, where they are now
/// @param checkpoint  the file that knows `before`
void check_unchanged(const std::string& before, const std::vector<ClipFile>& files, const std::string& checkpoint);

}  // namespace hsi4d
