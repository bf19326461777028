// When the frames of a video are shown, and which of them a clip of another rate keeps.
#pragma once

#include <vector>

#include "core/types.h"

namespace hsi4d {

/// Times of the frames of a video by its time stamps.
struct FrameTimes {
  std::vector<double> seconds;  ///< after the first frame, which is at 0; none is before the one ahead of it
  double tick = 0;              ///< to what multiples the file rounds them, seconds
};

/// Whether frames count as equally far apart in time: none is further than a fifth of the mean step from its place on
/// the straight line from first to last (where the file rounds coarsely, than what it rounds to, at most three tenths).
/// A single frame that is left out is more.
bool are_even(const FrameTimes& times);

/// The median of the steps from frame to frame, seconds; 0 for fewer than two frames.
double usual_step(const FrameTimes& times);

/// Two frames that follow each other, and the time between them.
struct TimeStep {
  Index before = 0;    ///< the first of both
  double seconds = 0;  ///< from it to the next
};

/// The longest of the steps. Throws InternalError for fewer than two frames.
TimeStep widest_step(const FrameTimes& times);

/// For each moment 0, 1/rate, 2/rate, ... up to half a usual step after the last frame, the frame that is nearest to it
/// in time; of two that are equally near the later. A frame is there twice where no other is nearer to two moments.
/// @param rate  moments a second, > 0
std::vector<Index> nearest_frames(const FrameTimes& times, double rate);

/// The frame that is nearest to a moment in time; of two that are equally near the later.
/// Throws InternalError where there is none.
/// @param seconds  after the first frame
Index nearest_frame(const FrameTimes& times, double seconds);

}  // namespace hsi4d
