// Motions on the spot, from keyframes: pour, lift, sit, lean, wave.
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
  motion.keys = {{.seconds = 0,
                  .pelvis = {-0.02, 0.07, -0.12},
                  .pelvis_turn = {14, -6, 0},
                  .spine = {26, -10, 2},
                  .head = {14, -6, 0},
                  .object = {-0.1, 0.58, 0.92},
                  .grip = 52,
                  .left = {{0.27, 0.2, 0.78}, {0, 0, 0}, 14}},
                 {.seconds = 0.7,
                  .pelvis = {0.04, -0.05, -0.02},
                  .pelvis_turn = {2, 6, 1},
                  .spine = {4, 8, -2},
                  .head = {16, 4, 0},
                  .object = {-0.08, 0.4, 1.06},
                  .object_turn = {20, 0, 6},
                  .grip = 62,
                  .left = {{0.22, 0.25, 1.05}, {12, 0, 16}, 42}},
                 {.seconds = 1.5,
                  .pelvis = {0.07, -0.02, -0.03},
                  .pelvis_turn = {3, 14, 3},
                  .spine = {6, 22, -3},
                  .head = {20, 10, 0},
                  .object = {0.02, 0.42, 1.1},
                  .object_turn = {42, 0, 16},
                  .grip = 64,
                  .left = {{0.28, 0.27, 1.07}, {10, 0, 10}, 30}},
                 {.seconds = 2.3,
                  .pelvis = {0.1, 0.02, -0.05},
                  .pelvis_turn = {6, 16, 3},
                  .spine = {12, 20, -4},
                  .head = {24, 10, 0},
                  .object = {0.06, 0.46, 1.06},
                  .object_turn = {52, 0, 22},
                  .grip = 64,
                  .left = {{0.3, 0.27, 1.03}, {6, 0, 4}, 22}},
                 {.seconds = kClipSeconds,
                  .pelvis = {0.03, -0.04, -0.02},
                  .pelvis_turn = {2, 4, 0},
                  .spine = {2, 4, 0},
                  .head = {8, 0, 0},
                  .object = {-0.06, 0.38, 1.02},
                  .object_turn = {6, 0, 4},
                  .grip = 60,
                  .left = {{0.22, 0.25, 1}, {8, 0, 6}, 36}}};
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
  motion.keys = {{.seconds = 0,
                  .pelvis = {-0.01, 0.03, -0.05 - 0.04 * stoop},
                  .pelvis_turn = {7, -3, 0},
                  .spine = {14 + 6 * stoop, -5, 1},
                  .head = {16, -4, 0},
                  .object = there,
                  .object_turn = begin_turn,
                  .away = {two_hands ? 0.0 : -0.04, -0.11, 0.13},
                  .grip = 16,
                  .left = {{0.02, 0.06 + 0.1 * stoop, 0.02 - 0.12 * stoop}, {0, 0, 0}, 22}},
                 {.seconds = 0.55,
                  .pelvis = {-0.02, 0.06, -0.1 - 0.09 * stoop},
                  .pelvis_turn = {13, -6, 0},
                  .spine = {23 + 9 * stoop, -9, 2},
                  .head = {14, -6, 0},
                  .object = there,
                  .object_turn = begin_turn,
                  .grip = 30,
                  .left = {{0.05 - 0.06 * stoop, 0.12 + 0.16 * stoop, 0.06 - 0.3 * stoop}, {0, 0, 0}, 24}},
                 {.seconds = 0.85,  // the fingers close, the knees give
                  .pelvis = {-0.02, 0.05, -0.125 - 0.1 * stoop},
                  .pelvis_turn = {14, -6, 0},
                  .spine = {24 + 9 * stoop, -9, 2},
                  .head = {12, -6, 0},
                  .object = there,
                  .object_turn = begin_turn,
                  .grip = 60,
                  .left = {{0.05 - 0.06 * stoop, 0.12 + 0.16 * stoop, 0.06 - 0.3 * stoop}, {0, 0, 0}, 26}},
                 {.seconds = 1.6,
                  .pelvis = {0.02, -0.05, -0.03},
                  .pelvis_turn = {2, 2, 0},
                  .spine = {0, 2, -2},
                  .head = {16, 2, 0},
                  .object = {0.8 * left, 0.4, 1.1},
                  .object_turn = {-6, 0, 4 + 36 * across},
                  .grip = 64,
                  .left = {{0.06, 0.03, 0.03}, {0, 0, 0}, 28}},
                 {.seconds = 2.25,
                  .pelvis = {0.04, -0.03, -0.025},
                  .pelvis_turn = {1, 14, 2},
                  .spine = {-2, 18, -2},
                  .head = {2, 8, 0},
                  .object = {left + 0.14, 0.37, high - 0.03},
                  .object_turn = {-10, 0, 26 + 54 * across},
                  .grip = 64,
                  .left = {{0.05, 0.02, 0.02}, {0, 0, 0}, 26}},
                 {.seconds = kClipSeconds,
                  .pelvis = {0.03, -0.03, -0.025},
                  .pelvis_turn = {1, 12, 1},
                  .spine = {-3, 15, -1},
                  .head = {-2, 6, 0},
                  .object = {left + 0.1, 0.38, high},
                  .object_turn = {6, 0, 20 + 56 * across},
                  .grip = 64,
                  .left = {{0.05, 0.02, 0.02}, {0, 0, 0}, 26}}};
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
  motion.keys = {{.seconds = 0,
                  .pelvis = {0, -0.24, -0.36},
                  .pelvis_turn = {42, 0, 0},
                  .spine = {34, 0, 0},
                  .head = {-34, 0, 0},
                  .object = floor,
                  .grip = 62},
                 {.seconds = 0.35,  // the hips go down before the bar comes up
                  .pelvis = {0, -0.25, -0.39},
                  .pelvis_turn = {41, 0, 0},
                  .spine = {33, 0, 0},
                  .head = {-34, 0, 0},
                  .object = floor,
                  .grip = 66},
                 {.seconds = 1.2,
                  .pelvis = {0, -0.17, -0.16},
                  .pelvis_turn = {33, 0, 0},
                  .spine = {24, 0, 0},
                  .head = {-26, 0, 0},
                  .object = {0, 0.18, 0.5 * (begin + hangs) + 0.05},
                  .grip = 66},
                 {.seconds = 2.1,
                  .pelvis = {0, 0.01, -0.012},
                  .pelvis_turn = {-1, 0, 0},
                  .spine = {0, 0, 0},
                  .head = {0, 0, 0},
                  .object = {0, 0.14, hangs + 0.035},
                  .grip = 66},
                 {.seconds = kClipSeconds,  // leans back a little under the weight
                  .pelvis = {0, 0.03, -0.014},
                  .pelvis_turn = {-3, 0, 0},
                  .spine = {-4, 0, 0},
                  .head = {2, 4, 0},
                  .object = {0, 0.14, hangs + 0.05},
                  .grip = 66}};
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
  motion.keys = {{.seconds = 0, .pelvis = {0, 0, -0.012}, .spine = {1, 0, 0}, .object = chair},
                 {.seconds = 0.4,  // the trunk goes forward first
                  .pelvis = {0, -0.1, -0.06},
                  .pelvis_turn = {16, 0, 0},
                  .spine = {14, 0, 0},
                  .head = {-6, 0, 0},
                  .object = chair,
                  .left = {{-0.01, 0.14, 0.06}, {6, 0, 0}, 20},
                  .right = {{0.01, 0.14, 0.06}, {6, 0, 0}, 20}},
                 {.seconds = 1.25,
                  .pelvis = {0, -0.35, seat + 0.05},
                  .pelvis_turn = {24, 0, 0},
                  .spine = {22, 0, 0},
                  .head = {-18, 0, 0},
                  .object = chair,
                  .left = left_leans,
                  .right = right_leans},
                 {.seconds = 1.6,
                  .pelvis = {0, -0.395, seat},
                  .pelvis_turn = {8, 0, 0},
                  .spine = {12, 0, 0},
                  .head = {-8, 0, 0},
                  .object = chair,
                  .left = on_thigh(-0.1, -0.06, -0.25),
                  .right = on_thigh(0.1, -0.06, -0.25)},
                 {.seconds = 2.1,
                  .pelvis = {0, -0.415, seat},
                  .pelvis_turn = {-8, 0, 0},
                  .spine = {3, 0, 0},
                  .head = {2, 0, 0},
                  .object = chair,
                  .left = on_thigh(-0.1, -0.1, -0.25),
                  .right = on_thigh(0.1, -0.1, -0.25)},
                 {.seconds = kClipSeconds,  // turns on the seat
                  .pelvis = {0, -0.415, seat},
                  .pelvis_turn = {-8, 17, 0},
                  .spine = {3, 8, 0},
                  .head = {4, 14, 0},
                  .object = chair,
                  .object_turn = {0, 0, 17},
                  .left = on_thigh(-0.13, -0.13, -0.25),
                  .right = on_thigh(0.06, -0.05, -0.25)}};
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
  motion.keys = {{.seconds = 0,
                  .pelvis = {0, -0.01, -0.02},
                  .pelvis_turn = {3, 0, 0},
                  .spine = {5, 0, 0},
                  .head = {6, 0, 0},
                  .object = {0, far, chair_grip},
                  .grip = 48},
                 {.seconds = 0.3,  // back before forward
                  .pelvis = {0, -0.03, -0.03},
                  .pelvis_turn = {1, 0, 0},
                  .spine = {2, 0, 0},
                  .head = {4, 0, 0},
                  .object = {0, far - 0.01, chair_grip},
                  .grip = 54},
                 {.seconds = 1.15,
                  .pelvis = {0.02, -0.16, -0.07},
                  .pelvis_turn = {on_chair ? 26.0 : 34.0, 0, 2},
                  .spine = {on_chair ? 24.0 : 30.0, 0, -2},
                  .head = {on_chair ? -16.0 : -22.0, 0, 0},
                  .object = {0, far + 0.07, chair_grip},
                  .grip = 58,
                  .left = on_knee(-0.1, 0.2, -0.16),
                  .right = on_knee(0.1, 0.2, -0.16)},
                 {.seconds = 2.0,
                  .pelvis = {0.055, -0.15, -0.075},
                  .pelvis_turn = {on_chair ? 27.0 : 35.0, 5, 5},
                  .spine = {on_chair ? 23.0 : 28.0, 7, -6},
                  .head = {on_chair ? -18.0 : -24.0, 22, 0},
                  .object = {0.03, far + 0.1, chair_grip},
                  .object_turn = {0, 0, 12},
                  .grip = 58,
                  .left = on_knee(-0.09, 0.2, -0.16),
                  .right = on_knee(0.11, 0.2, -0.16)},
                 {.seconds = kClipSeconds,
                  .pelvis = {-0.02, -0.1, -0.05},
                  .pelvis_turn = {15, -3, -2},
                  .spine = {16, -4, 2},
                  .head = {-8, -12, 0},
                  .object = {-0.02, far + 0.05, chair_grip},
                  .object_turn = {0, 0, -8},
                  .grip = 56,
                  .left = on_knee(-0.05, 0.12, 0.0),
                  .right = on_knee(0.05, 0.12, 0.0)}};
  return motion;
}

