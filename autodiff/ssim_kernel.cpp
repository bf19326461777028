// Vector code of SSIM, forward and adjoint in one sweep; the mathematics is in autodiff/ssim.h.
//
// Layout. Lane l of vector t is column first + l·blocks + t of the window: neighbouring columns are neighbouring
// *vectors*, so the filter along a row is the same code as the filter down a column, with aligned loads and no
// shuffles. Only the ends of a row of vectors need the neighbour lane (fill_halo), and only the images and the gradient
// are permuted.
//
// Accuracy. Every filter makes four neighbouring outputs from 14 inputs after subtracting one input k in their midst,
// which lies in all four windows with a weight of at least 0.1: Var = E[(z−k)²] − (E[z]−k)² then loses an order of
// magnitude at worst, whatever the level of the image. Groups of four start at fixed rows and columns of the image, so
// a pixel's result does not depend on the strip or region that it is computed in.
//
// Sweep. Step g loads rows 4g+5 … 4g+8, makes the map of rows 4g … 4g+3 and the gradient of rows 4g−5 … 4g−2:
//
//   load_rows        x, y → ring of s = x+y and d = x−y
//   columns_forward  moments down the columns
//   row_forward      moments along the rows, the map and its derivatives
//   row_adjoint      adjoint filter along the rows → ring
//   columns_adjoint  adjoint filter down the columns
//   store_gradient   back to rows of pixels
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "autodiff/ssim_kernel.cpp"
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include "autodiff/ssim_kernel.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <hwy/highway.h>

#include "autodiff/ssim_filter-inl.h"

HWY_BEFORE_NAMESPACE();
namespace hsi4d::detail::HWY_NAMESPACE {

constexpr Index kRing = 16;  // rows kept; a filter down the columns reads kInputs of them

enum Statistic { kMeanS, kVarS, kMeanD, kVarD, kPixelD, kStatistics };  // after the filter down the columns
enum Coefficient { kC, kBd, kBs, kCoefficients };                       // of the map
enum Partial { kOffset, kSlopeD, kSlopeS, kD, kPartials };              // after the adjoint filter along the rows

/// Distances between neighbouring columns of the two rings; odd numbers of vectors, so that a row does not fall into a
/// few sets of the first-level cache.
template <class S>
constexpr Index kRingStep = (2 * kRing + 1) * kLanes<S>;
template <class S>
constexpr Index kPartialStep = (kPartials * kRing + 1) * kLanes<S>;

/// Where the parts of a workspace lie, in elements of S.
template <class S>
struct Layout {
  static constexpr Index N = kLanes<S>;
  Index blocks, pixels_s, pixels_d, mask, ring, statistics, statistics_row, coefficients, partials, gradient, quad,
      sums, size;

  explicit Layout(Index blocks_) : blocks(blocks_) {
    Index at = 0;
    const auto take = [&](Index n) {
      const Index begin = at;
      at += round_up(n, 64);
      return begin;
    };
    pixels_s = take(blocks * N);
    pixels_d = take(blocks * N);
    mask = take(blocks * N);
    ring = take(blocks * kRingStep<S>);
    statistics_row = (blocks + 2 * kRadius) * kStatistics * N;
    statistics = take(kGroup * statistics_row);
    coefficients = take((blocks + 2 * kRadius) * kCoefficients * N);
    partials = take(blocks * kPartialStep<S>);
    gradient = take(kGroup * blocks * N);
    quad = take(blocks / kGroup * N);
    sums = take(blocks / kGroup * N * Index(sizeof(double) / sizeof(S)));
    size = at;
  }
};

template <class S>
Index blocks_of(Index cols) {
  return round_up((cols + kLanes<S> - 1) / kLanes<S>, kGroup);
}

template <class S>
class Sweep {
  static constexpr Index N = kLanes<S>;
  using V = Vec<S>;

