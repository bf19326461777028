// Metrics of a person's way through the world as WHAM and those after it measure them on EMDB-2 and RICH: the estimate
// is laid on the truth first, in pieces. [Shin et al. 2024, WHAM; its public evaluation and that of GVHMR]
//
// Joints are those of optim/metrics.h: arrays [J,3] in metres, of which the first kMetricJoints count. All frames do,
// the first too. A number that is not finite gives NaN; sizes that differ throw InternalError.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "core/types.h"
#include "optim/motion_metrics.h"

namespace hsi4d {

/// Frames of a piece: of the "100" in the metrics' names.
inline constexpr Index kPieceFrames = 100;

/// Frames of each piece that W-MPJPE lays on the truth.
inline constexpr Index kFirstFrames = 2;

/// The rate that these protocols are for, frames a second. Pieces and steps are counted in frames whatever the rate.
inline constexpr double kProtocolRate = 30;

/// A vertex of the truth stands between two frames where it moves by less than this, metres.
inline constexpr double kStandingStep = 0.01;

/// The jitter of these protocols is told in so many m/s³.
inline constexpr double kJitterUnit = 10;

/// Mean joint error of each frame, 1000/J Σ |s R x̂_j + t − x_j|, after the similarity that lays the first `aligned`
/// frames of its piece on the truth best: WA-MPJPE with as many as a piece has, W-MPJPE with kFirstFrames.
///
/// @param joints, truth  [T][J,3] metres
/// @param piece          frames of a piece, the last may be shorter; at least 1
/// @param aligned        at least 1
/// @return               [T] millimetres
std::vector<double> piecewise_mpjpe_mm(JointFrames joints, JointFrames truth, Index piece, Index aligned);

/// Error of the pelvis in each frame over the length of the truth's way, after the rotation and translation that lay
/// all of the estimate's way on the truth's best:
///
///   100 |R x̂_t + c − x_t| / Σ_t |x_{t+1} − x_t|
///
/// @param joints, truth  [T][J,3] metres, joint 0 the pelvis
/// @return               [T] percent; nothing where the truth's pelvis does not move
std::optional<std::vector<double>> root_way_errors_percent(JointFrames joints, JointFrames truth);

/// How far points slide from frame to frame while those of the truth stand: the mean of |p̂_{t+1} − p̂_t| over all points
/// and frames where |p_{t+1} − p_t| < kStandingStep.
///
/// @param points, truth  [T][P,3] metres, four vertices of the feet
/// @return               millimetres; nothing where no point of the truth ever stands
std::optional<double> standing_step_mm(JointFrames points, JointFrames truth);

}  // namespace hsi4d
