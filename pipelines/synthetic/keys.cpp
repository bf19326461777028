// Motions on the spot, from keyframes: pour, lift, put_down, sit, lean, wave, open.
//
// Before an effort there is a key that goes the other way
// (the knees give before something is lifted, the trunk leans forward before one sits).
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/angles.h"
#include "core/quaternion.h"
#include "core/rotation.h"
#include "pipelines/synthetic/keyframes.h"
#include "pipelines/synthetic/motion.h"

namespace hsi4d::detail {
namespace {

using Vector = Vector3<double>;

const Ground kBesideTable{{0.22, 0.8}, -58};

KeyedMotion pour_motion() {
  KeyedMotion motion;
  motion.ground = kBesideTable;
  motion.feet = {planted_foot(0.15, 0.08, 14), planted_foot(-0.15, -0.08, -16)};
  motion.hands_hang = motion.shares_turn = false;
  motion.keys = {holding(0, {-0.02, 0.07, -0.12}, {14, -6, 0}, {26, -10, 2}, {14, -6, 0}, {-0.1, 0.58, 0.92}, {0, 0, 0},
                         52, {{0.27, 0.2, 0.78}, {0, 0, 0}, 14}),
                 holding(0.7, {0.04, -0.05, -0.02}, {2, 6, 1}, {4, 8, -2}, {16, 4, 0}, {-0.08, 0.4, 1.06}, {20, 0, 6},
                         62, {{0.22, 0.25, 1.05}, {12, 0, 16}, 42}),
                 holding(1.5, {0.07, -0.02, -0.03}, {3, 14, 3}, {6, 22, -3}, {20, 10, 0}, {0.02, 0.42, 1.1},
                         {42, 0, 16}, 64, {{0.28, 0.27, 1.07}, {10, 0, 10}, 30}),
                 holding(2.3, {0.1, 0.02, -0.05}, {6, 16, 3}, {12, 20, -4}, {24, 10, 0}, {0.06, 0.46, 1.06},
                         {52, 0, 22}, 64, {{0.3, 0.27, 1.03}, {6, 0, 4}, 22}),
                 holding(kClipSeconds, {0.03, -0.04, -0.02}, {2, 4, 0}, {2, 4, 0}, {8, 0, 0}, {-0.06, 0.38, 1.02},
                         {6, 0, 4}, 60, {{0.22, 0.25, 1}, {8, 0, 6}, 36})};
  return motion;
}

/// @param begin  height of the grip of what stands there
KeyedMotion lift_motion(double begin, bool two_hands) {
  const double stoop = std::clamp((0.92 - begin) / 0.3, 0.0, 2.0), left = two_hands ? 0.0 : -0.1;
  const double high = stoop > 0.5 ? 1.14 : 1.33;  // what stood on the floor is tall
  const double across = two_hands ? 0.0 : 1.0;    // a handle is turned across, or the wrist would not follow
  const Vector there(left, 0.52, begin), begin_turn(0, 0, stoop > 0.5 ? 0.0 : 40 * across);
  KeyedMotion motion;
  motion.ground = kBesideTable;
  motion.feet = {planted_foot(0.15, 0.06, 12), planted_foot(-0.15, -0.05, -14)};
  motion.keys = {
      holding(0, {-0.01, 0.03, -0.05 - 0.04 * stoop}, {7, -3, 0}, {14 + 6 * stoop, -5, 1}, {16, -4, 0}, there,
              begin_turn, 16, {{0.02, 0.06 + 0.1 * stoop, 0.02 - 0.12 * stoop}, {0, 0, 0}, 22}, {},
              {two_hands ? 0.0 : -0.04, -0.11, 0.13}),
      holding(0.55, {-0.02, 0.06, -0.1 - 0.09 * stoop}, {13, -6, 0}, {23 + 9 * stoop, -9, 2}, {14, -6, 0}, there,
              begin_turn, 30, {{0.05 - 0.06 * stoop, 0.12 + 0.16 * stoop, 0.06 - 0.3 * stoop}, {0, 0, 0}, 24}),
      // the fingers close, the knees give
      holding(0.85, {-0.02, 0.05, -0.125 - 0.1 * stoop}, {14, -6, 0}, {24 + 9 * stoop, -9, 2}, {12, -6, 0}, there,
              begin_turn, 60, {{0.05 - 0.06 * stoop, 0.12 + 0.16 * stoop, 0.06 - 0.3 * stoop}, {0, 0, 0}, 26}),
      holding(1.6, {0.02, -0.05, -0.03}, {2, 2, 0}, {0, 2, -2}, {16, 2, 0}, {0.8 * left, 0.4, 1.1},
              {-6, 0, 4 + 36 * across}, 64, {{0.06, 0.03, 0.03}, {0, 0, 0}, 28}),
      holding(2.25, {0.04, -0.03, -0.025}, {1, 14, 2}, {-2, 18, -2}, {2, 8, 0}, {left + 0.14, 0.37, high - 0.03},
              {-10, 0, 26 + 54 * across}, 64, {{0.05, 0.02, 0.02}, {0, 0, 0}, 26}),
      holding(kClipSeconds, {0.03, -0.03, -0.025}, {1, 12, 1}, {-3, 15, -1}, {-2, 6, 0}, {left + 0.1, 0.38, high},
              {6, 0, 20 + 56 * across}, 64, {{0.05, 0.02, 0.02}, {0, 0, 0}, 26})};
  return motion;
}

/// From before the chest to a table and out of the hands.
KeyedMotion put_down_motion(bool two_hands) {
  const double left = two_hands ? 0.0 : -0.1, across = two_hands ? 0.0 : 40.0;
  const Vector there(left, 0.52, 0.92), there_turn(0, 0, across);
  KeyedMotion motion;
  motion.ground = kBesideTable;
  motion.feet = {planted_foot(0.15, 0.06, 12), planted_foot(-0.15, -0.05, -14)};
  const HandKey beside = {{0.05, 0.03, 0.02}, {0, 0, 0}, 26}, ahead = {{0.05, 0.12, 0.06}, {0, 0, 0}, 24};
  motion.keys = {
      holding(0, {0.03, -0.03, -0.025}, {1, 6, 1}, {-3, 8, -1}, {-2, 4, 0}, {left + 0.05, 0.38, 1.3},
              {3, 0, 8 + 1.6 * across}, 64, beside),
      holding(0.9, {0.02, -0.04, -0.03}, {2, 2, 0}, {0, 2, -2}, {12, 2, 0}, {0.8 * left, 0.4, 1.16},
              {-4, 0, 4 + across}, 64, beside),
      holding(1.6, {-0.02, 0.05, -0.1}, {13, -6, 0}, {23, -9, 2}, {12, -6, 0}, there, there_turn, 60, ahead),
      // the fingers open before the hands leave
      holding(1.85, {-0.02, 0.05, -0.1}, {13, -6, 0}, {23, -9, 2}, {12, -6, 0}, there, there_turn, 26, ahead),
      holding(2.5, {0, -0.02, -0.03}, {3, -2, 0}, {5, -3, 1}, {8, -2, 0}, there, there_turn, 18, beside, {},
              {0, -0.2, 0.12}),
      holding(kClipSeconds, {0.01, -0.03, -0.02}, {0, 0, 0}, {0, 0, 0}, {2, 4, 0}, there, there_turn, 20, beside, {},
              {0, -0.24, 0.14})};
  return motion;
}

/// A bar from the floor, with a straight back, until one stands.
/// @param begin  height of the bar on the floor
KeyedMotion heavy_lift_motion(const FigureSizes& sizes, double begin) {
  const double hangs = sizes.shoulder - 0.975 * sizes.arm - 0.09;
  const Vector floor(0, 0.2, begin);
  KeyedMotion motion;
  motion.ground = {{0, 0.7}, -28};
  motion.feet = {planted_foot(0.15, 0, 14), planted_foot(-0.15, 0, -14)};
  motion.keys = {
      holding(0, {0, -0.24, -0.36}, {42, 0, 0}, {34, 0, 0}, {-34, 0, 0}, floor, {0, 0, 0}, 62),
      // the hips go down before the bar comes up
      holding(0.35, {0, -0.25, -0.39}, {41, 0, 0}, {33, 0, 0}, {-34, 0, 0}, floor, {0, 0, 0}, 66),
      holding(1.2, {0, -0.17, -0.16}, {33, 0, 0}, {24, 0, 0}, {-26, 0, 0}, {0, 0.18, 0.5 * (begin + hangs) + 0.05},
              {0, 0, 0}, 66),
      holding(2.1, {0, 0.01, -0.012}, {-1, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0.14, hangs + 0.035}, {0, 0, 0}, 66),
      // leans back a little under the weight
      holding(kClipSeconds, {0, 0.03, -0.014}, {-3, 0, 0}, {-4, 0, 0}, {2, 4, 0}, {0, 0.14, hangs + 0.05}, {0, 0, 0},
              66)};
  return motion;
}

/// The object is the seat. @param seat  of the pelvis when it sits, against standing
KeyedMotion sit_motion(double seat, double chair_grip) {
  const Vector chair(0, -0.41, chair_grip);  // the middle of its seat
  const HandKey left_leans = {{-0.03, 0.12, -0.04}, {25, 0, 0}, 20},
                right_leans = {{0.03, 0.12, -0.04}, {25, 0, 0}, 20};
  KeyedMotion motion;
  motion.ground = {{0.05, 0.55}, -40};
  motion.feet = {planted_foot(0.13, 0.03, 9), planted_foot(-0.13, -0.01, -11)};
  const auto on_thigh = [&](double left, double forward, double up) {
    return HandKey{{left, forward, up}, {45, 0, 0}, 24};
  };
  motion.keys = {holding(0, {0, 0, -0.012}, {0, 0, 0}, {1, 0, 0}, {0, 0, 0}, chair),
                 // the trunk goes forward first
                 holding(0.4, {0, -0.1, -0.06}, {16, 0, 0}, {14, 0, 0}, {-6, 0, 0}, chair, {0, 0, 0}, 60,
                         {{-0.01, 0.14, 0.06}, {6, 0, 0}, 20}, {{0.01, 0.14, 0.06}, {6, 0, 0}, 20}),
                 holding(1.25, {0, -0.35, seat + 0.05}, {24, 0, 0}, {22, 0, 0}, {-18, 0, 0}, chair, {0, 0, 0}, 60,
                         left_leans, right_leans),
                 holding(1.6, {0, -0.395, seat}, {8, 0, 0}, {12, 0, 0}, {-8, 0, 0}, chair, {0, 0, 0}, 60,
                         on_thigh(-0.1, -0.06, -0.25), on_thigh(0.1, -0.06, -0.25)),
                 holding(2.1, {0, -0.415, seat}, {-8, 0, 0}, {3, 0, 0}, {2, 0, 0}, chair, {0, 0, 0}, 60,
                         on_thigh(-0.1, -0.1, -0.25), on_thigh(0.1, -0.1, -0.25)),
                 // turns on the seat
                 holding(kClipSeconds, {0, -0.415, seat}, {-8, 17, 0}, {3, 8, 0}, {4, 14, 0}, chair, {0, 0, 17}, 60,
                         on_thigh(-0.13, -0.13, -0.25), on_thigh(0.06, -0.05, -0.25))};
  return motion;
}

KeyedMotion lean_motion(bool on_chair, double chair_grip) {
  KeyedMotion motion;
  motion.ground = {{0.3, 0.75}, on_chair ? -62.0 : -35.0};
  motion.feet = {planted_foot(0.14, 0.07, 12), planted_foot(-0.14, -0.07, -14)};
  const double far = 0.44;
  const auto on_knee = [&](double left, double forward, double up) {
    return HandKey{{left, forward, up}, {50, 0, 0}, 26};
  };
  motion.keys = {
      holding(0, {0, -0.01, -0.02}, {3, 0, 0}, {5, 0, 0}, {6, 0, 0}, {0, far, chair_grip}, {0, 0, 0}, 48),
      // back before forward
      holding(0.3, {0, -0.03, -0.03}, {1, 0, 0}, {2, 0, 0}, {4, 0, 0}, {0, far - 0.01, chair_grip}, {0, 0, 0}, 54),
      holding(1.15, {0.02, -0.16, -0.07}, {on_chair ? 26.0 : 34.0, 0, 2}, {on_chair ? 24.0 : 30.0, 0, -2},
              {on_chair ? -16.0 : -22.0, 0, 0}, {0, far + 0.07, chair_grip}, {0, 0, 0}, 58, on_knee(-0.1, 0.2, -0.16),
              on_knee(0.1, 0.2, -0.16)),
      holding(2.0, {0.055, -0.15, -0.075}, {on_chair ? 27.0 : 35.0, 5, 5}, {on_chair ? 23.0 : 28.0, 7, -6},
              {on_chair ? -18.0 : -24.0, 22, 0}, {0.03, far + 0.1, chair_grip}, {0, 0, 12}, 58,
              on_knee(-0.09, 0.2, -0.16), on_knee(0.11, 0.2, -0.16)),
      holding(kClipSeconds, {-0.02, -0.1, -0.05}, {15, -3, -2}, {16, -4, 2}, {-8, -12, 0},
              {-0.02, far + 0.05, chair_grip}, {0, 0, -8}, 56, on_knee(-0.05, 0.12, 0.0), on_knee(0.05, 0.12, 0.0))};
  return motion;
}

KeyedMotion wave_motion(const Vector& carried) {
  KeyedMotion motion;
  motion.ground = {{0.1, 0.7}, -20};
  motion.feet = {planted_foot(0.12, 0.03, 10), planted_foot(-0.12, -0.02, -12)};
  motion.keys = {
      holding(0, {0, 0, -0.012}, {0, 0, 0}, {2, 0, 0}, {0, 0, 0}, carried),
      // the weight goes to the other leg
      holding(0.25, {-0.02, 0, -0.016}, {0, 0, 1}, {3, 0, 1}, {0, 0, 0}, carried, {0, 0, 0}, 60,
              {{0.01, -0.03, 0.005}, {0, 0, 0}, 24}),
      holding(0.95, {-0.035, -0.01, -0.018}, {0, 3, 2}, {-2, 5, 4}, {-3, 6, -4}, carried + Vector(-0.01, 0, 0.01)),
      holding(2.2, {-0.03, -0.01, -0.018}, {0, 4, 2}, {-2, 6, 5}, {-3, 8, 4}, carried + Vector(-0.01, 0, 0.015)),
      holding(kClipSeconds, {-0.01, 0, -0.014}, {0, 0, 0}, {0, 2, 1}, {2, 3, 0}, carried)};
  return motion;
}

/// The object turns about its hinge, and pulls and pushes the right hand along.
KeyedMotion open_motion() {
  const Vector hinge(0.42, 0.5, 0);
  const auto at = [&hinge](double seconds, const Vector& pelvis, const Vector& pelvis_turn, const Vector& spine,
                           const Vector& head, double opened_deg, const HandKey& left) {
    return holding(seconds, pelvis, pelvis_turn, spine, head, hinge, {0, 0, opened_deg - 20}, 64, left);
  };
  KeyedMotion motion;
  motion.ground = {{0.25, 0.85}, -100};
  motion.feet = {planted_foot(0.12, 0.1, 10), planted_foot(-0.13, -0.1, -14)};
  motion.keys = {
      at(0, {0, -0.02, -0.02}, {2, -4, 0}, {4, -4, 0}, {14, 4, 0}, 0, {{0, 0.02, 0}, {0, 0, 0}, 24}),
      // the weight goes back before it goes forward
      at(0.35, {0, -0.045, -0.03}, {1, -5, 0}, {2, -5, 0}, {15, 4, 0}, 0.5, {{0, 0.03, 0}, {0, 0, 0}, 24}),
      at(1.6, {0.01, 0.03, -0.03}, {6, 4, 0}, {9, 6, 0}, {8, 4, 0}, 26, {{0.02, -0.02, 0.01}, {0, 0, 0}, 26}),
      at(2.5, {0.02, 0.07, -0.045}, {9, 9, 0}, {13, 11, 0}, {2, 2, 0}, 42, {{0.03, -0.05, 0.02}, {0, 0, 0}, 26}),
      at(kClipSeconds, {0.02, 0.08, -0.05}, {10, 10, 0}, {14, 12, 0}, {0, 0, 0}, 45,
         {{0.03, -0.05, 0.02}, {0, 0, 0}, 26})};
  return motion;
}

/// The waving hand: raised from where it hangs, then from side to side with the forearm and the wrist after it.
void wave_hand(const Actor& actor, const Ground& ground, double t, FigureHand& hand) {
  const double raised = smooth_step((t - 0.2) / 0.75) * (1 - 0.75 * smooth_step((t - 2.2) / 0.75));
  const double waving = smooth_step((t - 0.8) / 0.3) * (1 - smooth_step((t - 2.1) / 0.4));
  const double phase = 2 * kPi * 1.5 * (t - 0.8);
  const Vector hangs = hanging_wrist(actor.sizes, kLeft);
  const double side = actor.sizes.shoulder_width / 2 + 0.24;
  const Vector up(side + 0.11 * waving * std::sin(phase), 0.2, actor.sizes.shoulder + 0.14);
  const Vector bow(0.16 * std::sin(kPi * raised), 0.2 * std::sin(kPi * raised), 0);  // around the body, not through it
  hand.wrist = ground.point(hangs + raised * (up - hangs) + bow);
  hand.elbow = ground.direction({0.75, -0.35, -0.6});
  const double tilt = 20 * kDegree * waving * std::sin(phase - 0.5);
  const auto frame = [&](const Vector& fingers, const Vector& back) {
    Matrix3<double> turn;
    const Vector x = ground.direction(fingers), y = ground.direction(back);
    turn << x, y, cross(x, y);
    return turn;
  };
  const Matrix3<double> down = frame({0, 0, -1}, {1, 0, 0});
  const Matrix3<double> shown = frame({std::sin(tilt), 0, std::cos(tilt)}, {0, -1, 0});
  const Vector4<double> q = slerp(quaternion_from_matrix(down), quaternion_from_matrix(shown), raised);
  hand.turn = so3_exp(quaternion_log(q));
  hand.curl_deg = 22 - 16 * raised;
}

KeyedMotion motion_of(const Actor& actor) {
  const SyntheticObject& object = actor.object;
  const double ground_to_grip = object.above_ground + object.grip.z();
  switch (actor.motion) {
    case SyntheticMotionKind::kLift: {
      if (object.is_heavy) return heavy_lift_motion(actor.sizes, ground_to_grip);
      const bool two_hands = object.hands[kLeft] && object.hands[kRight];
      return lift_motion(object.on_floor ? ground_to_grip + 0.03 : 0.92, two_hands);
    }
    case SyntheticMotionKind::kPutDown:
      return put_down_motion(object.hands[kLeft] && object.hands[kRight]);
    case SyntheticMotionKind::kSit:
      return sit_motion(kChairSeat + 0.085 - actor.sizes.standing, ground_to_grip);
    case SyntheticMotionKind::kLean:
      return lean_motion(object.exists(), ground_to_grip);
    case SyntheticMotionKind::kWave:
      return wave_motion(object.carried);
    case SyntheticMotionKind::kOpen:
      return open_motion();
    default:
      return pour_motion();
  }
}

}  // namespace

Moment keyed_moment(const Actor& actor, double seconds) {
  const KeyedMotion motion = motion_of(actor);
  const double t = time_in_clip(seconds, kClipSeconds);
  const KeyPose key = key_at(motion.keys, t);
  const Ground& ground = motion.ground;
  Moment moment;
  FigureTarget& figure = moment.figure;
  figure = keyed_figure(actor, motion, key);
  for (const int side : {kLeft, kRight}) {
    const auto i = static_cast<std::size_t>(side);
    const bool reaches = actor.motion == SyntheticMotionKind::kLift || actor.motion == SyntheticMotionKind::kPutDown;
    if (reaches && actor.object.hands[i])
      figure.hands[i].elbow = ground.direction({side == kLeft ? 0.9 : -0.9, -0.2, -0.3});
  }
  if (actor.motion == SyntheticMotionKind::kWave) wave_hand(actor, ground, t, figure.hands[kLeft]);
  if (!actor.object.exists()) return moment;
  const bool sits = actor.motion == SyntheticMotionKind::kSit;
  const Vector pivot = actor.object.grip + (sits ? Vector(kChairBack, 0, 0) : Vector(0, 0, 0));
  const ObjectPlace at{actor.object.hinge.value_or(pivot), key.object, key.object_turn};
  moment.object = object_on(ground, at);
  const bool is_free =
      sits || actor.motion == SyntheticMotionKind::kLean || actor.object.is_heavy || actor.object.hinge.has_value();
  moment.in_hand = !is_free && key.away.norm() == 0;
  if (!sits) hold_object(actor, at, key.away, key.grip, moment);
  return moment;
}

}  // namespace hsi4d::detail
