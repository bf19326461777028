// Building blocks of the SSIM kernel for one instruction set: filters, and the permutation between rows of pixels and
// rows of vectors. Included once per Highway target by ssim_kernel.cpp.
#if defined(HSI4D_SSIM_FILTER_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef HSI4D_SSIM_FILTER_INL
#undef HSI4D_SSIM_FILTER_INL
#else
#define HSI4D_SSIM_FILTER_INL
#endif

#include <hwy/highway.h>

#include "autodiff/ssim_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace hsi4d::detail::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

template <class S>
using Tag = hn::ScalableTag<S>;
template <class S>
using Vec = hn::Vec<Tag<S>>;
template <class S>
constexpr Index kLanes = static_cast<Index>(hn::MaxLanes(Tag<S>()));

constexpr int kRadius = static_cast<int>(kSsimRadius);
constexpr int kGroup = 4;                      // outputs of a filter call
constexpr int kInputs = kGroup + 2 * kRadius;  // inputs of a filter call

template <class S>
struct Window {
  Vec<S> w[kRadius + 1];
};

/// out[o] = Σ_j w_|j| in[o + 5 + j].
template <class S, bool kUnitCentre = false>
HWY_INLINE void filter(const Window<S>& window, const Vec<S> (&in)[kInputs], Vec<S> (&out)[kGroup]) {
#pragma GCC unroll 4
  for (int o = 0; o < kGroup; ++o) {
    const int c = o + kRadius;
    Vec<S> sum = kUnitCentre ? in[c] : hn::Mul(window.w[0], in[c]);
#pragma GCC unroll 5
    for (int j = 1; j <= kRadius; ++j) sum = hn::MulAdd(window.w[j], hn::Add(in[c - j], in[c + j]), sum);
    out[o] = sum;
  }
}

template <class S>
struct Moments {
  Vec<S> k;              // subtracted before filtering
  Vec<S> shift[kGroup];  // mean − k
  Vec<S> variance[kGroup];
};

/// Mean and variance of four windows whose inputs have means m = mean(i) and variances v themselves:
/// Var = Σ w (v + (m−k)²) − (Σ w (m−k))², where squares(i, m−k) gives v + (m−k)².
template <class S, class Mean, class AddVariance>
HWY_INLINE void central_moments(const Window<S>& window, Mean&& mean, AddVariance&& squares, Moments<S>& out) {
  Vec<S> in[kInputs];
  out.k = mean(kRadius + 1);
#pragma GCC unroll 14
  for (int i = 0; i < kInputs; ++i) in[i] = hn::Sub(mean(i), out.k);
  filter<S>(window, in, out.shift);
#pragma GCC unroll 14
  for (int i = 0; i < kInputs; ++i) in[i] = squares(i, in[i]);
  filter<S>(window, in, out.variance);
#pragma GCC unroll 4
  for (int o = 0; o < kGroup; ++o) out.variance[o] = hn::NegMulAdd(out.shift[o], out.shift[o], out.variance[o]);
}

/// out[o] = Σ_j w_|j| in(o + 5 + j).
template <class S, class In>
HWY_INLINE void plain(const Window<S>& window, In&& input, Vec<S> (&out)[kGroup]) {
  Vec<S> in[kInputs];
#pragma GCC unroll 14
  for (int i = 0; i < kInputs; ++i) in[i] = input(i);
  filter<S, true>(window, in, out);
}

/// slope[o] = Σ w b,  offset[o] = Σ w (c + b (z_o − z)), by differences.
template <class S, class C, class B, class Z>
HWY_INLINE void adjoint_filter(const Window<S>& window, C&& c, B&& b, Z&& z, Vec<S> (&offset)[kGroup],
                               Vec<S> (&slope)[kGroup]) {
  plain<S>(window, b, slope);
  const Vec<S> k = z(kRadius + 1);
  plain<S>(
      window, [&](int i) HWY_ATTR { return hn::NegMulAdd(b(i), hn::Sub(z(i), k), c(i)); }, offset);
#pragma GCC unroll 4
  for (int o = 0; o < kGroup; ++o) {
    offset[o] = hn::MulAdd(hn::Sub(z(o + kRadius), k), slope[o], offset[o]);
  }
}

// ---- permutation between rows of pixels and rows of vectors ----

#if HWY_TARGET == HWY_SCALAR
template <class S>
constexpr Index kPiece = 1;
template <class D, class S>
HWY_INLINE hn::Vec<D> load_pieces(D d, const S* p, Index) {
  return hn::LoadU(d, p);
}
template <class D, class S>
HWY_INLINE void store_pieces(D d, hn::Vec<D> v, S* p, Index) {
  hn::StoreU(v, d, p);
}
template <class D>
HWY_INLINE void transpose_pieces(D, hn::Vec<D> (&)[1]) {}
#else
template <class S>
constexpr Index kPiece = 16 / Index(sizeof(S));  // pixels in 128 bits

