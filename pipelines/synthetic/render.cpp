#include "pipelines/synthetic/render.h"

#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "autodiff/rotations.h"
#include "pipelines/draw/posed_splats.h"
#include "pipelines/draw/tape_image.h"

namespace hsi4d {
namespace {

Var<float> constant(Tape<float>& tape, std::string_view name, const std::vector<float>& values, Index columns) {
  const Var<float> var = tape.constant(name, shape_of(static_cast<Index>(values.size()) / columns, columns));
  tape.set(var, values);
  return var;
}

Var<float> constant(Tape<float>& tape, std::string_view name, std::span<const double> values, Index columns) {
  return constant(tape, name, std::vector<float>(values.begin(), values.end()), columns);
}

GaussianVars<float> constants(Tape<float>& tape, const Gaussians& g) {
  return {constant(tape, "means", g.means, 3), constant(tape, "quats", g.quats, 4),
          constant(tape, "log_scales", g.log_scales, 3), constant(tape, "opacity_logits", g.opacity_logits, 1),
          constant(tape, "sh", g.sh, 3 * g.sh_coefficients())};
}

SplatInputs<float> object_splats(Tape<float>& tape, const Gaussians& object, const Rigid<double>& pose, Var<float> xi,
                                 const SplatView& view) {
  const Matrix3<double> columns = pose.rotation.transpose();  // column-major, so its memory is the rows
  return rigid_splats(constants(tape, object), constant(tape, "rotation", std::span(columns.data(), 9), 9),
                      constant(tape, "translation", std::span(pose.translation.data(), 3), 3), xi, view);
}

SplatInputs<float> avatar_splats(Tape<float>& tape, const Avatar& avatar, const BodyPose& pose) {
  const GaussianVars<float> vars = {constant(tape, "means", avatar.means, 3), constant(tape, "quats", avatar.quats, 4),
                                    constant(tape, "log_scales", avatar.log_scales, 3),
                                    constant(tape, "opacity_logits", avatar.opacity_logits, 1),
                                    constant(tape, "colors", avatar.colors, 3)};
  const Var<float> rotations = rotations_from_axis_angle(constant(tape, "pose", std::span(pose.axis_angle), 3));
  return skinned_splats(vars, rotations, constant(tape, "transl", std::span(pose.transl.data(), 3), 3), avatar);
}

}  // namespace

SyntheticFrame SyntheticRenderer::frame(const BodyPose& pose, const Rigid<double>& world_from_object,
                                        const Camera& camera, int supersample,
                                        const std::vector<DrawnPerson>& others) const {
  const SplatView view{resized(camera, camera.width * supersample, camera.height * supersample), room_.origin_world,
                       settings_};
  Tape<float> tape;
  const Var<float> xi = tape.constant("xi", shape_of(1, 6));
  std::vector<SplatInputs<float>> parts = {standing_splats(constants(tape, room_), xi, view)};
  if (object_.count() > 0) parts.push_back(object_splats(tape, object_, world_from_object, xi, view));
  parts.push_back(avatar_splats(tape, avatar_, pose));
  const Index first = room_.count(), second = first + object_.count();
  Index end = second + avatar_.count();
  RenderRequest request;
  request.groups = {{second, end}};
  if (object_.count() > 0) request.groups.push_back({first, second});
  for (const DrawnPerson& other : others) {
    parts.push_back(avatar_splats(tape, other.avatar, other.pose));
    request.groups.push_back({end, end + other.avatar.count()});
    end += other.avatar.count();
  }
  const Rendered<float> rendered =
      render(stacked_splats(parts), xi, tape.constant("background", shape_of(1, 3)), view, request);
  tape.forward(rendered.image);
  tape.forward(rendered.group_opacity);
  const auto reduced = [&](Var<float> var, int plane, int count) {
    return resize_area(held_image(tape.value(var), plane, count), camera.height, camera.width);
  };
  SyntheticFrame frame{reduced(rendered.image, 0, 3), reduced(rendered.group_opacity, 0, 1), Image()};
  int plane = 1;
  if (object_.count() > 0) frame.object_mask = reduced(rendered.group_opacity, plane++, 1);
  for (std::size_t p = 0; p < others.size(); ++p)
    frame.other_masks.push_back(reduced(rendered.group_opacity, plane++, 1));
  return frame;
}

}  // namespace hsi4d
