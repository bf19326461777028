#include "autodiff/centroid.h"

#include "core/parallel.h"
#include "core/simd.h"

namespace hsi4d {

namespace {

/// Σ m and Σ m (j + ½) over one row, in running sums whose order is the same on every instruction set.
struct RowSums {
  double mass = 0, first = 0;
};

template <class S>
RowSums row_sums(const S* m, Index n) {
  RowSums total;
  on_best_isa([&] {
    constexpr Index kSums = 8;
    double mass[kSums] = {}, first[kSums] = {};
    Index j = 0;
    for (; j + kSums <= n; j += kSums) {
      for (Index lane = 0; lane < kSums; ++lane) {
        const double value = static_cast<double>(m[j + lane]);
        mass[lane] += value;
        first[lane] += value * (static_cast<double>(j + lane) + 0.5);
      }
    }
    for (; j < n; ++j) {
      mass[0] += static_cast<double>(m[j]);
      first[0] += static_cast<double>(m[j]) * (static_cast<double>(j) + 0.5);
    }
    for (Index lane = 0; lane < kSums; ++lane) {
      total.mass += mass[lane];
      total.first += first[lane];
    }
  });
  return total;
}

/// d(row) += or = along·(j + ½) + constant.
template <class S>
void row_adjoint(S* d, Index n, double along, double constant, bool assign) {
  on_best_isa([=] {
    for (Index j = 0; j < n; ++j) {
      const S slope = static_cast<S>(along * (static_cast<double>(j) + 0.5) + constant);
      d[j] = assign ? slope : d[j] + slope;
    }
  });
}

template <class S>
struct Centroids {
  static constexpr const char* kName = "centroids";
  static constexpr bool kAssigns = true;

  struct Moments {
    double mass, x, y;
  };
  Buffer<Moments> moments = {};  // of each image

  Index saved_bytes() const { return moments.capacity_bytes(); }

  static Index grain(const Shape& shape) { return std::max<Index>(1, 16384 / std::max<Index>(1, shape.cols)); }

  void forward(NodeIo<S>& io) {
    const ConstArray<S> m = io.in(0);
    const Index height = m.shape.rows;
    const auto rows = io.template scratch<RowSums>(m.total_rows());
    parallel_for(m.total_rows(), grain(m.shape), [&](Index begin, Index end) {
      for (Index r = begin; r < end; ++r) rows[static_cast<std::size_t>(r)] = row_sums(m.row(r), m.shape.cols);
    });
    moments.resize(m.shape.planes);
    for (Index o = 0; o < m.shape.planes; ++o) {
      double mass = 0, x = 0, y = 0;
      for (Index i = 0; i < height; ++i) {
        const RowSums& row = rows[static_cast<std::size_t>(o * height + i)];
        mass += row.mass;
        x += row.first;
        y += row.mass * (static_cast<double>(i) + 0.5);
      }
      moments[o] = mass == 0 ? Moments{0, 0, 0} : Moments{mass, x / mass, y / mass};
      S* out = io.out().row(o);
      out[0] = static_cast<S>(moments[o].x);
      out[1] = static_cast<S>(moments[o].y);
      out[2] = static_cast<S>(mass);
    }
  }

  void backward(NodeIo<S>& io) {
    const Array<S> d_m = io.d_in(0);
    const ConstArray<S> d_out = io.d_out();
    const Index height = d_m.shape.rows;
    const bool assign = io.must_assign(0);
    parallel_for(d_m.total_rows(), grain(d_m.shape), [&](Index begin, Index end) {
      for (Index r = begin; r < end; ++r) {
        const Index o = r / height;
        const auto [mass, x, y] = moments[o];
        const double scale = mass == 0 ? 0.0 : 1 / mass;
        const double d_x = static_cast<double>(d_out.row(o)[0]) * scale;
        const double d_y = static_cast<double>(d_out.row(o)[1]) * scale;
        const double d_mass = static_cast<double>(d_out.row(o)[2]);
        const double down = static_cast<double>(r % height) + 0.5;
        row_adjoint(d_m.row(r), d_m.shape.cols, d_x, d_y * (down - y) - d_x * x + d_mass, assign);
      }
    });
  }
};

}  // namespace

template <class S>
Var<S> centroids(Var<S> masks, Source where) {
  return masks.owner().record(Centroids<S>{}, {masks}, shape_of(masks.shape().planes, 3), where);
}

template Var<float> centroids(Var<float>, Source);
template Var<double> centroids(Var<double>, Source);

}  // namespace hsi4d
