// Rows P7, P8: the operators of body.
#include <array>

#include "body/blend_shapes.h"
#include "body/canonical_directions.h"
#include "body/color_net.h"
#include "body/kinematics.h"
#include "body/natural_pose.h"
#include "body/skinning.h"
#include "body/vposer.h"
#include "stress/poison.h"

namespace hsi4d::stress {

namespace {

constexpr Index kFrames = 4, kJoints = 6, kPoints = 60, kPoseJoints = 21;

PoisonInput rotations(Index rows, UnitOf unit = {}) {
  return {shape_of(rows, 9), std::move(unit), 0, 0, some_rotations(rows)};
}

/// Point v is on joint v mod J alone, with two places of its four unused.
SparseWeights some_weights() {
  SparseWeights weights{kPoints, kJoints, 4, {}, {}};
  for (Index v = 0; v < kPoints; ++v) {
    const auto joint = static_cast<std::int32_t>(v % kJoints);
    weights.indices.insert(weights.indices.end(), {joint, joint, joint, joint});
    weights.weights.insert(weights.weights.end(), {0.25, 0.75, 0, 0});
  }
  return weights;
}

Index joint_of(Index point) { return point % kJoints; }

DenseWeights spread_weights() {
  return {kPoints, kJoints, std::vector<double>(static_cast<std::size_t>(kPoints * kJoints), 1.0 / kJoints)};
}

struct Skeletons {
  template <class S>
  std::vector<PoisonedOperator<S>> operator()() const {
    std::vector<PoisonedOperator<S>> all;
    const std::vector<int> parents = {-1, 0, 1, 1, 3, 0};
    const auto chain = [parents](const Vars<S>& in) {
      const PosedSkeleton<S> posed =
          in.size() > 2 ? kinematic_chain(in[0], in[1], parents, in[2])
                        : kinematic_chain(in[0], in[1], parents, std::vector<double>(3 * kJoints, 0.3));
      return Vars<S>{posed.transforms, posed.joints};
    };
    const PoisonInput turns = rotations(kFrames * kJoints, units_of(kJoints)), places{shape_of(kFrames, 3)};
    all.push_back({{turns, places}, chain, {units_of(kJoints), units_of(kJoints)}});
    all.push_back({{turns, places, {shape_of(kJoints, 3), shared}}, chain, {units_of(kJoints), units_of(kJoints)}});
    const SkinWeights<S> sparse(some_weights()), dense(spread_weights());
    const PoisonInput joints{shape_of(kJoints, 12)}, points{shape_of(kPoints, 3), joint_of};
    all.push_back(
        {{joints, points}, [sparse](const Vars<S>& in) { return skin_points(sparse, in[0], in[1]); }, {joint_of}});
    all.push_back({{joints, points, {shape_of(1, 3), shared}},
                   [sparse](const Vars<S>& in) { return skin_points(sparse, in[0], in[1], in[2]); },
                   {joint_of}});
    all.push_back({{{shape_of(kJoints, 12), shared}, {shape_of(kPoints, 3)}},
                   [dense](const Vars<S>& in) { return skin_points(dense, in[0], in[1]); }});
    all.push_back({{joints}, [sparse](const Vars<S>& in) { return blend_transforms(sparse, in[0]); }, {joint_of}});
    all.push_back({{{shape_of(kJoints, 12), shared}},
                   [dense](const Vars<S>& in) { return blend_transforms(dense, in[0]); },
                   {shared}});
    all.push_back({{joints, points, {shape_of(kPoints, 9), joint_of}},
                   [sparse](const Vars<S>& in) {
                     const SkinnedFrames<S> skinned = skin_frames(sparse, in[0], in[1], in[2]);
                     return Vars<S>{skinned.points, skinned.frames};
                   },
                   {joint_of, joint_of}});
    all.push_back({{{shape_of(kPoints, 12)}, {shape_of(kPoints, 3)}},
                   [](const Vars<S>& in) { return transform_points(in[0], in[1]); }});
    all.push_back({{{shape_of(kPoints, 12)}, {shape_of(kPoints, 3)}, {shape_of(1, 3), shared}},
                   [](const Vars<S>& in) { return canonical_directions(in[0], in[1], in[2]); },
                   {},
                   true});
    return all;
  }
};

LinearWeights some_map(Index outputs, Index inputs) {
  LinearWeights map;
  RandomSequence random(83);
  for (Index i = 0; i < outputs * inputs; ++i) map.weight.push_back(random.uniform(-0.3, 0.3));
  for (Index i = 0; i < outputs; ++i) map.bias.push_back(random.uniform(-0.3, 0.3));
  return map;
}

VposerWeights some_vposer() {
  constexpr Index kLatents = 8, kHidden = 16;
  return {"none",
          kLatents,
          {some_map(kHidden, kLatents), some_map(kHidden, kHidden), some_map(6 * kPoseJoints, kHidden)},
          {some_map(kHidden, 3 * kPoseJoints), some_map(kLatents, kHidden)}};
}

/// A color net of whose leaves the features are an input.
template <class S>
Var<S> colored(const Vars<S>& in) {
  const std::vector<float> means(static_cast<std::size_t>(3 * kPoints), 0.3f);
  ColorNet net = new_color_net(means, kJoints, {5, 7, 2, true, 3});
  for (ColorNet::Layer& layer : net.layers) {
    for (std::size_t i = 0; i < layer.weights.size(); ++i) layer.weights[i] = 0.3 * std::sin(static_cast<double>(i));
  }
  ColorNetVars<S> vars = color_net_leaves(in[0].owner(), net);
  vars.features = in[0];
  return color_net(vars, in[1], pose_code(in[3], net.code_joints), in[2]);
}

struct BodyNets {
  template <class S>
  std::vector<PoisonedOperator<S>> operator()() const {
    std::vector<PoisonedOperator<S>> all;
    const UnitOf frames = units_of(kPoseJoints);
    const Index poses = kFrames * kPoseJoints;
    all.push_back({{rotations(20)}, [](const Vars<S>& in) { return rotation_offsets(in[0]); }});
    all.push_back({{{shape_of(20, 3)}}, [](const Vars<S>& in) { return rotation_offsets_from_axis_angle(in[0]); }});
    all.push_back({{{shape_of(kFrames, 63)}}, [](const Vars<S>& in) { return natural_decode(in[0]); }, {frames}});
    all.push_back({{rotations(poses, frames)}, [](const Vars<S>& in) { return natural_encode(in[0]); }});
    all.push_back({{rotations(poses)}, [](const Vars<S>& in) { return joint_limit_excess(in[0]); }});
    const Vposer<S> vposer(some_vposer());
    all.push_back(
        {{{shape_of(kFrames, 8)}}, [vposer](const Vars<S>& in) { return vposer_decode(vposer, in[0]); }, {frames}});
    all.push_back(
        {{{shape_of(poses, 3), frames}}, [vposer](const Vars<S>& in) { return vposer_encode(vposer, in[0]); }});
    std::vector<double> values(static_cast<std::size_t>(3 * kPoints * 9 * 2));
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = 0.01 * std::sin(static_cast<double>(i));
    const Directions<S> shapes(DirectionSource{values, kPoints, 18, {0}, 18});
    all.push_back({{{shape_of(1, 18), shared}},
                   [shapes](const Vars<S>& in) {
                     const std::array<BlendTerm<S>, 1> terms = {{{shapes, in[0]}}};
                     static const std::vector<double> rest(static_cast<std::size_t>(3 * kPoints), 0.3);
                     return blend_shapes(rest, std::span<const BlendTerm<S>>(terms));
                   },
                   {shared}});
    const PoseDirections<S> directions(values, kPoints, 1, 2, 0);
    all.push_back({{{shape_of(2, 9), shared}, {shape_of(kPoints, 3)}},
                   [directions](const Vars<S>& in) { return pose_correctives(directions, in[0], in[1]); }});
    all.push_back({{{shape_of(kPoints, 5)},
                    {shape_of(kPoints, 3), {}, 0.1, 0.9},
                    {shape_of(kPoints, 3)},
                    {shape_of(kJoints, 9), shared}},
                   [](const Vars<S>& in) { return colored<S>(in); }});
    return all;
  }
};

}  // namespace

std::vector<StressFigure> poisoned_skeletons(Remedy remedy) { return family_leaks(Skeletons(), remedy); }
std::vector<StressFigure> poisoned_body_nets(Remedy remedy) { return family_leaks(BodyNets(), remedy); }

void add_body_operators(OperatorNames& names) {
  add_family_operators(Skeletons(), names);
  add_family_operators(BodyNets(), names);
}

}  // namespace hsi4d::stress
