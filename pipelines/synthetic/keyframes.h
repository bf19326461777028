// Motions as keyframes: what the files of keys share.
//
// Between two keys everything accelerates, goes on and brakes.
#pragma once

#include <vector>

#include "pipelines/synthetic/moment.h"

namespace hsi4d::detail {

/// A hand that holds nothing, in the person's frame; rotations as vectors in degrees.
struct HandKey {
  Vector3<double> wrist = {0, 0, 0};  ///< against where it hangs
  Vector3<double> turn = {0, 0, 0};   ///< against the forearm
  double curl = 22;                   ///< of every finger joint
};

/// The state at one moment, in the person's frame: (left, forward, up) from the place between the feet, metres;
/// rotations are vectors in degrees, those of the body as in FigureTarget.
struct KeyPose {
  double seconds = 0;
  Vector3<double> pelvis = {0, 0, 0};  ///< up is relative to standing
  Vector3<double> pelvis_turn = {0, 0, 0};
  Vector3<double> spine = {0, 0, 0};
  Vector3<double> head = {0, 0, 0};
  Vector3<double> object = {0, 0, 0};       ///< the object's grip
  Vector3<double> object_turn = {0, 0, 0};  ///< about (left, forward, up)
  Vector3<double> away = {0, 0, 0};         ///< of the holding hands from their grips
  double grip = 60;                         ///< curl of the holding hands
  HandKey left = {}, right = {};
};

// Rows of tables of keys.
/// Hands that hold nothing.
inline KeyPose free_hands(double seconds, const Vector3<double>& pelvis, const Vector3<double>& pelvis_turn,
                          const Vector3<double>& spine, const Vector3<double>& head, const HandKey& left,
                          const HandKey& right) {
  KeyPose key{seconds, pelvis, pelvis_turn, spine, head};
  key.left = left, key.right = right;
  return key;
}
/// Hands that hold the object, or one that does beside a free one.
inline KeyPose holding(double seconds, const Vector3<double>& pelvis, const Vector3<double>& pelvis_turn,
                       const Vector3<double>& spine, const Vector3<double>& head, const Vector3<double>& object,
                       const Vector3<double>& object_turn = {0, 0, 0}, double grip = 60, const HandKey& left = {},
                       const HandKey& right = {}, const Vector3<double>& away = {0, 0, 0}) {
  return {seconds, pelvis, pelvis_turn, spine, head, object, object_turn, away, grip, left, right};
}

/// A motion as keys, and what is the same in all of them.
struct KeyedMotion {
  std::vector<KeyPose> keys;
  Ground ground;
  std::array<FigureFoot, 2> feet;  ///< place: left, forward, up; yaw against the heading
  bool hands_hang = true;          ///< wrists of free hands are relative to where they hang; else to the ground
  bool shares_turn = true;         ///< forearms take half of what free wrists turn about them
  std::array<Vector3<double>, 2> elbows = {Vector3<double>(0.65, -0.5, -0.6), Vector3<double>(-0.65, -0.6, -0.25)};
};

/// Between two keys: positions on a line, rotations along the shortest arc.
KeyPose key_at(const std::vector<KeyPose>& keys, double seconds);

/// Where a clip of a length is that runs forwards, backwards, and forwards again.
double time_in_clip(double seconds, double length);

/// A foot that stands flat. @param toes  degrees to the left of the heading
FigureFoot planted_foot(double left, double forward, double toes);

/// The body as a key says; hands hold nothing.
FigureTarget keyed_figure(const Actor& actor, const KeyedMotion& motion, const KeyPose& key);

/// Rotation of a wrist whose stretched fingers and thumb point there: left, forward, up.
Matrix3<double> hand_turn(const Ground& ground, const Vector3<double>& fingers, const Vector3<double>& thumb, int side);

}  // namespace hsi4d::detail
