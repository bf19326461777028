#include "autodiff/ssim_weights.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "autodiff/ssim_kernel.h"
#include "core/parallel.h"
#include "core/simd.h"

namespace hsi4d::detail {

namespace {

constexpr Index kRadius = kSsimRadius;

/// The window's weights, by distance.
std::array<double, kRadius + 1> window() {
  std::array<double, kRadius + 1> weights;
  double sum = 0;
  for (Index j = 0; j <= kRadius; ++j) {
    const double x = static_cast<double>(j);
    weights[static_cast<std::size_t>(j)] = std::exp(-x * x / (2 * kSsimSigma * kSsimSigma));
    sum += (j == 0 ? 1 : 2) * weights[static_cast<std::size_t>(j)];
  }
  for (double& w : weights) w /= sum;
  return weights;
}

/// Rows and columns [begin, end) of an image.
struct Area {
  Index row_begin, row_end, col_begin, col_end;
  Index rows() const { return row_end - row_begin; }
  Index cols() const { return col_end - col_begin; }
  Area grown(Index by, const Shape& image) const {
    return {std::max<Index>(row_begin - by, 0), std::min(row_end + by, image.rows), std::max<Index>(col_begin - by, 0),
            std::min(col_end + by, image.cols)};
  }
};

Area bounds(const TileMask* squares, const Shape& image) {
  if (squares == nullptr) return {0, image.rows, 0, image.cols};
  Area box{image.rows, 0, image.cols, 0};
  for (Index r = 0; r < squares->rows(); ++r) {
    for (Index c = 0; c < squares->cols(); ++c) {
      if (!squares->has(r, c)) continue;
      box = {std::min(box.row_begin, r * kMaskSquare), std::min((r + 1) * kMaskSquare, image.rows),
             std::min(box.col_begin, c * kMaskSquare),
             std::max(box.col_end, std::min((c + 1) * kMaskSquare, image.cols))};
    }
  }
  return box;
}

/// Numbers of an area; 0 outside.
template <class S>
struct Plane {
  Area area;
  std::vector<S> numbers;
  explicit Plane(const Area& a) : area(a), numbers(static_cast<std::size_t>(a.rows() * a.cols()), S(0)) {}
  S* row(Index r) { return numbers.data() + (r - area.row_begin) * area.cols(); }
  const S* row(Index r) const { return numbers.data() + (r - area.row_begin) * area.cols(); }
};

/// The window's means in `to.area` of numbers that are 0 outside of `from.area`.
template <class S>
void filter(const Plane<S>& from, Plane<S>& to) {
  const std::array<double, kRadius + 1> weights = window();
  const Area &in = from.area, &out = to.area;
  parallel_for(out.rows(), 8, [&](Index begin, Index end) {
    std::vector<S> line(static_cast<std::size_t>(in.cols() + 2 * kRadius + out.cols()));
    on_best_isa_for<S>([&] {
      for (Index r = out.row_begin + begin; r < out.row_begin + end; ++r) {
        std::fill(line.begin(), line.end(), S(0));
        S* const sums = line.data() + kRadius;
        for (Index j = -kRadius; j <= kRadius; ++j) {
          if (r + j < in.row_begin || r + j >= in.row_end) continue;
          const S w = static_cast<S>(weights[static_cast<std::size_t>(std::abs(j))]);
          const S* const row = from.row(r + j);
          for (Index c = 0; c < in.cols(); ++c) sums[c] += w * row[c];
        }
        // `out` lies within `in`, or around it by less than the line has room.
        S* const row = to.row(r);
        for (Index c = 0; c < out.cols(); ++c) {
          const Index at = out.col_begin + c - in.col_begin;
          S sum = 0;
          for (Index j = -kRadius; j <= kRadius; ++j)
            sum += static_cast<S>(weights[static_cast<std::size_t>(std::abs(j))]) * sums[at + j];
          row[c] = sum;
        }
      }
    });
  });
}

/// Variance under the window, of one plane of an image.
template <class S>
Plane<S> variance(const ConstArray<S>& image, Index plane, const Area& area) {
  const Area around = area.grown(kRadius, image.shape);
  Plane<S> values(around), squares(around), mean(area), result(area);
  for (Index r = around.row_begin; r < around.row_end; ++r) {
    std::copy_n(&image(plane, r, around.col_begin), around.cols(), values.row(r));
    for (Index c = 0; c < around.cols(); ++c) squares.row(r)[c] = values.row(r)[c] * values.row(r)[c];
  }
  filter(values, mean);
  filter(squares, result);
  for (std::size_t i = 0; i < result.numbers.size(); ++i)
    result.numbers[i] = std::max(S(0), result.numbers[i] - mean.numbers[i] * mean.numbers[i]);
  return result;
}

}  // namespace

template <class S>
void add_ssim_weights(const ConstArray<S>& image, const ConstArray<S>& target, const TileMask* squares,
                      double data_range, S scale, const Array<S>& to) {
  const Area area = bounds(squares, image.shape);
  if (area.rows() <= 0 || area.cols() <= 0) return;
  const Area around = area.grown(kRadius, image.shape);
  const S c2 = static_cast<S>(kSsimC2 * data_range * data_range);
  for (Index plane = 0; plane < image.shape.planes; ++plane) {
    Plane<S> inverse = variance(image, plane, around);
    const Plane<S> of_target = variance(target, plane, around);
    for (std::size_t i = 0; i < inverse.numbers.size(); ++i)
      inverse.numbers[i] = S(2) * scale / (inverse.numbers[i] + of_target.numbers[i] + c2);
    Plane<S> weights(area);
    filter(inverse, weights);
    for (Index r = area.row_begin; r < area.row_end; ++r) {
      for (Index c = 0; c < area.cols(); ++c) to(plane, r, area.col_begin + c) += weights.row(r)[c];
    }
  }
}

template void add_ssim_weights(const ConstArray<float>&, const ConstArray<float>&, const TileMask*, double, float,
                               const Array<float>&);
template void add_ssim_weights(const ConstArray<double>&, const ConstArray<double>&, const TileMask*, double, double,
                               const Array<double>&);

}  // namespace hsi4d::detail
