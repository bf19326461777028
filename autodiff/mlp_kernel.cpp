// Vector kernels of mlp_kernel.h: tiles of a few outputs by three vectors of rows stay in registers while the sums over
// inputs (or, for weights, over rows) run.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "autodiff/mlp_kernel.cpp"
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include "autodiff/mlp_kernel.h"

#include <type_traits>

#include <hwy/highway.h>

#include "core/simd.h"

HWY_BEFORE_NAMESPACE();
namespace hsi4d::detail::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

template <class S>
using Tag = hn::CappedTag<S, kMlpLanes>;
template <class S>
using Vec = hn::Vec<Tag<S>>;
template <class S>
inline constexpr Index kLanes = static_cast<Index>(hn::MaxLanes(Tag<S>()));

/// Vectors of rows, and outputs, of a tile: as many accumulators as registers hold beside what is multiplied.
inline constexpr int kWide = 3;
inline constexpr int kTall = HWY_TARGET <= HWY_AVX3 ? 8 : 4;  // lower targets are better
static_assert(kMlpBlock % (kWide * kMlpLanes) == 0);

/// 1/√s for s ≥ 1. In float within 8e-7: a first guess from the bits and two steps of Newton's method whose constants
/// balance the error [Walczyk, Moroz and Cieśliński 2021, "Improving the accuracy of the fast inverse square root by
/// modifying Newton-Raphson corrections"]; no division, no root, and none of the processor's own estimates, which
/// differ from maker to maker.
template <class S>
HWY_INLINE Vec<S> inverse_root(Vec<S> s) {
  const Tag<S> d;
  if constexpr (std::is_same_v<S, float>) {
    const hn::RebindToUnsigned<Tag<S>> bits;
    const auto half = hn::Mul(s, hn::Set(d, 0.5F));
    auto r = hn::BitCast(d, hn::Sub(hn::Set(bits, 0x5F376908u), hn::ShiftRight<1>(hn::BitCast(bits, s))));
    r = hn::Mul(r, hn::NegMulAdd(hn::Mul(half, r), r, hn::Set(d, 1.50087896F)));
    return hn::Mul(r, hn::NegMulAdd(hn::Mul(half, r), r, hn::Set(d, 1.50000057F)));
  } else {
    return hn::Div(hn::Set(d, S(1)), hn::Sqrt(s));
  }
}

/// a(z) = z (1 + t)/2 with t = z r, r = 1/√(1 + z²);   a'(z) = (1 + t (1 + r²))/2
template <class S>
HWY_INLINE Vec<S> activated(Vec<S> z, Vec<S>* slope) {
  const Tag<S> d;
  const auto half = hn::Set(d, S(0.5)), one = hn::Set(d, S(1));
  const auto r = inverse_root<S>(hn::MulAdd(z, z, one)), t = hn::Mul(z, r), half_z = hn::Mul(z, half);
  if (slope != nullptr) *slope = hn::MulAdd(hn::Mul(t, half), hn::MulAdd(r, r, one), half);
  return hn::MulAdd(half_z, t, half_z);
}

enum class Output { kLinear, kHidden, kHiddenWithSlope };

/// Rows of the tile's vectors of Σ_k numbers[k·between + t·beside] x_k, for kT outputs t, on top of `sum`.
template <class S, int kT>
HWY_INLINE void add_products(const S* HWY_RESTRICT numbers, Index between, Index beside, Index count,
                             const S* HWY_RESTRICT x, Vec<S> (&sum)[kT][kWide]) {
  const Tag<S> d;
  for (Index k = 0; k < count; ++k) {
    Vec<S> row[kWide];
#pragma GCC unroll 3
    for (int v = 0; v < kWide; ++v) row[v] = hn::LoadU(d, x + k * kMlpBlock + v * kLanes<S>);
#pragma GCC unroll 8
    for (int t = 0; t < kT; ++t) {
      const auto w = hn::Set(d, numbers[k * between + t * beside]);
#pragma GCC unroll 3
      for (int v = 0; v < kWide; ++v) sum[t][v] = hn::MulAdd(w, row[v], sum[t][v]);
    }
  }
}

