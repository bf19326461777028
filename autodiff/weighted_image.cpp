#include "autodiff/weighted_image.h"

#include <algorithm>

#include "autodiff/curvature_weights.h"
#include "core/parallel.h"
#include "core/simd.h"

namespace hsi4d {

namespace {

constexpr int kImage = 0, kWeight = 1;

/// row(plane, r, columns) for every row of pixels in the squares of both masks (null: all).
template <class Row>
void for_rows(const Shape& shape, const TileMask* mask, const TileMask& weighed, const Row& row) {
  const Index square_rows = mask_squares(shape.rows);
  run_chunks(shape.planes * square_rows, [&](Index chunk) {
    on_best_isa([&] {
      const Index plane = chunk / square_rows, square_row = chunk % square_rows;
      const Index last = std::min((square_row + 1) * kMaskSquare, shape.rows);
      const auto is_in = [&](Index c) { return mask == nullptr || mask->has(square_row, c); };
      for_runs(&weighed, square_row, shape.cols, [&](const PixelRun& run) {
        for (Index c = run.begin; c < run.end; c += kMaskSquare) {
          if (!is_in(c / kMaskSquare)) continue;
          const PixelRun square{c, std::min(c + kMaskSquare, run.end)};
          for (Index r = square_row * kMaskSquare; r < last; ++r) row(plane, r, square);
        }
      });
    });
  });
}

template <class S>
struct WeightedImage {
  static constexpr const char* kName = "weighted_image";
  static constexpr bool kPersistentOutputs = true;
  WeighedSquares<S> weighed = {};

  const TileMask& squares(const NodeIo<S>& io) { return weighed.of(io.in(kWeight), io.version(kWeight)); }
  const TileMask* looks_at(NodeIo<S>& io, int input) {
    return input == kImage && io.is_leaf(kWeight) && !io.wants(kWeight) ? &squares(io) : nullptr;
  }

  void forward(NodeIo<S>& io) {
    const ConstArray<S> a = io.in(kImage), w = io.in(kWeight);
    const Array<S> out = io.out();
    const bool is_new = io.is_changed(kWeight);
    const TileMask* const changed = is_new ? nullptr : io.changed(kImage);
    if (is_new) std::fill_n(out.data, out.shape.memory(), S(0));
    for_rows(a.shape, changed, squares(io), [&](Index plane, Index r, const PixelRun& run) {
      const S *const from = &a(plane, r, 0), *const weight = &w(0, r, 0);
      S* const to = &out(plane, r, 0);
#pragma GCC ivdep
      for (Index c = run.begin; c < run.end; ++c) to[c] = weight[c] == S(0) ? S(0) : from[c] * weight[c];
    });
    io.set_dirty_tiles(0, changed, io.wants(kWeight) ? nullptr : io.read(kImage));
  }

  // d_a = w d_out,  d_w = Σ a d_out over planes
  void backward(NodeIo<S>& io) {
    if (io.wants(kWeight)) differentiate_weight(io);
    if (!io.wants(kImage)) return;
    const ConstArray<S> w = io.in(kWeight), d_out = io.d_out();
    const Array<S> d = io.d_in(kImage);
    for_rows(d.shape, io.read(kImage), squares(io), [&](Index plane, Index r, const PixelRun& run) {
      const S *const weight = &w(0, r, 0), *const from = &d_out(plane, r, 0);
      S* const to = &d(plane, r, 0);
#pragma GCC ivdep
      for (Index c = run.begin; c < run.end; ++c) to[c] += weight[c] * from[c];
    });
  }

  bool weigh(NodeIo<S>& io, CurvatureWeights<S>& weights) {
    const ConstArray<S> of_out = weights.of_output(io), w = io.in(kWeight);
    if (!of_out || !io.wants(kImage)) return true;
    const Array<S> to = weights.of_input(io, kImage);
    for_rows(to.shape, io.read(kImage), squares(io), [&](Index plane, Index r, const PixelRun& run) {
      for (Index c = run.begin; c < run.end; ++c) to(plane, r, c) += w(0, r, c) * w(0, r, c) * of_out(plane, r, c);
    });
    return true;
  }

  static void differentiate_weight(const NodeIo<S>& io) {
    const ConstArray<S> a = io.in(kImage), d_out = io.d_out();
    const Array<S> d = io.d_in(kWeight);
    run_chunks(d.shape.rows, [&](Index r) {
      for (Index plane = 0; plane < a.shape.planes; ++plane) {
        for (Index c = 0; c < d.shape.cols; ++c) d(0, r, c) += a(plane, r, c) * d_out(plane, r, c);
      }
    });
  }

  Index saved_bytes() const { return weighed.capacity_bytes(); }
};

}  // namespace

template <class S>
Var<S> weighted_image(Var<S> a, Var<S> w, Source where) {
  const Shape &image = a.shape(), &weight = w.shape();
  HSI4D_CHECK(weight.planes == 1 && weight.rows == image.rows && weight.cols == image.cols,
              "weight against image: " + detail::both_values(weight, image));
  return a.owner().record(WeightedImage<S>{}, {a, w}, image, where);
}

template Var<float> weighted_image(Var<float>, Var<float>, Source);
template Var<double> weighted_image(Var<double>, Var<double>, Source);

}  // namespace hsi4d
