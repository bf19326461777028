#include "pipelines/run/frame_start.h"

#include <algorithm>

#include "core/check.h"
#include "core/rotation.h"

namespace hsi4d {

namespace {

using Vector = Vector3<double>;

/// exp(next) = exp(b) exp(a)⁻¹ exp(b): the turn from a to b once more.
Vector continued_rotation(const Vector& a, const Vector& b) {
  const Matrix3<double> last = so3_exp(b);
  return so3_log(Matrix3<double>(last * so3_exp(a).transpose() * last));
}

Vector continued(const Vector& a, const Vector& b) { return 2 * b - a; }

/// The centre goes on straight, and the view turns on.
Rigid<double> continued(const Rigid<double>& a, const Rigid<double>& b) {
  const auto center = [](const Rigid<double>& camera) -> Vector {
    return -(camera.rotation.transpose() * camera.translation);
  };
  Rigid<double> next;
  next.rotation = so3_exp(so3_log(Matrix3<double>(b.rotation * a.rotation.transpose()))) * b.rotation;
  next.translation = -(next.rotation * continued(center(a), center(b)));
  return next;
}

void start_joints(StartFrom from, Index first, Index count, const BodyPose* before, const BodyPose* estimate,
                  BodyPose& body) {
  for (Index j = first; j < first + count; ++j) {
    if (from == StartFrom::kEstimate && estimate != nullptr) body.set_rotation(j, estimate->rotation_of(j));
    if (from == StartFrom::kVelocity && before != nullptr)
      body.set_rotation(j, continued_rotation(before->rotation_of(j), body.rotation_of(j)));
  }
}

void start_body(const StartSettings& settings, const BodyPose* before, const BodyPose* estimate, BodyPose& body) {
  start_joints(settings.root, 0, 1, before, estimate, body);
  start_joints(settings.pose, 1, kSmplxJoints - 1, before, estimate, body);
  if (settings.root == StartFrom::kEstimate && estimate != nullptr) body.transl = estimate->transl;
  if (settings.root == StartFrom::kVelocity && before != nullptr) body.transl = continued(before->transl, body.transl);
}

void start_objects(StartFrom from, const SceneState* before, const std::vector<ObjectPose>* estimate,
                   SceneState& state) {
  if (from == StartFrom::kEstimate && estimate != nullptr) state.objects = *estimate;
  if (from != StartFrom::kVelocity || before == nullptr) return;
  for (std::size_t o = 0; o < state.objects.size(); ++o) {
    state.objects[o].rotation = continued_rotation(before->objects[o].rotation, state.objects[o].rotation);
    state.objects[o].translation = continued(before->objects[o].translation, state.objects[o].translation);
  }
}

/// Poses of objects on joints that know nothing of these: the nearest ones that their joints and limits allow.
void put_on_joints(const Clip& clip, std::vector<ObjectPose>& objects) {
  for (std::size_t o = 0; o < objects.size(); ++o) {
    if (!clip.objects[o].joint) continue;
    const ObjectJoint& joint = *clip.objects[o].joint;
    const double q = std::clamp(joint_value(joint, parent_from_object(joint, objects, o)), joint.low, joint.high);
    objects[o] = pose_of(compose(world_from_parent(joint, objects), on_joint(joint, q)));
  }
}

}  // namespace

void check_start(const StartSettings& settings, const Clip& clip) {
  for (std::size_t p = 0; p < clip.people(); ++p) {
    const std::string in = p == 0 ? "data" : "data.people." + clip.person(p).name;
    if (settings.root == StartFrom::kEstimate && clip.person(p).estimate.empty())
      throw UserError("/start/root: \"estimate\": " + in + ".initial names a motion of frame 0 alone");
  }
  if (settings.objects == StartFrom::kEstimate && !clip.objects.empty() && clip.object_estimate.empty())
    throw UserError("/start/objects: \"estimate\": data.initial names no object_tracks");
}

SceneState given_start(const Clip& clip, Index frame) {
  const auto index = static_cast<std::size_t>(frame);
  SceneState state = clip.first;
  for (std::size_t p = 0; p < clip.people(); ++p) {
    if (!clip.person(p).estimate.empty()) state.person(p) = clip.person(p).estimate[index];
  }
  if (!clip.object_estimate.empty()) {
    state.objects = clip.object_estimate[index];
    put_on_joints(clip, state.objects);
  }
  return state;
}

SceneState frame_start(const StartSettings& settings, const Clip& clip, const std::vector<SceneState>& done) {
  const std::size_t index = done.size();
  SceneState state = done.back();
  const SceneState* const before = index > 1 ? &done[index - 2] : nullptr;
  for (std::size_t p = 0; p < clip.people(); ++p) {
    const std::vector<BodyPose>& estimate = clip.person(p).estimate;
    start_body(settings, before != nullptr ? &before->person(p) : nullptr,
               estimate.empty() ? nullptr : &estimate[index], state.person(p));
  }
  start_objects(settings.objects, before, clip.object_estimate.empty() ? nullptr : &clip.object_estimate[index], state);
  if (settings.objects != StartFrom::kPrevious) put_on_joints(clip, state.objects);
  if (settings.camera == StartFrom::kVelocity && before != nullptr)
    state.camera_from_world = continued(before->camera_from_world, state.camera_from_world);
  return state;
}

}  // namespace hsi4d