/// kT outputs of a layer from output `first` on.
template <class S, Output kOutput, int kT>
HWY_NOINLINE void layer_tile(const MlpStep<S>& step, Index first, const S* x, S* y, S* slope) {
  const Tag<S> d;
  for (Index at = 0; at < kMlpBlock; at += kWide * kLanes<S>) {
    Vec<S> sum[kT][kWide];
#pragma GCC unroll 8
    for (int t = 0; t < kT; ++t) {
#pragma GCC unroll 3
      for (int v = 0; v < kWide; ++v) sum[t][v] = hn::Set(d, step.bias[first + t]);
    }
    add_products<S, kT>(step.weights + first, step.outputs, 1, step.inputs, x + at, sum);
#pragma GCC unroll 8
    for (int t = 0; t < kT; ++t) {
#pragma GCC unroll 3
      for (int v = 0; v < kWide; ++v) {
        const Index to = (first + t) * kMlpBlock + at + v * kLanes<S>;
        Vec<S> rise = sum[t][v];
        if constexpr (kOutput == Output::kLinear) {
          hn::StoreU(sum[t][v], d, y + to);
        } else {
          hn::StoreU(activated<S>(sum[t][v], kOutput == Output::kHiddenWithSlope ? &rise : nullptr), d, y + to);
          if constexpr (kOutput == Output::kHiddenWithSlope) hn::StoreU(rise, d, slope + to);
        }
      }
    }
  }
}

/// Calls tile<kT>(first) for all of [0, count), in the largest tiles that fit.
template <int kT, class F>
HWY_INLINE void for_tiles(Index first, Index count, const F& tile) {
  for (; first + kT <= count; first += kT) tile(std::integral_constant<int, kT>(), first);
  if constexpr (kT > 1) for_tiles<kT / 2>(first, count, tile);
}

template <class S, Output kOutput>
void layer(const MlpStep<S>& step, const S* x, S* y, S* slope) {
  for_tiles<kTall>(0, step.outputs, [&](auto tall, Index first) {
    layer_tile<S, kOutput, decltype(tall)::value>(step, first, x, y, slope);
  });
}

template <class S>
void linear(const MlpStep<S>& step, const S* x, S* z) {
  layer<S, Output::kLinear>(step, x, z, nullptr);
}
template <class S>
void hidden(const MlpStep<S>& step, const S* x, S* y) {
  layer<S, Output::kHidden>(step, x, y, nullptr);
}
template <class S>
void hidden_with_slope(const MlpStep<S>& step, const S* x, S* y, S* slope) {
  layer<S, Output::kHiddenWithSlope>(step, x, y, slope);
}

/// d_x of kT inputs from input `first` on.
template <class S, int kT>
HWY_NOINLINE void inputs_tile(const MlpStep<S>& step, Index first, const S* d_z, const S* slope, S* d_x) {
  const Tag<S> d;
  for (Index at = 0; at < kMlpBlock; at += kWide * kLanes<S>) {
    Vec<S> sum[kT][kWide];
#pragma GCC unroll 8
    for (int t = 0; t < kT; ++t) {
#pragma GCC unroll 3
      for (int v = 0; v < kWide; ++v) sum[t][v] = hn::Zero(d);
    }
    add_products<S, kT>(step.weights + first * step.outputs, 1, step.outputs, step.outputs, d_z + at, sum);
#pragma GCC unroll 8
    for (int t = 0; t < kT; ++t) {
#pragma GCC unroll 3
      for (int v = 0; v < kWide; ++v) {
        const Index to = (first + t) * kMlpBlock + at + v * kLanes<S>;
        hn::StoreU(slope == nullptr ? sum[t][v] : hn::Mul(sum[t][v], hn::LoadU(d, slope + to)), d, d_x + to);
      }
    }
  }
}

template <class S>
void to_inputs(const MlpStep<S>& step, const S* d_z, const S* slope, S* d_x) {
  for_tiles<kTall>(0, step.inputs, [&](auto tall, Index first) {
    inputs_tile<S, decltype(tall)::value>(step, first, d_z, slope, d_x);
  });
}

/// Sums of neighbouring lanes: those of a, then those of b.
template <class S>
HWY_INLINE Vec<S> sums_of_pairs(Vec<S> a, Vec<S> b) {
#if HWY_TARGET == HWY_SCALAR
  return hn::Add(a, b);  // one lane has no neighbours; never called
#else
  const Tag<S> d;
  return hn::Add(hn::ConcatEven(d, b, a), hn::ConcatOdd(d, b, a));
#endif
}

