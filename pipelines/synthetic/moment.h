// One moment of a synthetic motion, before inverse kinematics: what the motions of keys.cpp and
// walk.cpp make.
#pragma once

#include <array>
#include <optional>

#include "core/rigid.h"
#include "pipelines/config/synthetic_places.h"
#include "pipelines/synthetic/figure.h"
#include "pipelines/synthetic/object.h"

namespace hsi4d::detail {

/// Who acts with what.
struct Actor {
  FigureSizes sizes;
  const SyntheticObject& object;
  SyntheticMotionKind motion;
  const ScenePlace* place = nullptr;  ///< what it is done at, of motions that need one
};

struct Moment {
  FigureTarget figure;
  std::optional<Rigid<double>> object;  ///< world_from_object
  bool in_hand = false;                 ///< the object is fixed to the right wrist
};

/// Where an object is: its point `pivot` at `place` (left, forward, up on the ground), turned about it by degrees about
/// (left, forward, up) from where its front points forward.
struct ObjectPlace {
  Vector3<double> pivot;
  Vector3<double> place;
  Vector3<double> turn_deg = {0, 0, 0};
};

Rigid<double> object_on(const Ground& ground, const ObjectPlace& at);

/// How a hand that holds the object is turned when the object's front points forward; world.
Matrix3<double> grasp_on(const Ground& ground, const HandGrip& grip, int side);

/// How hands hold an object: left, right.
using HandGrips = std::array<std::optional<HandGrip>, 2>;

/// Puts the hands that hold the object to their grips.
/// @param away  of the hands from the grips: left, forward, up
void hold_object(const Actor& actor, const ObjectPlace& at, const Vector3<double>& away, double curl_deg,
                 Moment& moment);
void hold_object(const Actor& actor, const HandGrips& grips, const ObjectPlace& at, const Vector3<double>& away,
                 double curl_deg, Moment& moment);

/// Where a wrist is when the arm hangs: left, forward, up.
Vector3<double> hanging_wrist(const FigureSizes& sizes, int side);

/// From a seat to the pelvis of who sits on it; from a surface to the wrist of a palm that lies on it; metres.
inline constexpr double kSeatToPelvis = 0.085, kPalmToSurface = 0.06;

/// 0 below 0, 1 above 1, smooth between.
double smooth_step(double x);

/// pour, lift, sit, lean, wave, open. Feet stay where they stand.
Moment keyed_moment(const Actor& actor, double seconds);

/// walk, push.
Moment walking_moment(const Actor& actor, double seconds);

/// sit_on, lean_on, reach, wipe, water: keyframes at a place.
Moment placed_moment(const Actor& actor, double seconds);

/// run, slide, play, roll: what goes on and on, or along a way.
Moment flowing_moment(const Actor& actor, double seconds);

}  // namespace hsi4d::detail
