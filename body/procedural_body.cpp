#include "body/procedural_body.h"

#include <algorithm>
#include <cmath>

#include "body/procedural_directions.h"
#include "body/procedural_shape.h"
#include "body/procedural_weights.h"
#include "body/surface_nets.h"

namespace hsi4d {

namespace {

using Vector = Vector3<double>;

/// Height of the model's origin above the floor: 0.35 m above the pelvis.
constexpr double kOriginHeight = 1.295;

/// Cells of the body's grid, metres; those of hands and head are smaller by the factors below.
constexpr double kCell = 0.0150;
constexpr double kHandScale = 0.28;
constexpr double kHeadScale = 0.55;

/// A change of scale along an axis: 1 below `from`, `scale` above `to`, smooth between.
struct Refinement {
  double from, to, scale;

  double scale_at(double x) const { return 1 - (1 - scale) * detail::smoothstep(from, to, x); }
  /// ∫₀ˣ scale_at
  double length_to(double x) const {
    if (x <= from) return x;
    const double t = std::min((x - from) / (to - from), 1.0);
    const double between = (to - from) * (t - (1 - scale) * t * t * t * (1 - t / 2));  // ∫ 3t² − 2t³ = t³ − t⁴/2
    return from + between + std::max(x - to, 0.0) * scale;
  }
};

/// From the grid to the body: hands and head are drawn together about their axes, so that even cells become finer
/// there.
Vector bent(const Vector& grid) {
  constexpr Refinement kHand{0.60, 0.72, kHandScale};
  constexpr Refinement kHead{1.46, 1.54, kHeadScale};
  constexpr double kHandY = 1.396, kHandZ = -0.012;
  const double x = std::abs(grid[0]);
  const double hand = kHand.scale_at(x);
  Vector p(std::copysign(kHand.length_to(x), grid[0]), kHandY + (grid[1] - kHandY) * hand,
           kHandZ + (grid[2] - kHandZ) * hand);
  const double head = kHead.scale_at(p[1]);
  return {p[0] * head, kHead.length_to(p[1]), p[2] * head};
}

detail::NetMesh body_mesh() {
  detail::NetGrid grid;
  grid.cell = kCell;
  const double half_width = 1.68, low_y = -0.045, high_y = 1.96, low_z = -0.36, high_z = 0.42;
  const int half_nodes = static_cast<int>(half_width / kCell);
  grid.nodes = {2 * half_nodes + 1, static_cast<int>((high_y - low_y) / kCell),
                static_cast<int>((high_z - low_z) / kCell)};
  grid.low = {-half_nodes * kCell, low_y, low_z};
  return detail::surface_net(
      grid, [](const Vector& p) { return bent(p); }, [](const Vector& p) { return detail::body_field(p); },
      {0, 1.1, 0});
}

/// The first `count` of the columns of a matrix.
std::vector<double> first_columns(const std::vector<double>& matrix, Index columns, Index count) {
  std::vector<double> result;
  const Index rows = static_cast<Index>(matrix.size()) / columns;
  for (Index row = 0; row < rows; ++row) {
    const double* const from = matrix.data() + row * columns;
    result.insert(result.end(), from, from + count);
  }
  return result;
}

/// A relaxed hand, and the ways from there to a fist, to spread fingers, and to a thumb across the palm.
SmplxHand hand_space(int side) {
  using detail::kClosedHand, detail::kRelaxedHand;
  detail::HandBend spread = kRelaxedHand, thumb = kRelaxedHand;
  spread.spread = 0.15;
  thumb.thumb = kClosedHand.thumb;
  const std::array<double, 45> mean = detail::hand_pose_of(kRelaxedHand, side);
  SmplxHand hand{{mean.begin(), mean.end()}, {}};
  for (const detail::HandBend& bend : {kClosedHand, spread, thumb}) {
    const std::array<double, 45> pose = detail::hand_pose_of(bend, side);
    for (std::size_t i = 0; i < pose.size(); ++i) hand.components.push_back(pose[i] - mean[i]);
  }
  return hand;
}

BodyModel made_body() {
  const detail::NetMesh mesh = body_mesh();
  BodyModel body;
  body.name = kProceduralName;
  body.joint_names = smplx_joint_names();
  body.parents = smplx_parents();
  body.joints = detail::procedural_joints();
  for (std::size_t i = 1; i < body.joints.size(); i += 3) body.joints[i] -= kOriginHeight;
  for (const Vector& p : mesh.vertices) {
    for (const double x : {p[0], p[1] - kOriginHeight, p[2]}) body.vertices.push_back(static_cast<float>(x));
  }
  body.faces = mesh.faces;
  body.weights = detail::procedural_weights(mesh);
  return body;
}

}  // namespace

BodyModel procedural_body() {
  static const BodyModel body = made_body();
  return body;
}

SmplxModel procedural_smplx(Index betas) {
  constexpr Index kBetas = kProceduralBetas;
  HSI4D_CHECK(betas >= 0 && betas <= kBetas, std::to_string(betas) + " betas");
  const BodyModel body = procedural_body();
  const detail::ShapeDirections directions = detail::procedural_directions(body);
  SmplxModel model;
  model.source = "the procedural body";
  model.name = kProceduralName;
  model.vertices.assign(body.vertices.begin(), body.vertices.end());
  model.faces = body.faces;
  model.parents = body.parents;
  model.joints = body.joints;
  model.shape = first_columns(directions.vertices, kBetas, betas);
  model.joint_shape = first_columns(directions.joints, kBetas, betas);
  model.betas = betas;
  model.betas_in_file = kBetas;
  model.weights = {body.vertex_count(), body.joint_count(), {}};
  model.weights.weights.resize(static_cast<std::size_t>(body.vertex_count() * body.joint_count()));
  for (std::size_t i = 0; i < body.weights.indices.size(); ++i) {
    const std::size_t vertex = i / static_cast<std::size_t>(body.weights.per_vertex);
    const auto joint = static_cast<std::size_t>(body.weights.indices[i]);
    model.weights.weights[vertex * body.parents.size() + joint] += body.weights.weights[i];
  }
  for (int side = 0; side < 2; ++side) model.hands[static_cast<std::size_t>(side)] = hand_space(side);
  return model;
}

}  // namespace hsi4d
