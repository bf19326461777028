// The layout of poses of SMPL-X, and poses of other body models as such.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "body/pose.h"

namespace hsi4d {

/// The body: the pelvis and the joints of `body_pose` after it. Then come jaw and eyes, then the hands.
inline constexpr Index kBodyJoints = 22;
/// The left hand's; the right hand's follow.
inline constexpr Index kFirstHandJoint = 25;
/// Of each hand, and how many numbers their axis-angle vectors are.
inline constexpr Index kHandJoints = 15;
inline constexpr Index kHandNumbers = 3 * kHandJoints;

/// Of the other models: SMPL-H has no jaw and no eyes, SMPL no fingers either, but two hands after its body.
inline constexpr Index kSmplhJoints = 52, kSmplJoints = 24;

/// Larger numbers in a file are no metres, radians or coefficients of a body; with these, sums and products fit into
/// floats. What messages call the range.
inline constexpr double kLargestBodyNumber = 1e6;
inline constexpr const char* kBodyNumbersText = "-1e6 to 1e6";
/// Betas are this large at most, in files and configs: nobody is ten standard deviations from the mean.
inline constexpr double kLargestBeta = 10;
inline constexpr const char* kBetasText = "-10 to 10";
/// And this many: the shape directions of SMPL-X 1.1.
inline constexpr Index kMostBetas = 300;
/// Of translations, metres: maps count their northings up to this.
inline constexpr double kLargestPlace = 1e7;

/// Where the pelvis of the public models stands in the rest pose, neutral and of mean shape, metres: for files that do
/// not say of what body they are. That of SMPL-H is the neutral model's that comes with AMASS.
inline const Vector3<double> kSmplxPelvis{0.00312326, -0.35140747, 0.01203655};
inline const Vector3<double> kSmplhPelvis{-0.00179506, -0.22333345, 0.02821913};
inline const Vector3<double> kSmplPelvis{-0.00217368, -0.24078917, 0.02858379};

/// `joints` joints that follow each other, from joint `from` of one layout on, are those from `to` on of SMPL-X.
struct PoseRun {
  Index from, to, joints;
};

/// Where the joints of a pose of that many joints stand in SMPL-X: 55 (SMPL-X); 52 (SMPL-H: body and hands, no jaw, no
/// eyes); 22 to 24 (SMPL: the body; its two hand joints, 22 and 23, are left out, for they have no place there). Empty
/// for another number.
std::vector<PoseRun> smplx_runs(Index joints);

/// A pose of SMPL-X from the axis-angle vectors of one of these models; the joints that it has not are not turned.
///
/// @param axis_angle  [joints,3] radians
/// @param source      what messages call it
/// Throws DataError when it has another number of joints.
BodyPose smplx_pose(std::span<const double> axis_angle, std::string_view source);

}  // namespace hsi4d
