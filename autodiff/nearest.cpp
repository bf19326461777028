#include "autodiff/nearest.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "core/check.h"
#include "core/parallel.h"

namespace hsi4d {

namespace {

/// A pair and how far it is apart, squared.
struct Pair {
  double squared = std::numeric_limits<double>::infinity();
  Index point = 0, target = 0;
};

template <class S>
struct NearestPairs {
  static constexpr const char* kName = "nearest_pairs";
  std::vector<NearestSet> sets;
  std::vector<Pair> nearest;  // of each set

  explicit NearestPairs(std::vector<NearestSet> s) : sets(std::move(s)), nearest(sets.size()) {}

  Index saved_bytes() const { return static_cast<Index>(nearest.capacity() * sizeof(Pair)); }

  /// The nearest target of a row of points.
  static Pair nearest_of(ConstArray<S> points, Index i, ConstArray<S> targets, const NearestSet& set) {
    const S* p = points.row(i);
    S least = std::numeric_limits<S>::infinity();
    Index at = set.first_target;
    for (Index j = set.first_target; j < set.first_target + set.targets; ++j) {
      const S* q = targets.row(j);
      const S x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
      const S squared = x * x + y * y + z * z;
      if (squared < least) {
        least = squared;
        at = j;
      }
    }
    return {static_cast<double>(least), i, at};
  }

  void forward(NodeIo<S>& io) {
    const ConstArray<S> points = io.in(0), targets = io.in(1);
    const auto of_point = io.template scratch<Pair>(points.shape.rows);
    for (std::size_t s = 0; s < sets.size(); ++s) {
      const NearestSet& set = sets[s];
      const Index grain = 1 + 16384 / set.targets;
      parallel_for(set.points, grain, [&](Index begin, Index end) {
        for (Index i = begin; i < end; ++i)
          of_point[static_cast<std::size_t>(i)] = nearest_of(points, set.first_point + i, targets, set);
      });
      Pair least = of_point[0];
      for (Index i = 1; i < set.points; ++i) {
        const Pair& next = of_point[static_cast<std::size_t>(i)];
        if (next.squared < least.squared) least = next;
      }
      nearest[s] = least;
      S* y = io.out().row(static_cast<Index>(s));
      for (Index c = 0; c < 3; ++c) y[c] = points.row(least.point)[c] - targets.row(least.target)[c];
    }
  }

  void backward(NodeIo<S>& io) {
    const ConstArray<S> d_y = io.d_out();
    for (std::size_t s = 0; s < sets.size(); ++s) {
      const S* d = d_y.row(static_cast<Index>(s));
      for (Index c = 0; c < 3; ++c) {
        if (io.wants(0)) io.d_in(0).row(nearest[s].point)[c] += d[c];
        if (io.wants(1)) io.d_in(1).row(nearest[s].target)[c] -= d[c];
      }
    }
  }
};

}  // namespace

template <class S>
Var<S> nearest_pairs(Var<S> points, Var<S> targets, std::vector<NearestSet> sets, Source where) {
  HSI4D_CHECK(points.shape().cols == 3 && targets.shape().cols == 3,
              detail::both_values(points.shape(), targets.shape()));
  for (const NearestSet& set : sets) {
    HSI4D_CHECK(set.points > 0 && set.targets > 0, "a set without a pair");
    HSI4D_CHECK(set.first_point >= 0 && set.first_point + set.points <= points.shape().rows, "points beyond the array");
    HSI4D_CHECK(set.first_target >= 0 && set.first_target + set.targets <= targets.shape().rows,
                "targets beyond the array");
  }
  const auto count = static_cast<Index>(sets.size());
  return points.owner().record(NearestPairs<S>(std::move(sets)), {points, targets}, shape_of(count, 3), where);
}

template Var<float> nearest_pairs(Var<float>, Var<float>, std::vector<NearestSet>, Source);
template Var<double> nearest_pairs(Var<double>, Var<double>, std::vector<NearestSet>, Source);

}  // namespace hsi4d
