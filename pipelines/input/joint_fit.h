// The joint that an object's poses tell: of a run in which it moved freely.
#pragma once

#include <span>
#include <vector>

#include "core/angles.h"
#include "pipelines/input/object_joint.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// A joint, and how well poses fit it.
struct JointFit {
  ObjectJoint joint;
  std::vector<double> values;     ///< by frame, radians or metres
  std::vector<double> distances;  ///< by frame: of the object's Gaussian centres from where the poses have them, root
                                  ///< mean square, metres
};

/// Least turn and way, in any frame, that tell an axis: radians, metres.
inline constexpr double kLeastTurn = 5 * kDegree, kLeastWay = 0.02;

/// The joint whose poses are nearest: least Σ over frames and Gaussian centres x of |J(q_t) P_0 x − P_t x|², by the
/// axis, a point of it, and q_t. Of a slide the axis is the longest of the ways' scatter; of a hinge it is found by
/// Gauss-Newton steps, in which q_t is the best for each axis [variable projection: Golub and Pereyra 1973]. Where the
/// object rests is its pose in frame 0. The point of a hinge's axis is the one nearest to the object's centroid there.
///
/// @param parent_from_object  P_t, by frame, two at least
/// @param object              relative to the centroid of its centres
/// Throws UserError where the object turns, or moves, by less than kLeastTurn or kLeastWay.
JointFit fit_joint(JointType type, std::span<const Rigid<double>> parent_from_object, const Gaussians& object);

}  // namespace hsi4d