KeyedMotion wave_motion(const Vector& carried) {
  KeyedMotion motion;
  motion.ground = {{0.1, 0.7}, -20};
  motion.feet = {planted_foot(0.12, 0.03, 10), planted_foot(-0.12, -0.02, -12)};
  motion.keys = {{.seconds = 0, .pelvis = {0, 0, -0.012}, .spine = {2, 0, 0}, .object = carried},
                 {.seconds = 0.25,  // the weight goes to the other leg
                  .pelvis = {-0.02, 0, -0.016},
                  .pelvis_turn = {0, 0, 1},
                  .spine = {3, 0, 1},
                  .object = carried,
                  .left = {{0.01, -0.03, 0.005}, {0, 0, 0}, 24}},
                 {.seconds = 0.95,
                  .pelvis = {-0.035, -0.01, -0.018},
                  .pelvis_turn = {0, 3, 2},
                  .spine = {-2, 5, 4},
                  .head = {-3, 6, -4},
                  .object = carried + Vector(-0.01, 0, 0.01)},
                 {.seconds = 2.2,
                  .pelvis = {-0.03, -0.01, -0.018},
                  .pelvis_turn = {0, 4, 2},
                  .spine = {-2, 6, 5},
                  .head = {-3, 8, 4},
                  .object = carried + Vector(-0.01, 0, 0.015)},
                 {.seconds = kClipSeconds,
                  .pelvis = {-0.01, 0, -0.014},
                  .spine = {0, 2, 1},
                  .head = {2, 3, 0},
                  .object = carried}};
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
    case SyntheticMotionKind::kSit:
      return sit_motion(kChairSeat + 0.085 - actor.sizes.standing, ground_to_grip);
    case SyntheticMotionKind::kLean:
      return lean_motion(object.exists(), ground_to_grip);
    case SyntheticMotionKind::kWave:
      return wave_motion(object.carried);
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
    if (actor.motion == SyntheticMotionKind::kLift && actor.object.hands[i])
      figure.hands[i].elbow = ground.direction({side == kLeft ? 0.9 : -0.9, -0.2, -0.3});
  }
  if (actor.motion == SyntheticMotionKind::kWave) wave_hand(actor, ground, t, figure.hands[kLeft]);
  if (!actor.object.exists()) return moment;
  const bool sits = actor.motion == SyntheticMotionKind::kSit;
  const ObjectPlace at{actor.object.grip + (sits ? Vector(kChairBack, 0, 0) : Vector(0, 0, 0)), key.object,
                       key.object_turn};
  moment.object = object_on(ground, at);
  const bool is_free = sits || actor.motion == SyntheticMotionKind::kLean || actor.object.is_heavy;
  moment.in_hand = !is_free && key.away.norm() == 0;
  if (!sits) hold_object(actor, at, key.away, key.grip, moment);
  return moment;
}

}  // namespace hsi4d::detail