 public:
  Sweep(const SsimSweep<S>& job, Index first_col, Index blocks, S* memory)
      : job_(job), first_col_(first_col), blocks_(blocks), memory_(memory), at_(blocks) {
    set_weights();
    for (Index t = 0; t < blocks_; ++t) {
      for (Index lane = 0; lane < N; ++lane) {
        memory_[at_.mask + t * N + lane] = first_col_ + lane * blocks_ + t < job_.cols ? S(1) : S(0);
      }
    }
    std::memset(memory_ + at_.partials, 0, static_cast<size_t>(blocks_ * kPartialStep<S>) * sizeof(S));
    clear_sums();
  }

  void run(Index group_begin, Index group_end) {
    for (Index g = group_begin - 3; g < group_begin; ++g) load_rows(kGroup * g + kRadius);
    for (Index g = group_begin; g < group_end; ++g) {
      switch (g & 3) {
        case 0:
          step<0>(g);
          break;
        case 1:
          step<1>(g);
          break;
        case 2:
          step<2>(g);
          break;
        default:
          step<3>(g);
          break;
      }
    }
  }

 private:
  /// Gaussian of σ = 1.5 whose weights sum to 1 in S.
  void set_weights() {
    double gaussian[kRadius + 1], sum = 0;
    for (Index j = 0; j <= kRadius; ++j) {
      gaussian[j] = std::exp(-static_cast<double>(j * j) / (2 * kSsimSigma * kSsimSigma));
      sum += (j == 0 ? 1 : 2) * gaussian[j];
    }
    weights_[0] = 1;
    for (Index j = 1; j <= kRadius; ++j) {
      weights_[j] = static_cast<S>(gaussian[j] / sum);
      weights_[0] -= 2 * weights_[j];
    }
  }

  template <int Phase>
  HWY_NOINLINE void step(Index g) {
    load_rows(kGroup * g + kRadius);
    const Index row = kGroup * g;
    if (row >= -3 && row < job_.rows) {
      columns_forward<Phase>(g);
      std::memset(memory_ + at_.quad, 0, static_cast<size_t>(blocks_ / kGroup * N) * sizeof(S));
      for (Index r = 0; r < kGroup; ++r) {
        if (row + r >= 0 && row + r < job_.rows) {
          row_forward(r);
          if (job_.map != nullptr) store_map(row + r);
          if (!job_.gradient.empty()) row_adjoint(r, (row + r) & (kRing - 1));
        } else {
          zero_partials((row + r) & (kRing - 1));
        }
      }
      if (row >= job_.sums.row_begin && row < job_.sums.row_end) add_sums(row);
    } else {
      for (Index r = 0; r < kGroup; ++r) zero_partials((row + r) & (kRing - 1));
    }
    const Index out = row - kRadius;
    if (out + kGroup > job_.gradient.row_begin && out < job_.gradient.row_end) {
      columns_adjoint<Phase>(g);
      store_gradient(out);
    }
  }

  Window<S> window(bool unit = false) const {
    const Tag<S> d;
    Window<S> window;
    for (int j = 0; j <= kRadius; ++j) window.w[j] = hn::Set(d, unit ? weights_[j] / weights_[0] : weights_[j]);
    return window;
  }

  /// Asks for one vector of each of four rows of an image, so that memory works while the filters do.
  template <int Write>
  HWY_INLINE void prefetch(const S* image, Index stride, Index row, Index t) const {
    const S* at = image + row * stride + std::min(first_col_ + t * N, job_.cols - 1);
    if (row < 0 || row + kGroup > job_.rows) return;
#pragma GCC unroll 4
    for (Index r = 0; r < kGroup; ++r) __builtin_prefetch(at + r * stride, Write, 3);
  }

