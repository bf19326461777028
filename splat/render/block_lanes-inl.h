// Vectors of the block kernel: instructions that Highway has no name for, 2ᵖ, and transposes between lanes of pixels
// and lanes of Gaussians. Compiled once for each instruction set.
#if defined(HSI4D_SPLAT_BLOCK_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef HSI4D_SPLAT_BLOCK_LANES_INL_H
#undef HSI4D_SPLAT_BLOCK_LANES_INL_H
#else
#define HSI4D_SPLAT_BLOCK_LANES_INL_H
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

#include <hwy/highway.h>

#ifndef HSI4D_CHOSEN_LANES
#define HSI4D_CHOSEN_LANES
namespace hsi4d::detail {
/// The positions of the bits that are set, by byte.
inline constexpr auto kChosenLanes = [] {
  std::array<std::array<std::uint8_t, 8>, 256> lanes{};
  for (size_t bits = 0; bits < 256; ++bits) {
    for (std::uint8_t bit = 0, n = 0; bit < 8; ++bit) {
      if ((bits >> bit & 1) != 0) lanes[bits][n++] = bit;
    }
  }
  return lanes;
}();
}  // namespace hsi4d::detail
#endif

HWY_BEFORE_NAMESPACE();
namespace hsi4d::detail::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, 16>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(D()));
constexpr int kParts = 16 / kLanes;  ///< vectors of a block
using D4 = hn::CappedTag<float, 4>;
using DI = hn::RebindToSigned<D>;
using VI = hn::Vec<DI>;
using MI = hn::Mask<DI>;

// --- a few instructions that Highway has no name for -----------------------------------------------------------------

/// ⌊p⌋, and p − ⌊p⌋.
struct Parted {
  V whole, fraction;
};

#if HWY_TARGET <= HWY_AVX3 && HWY_ARCH_X86
/// α of a Gaussian in the pixels that it is composited in.
struct Drawn {
  M where;
  V alpha;  ///< elsewhere any number
};
/// α for drawn_where, with any number where it has not passed.
HWY_INLINE V masked(M, V a) { return a; }
HWY_INLINE Drawn drawn_where(M passed, V a, V t, V stop) {
  return {M{_mm512_mask_cmp_ps_mask(passed.raw, t.raw, stop.raw, _CMP_GE_OQ)}, a};
}
HWY_INLINE M is_drawn(Drawn x) { return x.where; }
HWY_INLINE Drawn without(Drawn x, M past) { return {hn::AndNot(past, x.where), x.alpha}; }
HWY_INLINE V alpha_of(Drawn x) { return hn::IfThenElseZero(x.where, x.alpha); }
HWY_INLINE V weight_of(Drawn x, V t) { return V{_mm512_maskz_mul_ps(x.where.raw, t.raw, x.alpha.raw)}; }
HWY_INLINE V behind(Drawn x, V t) { return V{_mm512_mask_fnmadd_ps(t.raw, x.where.raw, x.alpha.raw, t.raw)}; }
HWY_INLINE Parted parted(V p) { return {p, V{_mm512_reduce_ps(p.raw, 0x09)}}; }  // scalef takes the floor itself
HWY_INLINE V rest_of_rounding(V p) { return V{_mm512_reduce_ps(p.raw, 0x08)}; }
HWY_INLINE V times_power_of(V y, V whole) { return V{_mm512_scalef_ps(y.raw, whole.raw)}; }
HWY_INLINE void keep_bits(Drawn x, int, std::uint16_t* to) { _store_mask16(to, x.where.raw); }
/// first, first + 1, … of the lanes where m, one behind the other; writes a whole vector, returns how many count.
HWY_INLINE size_t store_chosen(VI place, MI m, std::int32_t* to) { return hn::CompressStore(place, m, DI(), to); }
#else
#if HWY_TARGET == HWY_SCALAR
/// y 2ⁿ for y in [½, 2) and a whole number n ≥ −126; for smaller n some number.
HWY_INLINE V times_power_of(V y, V n) {
  const float held = std::max(hn::GetLane(n), -126.0f);
  return hn::Set(D(), std::bit_cast<float>(std::bit_cast<std::int32_t>(hn::GetLane(y)) +
                                           static_cast<std::int32_t>(held) * (1 << 23)));
}
#else
/// The same. The sum of 1.5 · 2²³ and a whole number has that number in its lowest bits.
HWY_INLINE V times_power_of(V y, V n) {
  const DI di;
  const VI exponent = hn::BitCast(di, hn::Add(n, hn::Set(D(), 12582912.0f)));
  return hn::BitCast(D(), hn::Add(hn::BitCast(di, y), hn::ShiftLeft<23>(exponent)));
}
#endif
/// α of a Gaussian in the pixels that it is composited in, elsewhere 0.
struct Drawn {
  V alpha;
};
/// α for drawn_where: 0 where it has not passed.
HWY_INLINE V masked(M passed, V a) { return hn::IfThenElseZero(passed, a); }
HWY_INLINE Drawn drawn_where(M, V a, V t, V stop) { return {hn::IfThenElseZero(hn::Ge(t, stop), a)}; }
HWY_INLINE M is_drawn(Drawn x) { return hn::Gt(x.alpha, hn::Zero(D())); }
HWY_INLINE Drawn without(Drawn x, M past) { return {hn::IfThenZeroElse(past, x.alpha)}; }
HWY_INLINE V alpha_of(Drawn x) { return x.alpha; }
HWY_INLINE V weight_of(Drawn x, V t) { return hn::Mul(t, x.alpha); }
HWY_INLINE V behind(Drawn x, V t) { return hn::NegMulAdd(t, x.alpha, t); }
HWY_INLINE Parted parted(V p) {
  const V whole = hn::Floor(p);
  return {whole, hn::Sub(p, whole)};
}
HWY_INLINE V rest_of_rounding(V p) { return hn::Sub(p, hn::Round(p)); }
HWY_INLINE void keep_bits(Drawn x, int part, std::uint16_t* to) {
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(D(), is_drawn(x), bits);
  *to = static_cast<std::uint16_t>((part == 0 ? 0 : *to) | bits[0] << (part * kLanes));
}
/// The same by a table: GCC 12 copies that of Highway's CompressStore, of 1 KiB, to the stack in every call.
HWY_INLINE size_t store_chosen(VI place, MI m, std::int32_t* to) {
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(DI(), m, bits);
  const hn::Rebind<std::uint8_t, DI> bytes;
  const auto lanes = hn::PromoteTo(DI(), hn::LoadU(bytes, kChosenLanes[bits[0]].data()));
  hn::StoreU(hn::Add(hn::Set(DI(), hn::GetLane(place)), lanes), DI(), to);
  return static_cast<size_t>(std::popcount(bits[0]));
}
#endif

