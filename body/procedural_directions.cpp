#include "body/procedural_directions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "body/procedural_shape.h"
#include "core/rotation.h"
#include "core/text.h"

namespace hsi4d::detail {

namespace {

using Vector = Vector3<double>;

/// What a direction does to a bone: the share by which it grows along x, y and z of the rest pose for each unit.
struct Stretch {
  int direction;  ///< in kProceduralShapes
  const char* joint;
  Vector share;
  bool and_beyond = false;  ///< also all bones that hang on it
};

// Shares from tables of human measures (standard deviations of stature 4 %, of mass 20 %, of lengths of limbs at one
// stature 2 to 3 %, of breadths 5 %), rounded. Names without a side mean both sides. Arms lie along x, all else along
// y.
const Stretch kStretches[] = {
    {0, "pelvis", {0.04, 0.04, 0.04}, true},
    {1, "pelvis", {0.09, 0, 0.12}},
    {1, "spine1", {0.09, 0, 0.13}},
    {1, "spine2", {0.08, 0, 0.11}},
    {1, "spine3", {0.06, 0, 0.09}},
    {1, "neck", {0.07, 0, 0.07}},
    {1, "head", {0.015, 0, 0.01}},
    {1, "jaw", {0.04, 0, 0.02}},
    {1, "hip", {0.10, 0, 0.10}},
    {1, "knee", {0.06, 0, 0.06}},
    {1, "collar", {0, 0.07, 0.08}},
    {1, "shoulder", {0, 0.09, 0.09}},
    {1, "elbow", {0, 0.06, 0.06}},
    {1, "wrist", {0, 0.03, 0.02}, true},
    {2, "hip", {0, 0.04, 0}},
    {2, "knee", {0, 0.04, 0}},
    {3, "shoulder", {0.04, 0, 0}},
    {3, "elbow", {0.04, 0, 0}},
    {4, "spine1", {0, 0.05, 0}},
    {4, "spine2", {0, 0.05, 0}},
    {4, "spine3", {0, 0.03, 0}},
    {5, "spine3", {0.05, 0, 0.02}},
    {5, "collar", {0.08, 0.01, 0.02}},
    {6, "pelvis", {0.08, 0, 0.05}},
    {6, "hip", {0.03, 0, 0.03}},
    {7, "spine1", {0.06, 0, 0.16}},
    {7, "spine2", {0.02, 0, 0.08}},
    {7, "pelvis", {0.02, 0, 0.05}},
    {8, "head", {0.04, 0.04, 0.04}, true},
    {9, "wrist", {0.05, 0.05, 0.05}, true},
    {9, "ankle", {0.05, 0.03, 0.06}, true},
};

bool hangs_on(const std::vector<int>& parents, int joint, int ancestor) {
  while (joint > ancestor) joint = parents[static_cast<std::size_t>(joint)];
  return joint == ancestor;
}

/// s_j of one direction.
std::vector<Vector> stretches_of(const std::vector<std::string>& names, const std::vector<int>& parents,
                                 int direction) {
  std::vector<Vector> result(parents.size(), Vector::Zero());
  for (const Stretch& stretch : kStretches) {
    if (stretch.direction != direction) continue;
    for (std::size_t j = 0; j < result.size(); ++j) {
      for (const char* side : {"", "left_", "right_"}) {
        const auto named = std::find(names.begin(), names.end(), std::string(side) + stretch.joint);
        if (named == names.end()) continue;
        const int joint = static_cast<int>(named - names.begin()), at = static_cast<int>(j);
        if (at == joint || (stretch.and_beyond && hangs_on(parents, at, joint))) result[j] += stretch.share;
      }
    }
  }
  return result;
}

Vector row_of(const double* numbers, Index row) { return Vector(numbers + 3 * row); }

/// @param right  mirrors the left hand's turn
void put_turn(Vector turn, bool right, double* to) {
  if (right) turn = Vector(turn[0], -turn[1], -turn[2]);
  for (int i = 0; i < 3; ++i) to[i] = turn[i];
}

}  // namespace

ShapeDirections procedural_directions(const BodyModel& body) {
  constexpr Index kDirections = kProceduralBetas;
  const Index joints = body.joint_count(), vertices = body.vertex_count();
  ShapeDirections result;
  result.vertices.resize(static_cast<std::size_t>(3 * vertices * kDirections));
  result.joints.resize(static_cast<std::size_t>(3 * joints * kDirections));
  const auto put = [](const Vector& d, Index row, Index direction, std::vector<double>& to) {
    for (Index i = 0; i < 3; ++i) to[static_cast<std::size_t>((3 * row + i) * kDirections + direction)] = d[i];
  };
  for (Index k = 0; k < kDirections; ++k) {
    const std::vector<Vector> stretch = stretches_of(body.joint_names, body.parents, static_cast<int>(k));
    std::vector<Vector> moved(stretch.size(), Vector::Zero());  // d_j
    for (Index j = 1; j < joints; ++j) {
      const auto at = static_cast<std::size_t>(j), parent = static_cast<std::size_t>(body.parents[at]);
      const Vector bone = row_of(body.joints.data(), j) - row_of(body.joints.data(), body.parents[at]);
      moved[at] = moved[parent] + stretch[parent].cwiseProduct(bone);
      put(moved[at], j, k, result.joints);
    }
    for (Index v = 0; v < vertices; ++v) {
      const float* const rest = body.vertices.data() + 3 * v;
      const Vector x(rest[0], rest[1], rest[2]);
      Vector d = Vector::Zero();
      for (Index w = v * body.weights.per_vertex; w < (v + 1) * body.weights.per_vertex; ++w) {
        const std::int32_t joint = body.weights.indices[static_cast<std::size_t>(w)];
        const auto j = static_cast<std::size_t>(joint);
        const Vector carried = moved[j] + stretch[j].cwiseProduct(Vector(x - row_of(body.joints.data(), joint)));
        d += body.weights.weights[static_cast<std::size_t>(w)] * carried;
      }
      put(d, v, k, result.vertices);
    }
  }
  return result;
}

std::array<double, 45> hand_pose_of(const HandBend& bend, int side) {
  std::array<double, 45> pose{};
  const Vector palm(0, -1, 0);                      // the way that it looks in the rest pose
  const double places[4] = {-1.5, -0.5, 1.5, 0.5};  // index, middle, pinky, ring, from the middle of the hand
  for (std::size_t f = 0; f < 4; ++f) {
    const auto& at = left_fingers()[f].points;
    const Vector axis = direction_of(Vector(cross(Vector(at[3] - at[0]), palm))).unit;
    const double angles[3] = {bend.base, bend.middle, bend.tip};
    for (std::size_t bone = 0; bone < 3; ++bone) {
      Vector turn = axis * angles[bone];
      if (bone == 0) turn += palm * (-places[f] * bend.spread);
      put_turn(turn, side == 1, pose.data() + 9 * f + 3 * bone);
    }
  }
  // Found by a search: at 1 the thumb lies on the bent index and middle fingers, and goes through neither.
  const Vector bending(0.505, 0.862, -0.047);
  const Vector turns[3] = {Vector(0.30, 0.05, -0.30), bending * 0.85, bending * 0.85};
  for (std::size_t bone = 0; bone < 3; ++bone) {
    put_turn(turns[bone] * bend.thumb, side == 1, pose.data() + 36 + 3 * bone);
  }
  return pose;
}

}  // namespace hsi4d::detail

