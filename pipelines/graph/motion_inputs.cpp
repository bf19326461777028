#include "pipelines/graph/motion_inputs.h"

#include <algorithm>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/tape_rows.h"
#include "body/skinning.h"
#include "body/vposer.h"
#include "core/check.h"
#include "core/rotation.h"
#include "optim/metrics.h"

namespace hsi4d {

namespace {

constexpr Index kCoordinates = 3 * kMetricJoints;

/// Those of the frames that move, by these frames' numbers.
/// @param index  in the clip, of the first frame
std::vector<AnnotatedContact> contacts_of(const std::vector<AnnotatedContact>& all, Index index,
                                          const MotionStart& motion) {
  std::vector<AnnotatedContact> contacts;
  for (AnnotatedContact contact : all) {
    contact.frame -= index;
    if (contact.frame >= motion.still_frames && contact.frame < motion.frames()) contacts.push_back(contact);
  }
  return contacts;
}

/// Contacts are annotated of the first person.
std::shared_ptr<const MotionStart> start_of(const Clip& clip, std::size_t person, const SceneState& first,
                                            const std::vector<SceneState>& frames, Index index, Index moving) {
  const ClipPerson& who = clip.person(person);
  auto start = std::make_shared<MotionStart>();
  start->avatar = &who.avatar;
  start->mesh = who.body ? &*who.body : nullptr;
  for (const ClipObject& object : clip.objects) start->objects.push_back(&object.gaussians);
  start->scene = &clip.scene;
  start->first_camera_center = inverse(first.camera_from_world).translation;
  start->still_frames = std::ssize(frames) - moving;
  start->frame_rate = clip.frame_rate;
  start->foot_range = who.foot_range;
  start->first_body = pose_skeleton(who.avatar, first.person(person));
  for (const SceneState& frame : frames) {
    start->body.push_back(pose_skeleton(who.avatar, frame.person(person)));
    start->world_from_object.push_back(rigids_of(frame.objects));
  }
  if (clip.contacts && person == 0) start->contacts = contacts_of(*clip.contacts, index, *start);
  return start;
}

/// Joints of frames [first, last) when the stage began.
std::vector<double> start_joints(const MotionStart& motion, Index first, Index last) {
  std::vector<double> rows;
  for (Index t = first; t < last; ++t) {
    const std::vector<double>& joints = motion.body_in(t).joints;
    rows.insert(rows.end(), joints.begin(), joints.begin() + kCoordinates);
  }
  return rows;
}

/// The frames that stand, and those that move below them.
template <class S>
Var<S> joint_rows(const MovingFrames<S>& moving, const MotionStart& motion) {
  Tape<S>& tape = moving.skeleton.joints.owner();
  const Index frames = motion.moving_frames();
  const Var<S> all = reshape(moving.skeleton.joints, frames, moving.skeleton.joints.shape().count() / frames);
  const Var<S> moved = slice_cols(all, 0, kCoordinates);
  if (motion.still_frames == 0) return moved;
  const Var<S> still =
      constant_rows<S>(tape, "joints_before", start_joints(motion, 0, motion.still_frames), kCoordinates);
  return concat_rows<S>(std::array{still, moved});
}

/// The rotations of joints 1 to 21 of all frames that move.
template <class S>
Var<S> body_rotation_rows(Var<S> rotations) {
  const Index joints = kSmplxJoints, frames = rotations.shape().rows / joints;
  if (frames == 1) return slice_rows(rotations, 1, kBodyPoseJoints);
  const Var<S> by_frame = reshape(rotations, frames, 9 * joints);
  return reshape(slice_cols(by_frame, 9, 9 * kBodyPoseJoints), frames * kBodyPoseJoints, 9);
}

/// Points that follow transforms [.,12] by weights: those of some rows of files, each in a frame that moves.
template <class S>
struct FollowingPoints {
  SparseWeights weights;
  std::vector<double> rest;

  std::vector<std::uint32_t> rows = {};

