#include "pipelines/synthetic/figure.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "body/kinematics.h"
#include "core/angles.h"
#include "core/quaternion.h"
#include "core/rotation.h"

namespace hsi4d {
namespace {

using Vector = Vector3<double>;
using Matrix = Matrix3<double>;

Matrix about_z(double degrees) { return so3_exp(Vector(0, 0, degrees * kDegree)); }

std::string side_name(int side) { return side == kLeft ? "left_" : "right_"; }

/// A body being posed: rotations of joints in the world, made from the root outwards.
class Figure {
 public:
  explicit Figure(const BodyModel& body) : body_(body), world_(static_cast<std::size_t>(kSmplxJoints)) {
    positions_.resize(world_.size());
    for (std::size_t j = 0; j < world_.size(); ++j) world_[j] = Matrix::Identity();
  }

  Vector rest(int joint) const {
    const double* x = body_.joints.data() + 3 * joint;
    return {x[0], x[1], x[2]};
  }
  Vector offset(int joint) const { return rest(joint) - rest(parent(joint)); }
  int parent(int joint) const { return body_.parents[static_cast<std::size_t>(joint)]; }
  const Matrix& world(int joint) const { return world_[static_cast<std::size_t>(joint)]; }
  const Vector& position(int joint) const { return positions_[static_cast<std::size_t>(joint)]; }

  void set_root(const Vector& position, const Matrix& rotation) {
    positions_[0] = position;
    world_[0] = rotation;
  }
  void set_local(int joint, const Matrix& rotation) { set_world(joint, world(parent(joint)) * rotation); }
  void set_local(int joint, const Vector& degrees) { set_local(joint, so3_exp(Vector(degrees * kDegree))); }
  void set_world(int joint, const Matrix& rotation) {
    world_[static_cast<std::size_t>(joint)] = rotation;
    place(joint);
  }
  /// Where a joint is follows from its parent alone.
  void place(int joint) {
    positions_[static_cast<std::size_t>(joint)] = position(parent(joint)) + world(parent(joint)) * offset(joint);
  }

  /// Turns `upper` and `lower` so that `end` comes to `target`, or as near as the limb reaches.
  ///
  /// @param rest_bend  where the joint between them goes in the rest pose when the limb bends (forward for a knee)
  /// @param bend       the same in the world
  void reach(int upper, int lower, int end, const Vector& target, const Vector& rest_bend, const Vector& bend) {
    place(upper);
    const Vector first = offset(lower), second = offset(end);
    const double a = first.norm(), b = second.norm();
    const Vector to = target - position(upper);
    const double d = std::clamp(to.norm(), std::abs(a - b) * 1.001, (a + b) * 0.9995);
    const Vector along = to.normalized();
    const Vector aside = (bend - along * dot(bend, along)).normalized();
    const double cosine = (a * a + d * d - b * b) / (2 * a * d);
    const Vector first_world = cosine * along + std::sqrt(std::max(0.0, 1 - cosine * cosine)) * aside;
    const Vector second_world = (along * d - first_world * a).normalized();
    const Vector axis = cross(aside, along).normalized();
    const auto turn = [&](const Vector& bone, const Vector& bone_world) {
      const Vector u = bone.normalized();
      const Vector rest_axis = cross(rest_bend, u).normalized();
      Matrix from, to_world;
      from << u, rest_axis, cross(u, rest_axis);
      to_world << bone_world, axis, cross(bone_world, axis);
      return Matrix(to_world * from.transpose());
    };
    set_world(upper, turn(first, first_world));
    set_world(lower, turn(second, second_world));
    place(end);
  }

  /// Gives `joint` a rotation in the world, half of its turn about the bone before it to that bone's own joint.
  void set_world_shared(int joint, const Matrix& rotation) {
    const int bone = parent(joint);
    const Vector axis = offset(joint).normalized();
    const Vector4<double> q = quaternion_from_matrix(Matrix(world(bone).transpose() * rotation));
    const double twist = 2 * std::atan2(dot(Vector(q.tail<3>()), axis), q[0]);
    const double least = std::remainder(twist, 2 * std::numbers::pi);
    set_world(bone, world(bone) * so3_exp(Vector(axis * (0.5 * least))));
    set_world(joint, rotation);
  }

  BodyPose pose() const {
    BodyPose result = rest_pose(kSmplxJoints);
    result.transl = position(0) - rest(0);
    result.set_rotation(0, so3_log(world(0)));
    for (int j = 1; j < kSmplxJoints; ++j)
      result.set_rotation(j, so3_log(Matrix(world(parent(j)).transpose() * world(j))));
    return result;
  }