  /// Sum and difference of four rows of both images, from `row` on, into the ring; zero outside the images.
  void load_rows(Index row) {
    const Tag<S> d;
    S* s = memory_ + at_.pixels_s;
    S* diff = memory_ + at_.pixels_d;
    const Index width = blocks_ * N, valid = std::min(width, job_.cols - first_col_);
    for (Index r = row; r < row + kGroup; ++r) {
      Index c = 0;
      if (r >= 0 && r < job_.rows) {
        const S* x = job_.x + r * job_.x_stride + first_col_;
        const S* y = job_.y + r * job_.y_stride + first_col_;
        for (; c + N <= valid; c += N) {
          const V a = hn::LoadU(d, x + c), b = hn::LoadU(d, y + c);
          hn::Store(hn::Add(a, b), d, s + c);
          hn::Store(hn::Sub(a, b), d, diff + c);
        }
        for (; c < valid; ++c) {
          s[c] = x[c] + y[c];
          diff[c] = x[c] - y[c];
        }
      }
      std::fill(s + c, s + width, S(0));
      std::fill(diff + c, diff + width, S(0));
      S* ring = memory_ + at_.ring + (r & (kRing - 1)) * N;
      pixels_to_vectors(s, blocks_, ring, kRingStep<S>);
      pixels_to_vectors(diff, blocks_, ring + kRing * N, kRingStep<S>);
    }
  }

  /// Moments down the columns of map rows 4g … 4g+3.
  template <int Phase>
  HWY_INLINE void columns_forward(Index g) {
    const Tag<S> d;
    const Window<S> w = window();
    const Index ahead = kGroup * g + kRadius + kGroup;
    for (Index t = 0; t < blocks_; ++t) {
      prefetch<0>(job_.x, job_.x_stride, ahead, t);
      prefetch<0>(job_.y, job_.y_stride, ahead, t);
      const S* ring = memory_ + at_.ring + t * kRingStep<S>;
      S* out = memory_ + at_.statistics + (kRadius + t) * kStatistics * N;
      for (int f = 0; f < 2; ++f) {
        const S* z = ring + f * kRing * N;
        const auto value = [&](int i)
                               HWY_ATTR { return hn::Load(d, z + ((kGroup * Phase - kRadius + i) & (kRing - 1)) * N); };
        Moments<S> m;
        central_moments<S>(
            w, value, [](int, V v) HWY_ATTR { return hn::Mul(v, v); }, m);
#pragma GCC unroll 4
        for (int o = 0; o < kGroup; ++o) {
          S* row = out + o * at_.statistics_row;
          hn::Store(hn::Add(m.k, m.shift[o]), d, row + (f ? kMeanD : kMeanS) * N);
          hn::Store(m.variance[o], d, row + (f ? kVarD : kVarS) * N);
          if (f) hn::Store(value(o + kRadius), d, row + kPixelD * N);
        }
      }
    }
    for (Index r = 0; r < kGroup; ++r) {
      fill_halo(memory_ + at_.statistics + r * at_.statistics_row + kRadius * kStatistics * N, blocks_, kStatistics * N,
                kStatistics);
    }
  }

