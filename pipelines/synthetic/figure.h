// A body put into a pose by where its pelvis, feet and hands are to be: two-bone inverse kinematics.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "body/body_model.h"
#include "core/linear.h"
#include "pipelines/config/synthetic_places.h"

namespace hsi4d {

/// Of arrays of two: hands, feet.
enum Side { kLeft = 0, kRight = 1 };

/// The sign of "left" that leads out of the body on that side.
inline double outward(int side) { return side == kLeft ? 1 : -1; }

/// What stays the same of one body, metres.
struct FigureSizes {
  double standing = 0;  ///< height of the pelvis over the soles
  double ankle = 0;     ///< height of the ankles over the soles
  double shoulder = 0;  ///< height of the shoulders over the soles
  double shoulder_width = 0;
  double arm = 0;                       ///< from shoulder to wrist
  std::array<Vector3<double>, 2> palm;  ///< in the wrist's frame: what lies in a closed hand
};

FigureSizes figure_sizes(const BodyModel& body);

/// Where a foot is to be.
struct FigureFoot {
  Vector3<double> place;     ///< world: the point of the floor below the ankle of a flat foot; z: how high the sole is
  double yaw_deg = 0;        ///< direction of the toes, as a heading
  double pitch_deg = 0;      ///< the heel is raised about the ball of the foot
  bool flat_toes = true;     ///< the toes stay level when the heel is raised
  bool about_ankle = false;  ///< the pitch is about the ankle, which stays over `place`
};

/// Where a hand is to be.
struct FigureHand {
  Vector3<double> wrist;                ///< world
  std::optional<Matrix3<double>> turn;  ///< rotation of the wrist, world
  Vector3<double> local = {0, 0, 0};    ///< without it: against the forearm, degrees
  bool shared = false;                  ///< the forearm takes half of what of that is about itself
  Vector3<double> elbow = {0, 0, -1};   ///< where the elbow points, world
  double curl_deg = 20;                 ///< of every finger joint
};

/// What a body is to do. Rotations are vectors in degrees in the joint's own axes (left, up, forward): x leans forward,
/// y turns left, z leans right.
struct FigureTarget {
  Ground ground;
  Vector3<double> pelvis = {0, 0, 0};  ///< on the ground; up is relative to standing
  Vector3<double> pelvis_turn = {0, 0, 0};
  Vector3<double> spine = {0, 0, 0};  ///< of three joints together
  Vector3<double> head = {0, 0, 0};   ///< of neck and head together
  std::array<Vector3<double>, 2> collars = {Vector3<double>(0, -4, -6), Vector3<double>(0, 4, 6)};
  std::array<FigureFoot, 2> feet;
  std::array<FigureHand, 2> hands;
};

/// The pose. A limb that does not reach is stretched towards its target.
BodyPose posed_figure(const BodyModel& body, const FigureTarget& target);

}  // namespace hsi4d
