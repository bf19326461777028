#include "pipelines/graph/sequence_graph.h"

#include <algorithm>
#include <array>

#include "autodiff/matrix.h"
#include "autodiff/rotations.h"
#include "autodiff/tape_rows.h"
#include "core/check.h"
#include "core/rotation.h"
#include "core/rotation_6d.h"
#include "optim/metrics.h"

namespace hsi4d {

namespace {

constexpr Index kRowNumbers = 9;  // of a rotation
constexpr Index kOtherJoints = kSmplxJoints - 1 - kBodyPoseJoints;

/// Axis-angle vectors of joints [first, first + count) in frames 1 to T.
std::vector<double> axis_angles(const std::vector<BodyPose>& poses, Index first, Index count) {
  std::vector<double> all;
  for (std::size_t t = 1; t < poses.size(); ++t) {
    const auto begin = poses[t].axis_angle.begin() + 3 * first;
    all.insert(all.end(), begin, begin + 3 * count);
  }
  return all;
}

/// Rotations as numbers that a stage moves: axis-angle up to π (row D9: angles beyond π), or two columns of the matrix.
std::vector<double> rotation_numbers(const std::vector<double>& axis_angle, RotationParameters parameters) {
  std::vector<double> numbers;
  for (std::size_t i = 0; i < axis_angle.size(); i += 3) {
    Vector3<double> w(axis_angle.data() + i);
    if (parameters == RotationParameters::kAxisAngle) {
      wrap_axis_angle(w);
      numbers.insert(numbers.end(), w.data(), w.data() + 3);
    } else {
      const Matrix3<double> rotation = so3_exp(w);  // its memory is by columns
      numbers.insert(numbers.end(), rotation.data(), rotation.data() + 6);
    }
  }
  return numbers;
}

/// Matrices by rows, T rows of 9 numbers a joint.
std::vector<double> matrix_rows(const std::vector<double>& axis_angle) {
  std::vector<double> rows;
  for (std::size_t i = 0; i < axis_angle.size(); i += 3) {
    const Matrix3<double> transposed = so3_exp(Vector3<double>(axis_angle.data() + i)).transpose();
    rows.insert(rows.end(), transposed.data(), transposed.data() + kRowNumbers);
  }
  return rows;
}

template <class S>
Matrix3<double> matrix_of(const S* rows) {
  Matrix3<double> m;
  for (int i = 0; i < kRowNumbers; ++i) m(i / 3, i % 3) = static_cast<double>(rows[i]);
  return m;
}

}  // namespace

template <class S>
SequenceGraph<S>::SequenceGraph(Tape<S>& tape, const Clip& clip, const std::vector<SceneState>& states,
                                const PosePrior* prior, RotationParameters rotations)
    : tape_(tape), rotation_parameters_(rotations), frames_(std::ssize(states) - 1) {
  HSI4D_CHECK(frames_ > 0, "a sequence needs a frame beside the first");
  inputs_.others.resize(clip.others.size());
  for (std::size_t p = 0; p < clip.people(); ++p) {
    LossInputs<S>& inputs = p == 0 ? inputs_ : inputs_.others[p - 1];
    inputs.is_of_other = p > 0;
    const MovingFrames<S> moving = record_human(clip.person(p).avatar, bodies_of(states, p), prior);
    give_motion(moving, clip, p, states.front(), states, 0, inputs);
  }
  for (const ParameterGroup<S>& group : groups_) {
    for (const Var<S> block : group.blocks) tape_.freeze(block);
  }
}

template <class S>
void SequenceGraph<S>::give_sigmas(const std::vector<SceneState>& states, const std::vector<PlaceSigmas>& sigmas) {
  HSI4D_CHECK_EQ(states.size(), sigmas.size());
  std::vector<double> axes;
  for (const SceneState& state : states) {
    const Vector3<double> axis = state.camera_from_world.rotation.row(2);
    axes.insert(axes.end(), axis.data(), axis.data() + 3);
  }
  const Var<S> view_axes = constant_rows(tape_, "view_axes", axes, 3);
  for (std::size_t p = 0; p < humans_.size(); ++p) {
    std::vector<double> numbers;
    for (const PlaceSigmas& frame : sigmas) {
      for (const PlaceSigma& joint : p == 0 ? frame.joints : frame.others.at(p - 1))
        numbers.insert(numbers.end(), {joint.across, joint.along});
    }
    LossInputs<S>& inputs = p == 0 ? inputs_ : inputs_.others[p - 1];
    inputs.joints_sigma = constant_rows(tape_, "joints_sigma", numbers, 2 * kMetricJoints);
    inputs.view_axes = view_axes;
  }
}

template <class S>
ParameterGroup<S>& SequenceGraph<S>::group_of(const std::string& name) {
  auto place = std::find_if(groups_.begin(), groups_.end(), [&](const auto& known) { return known.name == name; });
  if (place == groups_.end()) place = groups_.insert(place, ParameterGroup<S>{name, {}});
  return *place;
}

template <class S>
Var<S> SequenceGraph<S>::leaf(const std::string& group, Index cols) {
  const Var<S> var = tape_.parameter(group, shape_of(frames_, cols));
  group_of(group).blocks.push_back(var);
  return var;
}

template <class S>
MovingFrames<S> SequenceGraph<S>::record_human(const Avatar& avatar, const std::vector<BodyPose>& poses,
                                               const PosePrior* prior) {
  Human& human = humans_.emplace_back();
  human.transl = leaf(kTranslGroup, 3);
  std::vector<double> places;
  for (std::size_t t = 1; t < poses.size(); ++t)
    places.insert(places.end(), poses[t].transl.data(), poses[t].transl.data() + 3);
  write_rows(human.transl, places);
  MovingFrames<S> moving;
  moving.rotations = record_rotations(poses, prior, human);
  moving.skeleton = kinematic_chain(moving.rotations, human.transl, avatar.parents, avatar.joints);
  return moving;
}

/// [55T,9], a frame after the other: heading, the body's joints, and what stays.
template <class S>
Var<S> SequenceGraph<S>::record_rotations(const std::vector<BodyPose>& poses, const PosePrior* prior, Human& human) {
  const bool is_axis_angle = rotation_parameters_ == RotationParameters::kAxisAngle;
  human.orient = leaf(kOrientGroup, is_axis_angle ? 3 : 6);
  group_of(kOrientGroup).are_axis_angles = is_axis_angle;
  write_rows(human.orient, rotation_numbers(axis_angles(poses, 0, 1), rotation_parameters_));
  const Var<S> headings = is_axis_angle ? rotations_from_axis_angle(human.orient) : rotations_from_6d(human.orient);
  const Var<S> others = constant_rotations("hands and head", axis_angles(poses, 1 + kBodyPoseJoints, kOtherJoints));
  const std::array parts = {headings, record_body(poses, prior, human), others};
  return reshape(concat_cols<S>(parts), frames_ * kSmplxJoints, kRowNumbers);
}

/// [T,9·21]
template <class S>
Var<S> SequenceGraph<S>::record_body(const std::vector<BodyPose>& poses, const PosePrior* prior, Human& human) {
  const std::vector<double> start = axis_angles(poses, 1, kBodyPoseJoints);
  if (prior == nullptr) {
    group_of(kPoseLatents);
    return constant_rotations("body", start);
  }
  const Var<S> latents = leaf(kPoseLatents, prior->latents());
  write_rows(latents, prior->encode(start));
  human.body_rotations = prior->decode(latents);
  return reshape(human.body_rotations, frames_, kRowNumbers * kBodyPoseJoints);
}

/// [T,9 a joint]
template <class S>
Var<S> SequenceGraph<S>::constant_rotations(const char* name, const std::vector<double>& axis_angle) {
  const std::vector<double> rows = matrix_rows(axis_angle);
  return constant_rows(tape_, name, rows, std::ssize(rows) / frames_);
}

template <class S>
void SequenceGraph<S>::read_states(const ConfigMap<ParameterGroupSettings>& moved,
                                   std::vector<SceneState>& states) const {
  const auto is_moved = [&moved](const char* group) { return find_entry(moved, group) != nullptr; };
  for (Index i = 0; i < frames_ * std::ssize(humans_); ++i) {
    const Index t = i % frames_, p = i / frames_;
    const Human& human = humans_[static_cast<std::size_t>(p)];
    BodyPose& body = states[static_cast<std::size_t>(t + 1)].person(static_cast<std::size_t>(p));
    if (is_moved(kTranslGroup)) {
      const S* place = tape_.value(human.transl).row(t);
      body.transl = {static_cast<double>(place[0]), static_cast<double>(place[1]), static_cast<double>(place[2])};
    }
    if (is_moved(kOrientGroup)) {
      const S* x = tape_.value(human.orient).row(t);
      Vector3<double> w(static_cast<double>(x[0]), static_cast<double>(x[1]), static_cast<double>(x[2]));
      if (rotation_parameters_ == RotationParameters::kSixD)
        w = so3_log(rotation_from_6d(
            w, Vector3<double>(static_cast<double>(x[3]), static_cast<double>(x[4]), static_cast<double>(x[5]))));
      body.set_rotation(0, w);
    }
    if (human.body_rotations.tape == nullptr || !is_moved(kPoseLatents)) continue;
    const ConstArray<S> rotations = tape_.value(human.body_rotations);
    for (Index j = 0; j < kBodyPoseJoints; ++j)
      body.set_rotation(j + 1, so3_log(matrix_of(rotations.row(t * kBodyPoseJoints + j))));
  }
}

template class SequenceGraph<float>;
template class SequenceGraph<double>;

}  // namespace hsi4d