/// sums[t] += Σ of the lanes of x[t], for kT vectors together: half the vectors, or half the lanes, at each step.
template <class S, int kT>
HWY_INLINE void add_sums_of_lanes(Vec<S> (&x)[kT], S* sums) {
  const Tag<S> d;
  if constexpr (kLanes < S >> 1 && kT <= kLanes<S>) {
#pragma GCC unroll 3
    for (int left = kT / 2; left > 0; left /= 2) {
#pragma GCC unroll 4
      for (int t = 0; t < left; ++t) x[t] = sums_of_pairs<S>(x[2 * t], x[2 * t + 1]);
    }
#pragma GCC unroll 4
    for (Index lanes = kLanes<S> / kT; lanes > 1; lanes /= 2) x[0] = sums_of_pairs<S>(x[0], x[0]);
    const hn::CappedTag<S, kT> few;
    using Few = hn::Vec<decltype(few)>;
    S folded[kLanes<S>];
    hn::StoreU(x[0], d, folded);
    if constexpr (hn::MaxLanes(few) == kT) {
      const Few all = hn::Add(hn::LoadU(few, sums), hn::LoadU(few, folded));
      hn::StoreU(all, few, sums);
    } else {
      for (int t = 0; t < kT; ++t) sums[t] += folded[t];
    }
  } else {
    for (int t = 0; t < kT; ++t) sums[t] += hn::GetLane(hn::SumOfLanes(d, x[t]));
  }
}

/// Sums over the block's rows of kT outputs by kI inputs.
template <class S, int kT, int kI>
HWY_NOINLINE void weights_tile(const MlpStep<S>& step, Index output, Index input, const S* HWY_RESTRICT x,
                               const S* HWY_RESTRICT d_z, S* HWY_RESTRICT sums) {
  const Tag<S> d;
  Vec<S> sum[kI][kT];
#pragma GCC unroll 3
  for (int i = 0; i < kI; ++i) {
#pragma GCC unroll 8
    for (int t = 0; t < kT; ++t) sum[i][t] = hn::Zero(d);
  }
  for (Index at = 0; at < kMlpBlock; at += kLanes<S>) {
    Vec<S> row[kI];
#pragma GCC unroll 3
    for (int i = 0; i < kI; ++i) row[i] = hn::LoadU(d, x + (input + i) * kMlpBlock + at);
#pragma GCC unroll 8
    for (int t = 0; t < kT; ++t) {
      const auto g = hn::LoadU(d, d_z + (output + t) * kMlpBlock + at);
#pragma GCC unroll 3
      for (int i = 0; i < kI; ++i) sum[i][t] = hn::MulAdd(g, row[i], sum[i][t]);
    }
  }
#pragma GCC unroll 3
  for (int i = 0; i < kI; ++i) add_sums_of_lanes<S, kT>(sum[i], sums + (input + i) * step.outputs + output);
}

template <class S>
void to_weights(const MlpStep<S>& step, const S* x, const S* d_z, S* sums) {
  for_tiles<kTall>(0, step.outputs, [&](auto tall, Index output) {
    constexpr int kT = decltype(tall)::value;
    Index input = 0;
    for (; input + kWide <= step.inputs; input += kWide) weights_tile<S, kT, kWide>(step, output, input, x, d_z, sums);
    for (; input < step.inputs; ++input) weights_tile<S, kT, 1>(step, output, input, x, d_z, sums);
  });
}

template <class S>
void to_bias(const MlpStep<S>& step, const S* d_z, S* sums) {
  const Tag<S> d;
  for_tiles<kTall>(0, step.outputs, [&](auto tall, Index output) {
    constexpr int kT = decltype(tall)::value;
    Vec<S> sum[kT];
#pragma GCC unroll 8
    for (int t = 0; t < kT; ++t) sum[t] = hn::Zero(d);
    for (Index at = 0; at < kMlpBlock; at += kLanes<S>) {
#pragma GCC unroll 8
      for (int t = 0; t < kT; ++t) sum[t] = hn::Add(sum[t], hn::LoadU(d, d_z + (output + t) * kMlpBlock + at));
    }
    add_sums_of_lanes<S, kT>(sum, sums + output);
  });
}

template <class S>
void set(MlpKernels<S>& kernels) {
  kernels = {linear<S>, hidden<S>, hidden_with_slope<S>, to_inputs<S>, to_weights<S>, to_bias<S>};
}

}  // namespace

void set_float(MlpKernels<float>& kernels) { set(kernels); }
void set_double(MlpKernels<double>& kernels) { set(kernels); }

}  // namespace hsi4d::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hsi4d::detail {

HWY_EXPORT(set_float);
HWY_EXPORT(set_double);

template <class S>
MlpKernels<S> mlp_kernels() {
  best_isa();  // holds Highway to it
  MlpKernels<S> kernels{};
  if constexpr (std::is_same_v<S, float>) {
    HWY_DYNAMIC_DISPATCH(set_float)(kernels);
  } else {
    HWY_DYNAMIC_DISPATCH(set_double)(kernels);
  }
  return kernels;
}
template MlpKernels<float> mlp_kernels();
template MlpKernels<double> mlp_kernels();

}  // namespace hsi4d::detail
#endif
