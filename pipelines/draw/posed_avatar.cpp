#include "pipelines/draw/posed_avatar.h"

#include <algorithm>

#include "autodiff/rotations.h"
#include "body/canonical_directions.h"
#include "core/check.h"
#include "core/rotation.h"
#include "splat/render/sh.h"

namespace hsi4d {

namespace {

template <class T>
Var<double> constant(Tape<double>& tape, const char* name, const std::vector<T>& numbers, Index columns) {
  const Var<double> var = tape.constant(name, shape_of(static_cast<Index>(numbers.size()) / columns, columns));
  tape.set(var, std::vector<double>(numbers.begin(), numbers.end()));
  return var;
}

/// The color net's colours.
std::vector<float> colors_by_net(const Avatar& avatar, const BodyPose& pose, const std::vector<double>& transforms,
                                 const Vector3<double>* center_world) {
  const ColorNet& net = *avatar.color_net;
  Tape<double> tape;
  const Var<double> rotations = rotations_from_axis_angle(constant(tape, "pose", pose.axis_angle, 3));
  Var<double> directions;
  if (net.view_direction) {
    HSI4D_CHECK(center_world != nullptr, "the avatar's color net needs the camera's centre");
    const Var<double> blended = constant(tape, "transforms", transforms, 12);
    directions = canonical_directions(
        blended, transform_points(blended, constant(tape, "means", avatar.means, 3)),
        constant(tape, "center", std::vector<double>(center_world->data(), center_world->data() + 3), 3));
  }
  const Var<double> colors = color_net(color_net_leaves(tape, net), constant(tape, "colors", avatar.colors, 3),
                                       pose_code(rotations, net.code_joints), directions);
  tape.forward(colors);
  return {tape.value(colors).data, tape.value(colors).data + 3 * avatar.count()};
}

/// Harmonics of degree 0.
std::vector<float> harmonics_of(std::vector<float> colors) {
  for (float& color : colors) color = static_cast<float>((static_cast<double>(color) - 0.5) / kShC0);
  return colors;
}

}  // namespace

Gaussians rest_gaussians(const Avatar& avatar) {
  check_sizes(avatar);
  return {.means = avatar.means,
          .quats = avatar.quats,
          .log_scales = avatar.log_scales,
          .opacity_logits = avatar.opacity_logits,
          .sh = harmonics_of(avatar.colors)};
}

std::vector<double> blended_transforms(const Avatar& avatar, const BodyPose& pose) {
  const PosedJoints skeleton = pose_skeleton(avatar, pose);
  const SparseWeights& weights = avatar.weights;
  std::vector<double> transforms(12 * static_cast<std::size_t>(avatar.count()));
  for (Index i = 0; i < weights.vertices * weights.per_vertex; ++i) {
    const double* joint = skeleton.transforms.data() + 12 * Index{weights.indices[static_cast<std::size_t>(i)]};
    double* blended = transforms.data() + 12 * (i / weights.per_vertex);
    for (int e = 0; e < 12; ++e) blended[e] += weights.weights[static_cast<std::size_t>(i)] * joint[e];
  }
  return transforms;
}

PosedGaussians posed_avatar(const Avatar& avatar, const BodyPose& pose, const Vector3<double>* center_world) {
  PosedGaussians posed{rest_gaussians(avatar), blended_transforms(avatar, pose)};
  if (avatar.color_net) posed.gaussians.sh = harmonics_of(colors_by_net(avatar, pose, posed.transforms, center_world));
  return posed;
}

PosedGaussians posed_object(const Gaussians& object, const ObjectPose& pose) {
  PosedGaussians posed{object, {}};
  const Matrix3<double> r = so3_exp(pose.rotation);
  for (Index n = 0; n < object.count(); ++n) {
    for (int row = 0; row < 3; ++row)
      posed.transforms.insert(posed.transforms.end(), {r(row, 0), r(row, 1), r(row, 2), pose.translation[row]});
  }
  return posed;
}

PosedGaussians concatenated(std::span<const PosedGaussians> parts) {
  std::vector<const Gaussians*> gaussians;
  bool moved = false;
  for (const PosedGaussians& part : parts) {
    gaussians.push_back(&part.gaussians);
    moved = moved || !part.transforms.empty();
  }
  PosedGaussians all{concatenated(gaussians), {}};
  if (!moved) return all;
  constexpr std::array<double, 12> kIdentity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  for (const PosedGaussians& part : parts) {
    all.transforms.insert(all.transforms.end(), part.transforms.begin(), part.transforms.end());
    if (!part.transforms.empty()) continue;
    for (Index n = 0; n < part.gaussians.count(); ++n)
      all.transforms.insert(all.transforms.end(), kIdentity.begin(), kIdentity.end());
  }
  return all;
}

}  // namespace hsi4d
