#include "pipelines/synthetic_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "body/kinematics.h"
#include "body/motion_edit.h"
#include "core/check.h"
#include "core/quaternion.h"
#include "core/rotation.h"

namespace hsi4d {
namespace {

using Vector = Vector3<double>;
using Matrix = Matrix3<double>;

constexpr double kDegree = std::numbers::pi / 180;

// Where the person stands and looks: metres in the world, degrees about z; 0 looks along -y, towards the camera.
const Vector kStand{0.22, 0.8, 0};
constexpr double kHeading = -58;

// The camera at time 0, metres; focal length in widths of the image.
const Vector kEye{0.42, -1.56, 1.36}, kTarget{0.02, 0.72, 0.85};
constexpr double kFocal = 1.12;

/// The state at one moment, in the person's frame: (left, forward, up) from the place between the feet, metres;
/// rotations are vectors in degrees. Body rotations are in the joint's own axes (left, up, forward), so x leans
/// forward, y turns left, z leans right.
struct KeyPose {
  double seconds;
  Vector pelvis;  ///< up is relative to standing
  Vector pelvis_turn;
  Vector spine;        ///< of three joints together
  Vector head;         ///< of neck and head together
  Vector palm;         ///< the right one
  Vector object_turn;  ///< against time 0, about (left, forward, up)
  Vector left_wrist;
  Vector left_hand;        ///< rotation of the left wrist
  double curl, left_curl;  ///< of every finger joint
};

const std::array<KeyPose, 5> kKeys = {{
    {0,
     {-0.02, 0.07, -0.12},
     {14, -6, 0},
     {26, -10, 2},
     {14, -6, 0},
     {-0.1, 0.58, 0.92},
     {0, 0, 0},
     {0.27, 0.2, 0.78},
     {0, 0, 0},
     52,
     14},
    {0.7,
     {0.04, -0.05, -0.02},
     {2, 6, 1},
     {4, 8, -2},
     {16, 4, 0},
     {-0.08, 0.4, 1.06},
     {20, 0, 6},
     {0.22, 0.25, 1.05},
     {12, 0, 16},
     62,
     42},
    {1.5,
     {0.07, -0.02, -0.03},
     {3, 14, 3},
     {6, 22, -3},
     {20, 10, 0},
     {0.02, 0.42, 1.1},
     {42, 0, 16},
     {0.28, 0.27, 1.07},
     {10, 0, 10},
     64,
     30},
    {2.3,
     {0.1, 0.02, -0.05},
     {6, 16, 3},
     {12, 20, -4},
     {24, 10, 0},
     {0.06, 0.46, 1.06},
     {52, 0, 22},
     {0.3, 0.27, 1.03},
     {6, 0, 4},
     64,
     22},
    {kClipSeconds,
     {0.03, -0.04, -0.02},
     {2, 4, 0},
     {2, 4, 0},
     {8, 0, 0},
     {-0.06, 0.38, 1.02},
     {6, 0, 4},
     {0.22, 0.25, 1.0},
     {8, 0, 6},
     60,
     36},
}};

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

/// Between two keys: positions on a line, rotations along the shortest arc.
KeyPose between(const KeyPose& a, const KeyPose& b, double part) {
  const auto line = [part](const auto& x, const auto& y) { return (x + (y - x) * part); };
  KeyPose pose = a;
  pose.seconds = line(a.seconds, b.seconds);
  for (Vector KeyPose::*member : {&KeyPose::pelvis, &KeyPose::palm, &KeyPose::left_wrist})
    pose.*member = line(a.*member, b.*member);
  for (Vector KeyPose::*member :
       {&KeyPose::pelvis_turn, &KeyPose::spine, &KeyPose::head, &KeyPose::object_turn, &KeyPose::left_hand})
    pose.*member = slerped(a.*member, b.*member, part);
  pose.curl = line(a.curl, b.curl);
  pose.left_curl = line(a.left_curl, b.left_curl);
  return pose;
}

/// The state at a time, which runs forwards and backwards through the clip.
KeyPose key_at(double seconds) {
  const double t = kClipSeconds - std::abs(std::remainder(seconds - kClipSeconds, 2 * kClipSeconds));
  for (std::size_t i = 0; i + 1 < kKeys.size(); ++i) {
    const KeyPose &a = kKeys[i], &b = kKeys[i + 1];
    if (t <= b.seconds) return between(a, b, eased(std::max(0.0, t - a.seconds) / (b.seconds - a.seconds)));
  }
  return kKeys.back();
}

Matrix about_z(double degrees) { return so3_exp(Vector(0, 0, degrees * kDegree)); }

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

/// The numbers of one body and object that stay the same through the clip.
struct Stage {
  const BodyModel& body;
  double standing = 0;  ///< height of the pelvis over the soles, metres
  double ankle = 0;     ///< height of the ankles over the soles, metres
  Vector palm;          ///< of the right hand, in the wrist's frame
  Matrix grasp;         ///< rotation of the right wrist at time 0, world
  Rigid<double> wrist_from_object;
};

Vector to_world(const Vector& left_forward_up) {
  return kStand + about_z(kHeading) * Vector(left_forward_up[0], -left_forward_up[1], left_forward_up[2]);
}

Vector turn_in_world(const Vector& left_forward_up) {
  return about_z(kHeading) * Vector(left_forward_up[0], -left_forward_up[1], left_forward_up[2]);
}

Stage stage_of(const BodyModel& body, const SyntheticObject& object) {
  Stage stage{body, 0, 0, {}, {}, {}};
  double sole = 0;
  for (std::size_t i = 1; i < body.vertices.size(); i += 3) sole = std::min(sole, double(body.vertices[i]));
  const Figure figure(body);
  stage.standing = figure.rest(smplx_joint("pelvis")).y() - sole;
  stage.ankle = figure.rest(smplx_joint("left_ankle")).y() - sole;
  const int wrist = smplx_joint("right_wrist");
  stage.palm = 0.92 * (figure.rest(smplx_joint("right_middle1")) - figure.rest(wrist)) + Vector(0, -0.03, 0);
  // the hand points down over the handle, which runs forward like the thumb; the fingers close to the left
  constexpr double kInward = 15 * kDegree;
  const Vector left = turn_in_world({1, 0, 0}), forward = turn_in_world({0, 1, 0});
  const Vector fingers = std::sin(kInward) * left - std::cos(kInward) * Vector::UnitZ();
  stage.grasp << -fingers, cross(forward, Vector(-fingers)), forward;
  const Matrix object_turn = about_z(kHeading - 90);  // its x, and the handle, points forward
  stage.wrist_from_object.rotation = stage.grasp.transpose() * object_turn;
  stage.wrist_from_object.translation = stage.palm - stage.wrist_from_object.rotation * object.grip;
  return stage;
}

void curl_fingers(Figure& figure, const std::string& side, double degrees) {
  const double sign = side == "right" ? 1 : -1;  // fingers bend about the axis that points forward in the rest pose
  for (const char* finger : {"index", "middle", "pinky", "ring"})
    for (int i = 1; i <= 3; ++i)
      figure.set_local(smplx_joint(side + "_" + finger + std::to_string(i)), Vector(0, 0, sign * degrees));
  for (int i = 1; i <= 3; ++i)
    figure.set_local(smplx_joint(side + "_thumb" + std::to_string(i)),
                     Vector(0.25 * degrees, sign * -0.35 * degrees, 0));
}

void pose_legs(Figure& figure, const Stage& stage) {
  for (const bool is_left : {true, false}) {
    const std::string side = is_left ? "left_" : "right_";
    const Vector foot = is_left ? Vector(0.15, 0.08, 0) : Vector(-0.15, -0.08, 0);
    const double toes = is_left ? 14 : -16;
    const Matrix foot_turn = about_z(kHeading + toes) * so3_exp(Vector(90 * kDegree, 0, 0));
    const Vector ankle = to_world(foot) + Vector(0, 0, stage.ankle);
    const Vector knee_out = foot_turn * Vector(0, 0, 1);
    const int ankle_joint = smplx_joint(side + "ankle");
    figure.reach(smplx_joint(side + "hip"), smplx_joint(side + "knee"), ankle_joint, ankle, Vector(0, 0, 1), knee_out);
    figure.set_world(ankle_joint, foot_turn);
    figure.set_local(smplx_joint(side + "foot"), Vector(0, 0, 0));
  }
}

BodyPose pose_at(const Stage& stage, const KeyPose& key) {
  Figure figure(stage.body);
  const Matrix upright = about_z(kHeading) * so3_exp(Vector(90 * kDegree, 0, 0));
  figure.set_root(to_world(key.pelvis + Vector(0, 0, stage.standing)),
                  upright * so3_exp(Vector(key.pelvis_turn * kDegree)));
  for (const char* joint : {"spine1", "spine2", "spine3"}) figure.set_local(smplx_joint(joint), Vector(key.spine / 3));
  for (const char* joint : {"neck", "head"}) figure.set_local(smplx_joint(joint), Vector(key.head / 2));
  for (const char* joint : {"jaw", "left_eye_smplhf", "right_eye_smplhf"})
    figure.set_local(smplx_joint(joint), Vector(0, 0, 0));
  pose_legs(figure, stage);
  figure.set_local(smplx_joint("left_collar"), Vector(0, -4, -6));
  figure.set_local(smplx_joint("right_collar"), Vector(0, 8, 5));

  const int right_wrist = smplx_joint("right_wrist");
  const Matrix hand = so3_exp(Vector(turn_in_world(key.object_turn) * kDegree)) * stage.grasp;
  figure.reach(smplx_joint("right_shoulder"), smplx_joint("right_elbow"), right_wrist,
               to_world(key.palm) - hand * stage.palm, Vector(0, 0, -1), turn_in_world({-0.65, -0.6, -0.25}));
  figure.set_world_shared(right_wrist, hand);
  curl_fingers(figure, "right", key.curl);

  const int left_wrist = smplx_joint("left_wrist");
  figure.reach(smplx_joint("left_shoulder"), smplx_joint("left_elbow"), left_wrist, to_world(key.left_wrist),
               Vector(0, 0, -1), turn_in_world({0.65, -0.5, -0.6}));
  figure.set_local(left_wrist, key.left_hand);
  curl_fingers(figure, "left", key.left_curl);
  return figure.pose();
}

Camera camera_at(double seconds, const ClipSettings& settings) {
  constexpr double kFastest = 0.142;  // metres a second
  constexpr double kSwing = 0.4;      // radians a second: it comes back after 8 seconds
  const double way = settings.camera_drift * kFastest / kSwing * std::sin(kSwing * seconds);
  Camera camera;
  camera.width = camera.height = settings.size_px;
  camera.fx = camera.fy = kFocal * settings.size_px;
  camera.cx = 0.512 * settings.size_px;
  camera.cy = 0.494 * settings.size_px;
  camera.camera_from_world = look_at(kEye + way * Vector(-0.94, 0.26, 0.22), kTarget + way * Vector(0.12, 0, -0.04));
  return camera;
}

}  // namespace

Rigid<double> joint_frame(const BodyModel& body, const BodyPose& pose, int joint) {
  const PosedJoints posed = pose_skeleton(body, pose);
  const double* row = posed.transforms.data() + 12 * joint;
  Rigid<double> frame;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) frame.rotation(i, j) = row[4 * i + j];
  const double* x = posed.joints.data() + 3 * joint;
  frame.translation = {x[0], x[1], x[2]};
  return frame;
}