  /// Moments along row r of the group, the map, and its derivatives, all of them divided by 4:
  /// with p = 2P, q = 2Q, L/2 = m_d²/p, D/2 = V_d/q (see ssim.h),
  ///   a = a_s + a_d = (1−D)/p (m_d − L/2 (m_d + m_s)),   b_d = (1−L)/q (1 − D/2),   −b_s = (1−L)/q D/2,
  ///   c = a + b_d (d − m_d) − b_s m_s.
  HWY_INLINE void row_forward(Index r) {
    const Tag<S> d;
    const Window<S> w = window();
    const V c1 = hn::Set(d, 2 * job_.c1), c2 = hn::Set(d, 2 * job_.c2), one = hn::Set(d, S(1));
    for (Index t = 0; t < blocks_; t += kGroup) {
      const S* in = memory_ + at_.statistics + r * at_.statistics_row + t * kStatistics * N;
      const auto statistic = [&](int f) HWY_ATTR {
        return [=](int i) HWY_ATTR { return hn::Load(Tag<S>(), in + (i * kStatistics + f) * N); };
      };
      const auto add_square = [&](int f) HWY_ATTR {
        return [=](int i, V v)
                   HWY_ATTR { return hn::MulAdd(v, v, hn::Load(Tag<S>(), in + (i * kStatistics + f) * N)); };
      };
      Moments<S> ms, md;
      central_moments<S>(w, statistic(kMeanS), add_square(kVarS), ms);
      central_moments<S>(w, statistic(kMeanD), add_square(kVarD), md);
      S* out = memory_ + at_.coefficients + (kRadius + t) * kCoefficients * N;
      const S* mask = memory_ + at_.mask + t * N;
      V sum = hn::Zero(d);
#pragma GCC unroll 4
      for (int o = 0; o < kGroup; ++o) {
        const V mean_s = hn::Add(ms.k, ms.shift[o]), mean_d = hn::Add(md.k, md.shift[o]);
        const V mean_d2 = hn::Mul(mean_d, mean_d);
        const V p = hn::MulAdd(mean_s, mean_s, hn::Add(mean_d2, c1));
        const V q = hn::Add(hn::Add(ms.variance[o], md.variance[o]), c2);
        const V r_pq = hn::Div(hn::Load(d, mask + o * N), hn::Mul(p, q));
        const V r_p = hn::Mul(r_pq, q), r_q = hn::Mul(r_pq, p);
        const V half_l = hn::Mul(mean_d2, r_p), half_d = hn::Mul(md.variance[o], r_q);
        const V l = hn::Sub(hn::Sub(one, half_l), half_l), cs = hn::Sub(hn::Sub(one, half_d), half_d);
        const V loss = hn::MulAdd(half_d, l, half_l);
        sum = hn::Add(sum, loss);
        if (job_.map != nullptr) hn::Store(loss, d, memory_ + at_.gradient + (t + o) * N);
        const V a = hn::Mul(hn::Mul(cs, r_p), hn::NegMulAdd(half_l, hn::Add(mean_d, mean_s), mean_d));
        const V lq = hn::Mul(l, r_q), bs = hn::Mul(lq, half_d), bd = hn::Sub(lq, bs);
        const V high = hn::Sub(hn::Sub(statistic(kPixelD)(o + kRadius), md.k), md.shift[o]);
        S* row = out + o * kCoefficients * N;
        hn::Store(hn::MulAdd(bd, high, hn::MulAdd(bs, mean_s, a)), d, row + kC * N);
        hn::Store(bd, d, row + kBd * N);
        hn::Store(bs, d, row + kBs * N);
      }
      S* quad = memory_ + at_.quad + t / kGroup * N;
      hn::Store(hn::Add(hn::Load(d, quad), sum), d, quad);
    }
    fill_halo(memory_ + at_.coefficients + kRadius * kCoefficients * N, blocks_, kCoefficients * N, kCoefficients);
  }

  /// Adjoint filter along row r of the group into the ring of partial adjoints.
  HWY_INLINE void row_adjoint(Index r, Index ring_row) {
    const Tag<S> d;
    const Window<S> w = window(true);
    for (Index t = 0; t < blocks_; t += kGroup) {
      const S* in = memory_ + at_.coefficients + t * kCoefficients * N;
      const S* pixel = memory_ + at_.statistics + r * at_.statistics_row + (t * kStatistics + kPixelD) * N;
      const auto coefficient = [&](int f) HWY_ATTR {
        return [=](int i) HWY_ATTR { return hn::Load(Tag<S>(), in + (i * kCoefficients + f) * N); };
      };
      const auto z = [&](int i) HWY_ATTR { return hn::Load(d, pixel + i * kStatistics * N); };
      V offset[kGroup], slope_d[kGroup], slope_s[kGroup];
      adjoint_filter<S>(w, coefficient(kC), coefficient(kBd), z, offset, slope_d);
      plain<S>(w, coefficient(kBs), slope_s);
      S* out = memory_ + at_.partials + t * kPartialStep<S> + ring_row * N;
#pragma GCC unroll 4
      for (int o = 0; o < kGroup; ++o) {
        S* column = out + o * kPartialStep<S>;
        hn::Store(offset[o], d, column + kOffset * kRing * N);
        hn::Store(slope_d[o], d, column + kSlopeD * kRing * N);
        hn::Store(slope_s[o], d, column + kSlopeS * kRing * N);
        hn::Store(z(o + kRadius), d, column + kD * kRing * N);
      }
    }
  }