 private:
  const BodyModel& body_;
  std::vector<Matrix> world_;
  std::vector<Vector> positions_;
};

void curl_fingers(Figure& figure, int side, double degrees) {
  const double sign = side == kRight ? 1 : -1;  // fingers bend about the axis that points forward in the rest pose
  const auto joint = [&](const char* finger, int i) {
    return smplx_joint(side_name(side) + finger + std::to_string(i));
  };
  for (int i = 1; i <= 3; ++i) {
    for (const char* finger : {"index", "middle", "pinky", "ring"})
      figure.set_local(joint(finger, i), Vector(0, 0, sign * degrees));
    figure.set_local(joint("thumb", i), Vector(0.25 * degrees, sign * -0.35 * degrees, 0));
  }
}

void pose_foot(Figure& figure, const FigureFoot& foot, double ankle_height, int side) {
  const std::string name = side_name(side);
  const int ankle_joint = smplx_joint(name + "ankle"), ball_joint = smplx_joint(name + "foot");
  const Matrix flat = about_z(foot.yaw_deg) * so3_exp(Vector(90 * kDegree, 0, 0));
  const Matrix turn = flat * so3_exp(Vector(foot.pitch_deg * kDegree, 0, 0));
  const Vector to_ball = figure.offset(ball_joint);
  Vector ankle = foot.place + Vector(0, 0, ankle_height) + (flat - turn) * to_ball;
  if (foot.about_ankle) ankle = foot.place + Vector(0, 0, ankle_height);
  figure.reach(smplx_joint(name + "hip"), smplx_joint(name + "knee"), ankle_joint, ankle, Vector(0, 0, 1),
               flat * Vector(0, 0, 1));
  figure.set_world(ankle_joint, turn);
  figure.set_local(ball_joint, Vector(foot.flat_toes ? -foot.pitch_deg : 0, 0, 0));
}

void pose_hand(Figure& figure, const FigureHand& hand, int side) {
  const std::string name = side_name(side);
  const int wrist = smplx_joint(name + "wrist");
  figure.reach(smplx_joint(name + "shoulder"), smplx_joint(name + "elbow"), wrist, hand.wrist, Vector(0, 0, -1),
               hand.elbow);
  if (hand.turn) {
    figure.set_world_shared(wrist, *hand.turn);
  } else if (hand.shared) {
    const Matrix forearm = figure.world(figure.parent(wrist));
    figure.set_world_shared(wrist, forearm * so3_exp(Vector(hand.local * kDegree)));
  } else {
    figure.set_local(wrist, hand.local);
  }
  curl_fingers(figure, side, hand.curl_deg);
}

double sole_of(const BodyModel& body) {
  double sole = 0;
  for (std::size_t i = 1; i < body.vertices.size(); i += 3) sole = std::min(sole, double(body.vertices[i]));
  return sole;
}

}  // namespace

FigureSizes figure_sizes(const BodyModel& body) {
  const double sole = sole_of(body);
  const Figure figure(body);
  const auto rest = [&](const char* name) { return figure.rest(smplx_joint(name)); };
  FigureSizes sizes;
  sizes.standing = rest("pelvis").y() - sole;
  sizes.ankle = rest("left_ankle").y() - sole;
  sizes.shoulder = rest("left_shoulder").y() - sole;
  sizes.shoulder_width = 2 * rest("left_shoulder").x();
  sizes.arm = (rest("left_wrist") - rest("left_elbow")).norm() + (rest("left_elbow") - rest("left_shoulder")).norm();
  sizes.palm[kLeft] = 0.92 * (rest("left_middle1") - rest("left_wrist")) + Vector(0, -0.03, 0);
  sizes.palm[kRight] = 0.92 * (rest("right_middle1") - rest("right_wrist")) + Vector(0, -0.03, 0);
  return sizes;
}

BodyPose posed_figure(const BodyModel& body, const FigureTarget& target) {
  Figure figure(body);
  const double sole = sole_of(body);
  const double standing = figure.rest(smplx_joint("pelvis")).y() - sole;
  const double ankle = figure.rest(smplx_joint("left_ankle")).y() - sole;
  const Matrix upright = target.ground.turn() * so3_exp(Vector(90 * kDegree, 0, 0));
  figure.set_root(target.ground.point(target.pelvis + Vector(0, 0, standing)),
                  upright * so3_exp(Vector(target.pelvis_turn * kDegree)));
  for (const char* joint : {"spine1", "spine2", "spine3"})
    figure.set_local(smplx_joint(joint), Vector(target.spine / 3));
  for (const char* joint : {"neck", "head"}) figure.set_local(smplx_joint(joint), Vector(target.head / 2));
  for (const char* joint : {"jaw", "left_eye_smplhf", "right_eye_smplhf"})
    figure.set_local(smplx_joint(joint), Vector(0, 0, 0));
  for (const int side : {kLeft, kRight}) {
    pose_foot(figure, target.feet[static_cast<std::size_t>(side)], ankle, side);
    figure.set_local(smplx_joint(side_name(side) + "collar"), target.collars[static_cast<std::size_t>(side)]);
    pose_hand(figure, target.hands[static_cast<std::size_t>(side)], side);
  }
  return figure.pose();
}

}  // namespace hsi4d