SyntheticClip synthetic_clip(const BodyModel& body, const SyntheticObject& object, const ClipSettings& settings) {
  HSI4D_CHECK_EQ(body.joint_count(), kSmplxJoints);
  HSI4D_CHECK(settings.frames > 0 && settings.frame_rate > 0 && settings.size_px > 0, "a clip needs frames");
  const Stage stage = stage_of(body, object);
  const int wrist = smplx_joint("right_wrist");
  SyntheticClip clip;
  clip.wrist_from_object = stage.wrist_from_object;
  clip.motion.frame_rate = settings.frame_rate;
  clip.motion.pelvis_rest = pelvis_of(body.joints);
  for (Index frame = 0; frame < settings.frames; ++frame) {
    const double seconds = double(frame) / settings.frame_rate;
    clip.motion.poses.push_back(pose_at(stage, key_at(seconds)));
    clip.object.push_back(compose(joint_frame(body, clip.motion.poses.back(), wrist), clip.wrist_from_object));
    clip.cameras.push_back(camera_at(seconds, settings));
  }
  const Vector ground = clip.object.front().translation - Vector(0, 0, object.above_ground);
  clip.room.table_top = ground + turn_in_world({0, 0.09, 0});
  clip.room.table_turn = kHeading * kDegree;
  clip.room.rug = kStand.head<2>();
  return clip;
}

}  // namespace hsi4d
