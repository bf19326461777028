#include "body/skinning_movers.h"

#include "core/linear.h"
#include "core/parallel.h"

namespace hsi4d::detail {

namespace {

/// A x.
template <class S>
Vector3<double> placed(const S* transform, const S* point) {
  Vector3<double> y;
  for (int r = 0; r < 3; ++r) {
    y[r] = static_cast<double>(transform[4 * r + 3]);
    for (int c = 0; c < 3; ++c) y[r] += static_cast<double>(transform[4 * r + c]) * static_cast<double>(point[c]);
  }
  return y;
}

/// What a transform's numbers are multiplied with to give its twist about `origin`: of a small motion (v, ω) of all
/// that it places, dR = ω × R, dt = v + ω × (t − o), and so v_k is that of the point that lies at o, ω_k = ½ tr((e_k ×
/// R)ᵀ dR).
template <class S>
std::array<std::vector<double>, kTwist> twist_cotangents(const S* transform, const Vector3<double>& origin) {
  Matrix3<double> rotation;
  Vector3<double> translation;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) rotation(r, c) = static_cast<double>(transform[4 * r + c]);
    translation[r] = static_cast<double>(transform[4 * r + 3]);
  }
  const Vector3<double> at_rest = rotation.transpose() * (origin - translation);
  std::array<std::vector<double>, kTwist> cotangents;
  for (int k = 0; k < 3; ++k) {
    std::vector<double>& velocity = cotangents[static_cast<std::size_t>(k)];
    velocity.assign(kTransformSize, 0.0);
    for (int c = 0; c < 3; ++c) velocity[static_cast<std::size_t>(4 * k + c)] = at_rest[c];
    velocity[static_cast<std::size_t>(4 * k + 3)] = 1;
    const Matrix3<double> turned = 0.5 * hat(Vector3<double>(Vector3<double>::Unit(k))) * rotation;
    std::vector<double>& turn = cotangents[static_cast<std::size_t>(3 + k)];
    turn.assign(kTransformSize, 0.0);
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) turn[static_cast<std::size_t>(4 * r + c)] = turned(r, c);
    }
  }
  return cotangents;
}

}  // namespace

template <class S>
void push_joints(NodeIo<S>& io, const SparseTable<S>& table, Movers<S>& movers) {
  if (!io.wants(0)) return;
  const ConstArray<S> transforms = io.in(0), points = io.in(1);
  const Index per_row = table.per_vertex;
  std::vector<Vector3<double>> origins(static_cast<std::size_t>(table.joints), Vector3<double>::Zero());
  std::vector<double> sums(static_cast<std::size_t>(table.joints), 0);
  const auto joint_of = [&](Index v, Index k) { return table.offsets[v * per_row + k] / kTransformSize; };
  const auto weight_of = [&](Index v, Index k) { return static_cast<double>(table.weights[v * per_row + k]); };
  for (Index v = 0; v < table.vertices; ++v) {
    for (Index k = 0; k < per_row; ++k) {
      const double w = weight_of(v, k);
      if (w == 0) continue;
      const auto j = static_cast<std::size_t>(joint_of(v, k));
      origins[j] += w * placed(transforms.row(joint_of(v, k)), points.row(v));
      sums[j] += w;
    }
  }
  std::vector<std::int32_t> numbers(static_cast<std::size_t>(table.joints), -1);
  for (std::size_t j = 0; j < numbers.size(); ++j) {
    if (sums[j] == 0) continue;
    origins[j] /= sums[j];
    const auto row = static_cast<Index>(j);
    numbers[j] = movers.add(io, 0, row, twist_cotangents(transforms.row(row), origins[j]));
  }
  Twists<S>& twists = movers.of_output(io, 0, table.vertices, per_row, 3);
  parallel_for(table.vertices, kSkinGrain, [&](Index begin, Index end) {
    for (Index v = begin; v < end; ++v) {
      for (Index k = 0; k < per_row; ++k) {
        const double w = weight_of(v, k);
        if (w == 0) continue;
        const auto j = static_cast<std::size_t>(joint_of(v, k));
        twists.mover(v, k) = numbers[j];
        const Vector3<double> arm = placed(transforms.row(joint_of(v, k)), points.row(v)) - origins[j];
        const Matrix3<double> turn = -hat(arm);
        S* const rate = twists.rate(v, k);
        for (int r = 0; r < 3; ++r) {
          for (int c = 0; c < 3; ++c) {
            rate[kTwist * r + c] = static_cast<S>(r == c ? w : 0);
            rate[kTwist * r + 3 + c] = static_cast<S>(w * turn(r, c));
          }
        }
      }
    }
  });
}

template void push_joints(NodeIo<float>&, const SparseTable<float>&, Movers<float>&);
template void push_joints(NodeIo<double>&, const SparseTable<double>&, Movers<double>&);

}  // namespace hsi4d::detail