/// 2ᵖ for p ≥ −126, 1 at 0, monotone, by a minimax polynomial of degree 5 of p − ⌊p⌋: it is off by 8e-8, with rounding
/// by 1.8e-7 or 3.1 ulp at most. If exact, of degree 6, 2e-9, of what is left of p by rounding it: 1e-7, 1.2 ulp, and
/// near p = 0, where 1 − 2ᵖ matters, half an ulp; and 0 for p < −126.
template <bool kExact>
HWY_INLINE V exp2_of(V p) {
  const D d;
  if constexpr (kExact) {
    const V f = rest_of_rounding(p);
    V y = hn::Set(d, 0.00015353365227943616f);
    for (const float c : {0.0013398874529485412f, 0.009618437347880177f, 0.055503324707932414f, 0.24022647913679607f,
                          0.693147202855229f, 1.0f}) {
      y = hn::MulAdd(y, f, hn::Set(d, c));
    }
    return hn::IfThenElseZero(hn::Ge(p, hn::Set(d, -126.0f)), times_power_of(y, hn::Sub(p, f)));
  } else {
    const auto [whole, f] = parted(p);
    // The inner terms in pairs: one more multiplication, and four cycles less to wait for.
    const V high = hn::MulAdd(hn::Set(d, 0.0018671309482703458f), f, hn::Set(d, 0.009017028235494745f));
    const V low = hn::MulAdd(hn::Set(d, 0.05579991480382185f), f, hn::Set(d, 0.24016444961251981f));
    const V inner = hn::MulAdd(hn::MulAdd(high, hn::Mul(f, f), low), f, hn::Set(d, 0.6931513118582556f));
    const V y = hn::MulAdd(inner, f, hn::Set(d, 1.0f));
    return times_power_of(y, whole);
  }
}

// --- lanes of pixels to lanes of Gaussians ---------------------------------------------------------------------------

