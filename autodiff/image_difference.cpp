#include "autodiff/image_difference.h"

#include <array>

#include "autodiff/curvature_weights.h"
#include "core/parallel.h"
#include "core/simd.h"

namespace hsi4d::detail {

namespace {

constexpr int kA = 0, kB = 1, kWeight = 2;

/// The sum of a square's 16 columns, always in this order.
double column_sum(const double* columns) {
  double sums[kMaskSquare];
  std::copy_n(columns, kMaskSquare, sums);
  for (Index half = kMaskSquare / 2; half > 0; half /= 2) {
    for (Index lane = 0; lane < half; ++lane) sums[lane] += sums[lane + half];
  }
  return sums[0];
}

template <class S, class F>
struct ImageDifference {
  static constexpr const char* kName = "image_difference";
  static constexpr bool kAssigns = true;
  Buffer<double> sums = {};  ///< [planes][rows of squares][squares of a row]
  WeighedSquares<S> weighed = {};

  static const S* weights_at(const NodeIo<S>& io, Index plane, Index row) {
    if (io.inputs() <= kWeight) return nullptr;
    const ConstArray<S> weight = io.in(kWeight);
    return &weight(weight.shape.planes == 1 ? 0 : plane, row, 0);
  }
  static bool wants_weight(const NodeIo<S>& io) { return io.inputs() > kWeight && io.wants(kWeight); }

  /// Where all weights are 0, so are value and gradient, unless one asks for that of the weights.
  const TileMask* looks_at(NodeIo<S>& io, int input) {
    if (input != kA || io.inputs() <= kWeight || !io.is_leaf(kWeight) || io.wants(kWeight)) return nullptr;
    return &weighed.of(io.in(kWeight), io.version(kWeight));
  }

  /// Squares of `a` that have to be summed again; null: all.
  static const TileMask* to_sum(const NodeIo<S>& io) {
    if (io.is_changed(kB) || (io.inputs() > kWeight && io.is_changed(kWeight))) return nullptr;
    return io.changed(kA);
  }
  /// Squares that need a gradient; null: all.
  static const TileMask* to_differentiate(const NodeIo<S>& io) {
    return io.wants(kB) || wants_weight(io) ? nullptr : io.read(kA);
  }

  void forward(NodeIo<S>& io) {
    const ConstArray<S> a = io.in(kA), b = io.in(kB);
    const Index rows = mask_squares(a.shape.rows), cols = mask_squares(a.shape.cols), planes = a.shape.planes;
    const TileMask* const mask = to_sum(io);
    sums.resize(planes * rows * cols);
    const Index width = cols * kMaskSquare;
    const std::span<double> columns = io.template scratch<double>(planes * rows * width);
    run_chunks(planes * rows, [&](Index chunk) {
      on_best_isa([&] {
        const Index plane = chunk / rows, square_row = chunk % rows;
        double* const mine = columns.data() + chunk * width;
        for_runs(mask, square_row, a.shape.cols, [&](const PixelRun& run) {
          const Index first = run.begin / kMaskSquare, end = mask_squares(run.end);
          std::fill_n(mine + run.begin, (end - first) * kMaskSquare, 0.0);
          const Index last_row = std::min((square_row + 1) * kMaskSquare, a.shape.rows);
          for (Index r = square_row * kMaskSquare; r < last_row; ++r)
            add_row(&a(plane, r, 0), &b(plane, r, 0), weights_at(io, plane, r), run, mine);
          for (Index c = first; c < end; ++c) sums[chunk * cols + c] = column_sum(mine + c * kMaskSquare);
        });
      });
    });
    io.out().scalar() = static_cast<S>(pairwise_sum(sums.data(), sums.size()));
  }

  static void add_row(const S* a, const S* b, const S* w, const PixelRun& run, double* columns) {
    if (w == nullptr) {
#pragma GCC ivdep
      for (Index c = run.begin; c < run.end; ++c) columns[c] += static_cast<double>(F::value(a[c] - b[c]));
    } else {
#pragma GCC ivdep
      for (Index c = run.begin; c < run.end; ++c)
        columns[c] += static_cast<double>(weighted(w[c], F::value(a[c] - b[c])));
    }
  }

  static S weighted(S w, S term) { return w * (counts(w, term) ? term : S(0)); }