/// 128-bit pieces at p, p + step, … as one vector.
template <class D, class S>
HWY_INLINE hn::Vec<D> load_pieces(D d, const S* p, Index step) {
  if constexpr (hn::MaxLanes(D()) * sizeof(S) <= 16) {
    return hn::LoadU(d, p);
  } else {
    const hn::Half<D> half;
    return hn::Combine(d, load_pieces(half, p + step * Index(hn::MaxLanes(half) * sizeof(S) / 16), step),
                       load_pieces(half, p, step));
  }
}
template <class D, class S>
HWY_INLINE void store_pieces(D d, hn::Vec<D> v, S* p, Index step) {
  if constexpr (hn::MaxLanes(D()) * sizeof(S) <= 16) {
    hn::StoreU(v, d, p);
  } else {
    const hn::Half<D> half;
    store_pieces(half, hn::LowerHalf(half, v), p, step);
    store_pieces(half, hn::UpperHalf(half, v), p + step * Index(hn::MaxLanes(half) * sizeof(S) / 16), step);
  }
}

/// Transposes each 128-bit piece of four (float) or two (double) vectors.
template <class D>
HWY_INLINE void transpose_pieces(D d, hn::Vec<D> (&v)[4]) {
  const auto a = hn::InterleaveLower(d, v[0], v[2]), b = hn::InterleaveUpper(d, v[0], v[2]);
  const auto c = hn::InterleaveLower(d, v[1], v[3]), e = hn::InterleaveUpper(d, v[1], v[3]);
  v[0] = hn::InterleaveLower(d, a, c);
  v[1] = hn::InterleaveUpper(d, a, c);
  v[2] = hn::InterleaveLower(d, b, e);
  v[3] = hn::InterleaveUpper(d, b, e);
}
template <class D>
HWY_INLINE void transpose_pieces(D d, hn::Vec<D> (&v)[2]) {
  const auto a = hn::InterleaveLower(d, v[0], v[1]);
  v[1] = hn::InterleaveUpper(d, v[0], v[1]);
  v[0] = a;
}
#endif

/// vectors[t·step + lane] = pixels[lane·blocks + t].
template <class S>
void pixels_to_vectors(const S* pixels, Index blocks, S* vectors, Index step) {
  const Tag<S> d;
  constexpr Index K = kPiece<S>;
  for (Index t = 0; t < blocks; t += K) {
    Vec<S> v[K];
    for (Index q = 0; q < K; ++q) v[q] = load_pieces(d, pixels + q * blocks + t, K * blocks);
    transpose_pieces(d, v);
    for (Index q = 0; q < K; ++q) hn::Store(v[q], d, vectors + (t + q) * step);
  }
}

/// pixels[lane·blocks + t] = vectors[t·step + lane].
template <class S>
void vectors_to_pixels(const S* vectors, Index blocks, S* pixels, Index step) {
  const Tag<S> d;
  constexpr Index K = kPiece<S>;
  for (Index t = 0; t < blocks; t += K) {
    Vec<S> v[K];
    for (Index q = 0; q < K; ++q) v[q] = hn::Load(d, vectors + (t + q) * step);
    transpose_pieces(d, v);
    for (Index q = 0; q < K; ++q) store_pieces(d, v[q], pixels + q * blocks + t, K * blocks);
  }
}

/// Vectors −5…−1 and blocks…blocks+4 of a row: the same columns as seen from the neighbouring lane; zero past the ends.
/// From the inside outwards, because with four blocks the fifth vector comes from the halo itself.
template <class S>
HWY_INLINE void fill_halo(S* row, Index blocks, Index step, Index fields) {
  const Tag<S> d;
  const auto first = hn::FirstN(d, 1);
  const auto all_but_last = hn::FirstN(d, static_cast<size_t>(kLanes<S> - 1));
  for (Index t = 0; t < kRadius; ++t) {
    for (Index f = 0; f < fields; ++f) {
      S* field = row + f * kLanes<S>;
      const auto from_left = hn::LoadU(d, field + (blocks - 1 - t) * step - 1);
      hn::Store(hn::IfThenZeroElse(first, from_left), d, field + (-1 - t) * step);
      const auto from_right = hn::LoadU(d, field + t * step + 1);
      hn::Store(hn::IfThenElseZero(all_but_last, from_right), d, field + (blocks + t) * step);
    }
  }
}

}  // namespace hsi4d::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
