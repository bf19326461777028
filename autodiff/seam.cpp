#include "autodiff/seam.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "core/simd.h"

namespace hsi4d {

namespace {

/// row(offset in memory, count) for what of every row of an array lies in the squares of a mask (null: all), in
/// parallel.
template <class Row>
void for_rows(const Shape& shape, const TileMask* mask, const Row& row) {
  const Index square_rows = mask_squares(shape.rows);
  run_chunks(shape.planes * square_rows, [&](Index chunk) {
    on_best_isa([&] {
      const Index plane = chunk / square_rows, square_row = chunk % square_rows;
      const Index last = std::min((square_row + 1) * kMaskSquare, shape.rows);
      for_runs(mask, square_row, shape.cols, [&](const PixelRun& run) {
        for (Index r = square_row * kMaskSquare; r < last; ++r)
          row((plane * shape.rows + r) * shape.stride + run.begin, run.end - run.begin);
      });
    });
  });
}

template <class S>
struct Seam {
  static constexpr const char* kName = "seam";
  static constexpr bool kPersistentOutputs = true;
  static constexpr bool kAssigns = true;
  const SeamMode* mode;
  Buffer<S> kept = {};   // the gradient, laid out as it is; where it was not read, 0
  Buffer<S> known = {};  // likewise 1 where it was read, else 0

  void forward(NodeIo<S>& io) {
    const ConstArray<S> x = io.in(0);
    const Array<S> out = io.out();
    for_rows(x.shape, io.changed(0), [&](Index at, Index n) { std::copy_n(x.data + at, n, out.data + at); });
    io.set_dirty_tiles(0, io.changed(0), io.read(0));
  }

  // d_x += d_out; or scale (d_out − kept) where it is known
  void backward(NodeIo<S>& io) {
    if (!mode->of_change) keep(io);
    const ConstArray<S> d_out = io.d_out();
    const Array<S> d = io.d_in(0);
    const bool assign = io.must_assign(0), of_change = mode->of_change;
    const S scale = static_cast<S>(mode->scale);
    HSI4D_CHECK_EQ(kept.size(), d.shape.memory());  // a change of what was never kept
    for_rows(d.shape, io.read(0), [&](Index at, Index n) {
      const S *from = d_out.data + at, *before = kept.data() + at, *is_known = known.data() + at;
      S* to = d.data + at;
#pragma GCC ivdep
      for (Index i = 0; i < n; ++i) {
        const S value = !of_change ? from[i] : is_known[i] != S(0) ? scale * (from[i] - before[i]) : S(0);
        to[i] = assign ? value : to[i] + value;
      }
    });
  }

  void keep(const NodeIo<S>& io) {
    const ConstArray<S> d_out = io.d_out();
    kept.resize(d_out.shape.memory());
    known.resize(kept.size());
    std::fill_n(kept.data(), kept.size(), S(0));
    std::fill_n(known.data(), known.size(), S(0));
    for_rows(d_out.shape, io.read(0), [&](Index at, Index n) {
      std::copy_n(d_out.data + at, n, kept.data() + at);
      std::fill_n(known.data() + at, n, S(1));
    });
  }

  Index saved_bytes() const { return kept.capacity_bytes() + known.capacity_bytes(); }
};

template <class S>
struct ReweightedL1 {
  static constexpr const char* kName = "reweighted_l1";
  static constexpr bool kAssigns = true;
  double floor;
  const SeamMode* mode;
  Buffer<S> weights = {};  // laid out as the arrays are
  Buffer<double> sums = {};

  void forward(NodeIo<S>& io) {
    const ConstArray<S> a = io.in(0), b = io.in(1);
    sums.resize(a.total_rows());
    const S least = static_cast<S>(floor);
    parallel_for(a.total_rows(), kMaskSquare, [&](Index begin, Index end) {
      for (Index r = begin; r < end; ++r) {
        double sum = 0;
        for (Index c = 0; c < a.shape.cols; ++c) {
          const S distance = std::fabs(a.row(r)[c] - b.row(r)[c]), near = std::min(distance, least);
          sum += static_cast<double>(near * (distance - near / 2) / least);
        }
        sums[r] = sum;
      }
    });
    // near (|d| − near/2)/ε is d²/(2 ε) within ε and |d| − ε/2 beyond
    io.out().scalar() = static_cast<S>(pairwise_sum(sums.data(), sums.size()) / static_cast<double>(a.shape.count()));
  }

  // d_a += g w d / n
  void backward(NodeIo<S>& io) {
    io.begin_rows(1, 0, io.in(1).total_rows());  // b has none
    if (!io.wants(0)) return;
    const ConstArray<S> a = io.in(0), b = io.in(1);
    const Array<S> d = io.d_in(0);
    const S g = io.d_out().scalar() / static_cast<S>(a.shape.count()), least = static_cast<S>(floor);
    const bool assign = io.must_assign(0), weigh = !mode->of_change;
    if (weigh) weights.resize(a.shape.memory());
    if (weigh) std::fill_n(weights.data(), weights.size(), S(0));
    HSI4D_CHECK_EQ(weights.size(), a.shape.memory());  // a change of what was never kept
    for_rows(d.shape, io.read(0), [&](Index at, Index n) {
      const S *x = a.data + at, *y = b.data + at;
      S *w = weights.data() + at, *to = d.data + at;
#pragma GCC ivdep
      for (Index i = 0; i < n; ++i) {
        const S difference = x[i] - y[i];
        if (weigh) w[i] = S(1) / std::max(std::fabs(difference), least);
        const S value = g * (w[i] * difference);
        to[i] = assign ? value : to[i] + value;
      }
    });
  }

  Index saved_bytes() const { return weights.capacity_bytes() + sums.capacity_bytes(); }
};

}  // namespace

template <class S>
Var<S> seam(Var<S> x, const SeamMode& mode, Source where) {
  return x.owner().record(Seam<S>{&mode}, {x}, x.shape(), where);
}

template <class S>
Var<S> reweighted_l1(Var<S> a, Var<S> b, double floor, const SeamMode& mode, Source where) {
  HSI4D_CHECK(floor > 0, "floor = " + std::to_string(floor));
  HSI4D_CHECK(a.shape().count() > 0 && a.shape() == b.shape(), detail::both_values(a.shape(), b.shape()));
  return a.owner().record(ReweightedL1<S>{floor, &mode}, {a, b}, kScalarShape, where);
}

template Var<float> seam(Var<float>, const SeamMode&, Source);
template Var<double> seam(Var<double>, const SeamMode&, Source);
template Var<float> reweighted_l1(Var<float>, Var<float>, double, const SeamMode&, Source);
template Var<double> reweighted_l1(Var<double>, Var<double>, double, const SeamMode&, Source);

}  // namespace hsi4d