  // d_a = g w f'(a − b) = −d_b,  d_w = g f(a − b); 0 where the term does not count
  void backward(NodeIo<S>& io) {
    const Shape shape = io.in(kA).shape;
    const TileMask* const mask = to_differentiate(io);
    run_chunks(mask_squares(shape.rows), [&](Index square_row) {
      on_best_isa([&] {
        const Index last_row = std::min((square_row + 1) * kMaskSquare, shape.rows);
        for_runs(mask, square_row, shape.cols, [&](const PixelRun& run) {
          for (Index plane = 0; plane < shape.planes; ++plane) {
            for (Index r = square_row * kMaskSquare; r < last_row; ++r) differentiate_row(io, plane, r, run);
          }
        });
      });
    });
  }

  static void differentiate_row(const NodeIo<S>& io, Index plane, Index row, const PixelRun& run) {
    const S g = io.d_out().scalar();
    const S *const a = &io.in(kA)(plane, row, 0), *const b = &io.in(kB)(plane, row, 0);
    const S* const w = weights_at(io, plane, row);
    for (const int i : {kA, kB}) {
      if (!io.wants(i)) continue;
      const S sign = i == kA ? g : -g;
      if (w == nullptr) {
        put(&io.d_in(i)(plane, row, 0), io.must_assign(i), run,
            [=](Index c) { return sign * F::derivative(a[c] - b[c]); });
      } else {
        put(&io.d_in(i)(plane, row, 0), io.must_assign(i), run, [=](Index c) {
          const S d = a[c] - b[c], slope = F::derivative(d);
          return sign * w[c] * (counts(w[c], F::value(d)) ? slope : S(0));
        });
      }
    }
    if (!wants_weight(io)) return;
    const bool is_shared = io.in(kWeight).shape.planes == 1;
    put(&io.d_in(kWeight)(is_shared ? 0 : plane, row, 0), io.must_assign(kWeight) && (plane == 0 || !is_shared), run,
        [&](Index c) {
          const S term = F::value(a[c] - b[c]);
          return counts(w[c], term) ? g * term : S(0);
        });
  }

  template <class Term>
  static void put(S* d, bool assign, const PixelRun& run, const Term& term) {
    if (assign) {
#pragma GCC ivdep
      for (Index c = run.begin; c < run.end; ++c) d[c] = term(c);
    } else {
#pragma GCC ivdep
      for (Index c = run.begin; c < run.end; ++c) d[c] += term(c);
    }
  }

  /// w_a += g w f''(a − b), where it has a gradient; not of b, which is a frame.
  bool weigh(NodeIo<S>& io, CurvatureWeights<S>& weights) {
    const S g = io.d_out().scalar();
    if (!io.wants(kA) || !(g > S(0))) return true;
    const ConstArray<S> a = io.in(kA), b = io.in(kB);
    const S least = static_cast<S>(weights.rule.least_difference);
    const Array<S> to = weights.of_input(io, kA);
    run_chunks(mask_squares(a.shape.rows), [&](Index square_row) {
      const Index last_row = std::min((square_row + 1) * kMaskSquare, a.shape.rows);
      for_runs(to_differentiate(io), square_row, a.shape.cols, [&](const PixelRun& run) {
        for (Index plane = 0; plane < a.shape.planes; ++plane) {
          for (Index r = square_row * kMaskSquare; r < last_row; ++r) {
            const S* const w = weights_at(io, plane, r);
            for (Index c = run.begin; c < run.end; ++c) {
              const S d = a(plane, r, c) - b(plane, r, c), each = w == nullptr ? S(1) : w[c];
              if (counts(each, F::value(d))) to(plane, r, c) += g * each * F::curvature(d, least);
            }
          }
        }
      });
    });
    return true;
  }

  Index saved_bytes() const { return sums.capacity_bytes() + weighed.capacity_bytes(); }
};

}  // namespace

template <class S, class F>
Var<S> image_difference(Var<S> a, Var<S> b, Var<S> weight, Source where) {
  HSI4D_CHECK(are_images(a, b, weight), "images of different sizes, or too small");
  std::array<Var<S>, 3> inputs = {a, b, weight};
  return a.owner().record(ImageDifference<S, F>{},
                          std::span<const Var<S>>(inputs).first(weight.tape != nullptr ? 3 : 2),
                          std::array{kScalarShape}, where);
}

template Var<float> image_difference<float, AbsoluteDifference>(Var<float>, Var<float>, Var<float>, Source);
template Var<double> image_difference<double, AbsoluteDifference>(Var<double>, Var<double>, Var<double>, Source);
template Var<float> image_difference<float, SquaredDifference>(Var<float>, Var<float>, Var<float>, Source);
template Var<double> image_difference<double, SquaredDifference>(Var<double>, Var<double>, Var<double>, Source);

}  // namespace hsi4d::detail
