#include "body/smplx_body.h"

#include <algorithm>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/rotations.h"
#include "body/pose_layout.h"
#include "body/skinning.h"

namespace hsi4d {

namespace {

/// The joints of each SmplxPart.
struct JointRun {
  Index first, count;
};
constexpr std::array<JointRun, kSmplxParts> kPartJoints = {{{kFirstHandJoint, kHandJoints},
                                                            {kFirstHandJoint + kHandJoints, kHandJoints},
                                                            {kBodyJoints, kFirstHandJoint - kBodyJoints},
                                                            {1, kBodyJoints - 1}}};

/// All columns as one group.
template <class S>
Directions<S> all_directions(const std::vector<double>& values, Index points, Index columns) {
  DirectionSource source{values, points, columns, {}, columns};
  if (columns > 0) source.group_begin.push_back(0);
  return Directions<S>(source);
}

template <class S>
SkinWeights<S> skin_weights(const DenseWeights& dense) {
  const std::optional<SparseWeights> sparse = sparse_weights(dense);
  return sparse ? SkinWeights<S>(*sparse) : SkinWeights<S>(dense);
}

template <class S>
std::vector<S> as_type(const std::vector<double>& numbers) {
  return {numbers.begin(), numbers.end()};
}

template <class S>
Var<S> constant_of(Tape<S>& tape, std::string_view name, const Shape& shape, std::span<const S> values,
                   const Source& where) {
  const Var<S> var = tape.constant(name, shape, where);
  tape.set(var, values);
  return var;
}

/// template + directions · coefficients, of the coefficients that there are.
template <class S>
Var<S> blended(Tape<S>& tape, std::string_view name, const std::vector<double>& rest, const Directions<S>& shape,
               Var<S> betas, const Directions<S>& expression, Var<S> coefficients, const Source& where) {
  std::vector<BlendTerm<S>> terms;
  if (betas.tape != nullptr) terms.push_back({shape, betas});
  if (coefficients.tape != nullptr) terms.push_back({expression, coefficients});
  if (!terms.empty()) return blend_shapes(rest, std::span<const BlendTerm<S>>(terms), where);
  const std::vector<S> numbers = as_type<S>(rest);
  return constant_of<S>(tape, name, shape_of(static_cast<Index>(rest.size()) / 3, 3), numbers, where);
}

/// The rotations of a run of joints, and R − I.
template <class S>
struct Rotations {
  Var<S> matrices, offsets;
};

template <class S>
Rotations<S> rotations_of(Tape<S>& tape, Var<S> parameters, Index joints, const Source& where) {
  if (parameters.tape == nullptr) parameters = tape.constant("no rotation", shape_of(joints, 3), where);
  HSI4D_CHECK_EQ(parameters.shape().rows, joints);
  if (parameters.shape().cols != 3) {
    const bool are_columns = parameters.shape().cols == 6;
    const Var<S> matrices = are_columns ? rotations_from_6d(parameters, where) : parameters;
    HSI4D_CHECK_EQ(matrices.shape(), shape_of(joints, 9));
    return {matrices, rotation_offsets(matrices, where)};
  }
  return {rotations_from_axis_angle(parameters, where), rotation_offsets_from_axis_angle(parameters, where)};
}

template <class S>
Rotations<S> hand_rotations(Tape<S>& tape, const SmplxBody<S>& body, Var<S> parameters, int side, const Source& where) {
  if (parameters.tape == nullptr) parameters = tape.constant("no rotation", shape_of(kHandJoints, 3), where);
  const bool is_whole =
      parameters.shape() == shape_of(kHandJoints, 6) || parameters.shape() == shape_of(kHandJoints, 9);
  if (is_whole) return rotations_of(tape, parameters, kHandJoints, where);
  return rotations_of(tape, hand_pose(body, parameters, side, where), kHandJoints, where);
}

/// Rotations of all joints in the order of SMPL-X, and the offsets of each SmplxPart.
template <class S>
struct PoseRotations {
  Var<S> matrices;
  std::array<Var<S>, kSmplxParts> offsets;
};

template <class S>
PoseRotations<S> pose_rotations(Tape<S>& tape, const SmplxBody<S>& body, const SmplxParameters<S>& p,
                                const Source& where) {
  const Rotations<S> root = rotations_of(tape, p.global_orient, 1, where);
  const Rotations<S> joints = rotations_of(tape, p.body_pose, 21, where);
  const Rotations<S> jaw = rotations_of(tape, p.jaw_pose, 1, where);
  const Rotations<S> left_eye = rotations_of(tape, p.leye_pose, 1, where);
  const Rotations<S> right_eye = rotations_of(tape, p.reye_pose, 1, where);
  const Rotations<S> left = hand_rotations(tape, body, p.left_hand_pose, 0, where);
  const Rotations<S> right = hand_rotations(tape, body, p.right_hand_pose, 1, where);
  const std::array matrices = {root.matrices,      joints.matrices, jaw.matrices,  left_eye.matrices,
                               right_eye.matrices, left.matrices,   right.matrices};
  const std::array face = {jaw.offsets, left_eye.offsets, right_eye.offsets};
  return {concat_rows(std::span<const Var<S>>(matrices), where),
          {left.offsets, right.offsets, concat_rows(std::span<const Var<S>>(face), where), joints.offsets}};
}

}  // namespace

template <class S>
SmplxBody<S>::SmplxBody(const SmplxModel& model, const SmplxBodyOptions& options) {
  HSI4D_CHECK_EQ(model.joint_count(), kSmplxJoints);
  const Index vertices = model.vertex_count(), joints = model.joint_count();
  auto tables = std::make_shared<Tables>();
  tables->parents = model.parents;
  tables->vertices = model.vertices;
  tables->joints = model.joints;
  tables->shape = all_directions<S>(model.shape, vertices, model.betas);
  tables->expression = all_directions<S>(model.expression, vertices, model.expressions);
  tables->joint_shape = all_directions<S>(model.joint_shape, joints, model.betas);
  tables->joint_expression = all_directions<S>(model.joint_expression, joints, model.expressions);
  if (options.correctives && !model.correctives.empty()) {
    for (std::size_t part = 0; part < kSmplxParts; ++part) {
      const auto& [first, count] = kPartJoints[part];
      const double share = static_cast<double>(count) / static_cast<double>(kSmplxJoints - 1);
      tables->correctives[part] = PoseDirections<S>(model.correctives, vertices, first, count, share * options.packing);
    }
  }
  tables->weights = std::make_unique<SkinWeights<S>>(skin_weights<S>(model.weights));
  for (std::size_t side = 0; side < 2; ++side) {
    const SmplxHand& hand = model.hands[side];
    tables->hand_means[side] = as_type<S>(hand.mean);
    if (options.flat_hand_mean || hand.mean.empty()) tables->hand_means[side].assign(3 * kHandJoints, S(0));
    tables->hand_components[side] = as_type<S>(hand.components);
  }
  tables->betas = model.betas;
  tables->expressions = model.expressions;
  tables_ = std::move(tables);
}

template <class S>
Var<S> hand_pose(const SmplxBody<S>& body, Var<S> coefficients, int side, Source where) {
  const auto at = static_cast<std::size_t>(side);
  const std::vector<S>& all = body.tables().hand_components[at];
  Tape<S>& tape = coefficients.owner();
  Var<S> pose = coefficients;
  if (coefficients.shape() != shape_of(kHandJoints, 3)) {
    const Index count = coefficients.shape().cols, there = static_cast<Index>(all.size()) / (3 * kHandJoints);
    HSI4D_CHECK_EQ(coefficients.shape(), shape_of(1, count));
    HSI4D_CHECK(count <= there,
                std::to_string(count) + " components of a hand; the model has " + std::to_string(there));
    const Var<S> components =
        constant_of<S>(tape, "hand components", shape_of(count, 3 * kHandJoints),
                       std::span(all).first(static_cast<std::size_t>(count * 3 * kHandJoints)), where);
    pose = reshape(matmul(coefficients, components, where), kHandJoints, 3, where);
  }
  const std::vector<S>& mean = body.tables().hand_means[at];
  const bool is_flat = std::all_of(mean.begin(), mean.end(), [](S x) { return x == 0; });
  return is_flat ? pose
                 : pose + Operand<S>(constant_of<S>(tape, "hand mean", shape_of(kHandJoints, 3), mean, where), where);
}

template <class S>
PosedSmplx<S> pose_smplx(Tape<S>& tape, const SmplxBody<S>& body, const SmplxParameters<S>& p, Source where) {
  const auto& t = body.tables();
  PosedSmplx<S> posed;
  posed.rest_vertices = blended(tape, "template", t.vertices, t.shape, p.betas, t.expression, p.expression, where);
  posed.rest_joints =
      blended(tape, "joints", t.joints, t.joint_shape, p.betas, t.joint_expression, p.expression, where);
  const PoseRotations<S> rotations = pose_rotations(tape, body, p, where);
  posed.rotations = rotations.matrices;
  const Var<S> still = tape.constant("no translation", shape_of(1, 3), where);
  const Var<S> transl = p.transl.tape != nullptr ? p.transl : still;
  // Vertices take the translation last and not through the weights, whose sum is 1 to rounding only.
  const PosedSkeleton<S> in_place = kinematic_chain(posed.rotations, still, t.parents, posed.rest_joints, where);
  Var<S> corrected = posed.rest_vertices;
  for (std::size_t part = 0; part < kSmplxParts; ++part) {
    if (t.correctives[part].joints() == 0) continue;
    corrected = pose_correctives(t.correctives[part], rotations.offsets[part], corrected, where);
  }
  posed.vertices = skin_points(*t.weights, in_place.transforms, corrected, transl, where);
  const PosedSkeleton<S> moved = kinematic_chain(posed.rotations, transl, t.parents, posed.rest_joints, where);
  posed.joints = moved.joints;
  posed.transforms = moved.transforms;
  return posed;
}

#define HSI4D_INSTANTIATE(S)                                           \
  template class SmplxBody<S>;                                         \
  template Var<S> hand_pose(const SmplxBody<S>&, Var<S>, int, Source); \
  template PosedSmplx<S> pose_smplx(Tape<S>&, const SmplxBody<S>&, const SmplxParameters<S>&, Source);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d
