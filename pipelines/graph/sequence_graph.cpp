#include "pipelines/graph/sequence_graph.h"

#include <algorithm>
#include <array>

#include "autodiff/matrix.h"
#include "autodiff/rotations.h"
#include "core/check.h"
#include "core/rotation.h"
#include "core/rotation_6d.h"
#include "pipelines/graph/motion_inputs.h"
#include "pipelines/graph/tape_rows.h"

namespace hsi4d {

namespace {

constexpr Index kRowNumbers = 9;  // of a rotation
constexpr Index kOtherJoints = kSmplxJoints - 1 - kBodyPoseJoints;

/// Axis-angle vectors of joints [first, first + count) in frames 1 to T.
std::vector<double> axis_angles(const std::vector<SceneState>& states, Index first, Index count) {
  std::vector<double> all;
  for (std::size_t t = 1; t < states.size(); ++t) {
    const auto begin = states[t].body.axis_angle.begin() + 3 * first;
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
  transl_ = leaf(kTranslGroup, 3);
  std::vector<double> places;
  for (std::size_t t = 1; t < states.size(); ++t) {
    const Vector3<double>& transl = states[t].body.transl;
    places.insert(places.end(), transl.data(), transl.data() + 3);
  }
  write_rows(transl_, places);
  MovingFrames<S> moving;
  moving.rotations = record_rotations(states, prior);
  moving.skeleton = kinematic_chain(moving.rotations, transl_, clip.avatar.parents, clip.avatar.joints);
  give_motion(moving, clip, states.front(), states, 0, inputs_);
  for (const ParameterGroup<S>& group : groups_) {
    for (const Var<S> block : group.blocks) tape_.freeze(block);
  }
}

template <class S>
Var<S> SequenceGraph<S>::leaf(const std::string& group, Index cols) {
  const Var<S> var = tape_.parameter(group, shape_of(frames_, cols));
  groups_.push_back({group, {var}});
  return var;
}

/// [55T,9], a frame after the other: heading, the body's joints, and what stays.
template <class S>
Var<S> SequenceGraph<S>::record_rotations(const std::vector<SceneState>& states, const PosePrior* prior) {
  const bool is_axis_angle = rotation_parameters_ == RotationParameters::kAxisAngle;
  orient_ = leaf(kOrientGroup, is_axis_angle ? 3 : 6);
  groups_.back().are_axis_angles = is_axis_angle;
  write_rows(orient_, rotation_numbers(axis_angles(states, 0, 1), rotation_parameters_));
  const Var<S> headings = is_axis_angle ? rotations_from_axis_angle(orient_) : rotations_from_6d(orient_);
  const Var<S> others = constant_rotations("hands and head", axis_angles(states, 1 + kBodyPoseJoints, kOtherJoints));
  const std::array parts = {headings, record_body(states, prior), others};
  return reshape(concat_cols<S>(parts), frames_ * kSmplxJoints, kRowNumbers);
}

/// [T,9·21]
template <class S>
Var<S> SequenceGraph<S>::record_body(const std::vector<SceneState>& states, const PosePrior* prior) {
  const std::vector<double> start = axis_angles(states, 1, kBodyPoseJoints);
  if (prior == nullptr) {
    groups_.push_back({kPoseLatents, {}});
    return constant_rotations("body", start);
  }
  const Var<S> latents = leaf(kPoseLatents, prior->latents());
  write_rows(latents, prior->encode(start));
  body_rotations_ = prior->decode(latents);
  return reshape(body_rotations_, frames_, kRowNumbers * kBodyPoseJoints);
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
  for (Index t = 0; t < frames_; ++t) {
    BodyPose& body = states[static_cast<std::size_t>(t + 1)].body;
    if (is_moved(kTranslGroup)) {
      const S* place = tape_.value(transl_).row(t);
      body.transl = {static_cast<double>(place[0]), static_cast<double>(place[1]), static_cast<double>(place[2])};
    }
    if (is_moved(kOrientGroup)) {
      const S* x = tape_.value(orient_).row(t);
      Vector3<double> w(static_cast<double>(x[0]), static_cast<double>(x[1]), static_cast<double>(x[2]));
      if (rotation_parameters_ == RotationParameters::kSixD)
        w = so3_log(rotation_from_6d(
            w, Vector3<double>(static_cast<double>(x[3]), static_cast<double>(x[4]), static_cast<double>(x[5]))));
      body.set_rotation(0, w);
    }
    if (body_rotations_.tape == nullptr || !is_moved(kPoseLatents)) continue;
    const ConstArray<S> rotations = tape_.value(body_rotations_);
    for (Index j = 0; j < kBodyPoseJoints; ++j)
      body.set_rotation(j + 1, so3_log(matrix_of(rotations.row(t * kBodyPoseJoints + j))));
  }
}

template class SequenceGraph<float>;
template class SequenceGraph<double>;

}  // namespace hsi4d