  /// @param offsets  of all rows in the rest pose; empty: none
  Var<S> record(Var<S> transforms, Var<S> offsets) {
    weights.joints = transforms.shape().rows;
    Var<S> points = constant_rows<S>(transforms.owner(), "points_at_rest", rest, 3);
    if (offsets.tape != nullptr) points = points + gather_rows(offsets, rows);
    return skin_points(SkinWeights<S>(weights), transforms, points);
  }
  void add_rest(const std::vector<float>& means, Index row, const Vector3<double>& offset) {
    for (Index i = 0; i < 3; ++i)
      rest.push_back(static_cast<double>(means[static_cast<std::size_t>(3 * row + i)]) + offset[i]);
    ++weights.vertices;
    rows.push_back(static_cast<std::uint32_t>(row));
  }
};

Index moving_frame(const MotionStart& motion, Index frame) {
  HSI4D_CHECK(frame >= motion.still_frames && frame < motion.frames(), "the point's frame does not move in the stage");
  return frame - motion.still_frames;
}

template <class S>
Var<S> record_body_points(Var<S> transforms, Var<S> offsets, const MotionStart& motion,
                          const std::vector<BodyPoint>& points) {
  const BodySet of = points.empty() ? BodySet::kGaussians : points.front().of;
  const RestPoints rest = motion.rest_points(of);
  const SparseWeights& all = *rest.weights;
  FollowingPoints<S> chosen;
  chosen.weights.per_vertex = all.per_vertex;
  for (const BodyPoint& point : points) {
    HSI4D_CHECK(point.of == of, "points of Gaussians and of vertices at once");
    const Index first_joint = moving_frame(motion, point.frame) * all.joints;
    for (Index k = 0; k < all.per_vertex; ++k) {
      const auto at = static_cast<std::size_t>(point.row * all.per_vertex + k);
      chosen.weights.indices.push_back(static_cast<std::int32_t>(first_joint + all.indices[at]));
      chosen.weights.weights.push_back(all.weights[at]);
    }
    chosen.add_rest(*rest.places, point.row, point.offset);
  }
  return chosen.record(transforms, of == BodySet::kGaussians ? offsets : Var<S>{});
}

template <class S>
Var<S> record_object_points(Tape<S>& tape, Var<S> transforms, const MotionStart& motion,
                            const std::vector<ObjectPoint>& points) {
  if (transforms.tape == nullptr) {  // the objects stand
    std::vector<double> places;
    for (const ObjectPoint& point : points) {
      const Vector3<double> place = motion.place(point);
      places.insert(places.end(), place.data(), place.data() + 3);
    }
    return constant_rows<S>(tape, "object_points", places, 3);
  }
  FollowingPoints<S> chosen;
  chosen.weights.per_vertex = 1;
  for (const ObjectPoint& point : points) {
    moving_frame(motion, point.frame);
    chosen.weights.indices.push_back(static_cast<std::int32_t>(point.object));
    chosen.weights.weights.push_back(1);
    chosen.add_rest(motion.objects[static_cast<std::size_t>(point.object)]->means, point.row, point.offset);
  }
  return chosen.record(transforms, {});
}

}  // namespace

template <class S>
void give_motion(const MovingFrames<S>& moving, const Clip& clip, std::size_t person, const SceneState& first,
                 const std::vector<SceneState>& frames, Index index, LossInputs<S>& inputs) {
  const Index count = moving.rotations.shape().rows / kSmplxJoints;
  const std::shared_ptr<const MotionStart> motion = start_of(clip, person, first, frames, index, count);
  inputs.motion = motion;
  inputs.body_rotations = body_rotation_rows(moving.rotations);
  inputs.joints = joint_rows(moving, *motion);
  Tape<S>& tape = inputs.joints.owner();
  inputs.joints_start =
      constant_rows<S>(tape, "joints_start", start_joints(*motion, 0, motion->frames()), kCoordinates);
  const Var<S> transforms = moving.skeleton.transforms, objects = moving.object_transforms;
  inputs.body_points = [transforms, offsets = moving.rest_offsets, motion](const std::vector<BodyPoint>& points) {
    return record_body_points(transforms, offsets, *motion, points);
  };
  inputs.object_points = [&tape, objects, motion](const std::vector<ObjectPoint>& points) {
    return record_object_points(tape, objects, *motion, points);
  };
}

std::shared_ptr<const MotionStart> with_objects_after(const MotionStart& motion, std::span<const SceneState> frames) {
  auto all = std::make_shared<MotionStart>(motion);
  for (const SceneState& frame : frames) all->world_from_object.push_back(rigids_of(frame.objects));
  return all;
}

template void give_motion(const MovingFrames<float>&, const Clip&, std::size_t, const SceneState&,
                          const std::vector<SceneState>&, Index, LossInputs<float>&);
template void give_motion(const MovingFrames<double>&, const Clip&, std::size_t, const SceneState&,
                          const std::vector<SceneState>&, Index, LossInputs<double>&);

}  // namespace hsi4d
