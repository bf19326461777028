// Feet that stand, and how far they slide.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/linear.h"

namespace hsi4d {

/// When a joint of a foot counts as standing between two adjacent frames.
struct StandingRule {
  double height = 0.05;  ///< at most this much higher than in the first frame, in both, metres
  double speed = 0.5;    ///< and slower than this, metres a second
};

/// Whether a joint of a foot stands between two adjacent frames.
/// @param before, after  its places, metres, world (z up)
/// @param first_height   its height in the first frame, metres
/// @param frame_rate     frames a second
bool foot_stands(const Vector3<double>& before, const Vector3<double>& after, double first_height, double frame_rate,
                 const StandingRule& rule);

/// Steps count as what they come to in a frame at so many frames a second, that of the method's clips.  [method, 7]
inline constexpr double kSlidingRate = 10;

/// How far the feet slide: the mean horizontal step of ankles and balls of the feet between two adjacent frames, of
/// those that stand by the default rule, in a tenth of a second, so that it does not depend on the frame rate f:
///
///   1000/|S| Σ_{j ∈ S} |(x'_j − x_j)_{xy}| · f / kSlidingRate
///
/// @param before, after, first  joints [J,3] in the order of SMPL-X, metres, world; the last of the first frame
/// @return  millimetres, at most 50; nothing where no foot stands
/// Throws InternalError where counts differ.
std::optional<double> foot_sliding_mm(std::span<const double> before, std::span<const double> after,
                                      std::span<const double> first, double frame_rate);

/// How far the lower foot goes up and down: the range over the frames of the height of the lowest of ankles and balls
/// of the feet, each the median of the frames around it, up to two before and after, metres. On level ground it is the
/// noise of the poses.
/// @param joints  [frame][J,3] in the order of SMPL-X, metres, world (z up); one frame at least
double lower_foot_range(std::span<const std::vector<double>> joints);

}  // namespace hsi4d
