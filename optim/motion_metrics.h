// Metrics of motions over time: acceleration against the truth, and how far motions are apart from each other.
//
// As in optim/metrics.h joints are arrays [J,3] in metres, world, of which the first kMetricJoints count, and sizes
// that differ throw InternalError.
#pragma once

#include <optional>
#include <span>
#include <vector>

namespace hsi4d {

/// The joints of a motion: [T] arrays [J,3].
using JointFrames = std::span<const std::span<const double>>;

/// Acceleration error of each frame that has one on either side, frames 1 to T−2:
///
///   rate²/J Σ_j |(x̂_{t+1} − 2 x̂_t + x̂_{t−1}) − (x_{t+1} − 2 x_t + x_{t−1})|      [Kanazawa et al. 2019, section 5.2]
///
/// @param joints, truth  [T][J,3] metres
/// @param rate           frames a second
/// @return               [max(0, T−2)] m/s²
std::vector<double> acceleration_errors(JointFrames joints, JointFrames truth, double rate);

/// How far motions are apart: the mean over all pairs of motions, frames and joints of |x̂_j − x_j|, of as many frames
/// as all have. The average pairwise distance of generative models, per joint.
///
/// @param motions        [S][T][J,3] metres, at the same moments
/// @param root_relative  with each pelvis at the origin: of poses, not of places
/// @return               millimetres; nothing for fewer than two motions, or where one has no frame
std::optional<double> pairwise_distance_mm(std::span<const std::vector<std::span<const double>>> motions,
                                           bool root_relative);

}  // namespace hsi4d
