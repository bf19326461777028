#include "pipelines/synthetic/keyframes.h"

#include <algorithm>
#include <cmath>

#include "core/angles.h"
#include "core/quaternion.h"

namespace hsi4d::detail {
namespace {

using Vector = Vector3<double>;

/// From 0 to 1: constant acceleration, constant speed (1.25 of the mean), constant braking.
double eased(double x) {
  constexpr double kRamp = 0.2, kSpeed = 1 / (1 - kRamp);
  if (x < kRamp) return kSpeed * x * x / (2 * kRamp);
  if (x > 1 - kRamp) return 1 - kSpeed * (1 - x) * (1 - x) / (2 * kRamp);
  return kSpeed * (x - kRamp / 2);
}

Vector slerped(const Vector& a, const Vector& b, double part) {
  const Vector4<double> q0 = quaternion_exp(Vector(a * kDegree)), q1 = quaternion_exp(Vector(b * kDegree));
  return quaternion_log(slerp(q0, q1, part)) / kDegree;
}

HandKey between(const HandKey& a, const HandKey& b, double part) {
  return {a.wrist + (b.wrist - a.wrist) * part, slerped(a.turn, b.turn, part), a.curl + (b.curl - a.curl) * part};
}

KeyPose between(const KeyPose& a, const KeyPose& b, double part) {
  KeyPose pose = a;
  pose.seconds = a.seconds + (b.seconds - a.seconds) * part;
  for (Vector KeyPose::*member : {&KeyPose::pelvis, &KeyPose::object, &KeyPose::away})
    pose.*member = a.*member + (b.*member - a.*member) * part;
  for (Vector KeyPose::*member : {&KeyPose::pelvis_turn, &KeyPose::spine, &KeyPose::head, &KeyPose::object_turn})
    pose.*member = slerped(a.*member, b.*member, part);
  pose.grip = a.grip + (b.grip - a.grip) * part;
  pose.left = between(a.left, b.left, part);
  pose.right = between(a.right, b.right, part);
  return pose;
}

}  // namespace

double time_in_clip(double seconds, double length) {
  return length - std::abs(std::remainder(seconds - length, 2 * length));
}

KeyPose key_at(const std::vector<KeyPose>& keys, double t) {
  for (std::size_t i = 0; i + 1 < keys.size(); ++i) {
    const KeyPose &a = keys[i], &b = keys[i + 1];
    if (t <= b.seconds) return between(a, b, eased(std::max(0.0, t - a.seconds) / (b.seconds - a.seconds)));
  }
  return keys.back();
}

FigureFoot planted_foot(double left, double forward, double toes) { return {Vector(left, forward, 0), toes, 0, true}; }

FigureTarget keyed_figure(const Actor& actor, const KeyedMotion& motion, const KeyPose& key) {
  const Ground& ground = motion.ground;
  FigureTarget figure;
  figure.ground = ground;
  figure.pelvis = key.pelvis;
  figure.pelvis_turn = key.pelvis_turn;
  figure.spine = key.spine;
  figure.head = key.head;
  figure.collars = {Vector(0, -4, -6), Vector(0, 8, 5)};
  for (const int side : {kLeft, kRight}) {
    const auto i = static_cast<std::size_t>(side);
    figure.feet[i] = motion.feet[i];
    figure.feet[i].place = ground.point(motion.feet[i].place);
    figure.feet[i].yaw_deg += ground.heading_deg;
    const HandKey& hand = side == kLeft ? key.left : key.right;
    const Vector from = motion.hands_hang ? hanging_wrist(actor.sizes, side) : Vector(0, 0, 0);
    figure.hands[i].wrist = ground.point(from + hand.wrist);
    figure.hands[i].local = hand.turn;
    figure.hands[i].shared = motion.shares_turn;
    figure.hands[i].curl_deg = hand.curl;
    figure.hands[i].elbow = ground.direction(motion.elbows[i]);
  }
  return figure;
}

Matrix3<double> hand_turn(const Ground& ground, const Vector& fingers, const Vector& thumb, int side) {
  const Vector along = ground.direction(fingers).normalized();
  const Vector up = ground.direction(thumb);
  const Vector across = (up - along * dot(along, up)).normalized();
  const Vector out = side == kRight ? Vector(-along) : along;  // +x of the wrist's frame
  Matrix3<double> turn;
  turn << out, cross(across, out), across;
  return turn;
}

}  // namespace hsi4d::detail