namespace hsi4d {

std::string procedural_shape_fault(std::span<const double> betas) {
  HSI4D_CHECK(std::ssize(betas) <= kProceduralBetas, std::to_string(betas.size()) + " betas");
  const std::vector<std::string>& names = smplx_joint_names();
  const std::vector<int>& parents = smplx_parents();
  std::vector<Vector3<double>> scale(names.size(), Vector3<double>::Ones());
  for (std::size_t k = 0; k < betas.size(); ++k) {
    const auto stretch = detail::stretches_of(names, parents, static_cast<int>(k));
    for (std::size_t j = 0; j < scale.size(); ++j) scale[j] += betas[k] * stretch[j];
  }
  for (std::size_t j = 0; j < scale.size(); ++j) {
    for (int i = 0; i < 3; ++i) {
      if (scale[j][i] >= kLeastStretch && scale[j][i] <= kLargestStretch) continue;
      const std::array<const char*, 3> kAlong = {"wide", "high", "deep"};
      return "makes " + names[j] + " " + rounded(scale[j][i], 3) + " times as " + kAlong[static_cast<std::size_t>(i)] +
             " as the mean body's; allowed: " + number_text(kLeastStretch) + " to " + number_text(kLargestStretch);
    }
  }
  return "";
}

}  // namespace hsi4d
