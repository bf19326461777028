#include "pipelines/synthetic_render.h"

#include <algorithm>
#include <array>
#include <string>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/rotations.h"
#include "body/kinematics.h"
#include "body/skinning.h"
#include "splat/covariance.h"
#include "splat/render.h"
#include "splat/sh.h"

namespace hsi4d {
namespace {

using Vars = SplatInputs<float>;

Var<float> constant(Tape<float>& tape, std::string_view name, const std::vector<float>& values, Index columns) {
  const Var<float> var = tape.constant(name, shape_of(static_cast<Index>(values.size()) / columns, columns));
  tape.set(var, values);
  return var;
}

std::vector<float> as_floats(std::span<const double> values) {
  std::vector<float> result;
  result.reserve(values.size());
  for (const double x : values) result.push_back(static_cast<float>(x));
  return result;
}

Var<float> transform_var(Tape<float>& tape, const Rigid<double>& rigid) {
  std::vector<float> rows;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) rows.push_back(static_cast<float>(rigid.rotation(i, j)));
    rows.push_back(static_cast<float>(rigid.translation[i]));
  }
  return constant(tape, "world_from_object", rows, 12);
}

Vars room_vars(Tape<float>& tape, const Gaussians& g, Var<float> xi, const SplatView& view) {
  Vars vars;
  vars.means = constant(tape, "room means", g.means, 3);
  vars.axes =
      gaussian_axes(constant(tape, "room quats", g.quats, 4), constant(tape, "room log_scales", g.log_scales, 3));
  vars.opacities = sigmoid(constant(tape, "room opacity_logits", g.opacity_logits, 1));
  vars.colors = sh_colors(constant(tape, "room sh", g.sh, 3 * g.sh_coefficients()), vars.means, xi, view);
  return vars;
}

Vars object_vars(Tape<float>& tape, const Gaussians& g, const Rigid<double>& pose, Var<float> xi,
                 const SplatView& view) {
  SparseWeights one_bone{g.count(), 1, 1, std::vector<std::int32_t>(static_cast<std::size_t>(g.count()), 0),
                         std::vector<double>(static_cast<std::size_t>(g.count()), 1.0)};
  const Var<float> transform = transform_var(tape, pose);
  Vars vars;
  vars.means = skin_points(SkinWeights<float>(one_bone), transform, constant(tape, "object means", g.means, 3));
  vars.axes = transform_axes(transform, gaussian_axes(constant(tape, "object quats", g.quats, 4),
                                                      constant(tape, "object log_scales", g.log_scales, 3)));
  vars.opacities = sigmoid(constant(tape, "object opacity_logits", g.opacity_logits, 1));
  vars.colors = sh_colors(constant(tape, "object sh", g.sh, 3 * g.sh_coefficients()), vars.means, xi, view, transform);
  return vars;
}

Vars avatar_vars(Tape<float>& tape, const Avatar& avatar, const BodyPose& pose) {
  const Var<float> rotations = rotations_from_axis_angle(constant(tape, "pose", as_floats(pose.axis_angle), 3));
  const std::array<double, 3> transl = {pose.transl[0], pose.transl[1], pose.transl[2]};
  const PosedSkeleton<float> skeleton =
      kinematic_chain(rotations, constant(tape, "transl", as_floats(transl), 3), avatar.parents, avatar.joints);
  const Var<float> blended = blend_transforms(SkinWeights<float>(avatar.weights), skeleton.transforms);
  Vars vars;
  vars.means = transform_points(blended, constant(tape, "avatar means", avatar.means, 3));
  vars.axes = transform_axes(blended, gaussian_axes(constant(tape, "avatar quats", avatar.quats, 4),
                                                    constant(tape, "avatar log_scales", avatar.log_scales, 3)));
  vars.opacities = sigmoid(constant(tape, "avatar opacity_logits", avatar.opacity_logits, 1));
  vars.colors = constant(tape, "avatar colors", avatar.colors, 3);
  return vars;
}

Vars joined(std::span<const Vars> parts) {
  const auto rows = [parts](Var<float> Vars::*member) {
    std::vector<Var<float>> vars;
    for (const Vars& part : parts) vars.push_back(part.*member);
    return concat_rows(std::span<const Var<float>>(vars));
  };
  return {rows(&Vars::means), rows(&Vars::axes), rows(&Vars::opacities), rows(&Vars::colors)};
}

/// Planes [first, first + count) of an image on the tape, held in [0, 1].
Image held_image(const ConstArray<float>& values, int first, int count) {
  Image image(count, static_cast<int>(values.shape.rows), static_cast<int>(values.shape.cols));
  for (int c = 0; c < count; ++c)
    for (int y = 0; y < image.height(); ++y)
      for (int x = 0; x < image.width(); ++x) image(c, y, x) = std::clamp(values(first + c, y, x), 0.0F, 1.0F);
  return image;
}

}  // namespace

SyntheticFrame SyntheticRenderer::frame(const BodyPose& pose, const Rigid<double>& world_from_object,
                                        const Camera& camera, int supersample) const {
  const SplatView view{resized(camera, camera.width * supersample, camera.height * supersample), room_.origin_world,
                       settings_};
  Tape<float> tape;
  const Var<float> xi = tape.constant("xi", shape_of(1, 6));
  const std::array<Vars, 3> parts = {room_vars(tape, room_, xi, view),
                                     object_vars(tape, object_, world_from_object, xi, view),
                                     avatar_vars(tape, avatar_, pose)};
  const Index first = room_.count(), second = first + object_.count(), end = second + avatar_.count();
  RenderRequest request;
  request.groups = {{second, end}, {first, second}};
  const Rendered<float> rendered =
      render(joined(parts), xi, tape.constant("background", shape_of(1, 3)), view, request);
  tape.forward(rendered.image);
  tape.forward(rendered.group_opacity);
  const auto reduced = [&](Var<float> var, int plane, int count) {
    return resize_area(held_image(tape.value(var), plane, count), camera.height, camera.width);
  };
  return {reduced(rendered.image, 0, 3), reduced(rendered.group_opacity, 0, 1), reduced(rendered.group_opacity, 1, 1)};
}

}  // namespace hsi4d