/// Gaussians whose sums over pixels are made together, in quads: as many as there are lanes.
constexpr int kQuads = kLanes > 4 ? kLanes / 4 : 1, kBatch = 4 * kQuads;

/// A number of each Gaussian of a batch. Not to be copied: GCC moves it in pieces of 16 bytes, for which the whole
/// vectors that are read afterwards have to wait.
struct OfBatch {
  V v[kBatch / kLanes];
};

#if HWY_TARGET == HWY_SCALAR
/// From v[Gaussian] with lanes [row][column] to v[column] with lanes [row][Gaussian].
void transpose4(V (&v)[4][kParts]) {
  for (int row = 0; row < 4; ++row) {
    for (int g = 0; g < 4; ++g) {
      for (int x = 0; x < g; ++x) std::swap(v[g][4 * row + x], v[x][4 * row + g]);
    }
  }
}

/// Vectors with lanes [row][Gaussian] for the quads of a batch, summed over rows.
void sum_over_rows(const V (&quads)[kQuads][kParts], OfBatch& r) {
  for (int i = 0; i < kBatch; ++i) {
    const V* const of = quads[0] + i;
    r.v[i] = hn::Add(hn::Add(of[0], of[4]), hn::Add(of[8], of[12]));
  }
}

/// Four numbers from each of some places, as lanes of places.
void load_fours(const float* const (&places)[kBatch], OfBatch (&out)[4]) {
  for (int i = 0; i < kBatch; ++i) {
    for (int k = 0; k < 4; ++k) out[k].v[i] = hn::Set(D(), places[i][k]);
  }
}

/// Adds four numbers to each of some places.
void add_fours(const OfBatch* of, float* const (&places)[kBatch], Index first) {
  for (int i = 0; i < kBatch; ++i) {
    for (int k = 0; k < 4; ++k) places[i][first + k] += hn::GetLane(of[k].v[i]);
  }
}
#else
/// Transposes the 4×4 numbers of every 128 bits of four vectors.
HWY_INLINE void transpose4(V& a, V& b, V& c, V& e) {
  const D d;
  const hn::Repartition<double, D> dd;
  const auto wide = [&](V v) HWY_ATTR { return hn::BitCast(dd, v); };
  const V ab_low = hn::InterleaveLower(d, a, b), ab_high = hn::InterleaveUpper(d, a, b);
  const V ce_low = hn::InterleaveLower(d, c, e), ce_high = hn::InterleaveUpper(d, c, e);
  a = hn::BitCast(d, hn::InterleaveLower(dd, wide(ab_low), wide(ce_low)));
  b = hn::BitCast(d, hn::InterleaveUpper(dd, wide(ab_low), wide(ce_low)));
  c = hn::BitCast(d, hn::InterleaveLower(dd, wide(ab_high), wide(ce_high)));
  e = hn::BitCast(d, hn::InterleaveUpper(dd, wide(ab_high), wide(ce_high)));
}

/// From v[Gaussian] with lanes [row][column] to v[column] with lanes [row][Gaussian].
HWY_INLINE void transpose4(V (&v)[4][kParts]) {
  for (int j = 0; j < kParts; ++j) transpose4(v[0][j], v[1][j], v[2][j], v[3][j]);
}

#if HWY_CAP_GE256
/// The sum of a's halves, then that of b's.
HWY_INLINE V sums_of_halves(V a, V b) {
  const D d;
  return hn::Add(hn::ConcatLowerLower(d, b, a), hn::ConcatUpperUpper(d, b, a));
}
#endif

#if HWY_CAP_GE512 && HWY_ARCH_X86
/// Transposes the 4×4 blocks of 128 bits of four vectors.
HWY_INLINE void transpose_blocks(V& a, V& b, V& c, V& e) {
  const V ab_low{_mm512_shuffle_f32x4(a.raw, b.raw, 0x44)}, ab_high{_mm512_shuffle_f32x4(a.raw, b.raw, 0xEE)};
  const V ce_low{_mm512_shuffle_f32x4(c.raw, e.raw, 0x44)}, ce_high{_mm512_shuffle_f32x4(c.raw, e.raw, 0xEE)};
  a = V{_mm512_shuffle_f32x4(ab_low.raw, ce_low.raw, 0x88)};
  b = V{_mm512_shuffle_f32x4(ab_low.raw, ce_low.raw, 0xDD)};
  c = V{_mm512_shuffle_f32x4(ab_high.raw, ce_high.raw, 0x88)};
  e = V{_mm512_shuffle_f32x4(ab_high.raw, ce_high.raw, 0xDD)};
}
#endif