  void zero_partials(Index ring_row) {
    const Tag<S> d;
    for (Index t = 0; t < blocks_; ++t) {
      S* column = memory_ + at_.partials + t * kPartialStep<S> + ring_row * N;
      for (Index f = 0; f < kPartials; ++f) hn::Store(hn::Zero(d), d, column + f * kRing * N);
    }
  }

  /// Adjoint filter down the columns for rows 4g−5 … 4g−2.
  template <int Phase>
  HWY_INLINE void columns_adjoint(Index g) {
    const Tag<S> d;
    const Window<S> w = window(true);
    for (Index t = 0; t < blocks_; ++t) {
      prefetch<1>(job_.d_x, job_.d_stride, kGroup * g - kRadius, t);
      const S* in = memory_ + at_.partials + t * kPartialStep<S>;
      const auto partial = [&](int f) HWY_ATTR {
        return [=](int i) HWY_ATTR {
          constexpr int first = kGroup * Phase - 2 * kRadius;
          return hn::Load(Tag<S>(), in + (f * kRing + ((first + i) & (kRing - 1))) * N);
        };
      };
      V offset[kGroup], slope_d[kGroup], slope_s[kGroup];
      adjoint_filter<S>(w, partial(kOffset), partial(kSlopeD), partial(kD), offset, slope_d);
      plain<S>(w, partial(kSlopeS), slope_s);
      const S* s = memory_ + at_.ring + t * kRingStep<S>;
      S* out = memory_ + at_.gradient + t * N;
#pragma GCC unroll 4
      for (int o = 0; o < kGroup; ++o) {
        const V pixel_s = hn::Load(d, s + ((kGroup * Phase - kRadius + o) & (kRing - 1)) * N);
        hn::Store(hn::NegMulAdd(pixel_s, slope_s[o], offset[o]), d, out + o * blocks_ * N);
      }
    }
  }

  /// The first row of the gradient's place holds (1 − ssim)/2 until the gradient is made.
  void store_map(Index row) {
    const SsimRect& area = job_.sums;
    if (row < area.row_begin || row >= area.row_end) return;
    S* pixels = memory_ + at_.pixels_s;
    vectors_to_pixels(memory_ + at_.gradient, blocks_, pixels, N);
    S* out = job_.map + row * job_.map_stride;
    for (Index c = area.col_begin; c < area.col_end; ++c) out[c] = 1 - 2 * pixels[c - first_col_];
  }

  void store_gradient(Index first_row) {
    const Tag<S> d;
    // 4: of the derivatives in row_forward; the two adjoint filters divide their weights by the one in the centre.
    const S factor = 4 * weights_[0] * weights_[0] * job_.scale;
    const V scale = hn::Set(d, factor);
    S* pixels = memory_ + at_.pixels_s;
    for (Index o = 0; o < kGroup; ++o) {
      const Index row = first_row + o;
      if (row < job_.gradient.row_begin || row >= job_.gradient.row_end) continue;
      vectors_to_pixels(memory_ + at_.gradient + o * blocks_ * N, blocks_, pixels, N);
      S* out = job_.d_x + row * job_.d_stride;
      Index c = job_.gradient.col_begin;
      for (; c + N <= job_.gradient.col_end; c += N) {
        hn::StoreU(hn::Mul(scale, hn::LoadU(d, pixels + c - first_col_)), d, out + c);
      }
      for (; c < job_.gradient.col_end; ++c) out[c] = factor * pixels[c - first_col_];
    }
  }

