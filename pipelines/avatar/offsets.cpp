#include "pipelines/avatar/offsets.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "core/parallel.h"
#include "core/quaternion.h"

namespace hsi4d {

namespace {

using Vector = Vector3<double>;

constexpr Index kOffsetGrain = 512;
constexpr double kLeastReach = 1e-9;  // metres: where the fifth control is where the others are, all count alike

Vector mean_of(const Avatar& avatar, Index n) { return Vector3<float>(avatar.means.data() + 3 * n).cast<double>(); }

/// From the nearest place on a bone, which goes from a joint to its parent, to a point.
Vector from_bones(const Avatar& avatar, const Vector& point) {
  Vector best = point - Vector(avatar.joints.data());
  for (std::size_t j = 1; j < avatar.parents.size(); ++j) {
    const Vector from(avatar.joints.data() + 3 * avatar.parents[j]), way = Vector(avatar.joints.data() + 3 * j) - from;
    const double length = way.squaredNorm();
    const double share = length > 0 ? std::clamp((point - from).dot(way) / length, 0.0, 1.0) : 0;
    const Vector off = point - from - share * way;
    if (off.squaredNorm() < best.squaredNorm()) best = off;
  }
  return best;
}

/// Rows of Gaussians, each the farthest from those before it; the first is row 0.
std::vector<Index> spread_rows(const Avatar& avatar, Index count) {
  std::vector<double> distance(static_cast<std::size_t>(avatar.count()), std::numeric_limits<double>::infinity());
  std::vector<Index> rows = {0};
  while (std::ssize(rows) < count) {
    const Vector last = mean_of(avatar, rows.back());
    parallel_for(avatar.count(), kOffsetGrain, [&](Index begin, Index end) {
      for (Index n = begin; n < end; ++n) {
        double& d = distance[static_cast<std::size_t>(n)];
        d = std::min(d, (mean_of(avatar, n) - last).squaredNorm());
      }
    });
    rows.push_back(std::max_element(distance.begin(), distance.end()) - distance.begin());
  }
  return rows;
}

/// The nearest places, with squared distances, the nearest first; of equal ones that of the lower number.
std::vector<std::pair<double, std::uint32_t>> nearest_of(const std::vector<Vector>& places, const Vector& point,
                                                         std::size_t count) {
  std::vector<std::pair<double, std::uint32_t>> all;
  for (std::size_t k = 0; k < places.size(); ++k)
    all.emplace_back((places[k] - point).squaredNorm(), static_cast<std::uint32_t>(k));
  count = std::min(count, all.size());
  std::partial_sort(all.begin(), all.begin() + static_cast<Index>(count), all.end());
  all.resize(count);
  return all;
}

}  // namespace

std::vector<float> outward_normals(const Avatar& avatar) {
  std::vector<float> normals(avatar.means.size());
  parallel_for(avatar.count(), kOffsetGrain, [&](Index begin, Index end) {
    for (Index n = begin; n < end; ++n) {
      const float* const scales = avatar.log_scales.data() + 3 * n;
      const float* const q = avatar.quats.data() + 4 * n;
      const Matrix3<double> axes = quaternion_to_matrix(Vector4<double>(q[0], q[1], q[2], q[3]));
      Vector normal = axes.col(static_cast<int>(std::min_element(scales, scales + 3) - scales));
      if (normal.dot(from_bones(avatar, mean_of(avatar, n))) < 0) normal = -normal;
      for (int i = 0; i < 3; ++i) normals[static_cast<std::size_t>(3 * n + i)] = static_cast<float>(normal[i]);
    }
  });
  return normals;
}

OffsetField offset_field(const Avatar& avatar, Index controls) {
  HSI4D_CHECK(avatar.count() > 0, "an avatar without Gaussians");
  OffsetField field{outward_normals(avatar), std::min(controls, avatar.count()), {}, {}};
  const auto count = static_cast<std::size_t>(avatar.count());
  for (std::size_t k = 0; k < OffsetField::kNear; ++k) {
    field.controls_of[k].assign(count, 0);
    field.shares[k].assign(count, 0);
  }
  std::vector<Vector> places;
  for (const Index row : spread_rows(avatar, field.controls)) places.push_back(mean_of(avatar, row));
  parallel_for(avatar.count(), kOffsetGrain, [&](Index begin, Index end) {
    for (Index row = begin; row < end; ++row) {
      const auto n = static_cast<std::size_t>(row);
      const auto near = nearest_of(places, mean_of(avatar, row), OffsetField::kNear + 1);
      const double reach = std::sqrt(near.back().first) + kLeastReach;
      double sum = 0;
      std::array<double, OffsetField::kNear> shares{};
      for (std::size_t k = 0; k < std::min(near.size(), OffsetField::kNear); ++k) {
        const double left = 1 - std::sqrt(near[k].first) / reach;
        sum += shares[k] = left * left;
        field.controls_of[k][n] = near[k].second;
      }
      for (std::size_t k = 0; k < OffsetField::kNear; ++k) field.shares[k][n] = static_cast<float>(shares[k] / sum);
    }
  });
  return field;
}

template <class S>
Var<S> offset_means(const OffsetField& field, Var<S> means, Var<S> offsets) {
  Tape<S>& tape = means.owner();
  const Index rows = means.shape().rows;
  const auto constant = [&](const char* name, const std::vector<float>& values, Index cols) {
    const Var<S> var = tape.constant(name, shape_of(rows, cols));
    tape.set(var, std::vector<S>(values.begin(), values.end()));
    return var;
  };
  Var<S> along;
  for (std::size_t k = 0; k < OffsetField::kNear; ++k) {
    const Var<S> part = gather_rows(offsets, field.controls_of[k]) * constant("offset_shares", field.shares[k], 1);
    along = k == 0 ? part : along + part;
  }
  return means + constant("normals", field.normals, 3) * along;
}

template Var<float> offset_means(const OffsetField&, Var<float>, Var<float>);
template Var<double> offset_means(const OffsetField&, Var<double>, Var<double>);

}  // namespace hsi4d
