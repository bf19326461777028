// A sequence of BEHAVE as its annotations at 30 frames a second have it.
#pragma once

#include <string>

#include "pipelines/evaluate/tracks.h"

namespace hsi4d {

/// Frames a second of these annotations.
inline constexpr double kBehaveRate = 30;

/// Whether a folder holds such a sequence: `smpl_fit_all.npz`.
bool is_behave_sequence(const std::string& folder);

/// Reads `smpl_fit_all.npz`, a motion of SMPL-H (read_motion: `poses` [T,156], `trans` [T,3], `betas`), and, where it
/// is there, `object_fit_all.npz`: `angles` [T,3], axis-angle in radians, and `trans` [T,3] metres, of the object's
/// template about the mean of its vertices. `frame_times` [T] of both are texts like "t0012.033", seconds.
///
/// Frames that both files have are read; those between them, which the data set leaves out, are interpolated and no
/// good frames. The world is that of a camera, x right, y down, z forward, and is turned so that what is up in its
/// image is z.
///
/// @param object  what the object is called
/// Throws UserError and DataError as read_motion; DataError naming file and array: no times, one that is no such text,
/// or no later than the one before it; a shape that does not fit, a number that is not finite; no frame in common; more
/// than kLongestGap frames in a row that are missing.
Track read_behave_sequence(const std::string& folder, const std::string& object);

/// Frames in a row that may be missing.
inline constexpr Index kLongestGap = 999;

}  // namespace hsi4d