/// Vectors with lanes [row][Gaussian] for the quads of a batch, summed over rows.
HWY_INLINE void sum_over_rows(const V (&quads)[kQuads][kParts], OfBatch& r) {
#if HWY_CAP_GE512
  const V even = sums_of_halves(quads[0][0], quads[2][0]), odd = sums_of_halves(quads[1][0], quads[3][0]);
  // blocks of 128 bits: quads 0 0 2 2, and 1 1 3 3
  r.v[0] = hn::Add(hn::OddEvenBlocks(hn::SwapAdjacentBlocks(odd), even),
                   hn::OddEvenBlocks(odd, hn::SwapAdjacentBlocks(even)));
#elif HWY_CAP_GE256
  r.v[0] = sums_of_halves(hn::Add(quads[0][0], quads[0][1]), hn::Add(quads[1][0], quads[1][1]));
#else
  r.v[0] = hn::Add(hn::Add(quads[0][0], quads[0][1]), hn::Add(quads[0][2], quads[0][3]));
#endif
}

/// Four numbers from places 0, 4, … of `from`, as 128 bits each.
HWY_INLINE V blocks_from(const float* const* from) {
  const D4 d4;
#if HWY_CAP_GE256
  const hn::CappedTag<float, 8> d8;
  const auto low = hn::Combine(d8, hn::LoadU(d4, from[4]), hn::LoadU(d4, from[0]));
#if HWY_CAP_GE512
  return hn::Combine(D(), hn::Combine(d8, hn::LoadU(d4, from[12]), hn::LoadU(d4, from[8])), low);
#else
  return low;
#endif
#else
  return hn::LoadU(d4, from[0]);
#endif
}

/// Four numbers from each of some places, as lanes of places.
HWY_INLINE void load_fours(const float* const (&places)[kBatch], OfBatch (&out)[4]) {
  for (int i = 0; i < 4; ++i) out[i].v[0] = blocks_from(places + i);
  transpose4(out[0].v[0], out[1].v[0], out[2].v[0], out[3].v[0]);
}

/// Adds four numbers to each of some places, from number `first` there on.
HWY_INLINE void add_fours(const OfBatch* of, float* const (&places)[kBatch], Index first) {
  const D d;
  const D4 d4;
  V v[4] = {of[0].v[0], of[1].v[0], of[2].v[0], of[3].v[0]};
  transpose4(v[0], v[1], v[2], v[3]);
  HWY_ALIGN float rows[4][kLanes];
  for (int i = 0; i < 4; ++i) hn::Store(v[i], d, rows[i]);
  for (int g = 0; g < kBatch; ++g) {
    float* const to = places[g] + first;
    hn::Store(hn::Add(hn::Load(d4, to), hn::Load(d4, rows[g % 4] + g / 4 * 4)), d4, to);
  }
}

#if HWY_CAP_GE256
/// Adds eight numbers to each of some places.
HWY_INLINE void add_eights(const OfBatch* of, float* const (&places)[kBatch]) {
  const D d;
  const hn::CappedTag<float, 8> d8;
  V low[4] = {of[0].v[0], of[1].v[0], of[2].v[0], of[3].v[0]},
    high[4] = {of[4].v[0], of[5].v[0], of[6].v[0], of[7].v[0]};
  transpose4(low[0], low[1], low[2], low[3]);
  transpose4(high[0], high[1], high[2], high[3]);
  // Blocks of 128 bits are of places i, i + 4, …: next to those of `low` come those of `high`.
  HWY_ALIGN float rows[4][2][kLanes];
  for (int i = 0; i < 4; ++i) {
    hn::Store(hn::OddEvenBlocks(hn::SwapAdjacentBlocks(high[i]), low[i]), d, rows[i][0]);
    hn::Store(hn::OddEvenBlocks(high[i], hn::SwapAdjacentBlocks(low[i])), d, rows[i][1]);
  }
  for (int g = 0; g < kBatch; ++g) {
    float* const to = places[g];
    hn::StoreU(hn::Add(hn::LoadU(d8, to), hn::Load(d8, rows[g % 4][g / 4 % 2] + g / 8 * 8)), d8, to);
  }
}
#endif
#endif

}  // namespace hsi4d::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // HSI4D_SPLAT_BLOCK_LANES_INL_H
