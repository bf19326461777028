// Motions at the places of a scene, from keyframes: sit_on, lean_on, reach, wipe, water. Heights and distances are
// those of the place.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "pipelines/synthetic/keyframes.h"

namespace hsi4d::detail {
namespace {

using Vector = Vector3<double>;

constexpr double kLength = 5;  // seconds, before it runs backwards

Ground ahead_of(const Ground& ground, double forward) {
  Ground result = ground;
  result.place = ground.point({0, forward, 0}).head<2>();
  return result;
}

/// How a person sits on a seat: on a low one deep, with bent knees; on a high one on its edge.
struct Seat {
  double high;    ///< 0: as low as a chair; 1: as high as the back of a sofa
  double edge;    ///< from the feet back to the seat's front edge
  double pelvis;  ///< forward
  double down;    ///< of the pelvis, against standing
};

Seat seat_of(const Actor& actor) {
  const double height = actor.place->height;
  Seat seat{};
  seat.high = std::clamp((height - 0.47) / 0.3, 0.0, 1.0);
  seat.edge = 0.13 + 0.07 * seat.high;
  seat.pelvis = -seat.edge - 0.21 + 0.19 * seat.high;
  seat.down = height + kSeatToPelvis + 0.04 * seat.high - actor.sizes.standing;
  return seat;
}

KeyedMotion sit_on_motion(const Actor& actor) {
  const Seat seat = seat_of(actor);
  const double top = actor.place->height, back = seat.pelvis, low = 1 - seat.high, effort = 0.35 + 0.65 * low;
  const Vector hang_left = hanging_wrist(actor.sizes, kLeft), hang_right = hanging_wrist(actor.sizes, kRight);
  const auto on_thigh = [&](double out, double forward, double up) {
    return HandKey{{out, back + forward, top + up}, {45, 0, 0}, 22};
  };
  const double thigh = 0.31 - 0.05 * seat.high, above = 0.2 - 0.04 * seat.high;
  KeyedMotion motion;
  motion.ground = ahead_of(actor.place->ground, seat.edge);
  motion.feet = {planted_foot(0.12, 0.02, 9), planted_foot(-0.12, -0.02, -11)};
  motion.hands_hang = false;
  const auto hanging = [&](double forward, double up) {
    return std::array<HandKey, 2>{HandKey{hang_left + Vector(0, forward, up)},
                                  HandKey{hang_right + Vector(0, forward, up)}};
  };
  const auto stands = hanging(0, 0), swings = hanging(0.13, 0.05);
  motion.keys = {free_hands(0, {0, -0.01, -0.012}, {0, 0, 0}, {1, 0, 0}, {0, 0, 0}, stands[kLeft], stands[kRight]),
                 // the trunk goes forward first
                 free_hands(0.55, {0, 0.35 * back, -0.05 - 0.04 * low}, {15 * effort, 0, 0}, {13 * effort, 0, 0},
                            {-6, 0, 0}, swings[kLeft], swings[kRight]),
                 free_hands(1.5, {0, back + 0.04, seat.down + 0.04}, {24 * effort, 0, 0}, {21 * effort, 0, 0},
                            {-18 * effort, 0, 0}, on_thigh(0.2, thigh + 0.06, above + 0.1),
                            on_thigh(-0.2, thigh + 0.06, above + 0.1)),
                 free_hands(1.95, {0, back, seat.down}, {8 * effort, 0, 0}, {10, 0, 0}, {-7, 0, 0},
                            on_thigh(0.14, thigh, above), on_thigh(-0.14, thigh, above)),
                 free_hands(2.7, {0, back - 0.01, seat.down}, {-7, 0, 0}, {4, 0, 0}, {2, 0, 0},
                            on_thigh(0.14, thigh - 0.03, above), on_thigh(-0.14, thigh - 0.03, above)),
                 // looks around
                 free_hands(3.8, {0.01, back - 0.01, seat.down}, {-6, 5, 1}, {3, 8, -1}, {2, 24, 0},
                            on_thigh(0.15, thigh - 0.05, above), on_thigh(-0.12, thigh + 0.01, above)),
                 free_hands(kLength, {-0.01, back, seat.down}, {-3, -4, -1}, {8, -7, 2}, {3, -18, 0},
                            on_thigh(0.12, thigh, above + 0.005), on_thigh(-0.15, thigh - 0.04, above))};
  return motion;
}

/// Hands, or forearms, on something ahead: a counter, the rungs of a ladder.
KeyedMotion lean_on_motion(const Actor& actor) {
  const ScenePlace& place = *actor.place;
  const bool is_grasped = place.rise > 0;  // rungs
  const double deep = is_grasped ? -0.07 : 0.1, over = is_grasped ? 0.0 : 0.045, curl = is_grasped ? 62.0 : 16.0;
  const Vector hang_right = hanging_wrist(actor.sizes, kRight);
  const auto rest = [&](double out, double forward, double up) {
    return HandKey{{out, place.reach + deep + forward, place.height + over + up}, {0, 0, 0}, curl};
  };
  KeyedMotion motion;
  motion.ground = place.ground;
  motion.feet = {planted_foot(0.11, 0.05, 10), planted_foot(-0.13, -0.12, -16)};
  motion.hands_hang = false;
  motion.elbows = is_grasped ? std::array<Vector, 2>{Vector(0.5, -0.3, -0.8), Vector(-0.5, -0.3, -0.8)}
                             : std::array<Vector, 2>{Vector(0.9, -0.15, -0.25), Vector(-0.9, -0.15, -0.25)};
  const double tilt = is_grasped ? 8 : 15;
  motion.keys = {free_hands(0, {0, -0.03, -0.014}, {0, 0, 0}, {2, 0, 0}, {4, 0, 0}, rest(0.17, -0.02, place.rise),
                            {hang_right, {0, 0, 0}, 22}),
                 free_hands(1.1, {0, -0.1, -0.03}, {tilt, 0, 0}, {tilt, 0, 0}, {-10, 0, 0}, rest(0.16, 0, place.rise),
                            rest(-0.17, 0, 0)),
                 // looks to the side
                 free_hands(2.3, {0.03, -0.11, -0.035}, {tilt + 1, -3, 3}, {tilt, -6, -3}, {-8, -34, 0},
                            rest(0.16, 0, place.rise), rest(-0.17, 0, 0)),
                 free_hands(3.6, {-0.03, -0.12, -0.035}, {tilt + 3, 2, -2}, {tilt + 2, 3, 2}, {-14, 10, 0},
                            rest(0.16, 0, place.rise), rest(-0.17, 0, 0)),
                 free_hands(kLength, {-0.01, -0.09, -0.03}, {tilt - 2, 0, 0}, {tilt - 2, -2, 0}, {-8, -22, 0},
                            rest(0.16, 0, place.rise), rest(-0.17, 0, 0))};
  return motion;
}

/// Takes something from a shelf with the right hand, then from lower down with the left one.
KeyedMotion reach_motion(const Actor& actor) {
  const ScenePlace& place = *actor.place;
  const Vector hang_left = hanging_wrist(actor.sizes, kLeft), hang_right = hanging_wrist(actor.sizes, kRight);
  const double near = place.reach - 0.13;  // of a wrist whose fingers are at the packages
  KeyedMotion motion;
  motion.ground = place.ground;
  motion.feet = {planted_foot(0.12, 0.03, 8), planted_foot(-0.12, -0.05, -14)};
  motion.hands_hang = false;
  const auto high = [&](double back, double curl) {
    return HandKey{{-0.14, near - back, place.height + 0.17}, {0, 0, 0}, curl};
  };
  const auto low = [&](double back, double curl) {
    return HandKey{{0.16, near - back, place.height - 0.2}, {0, 0, 0}, curl};
  };
  const HandKey left_chest{{0.1, 0.27, 1.06}, {0, 0, 0}, 34}, right_chest{{-0.1, 0.28, 1.12}, {0, 0, 0}, 48};
  motion.keys = {free_hands(0, {0, -0.01, -0.012}, {0, 0, 0}, {0, 0, 0}, {-4, 6, 0}, {hang_left}, {hang_right}),
                 free_hands(0.9, {-0.01, 0.03, -0.014}, {5, 5, 0}, {7, 10, 0}, {-6, 0, 0},
                            {hang_left + Vector(0, 0.06, 0.02)}, high(0, 12)),
                 // the fingers close
                 free_hands(1.3, {-0.01, 0.035, -0.014}, {6, 5, 0}, {8, 10, 0}, {-6, 0, 0},
                            {hang_left + Vector(0, 0.08, 0.04)}, high(0, 50)),
                 free_hands(2.2, {0.01, -0.02, -0.014}, {1, 0, 0}, {3, 0, 0}, {24, 0, 0}, left_chest, right_chest),
                 free_hands(2.9, {0.015, -0.02, -0.014}, {0, 0, 0}, {3, -3, 0}, {26, 4, 0}, left_chest, right_chest),
                 free_hands(3.8, {0.02, 0.03, -0.03}, {8, -5, 0}, {9, -8, 0}, {8, 6, 0}, low(0, 12), right_chest),
                 free_hands(4.2, {0.02, 0.03, -0.03}, {8, -5, 0}, {9, -8, 0}, {8, 6, 0}, low(0, 50), right_chest),
                 free_hands(kLength, {0, -0.02, -0.014}, {0, 0, 0}, {3, 2, 0}, {22, 0, 0},
                            {{0.12, 0.27, 1.1}, {0, 0, 0}, 48}, right_chest)};
  return motion;
}

/// Where the wiping hand is on its surface, against the middle: left and up.
Vector2<double> wiped(double seconds) {
  const double angle = 2 * std::numbers::pi * seconds / 1.4, drift = std::sin(0.9 * seconds);
  return {0.1 * std::cos(angle) + 0.08 * drift, 0.075 * std::sin(angle) + 0.03 * std::sin(0.6 * seconds)};
}

KeyedMotion wipe_motion(const Actor& actor, double seconds) {
  const ScenePlace& place = *actor.place;
  const Vector2<double> at = wiped(seconds);
  KeyedMotion motion;
  motion.ground = place.ground;
  motion.feet = {planted_foot(0.14, 0.05, 10), planted_foot(-0.14, -0.05, -14)};
  motion.hands_hang = false;
  KeyPose key;
  key.pelvis = {0.15 * at[0], -0.02, -0.02};
  key.pelvis_turn = {5, 3 + 14 * at[0], 0};
  key.spine = {8 - 20 * at[1], 6 + 30 * at[0], 0};
  key.head = {4 - 30 * at[1], -2 + 40 * at[0], 0};
  const Vector hang = hanging_wrist(actor.sizes, kLeft);
  key.left = {hang + Vector(0.01, 0.05 - 0.1 * at[0], 0.02), {0, 0, 0}, 26};
  key.right = {{-0.14 + at[0], place.reach - kPalmToSurface, place.height + at[1]}, {0, 0, 0}, 6};
  motion.keys = {key};
  return motion;
}

/// A can in the right hand goes along over the flowers.
KeyedMotion water_motion(const Actor& actor) {
  const double far = std::clamp(actor.place->reach - 0.36, 0.34, 0.5);
  const Vector hang = hanging_wrist(actor.sizes, kLeft);
  KeyedMotion motion;
  motion.ground = actor.place->ground;
  motion.feet = {planted_foot(0.13, 0.06, 10), planted_foot(-0.13, -0.06, -16)};
  motion.hands_hang = false;
  const auto left = [&](double forward, double up) { return HandKey{hang + Vector(0.01, forward, up), {0, 0, 0}, 26}; };
  motion.keys = {holding(0, {0, -0.01, -0.014}, {1, 0, 0}, {3, -2, 0}, {14, 0, 0}, {-0.19, far - 0.1, 0.97}, {0, 0, 0},
                         60, left(0, 0)),
                 holding(0.9, {0.01, 0.0, -0.025}, {5, 0, 0}, {10, -2, 0}, {20, 0, 0}, {-0.16, far, 1.0}, {24, 0, 6},
                         60, left(0.04, 0.02)),
                 holding(2.0, {0.03, 0.01, -0.03}, {6, 7, 1}, {12, 9, 0}, {20, 8, 0}, {-0.02, far + 0.02, 1.0},
                         {32, 0, 22}, 60, left(0.07, 0.04)),
                 holding(3.2, {-0.02, 0.01, -0.03}, {6, -7, -1}, {12, -8, 0}, {20, -8, 0}, {-0.27, far, 1.0},
                         {32, 0, -8}, 60, left(0.0, 0.02)),
                 holding(4.2, {0.01, 0.01, -0.03}, {7, 2, 0}, {13, 2, 0}, {22, 2, 0}, {-0.12, far + 0.03, 0.98},
                         {36, 0, 10}, 60, left(0.05, 0.03)),
                 holding(kLength, {0, -0.01, -0.016}, {1, 0, 0}, {4, 0, 0}, {14, 0, 0}, {-0.18, far - 0.08, 0.98},
                         {4, 0, 2}, 60, left(0.01, 0.01))};
  return motion;
}

KeyedMotion motion_at(const Actor& actor, double seconds) {
  switch (actor.motion) {
    case SyntheticMotionKind::kSitOn:
      return sit_on_motion(actor);
    case SyntheticMotionKind::kLeanOn:
      return lean_on_motion(actor);
    case SyntheticMotionKind::kReach:
      return reach_motion(actor);
    case SyntheticMotionKind::kWipe:
      return wipe_motion(actor, seconds);
    default:
      return water_motion(actor);
  }
}

}  // namespace

Moment placed_moment(const Actor& actor, double seconds) {
  const KeyedMotion motion = motion_at(actor, seconds);
  const KeyPose key = key_at(motion.keys, time_in_clip(seconds, kLength));
  Moment moment;
  moment.figure = keyed_figure(actor, motion, key);
  if (actor.motion == SyntheticMotionKind::kWipe)  // the palm on the surface
    moment.figure.hands[kRight].turn = hand_turn(motion.ground, {0.5, 0, 0.87}, {0.87, 0, -0.5}, kRight);
  if (!actor.object.exists()) return moment;
  const ObjectPlace at{actor.object.grip, key.object, key.object_turn};
  moment.object = object_on(motion.ground, at);
  moment.in_hand = true;
  hold_object(actor, at, key.away, key.grip, moment);
  return moment;
}

}  // namespace hsi4d::detail
