#include "pipelines/draw/seen_rows.h"

#include <array>
#include <numbers>
#include <numeric>

#include "core/rotation.h"
#include "pipelines/draw/taped_scene.h"

namespace hsi4d {

namespace {

/// Pixels, of a Gaussian: a twentieth of what one has in the middle that is seen, of 50,000 on a figure of 250 pixels.
constexpr double kLeastWeight = 0.02;

/// The Gaussians with grey harmonics of degree 0: what is asked is where they are, not their colour.
PosedGaussians grey(const PosedGaussians& part) {
  PosedGaussians result = part;
  result.gaussians.sh_degree = 0;
  result.gaussians.sh.assign(3 * static_cast<std::size_t>(part.gaussians.count()), 0);
  return result;
}

Vector3<double> middle(const PosedGaussians& part) {
  const std::vector<double> means = TapedScene<double>::posed_means(part, Vector3<double>::Zero());
  Vector3<double> sum = Vector3<double>::Zero();
  for (std::size_t n = 0; n < means.size(); n += 3) sum += Vector3<double>(means.data() + n);
  return sum / static_cast<double>(part.gaussians.count());
}

/// The update of a camera that turns it about a place, in its own axes.
Vector6<double> turn_about(const Vector3<double>& place, const Vector3<double>& axis_angle) {
  const Matrix3<double> turn = so3_exp(axis_angle);
  return se3_log(Rigid<double>{turn, place - turn * place});
}

/// Marks what is seen after the camera's update: the derivative of the image's sum by a Gaussian's colour is the sum of
/// its weights.
void mark_seen(TapedScene<float>& scene, const Vector6<double>& xi, std::vector<char>& is_seen) {
  scene.tape.set(scene.xi, std::vector<float>(xi.data(), xi.data() + 6));
  scene.tape.forward(scene.rendered.image);
  const auto numbers = static_cast<std::size_t>(scene.rendered.image.shape().count());
  scene.tape.backward(scene.rendered.image, std::vector<float>(numbers, 1));
  const std::vector<double> of_harmonics = scene.gradient(scene.sh);
  for (std::size_t n = 0; n < is_seen.size(); ++n) {
    if (of_harmonics[3 * n] > kShC0 * kLeastWeight) is_seen[n] = 1;
  }
}

}  // namespace

std::vector<Index> seen_rows(const PosedGaussians& part, const ViewRange& view_range) {
  const PosedGaussians drawn = grey(part);
  TapedScene<float> scene(drawn, {view_range.camera, {}, view_range.render}, false);
  for (const Var<float> var : {scene.means, scene.quats, scene.log_scales, scene.logits, scene.xi})
    scene.tape.freeze(var);
  const Vector3<double> about = transform_point(view_range.camera.camera_from_world, middle(drawn));
  const double angle = view_range.within_deg * std::numbers::pi / 180;
  const std::array<Vector3<double>, 5> turns = {
      {{0, 0, 0}, {angle, 0, 0}, {-angle, 0, 0}, {0, angle, 0}, {0, -angle, 0}}};
  std::vector<char> is_seen(static_cast<std::size_t>(part.gaussians.count()));
  for (const Vector3<double>& turn : turns) mark_seen(scene, turn_about(about, turn), is_seen);
  std::vector<Index> rows;
  for (std::size_t n = 0; n < is_seen.size(); ++n) {
    if (is_seen[n] != 0) rows.push_back(static_cast<Index>(n));
  }
  return rows.empty() ? all_rows(part.gaussians.count()) : rows;
}

std::vector<Index> all_rows(Index count) {
  std::vector<Index> rows(static_cast<std::size_t>(count));
  std::iota(rows.begin(), rows.end(), Index{0});
  return rows;
}

}  // namespace hsi4d