  double* sums() { return reinterpret_cast<double*>(memory_ + at_.sums); }
  void clear_sums() { std::fill_n(sums(), blocks_ / kGroup * N, 0.0); }

  void add_sums(Index row) {
    const S* quad = memory_ + at_.quad;
    double* sum = sums();
    for (Index i = 0; i < blocks_ / kGroup * N; ++i) sum[i] += static_cast<double>(quad[i]);
    if ((row + kGroup) % kSsimTile != 0 && row + kGroup < job_.sums.row_end) return;
    double* out = job_.tile_sums + row / kSsimTile * job_.tile_stride;
    for (Index col = job_.sums.col_begin; col < job_.sums.col_end; col += kSsimTile) {
      double tile = 0;
      for (Index c = col - first_col_; c < std::min(col + kSsimTile, job_.sums.col_end) - first_col_; c += kGroup) {
        tile += sum[c % blocks_ / kGroup * N + c / blocks_];
      }
      const S high = static_cast<S>(tile);  // as it is kept between evaluations: two numbers of S
      out[col / kSsimTile] = static_cast<double>(high) + static_cast<double>(static_cast<S>(tile - high));
    }
    clear_sums();
  }

  const SsimSweep<S>& job_;
  Index first_col_, blocks_;
  S* memory_;
  Layout<S> at_;
  S weights_[kRadius + 1];
};

template <class S>
Index workspace_size(Index cols) {
  return Layout<S>(blocks_of<S>(cols + 4 * kRadius + 2 * kGroup)).size;
}

template <class S>
void sweep(const SsimSweep<S>& job, S* workspace) {
  const bool with_gradient = !job.gradient.empty();
  Index c0 = job.sums.col_begin - kRadius, c1 = job.sums.col_end + kRadius;
  Index r0 = job.sums.row_begin, r1 = job.sums.row_end;
  if (with_gradient) {
    c0 = std::min(c0, job.gradient.col_begin - 2 * kRadius);
    c1 = std::max(c1, job.gradient.col_end + 2 * kRadius);
    r0 = std::min(r0, job.gradient.row_begin - kRadius);
    r1 = std::max(r1, job.gradient.row_end + kRadius);
  }
  c0 = std::max(Index(0), c0) / kGroup * kGroup;
  c1 = std::min(job.cols, c1);
  const auto floor_group = [](Index r) { return (r + 4 * kGroup) / kGroup - 4; };
  Sweep<S>(job, c0, blocks_of<S>(c1 - c0), workspace).run(floor_group(r0), floor_group(r1 - 1) + 1);
}

void sweep_float(const SsimSweep<float>& job, float* workspace) { sweep(job, workspace); }
void sweep_double(const SsimSweep<double>& job, double* workspace) { sweep(job, workspace); }
Index workspace_float(Index cols) { return workspace_size<float>(cols); }
Index workspace_double(Index cols) { return workspace_size<double>(cols); }

}  // namespace hsi4d::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hsi4d::detail {
HWY_EXPORT(sweep_float);
HWY_EXPORT(sweep_double);
HWY_EXPORT(workspace_float);
HWY_EXPORT(workspace_double);

template <>
void ssim_sweep(const SsimSweep<float>& job, float* workspace) {
  HWY_DYNAMIC_DISPATCH(sweep_float)(job, workspace);
}
template <>
void ssim_sweep(const SsimSweep<double>& job, double* workspace) {
  HWY_DYNAMIC_DISPATCH(sweep_double)(job, workspace);
}
template <>
Index ssim_workspace_size<float>(Index cols) {
  return HWY_DYNAMIC_DISPATCH(workspace_float)(cols);
}
template <>
Index ssim_workspace_size<double>(Index cols) {
  return HWY_DYNAMIC_DISPATCH(workspace_double)(cols);
}
}  // namespace hsi4d::detail
#endif
