#include "optim/motion_start.h"

#include <algorithm>
#include <array>

#include "body/body_model.h"
#include "body/pose_layout.h"
#include "core/check.h"

namespace hsi4d {

namespace {

Vector3<double> mean_at(const std::vector<float>& means, Index row) {
  return Vector3<float>(means.data() + 3 * row).cast<double>();
}

}  // namespace

RestPoints MotionStart::rest_points(BodySet of) const {
  if (of == BodySet::kGaussians) return {&avatar->means, &avatar->weights};
  HSI4D_CHECK(mesh != nullptr, "vertices of a body that is not known");
  return {&mesh->vertices, &mesh->weights};
}

Vector3<double> MotionStart::place(const BodyPoint& point) const {
  const RestPoints points = rest_points(point.of);
  const SparseWeights& weights = *points.weights;
  const PosedJoints& posed = body_in(point.frame);
  const Vector3<double> rest = mean_at(*points.places, point.row) + point.offset;
  Vector3<double> place = Vector3<double>::Zero();
  for (Index k = 0; k < weights.per_vertex; ++k) {
    const auto at = static_cast<std::size_t>(point.row * weights.per_vertex + k);
    const double* a = posed.transforms.data() + 12 * weights.indices[at];
    for (int r = 0; r < 3; ++r) {
      const double* row = a + 4 * r;
      place[r] += weights.weights[at] * (row[0] * rest[0] + row[1] * rest[1] + row[2] * rest[2] + row[3]);
    }
  }
  return place;
}

Vector3<double> MotionStart::place(const ObjectPoint& point) const {
  const auto object = static_cast<std::size_t>(point.object);
  const Vector3<double> at = mean_at(objects[object]->means, point.row) + point.offset;
  return transform_point(world_from_object[static_cast<std::size_t>(point.frame)][object], at);
}

std::optional<std::size_t> hand_of_joint(Index joint) {
  for (std::size_t hand = 0; hand < kWristJoints.size(); ++hand) {
    const Index finger = joint - kFirstHandJoint - static_cast<Index>(hand) * kHandJoints;
    if (joint == kWristJoints[hand] || (finger >= 0 && finger < kHandJoints)) return hand;
  }
  return {};
}

bool is_foot_joint(Index joint) {
  static const std::array feet = {smplx_joint("left_ankle"), smplx_joint("right_ankle"), smplx_joint("left_foot"),
                                  smplx_joint("right_foot")};
  return std::find(feet.begin(), feet.end(), joint) != feet.end();
}

std::vector<Index> rows_of_joints(const SparseWeights& weights, const std::function<bool(Index joint)>& is_part) {
  std::vector<Index> rows;
  for (Index v = 0; v < weights.vertices; ++v) {
    const auto first = weights.weights.begin() + v * weights.per_vertex;
    const auto largest = std::max_element(first, first + weights.per_vertex);
    if (is_part(weights.indices[static_cast<std::size_t>(largest - weights.weights.begin())])) rows.push_back(v);
  }
  return rows;
}

}  // namespace hsi4d
