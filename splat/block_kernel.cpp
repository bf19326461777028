// Vector code of compositing in blocks; the mathematics is in splat/composite.h and splat/block_kernel.h.
//
// A block of 4×4 pixels is 16 lanes: one vector of 512 bits, two of 256, four of 128. For each block the list of its
// Gaussians is taken from the tile's by the entries' masks. Forward keeps T and colours of a block in registers.
//
// The backward pass replays a segment of a block's list from a kept T, by the same functions in the same order, so
// that it finds the same α, the same T and the same end (row B13), and keeps α and w = T α of the segment. From the
// back, v = w (g·f − S) and S ← S + α (g·f − S): nothing is divided (row B2). Sums over the pixels of a block are
// made of 16 Gaussians at a time: 4×4 transposes make lanes of Gaussians, and the moments {1, x, y, x², xy, y²} of v
// follow by rows. About the block's centre they are small numbers; they are moved to u and w there (row A1).
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat/block_kernel.cpp"
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include "splat/block_kernel.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include "core/check.h"

#ifndef HSI4D_SPLAT_BLOCK_KERNEL_ONCE
#define HSI4D_SPLAT_BLOCK_KERNEL_ONCE
namespace hsi4d::detail {

/// A Gaussian as the loops of one tile use it.
struct PackedSplat {
  float l11, l21, l22, log2_opacity, u0, w0, opacity, unused;
};
static_assert(sizeof(PackedSplat) == 32);

/// Parts of a tile's workspace.
struct BlockWorkspace {
  static constexpr Index kMostBlocks = 16;
  PackedSplat* packed;     ///< [kBlockChunk + 1], the last never drawn
  std::int32_t* blocks;    ///< [kBlockChunk + 16] masks of the chunk
  std::int32_t* list;      ///< [kBlockChunk + 32]
  float* centers;          ///< [kBlockChunk + 32][2] u and w at the block's centre, of the list; only kExact
  std::uint16_t* drawn;    ///< [kBlockChunk + 4] pixels that a Gaussian of the list was composited in
  float* state;            ///< [blocks][1 + C][16]
  float* features;         ///< [kBlockChunk + 1][C]
  float *alpha, *weight;   ///< [kBlockSegment][16]
  float* gradient_weight;  ///< [kBlockSegment][16] ∂(w · …)/∂ log α: 0 where the cap holds
  float* sums;             ///< [kBlockChunk + 1][block_slot(C)]

  static Index numbers(Index channels) {
    const Index numbers = (kBlockChunk + 1) * 8 + 4 * (kBlockChunk + 32) + (kBlockChunk + 32) / 2 +
                          kMostBlocks * (1 + channels) * kBlockPixels + (kBlockChunk + 1) * channels +
                          3 * kBlockSegment * kBlockPixels + (kBlockChunk + 1) * block_slot(channels);
    return aligned(numbers) + 11 * kAligned;
  }
  static constexpr Index kAligned = 16;
  static Index aligned(Index count) { return (count + kAligned - 1) / kAligned * kAligned; }
  BlockWorkspace(float* memory, Index channels) {
    const auto take = [&](Index count) {
      float* const part = memory;
      memory += aligned(count);
      return part;
    };
    packed = reinterpret_cast<PackedSplat*>(take((kBlockChunk + 1) * 8));
    blocks = reinterpret_cast<std::int32_t*>(take(kBlockChunk + 16));
    list = reinterpret_cast<std::int32_t*>(take(kBlockChunk + 32));
    centers = take(2 * (kBlockChunk + 32));
    drawn = reinterpret_cast<std::uint16_t*>(take((kBlockChunk + 32) / 2));
    state = take(kMostBlocks * (1 + channels) * kBlockPixels);
    features = take((kBlockChunk + 1) * channels);
    alpha = take(kBlockSegment * kBlockPixels);
    weight = take(kBlockSegment * kBlockPixels);
    gradient_weight = take(kBlockSegment * kBlockPixels);
    sums = take((kBlockChunk + 1) * block_slot(channels));
  }
};

/// kPlain: no α reaches the cap, and the stop is inclusive. kCapped: with a cap and either stop. kExact: as kCapped,
/// with u and w from the block's centre, and the better exponential: for settings whose user wants small errors.
enum class Form { kPlain, kCapped, kExact };

inline bool wants_exact(const CompositeRules<float>& rules) {
  return rules.alpha_min < kExactBelowAlpha || rules.stop_below < kExactBelowStop || rules.blur < kExactBelowBlur;
}

/// log₂ of the least α that is composited; what is below 2⁻¹²⁶ never is.
inline float least_log2(float alpha_min) { return alpha_min > 0x1p-126f ? std::log2(alpha_min) : -126.0f; }

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

// --- a few instructions that Highway has no name for -----------------------------------------------------------------

#if HWY_TARGET <= HWY_AVX3 && HWY_ARCH_X86
HWY_INLINE M both_at_least(V a, V b, V c, V d) {
  return M{_mm512_mask_cmp_ps_mask(_mm512_cmp_ps_mask(a.raw, b.raw, _CMP_GE_OQ), c.raw, d.raw, _CMP_GE_OQ)};
}
HWY_INLINE V product_or_zero(M m, V a, V b) { return V{_mm512_maskz_mul_ps(m.raw, a.raw, b.raw)}; }
/// t − t a where m, else t.
HWY_INLINE V dimmed(M m, V t, V a) { return V{_mm512_mask_fnmadd_ps(t.raw, m.raw, a.raw, t.raw)}; }
HWY_INLINE V fraction(V p) { return V{_mm512_reduce_ps(p.raw, 0x09)}; }
HWY_INLINE V rest_of_rounding(V p) { return V{_mm512_reduce_ps(p.raw, 0x08)}; }
HWY_INLINE V times_power_of_floor(V y, V p) { return V{_mm512_scalef_ps(y.raw, p.raw)}; }
HWY_INLINE void keep_bits(M m, int, std::uint16_t* to) { _store_mask16(to, m.raw); }
#else
#if HWY_TARGET == HWY_SCALAR
/// y 2^⌊p⌋ for y in [1, 2) and p ≥ −126; for smaller p some number.
HWY_INLINE V times_power_of_floor(V y, V p) {
  const float floor = std::floor(std::max(hn::GetLane(p), -126.0f));
  return hn::Set(D(), std::bit_cast<float>(std::bit_cast<std::int32_t>(hn::GetLane(y)) +
                                           static_cast<std::int32_t>(floor) * (1 << 23)));
}
#else
/// The same.
HWY_INLINE V times_power_of_floor(V y, V p) {
  const hn::RebindToSigned<D> di;
  const auto n = hn::ConvertTo(di, hn::Floor(hn::Max(p, hn::Set(D(), -126.0f))));
  return hn::BitCast(D(), hn::Add(hn::BitCast(di, y), hn::ShiftLeft<23>(n)));
}
#endif
HWY_INLINE M both_at_least(V a, V b, V c, V d) { return hn::And(hn::Ge(a, b), hn::Ge(c, d)); }
HWY_INLINE V product_or_zero(M m, V a, V b) { return hn::IfThenElseZero(m, hn::Mul(a, b)); }
HWY_INLINE V dimmed(M m, V t, V a) { return hn::NegMulAdd(t, hn::IfThenElseZero(m, a), t); }
HWY_INLINE V fraction(V p) { return hn::Sub(p, hn::Floor(p)); }
HWY_INLINE V rest_of_rounding(V p) { return hn::Sub(p, hn::Round(p)); }
HWY_INLINE void keep_bits(M m, int part, std::uint16_t* to) {
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(D(), m, bits);
  *to = static_cast<std::uint16_t>((part == 0 ? 0 : *to) | bits[0] << (part * kLanes));
}
#endif

/// 2ᵖ for p ≥ −126, 1 at 0, by a minimax polynomial of degree 5 of p − ⌊p⌋, 8e-8, and rounding, 1e-7. If `exact`, of
/// degree 6, 2e-9, of what is left of p by rounding it: near p = 0, where 1 − 2ᵖ matters, within half an ulp.
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
    return times_power_of_floor(y, hn::Sub(p, f));
  } else {
    const V f = fraction(p);
    V y = hn::Set(d, 0.0018671309482703458f);
    for (const float c :
         {0.009017028235494745f, 0.05579991480382185f, 0.24016444961251981f, 0.6931513118582556f, 1.0f}) {
      y = hn::MulAdd(y, f, hn::Set(d, c));
    }
    return times_power_of_floor(y, p);
  }
}

struct UW {
  V u, w;
};

/// @param origin  u and w where x = y = 0
HWY_INLINE UW uw_at(const PackedSplat& g, const float* origin, V x, V y) {
  const D d;
  return {hn::MulAdd(hn::Set(d, g.l11), x, hn::MulAdd(hn::Set(d, g.l21), y, hn::Set(d, origin[0]))),
          hn::MulAdd(hn::Set(d, g.l22), y, hn::Set(d, origin[1]))};
}

HWY_INLINE V log2_alpha(const PackedSplat& g, const float* origin, V x, V y) {
  const auto [u, w] = uw_at(g, origin, x, y);
  return hn::NegMulAdd(u, u, hn::NegMulAdd(w, w, hn::Set(D(), g.log2_opacity)));
}

/// o 2^(−u² − w²): to the last digits also where o is small and its logarithm is not.
HWY_INLINE V exact_alpha(const PackedSplat& g, const float* origin, V x, V y) {
  const D d;
  const auto [u, w] = uw_at(g, origin, x, y);
  const V p = hn::Max(hn::NegMulAdd(u, u, hn::Neg(hn::Mul(w, w))), hn::Set(d, -150.0f));
  return hn::Mul(hn::Set(d, g.opacity), exp2_of<true>(p));
}

// --- blocks ----------------------------------------------------------------------------------------------------------

/// A block's pixels: centres from the tile's centre, and the constants of compositing.
struct Block {
  V x[kParts], y[kParts];
  V col[kParts], row[kParts];  ///< from the block's centre
  V least, least_alpha, stop, cap;
  float center_x, center_y;

  Block(Index side, Index block, const CompositeRules<float>& rules) {
    const D d;
    const Index across = side / kBlockSide;
    const float middle = static_cast<float>(side) / 2;
    center_x = static_cast<float>(block % across * kBlockSide) + 2 - middle;
    center_y = static_cast<float>(block / across * kBlockSide) + 2 - middle;
    HWY_ALIGN float xs[16], ys[16];
    for (int i = 0; i < 16; ++i) {
      xs[i] = center_x + static_cast<float>(i % 4) - 1.5f;
      ys[i] = center_y + static_cast<float>(i / 4) - 1.5f;
    }
    for (int j = 0; j < kParts; ++j) {
      x[j] = hn::Load(d, xs + j * kLanes);
      y[j] = hn::Load(d, ys + j * kLanes);
      col[j] = hn::Sub(x[j], hn::Set(d, center_x));
      row[j] = hn::Sub(y[j], hn::Set(d, center_y));
    }
    least = hn::Set(d, least_log2(rules.alpha_min));
    least_alpha = hn::Set(d, std::max(rules.alpha_min, 0x1p-126f));
    stop = hn::Set(d, rules.stop_below);
    cap = hn::Set(d, rules.alpha_cap);
  }
};

/// What compositing one Gaussian makes of one part of a block.
struct Composited1 {
  M drawn;
  V alpha, weight;
  V full;  ///< α before the cap; only in the general form
};

/// One Gaussian at part j of a block, at list position `at`.
template <Form kForm>
HWY_INLINE Composited1 composite_one(const BlockWorkspace& space, const PackedSplat& g, Index at, const Block& b, int j,
                                     bool exclusive, V& t) {
  constexpr bool kExact = kForm == Form::kExact, kGeneral = kForm != Form::kPlain;
  Composited1 r;
  V tried, least;  // what is compared with the threshold
  if constexpr (kExact) {
    tried = r.full = exact_alpha(g, space.centers + 2 * at, b.col[j], b.row[j]);
    least = b.least_alpha;
  } else {
    tried = log2_alpha(g, &g.u0, b.x[j], b.y[j]);
    r.full = exp2_of<false>(tried);
    least = b.least;
  }
  r.alpha = kGeneral ? hn::Min(r.full, b.cap) : r.full;
  r.drawn = both_at_least(tried, least, t, b.stop);
  if (kGeneral && exclusive) {
    const V next = hn::NegMulAdd(t, r.alpha, t);
    const M past = hn::And(r.drawn, hn::Lt(next, b.stop));
    r.drawn = hn::AndNot(past, r.drawn);
    r.weight = product_or_zero(r.drawn, t, r.alpha);
    t = hn::IfThenElse(past, hn::Neg(t), hn::IfThenElse(r.drawn, next, t));  // finished pixels are negative
  } else {
    r.weight = product_or_zero(r.drawn, t, r.alpha);
    t = dimmed(r.drawn, t, r.alpha);
  }
  return r;
}

// --- a chunk of a tile's list ----------------------------------------------------------------------------------------

struct Chunk {
  std::span<const TileEntry> entries;
  Form form = Form::kPlain;
};

/// Not inlined: g++ 12 may carry on with the double where a float was rounded, in one caller and not in another, and
/// both passes need the same bits (row B13).
HWY_NOINLINE void pack_splat(const SplatRecord<float>& r, double center_x, double center_y, PackedSplat& p) {
  const double l11 = r.l11 * kLog2Scale, l21 = r.l21 * kLog2Scale, l22 = r.l22 * kLog2Scale;
  const double dx = center_x - r.x, dy = center_y - r.y;
  p.l11 = static_cast<float>(l11);
  p.l21 = static_cast<float>(l21);
  p.l22 = static_cast<float>(l22);
  p.log2_opacity = r.log2_opacity;
  p.u0 = static_cast<float>(static_cast<double>(p.l11) * dx + static_cast<double>(p.l21) * dy);
  p.w0 = static_cast<float>(static_cast<double>(p.l22) * dy);
  p.opacity = r.opacity;
  p.unused = 0;
}

/// Packs the Gaussians of a chunk and their features.
Chunk pack_chunk(Index side, const CompositeScene<float>& scene, const BlockJob& job, Index number,
                 const BlockWorkspace& space) {
  const auto begin = static_cast<size_t>(number * kBlockChunk);
  Chunk chunk{job.entries.subspan(begin, std::min(job.entries.size() - begin, static_cast<size_t>(kBlockChunk)))};
  const double x = static_cast<double>(job.left) + static_cast<double>(side) / 2;
  const double y = static_cast<double>(job.top) + static_cast<double>(side) / 2;
  const float near_cap = std::log2(scene.rules.alpha_cap) - 1e-5f;
  const size_t size = chunk.entries.size();
  bool general = scene.rules.exclusive;
  constexpr size_t kAhead = 12;
  for (size_t at = 0; at < size; ++at) {
    if (at + kAhead < size) {
      const auto next = chunk.entries[at + kAhead].index;
      const auto* const record = reinterpret_cast<const char*>(&scene.records[static_cast<size_t>(next)]);
      hwy::Prefetch(record);
      hwy::Prefetch(record + sizeof(SplatRecord<float>) - 1);
      hwy::Prefetch(scene.features + next * scene.channels);
    }
    const std::int32_t index = chunk.entries[at].index;
    const SplatRecord<float>& r = scene.records[static_cast<size_t>(index)];
    pack_splat(r, x, y, space.packed[at]);
    space.blocks[at] = static_cast<std::int32_t>(chunk.entries[at].blocks);
    general |= r.log2_opacity > near_cap;
    const float* const feature = scene.features + index * scene.channels;
    float* const to = space.features + static_cast<Index>(at) * scene.channels;
    for (Index k = 0; k < scene.channels; ++k) to[k] = feature[k];
  }
  std::fill_n(space.blocks + size, 16, 0);
  space.packed[size] = {0, 0, 0, -1e4f, 0, 0, 0, 0};
  std::fill_n(space.features + static_cast<Index>(size) * scene.channels, scene.channels, 0.0f);
  chunk.form = wants_exact(scene.rules) ? Form::kExact : general ? Form::kCapped : Form::kPlain;
  return chunk;
}

/// Positions in the chunk of the Gaussians that may touch a block, padded to fours by one that is never drawn. Returns
/// how many.
Index make_list(const Chunk& chunk, Index block, const BlockWorkspace& space) {
  const hn::RebindToSigned<D> di;
  const auto bit = hn::Set(di, std::int32_t(1) << block), zero = hn::Zero(di), step = hn::Set(di, kLanes);
  auto place = hn::Iota(di, 0);
  const size_t size = chunk.entries.size();
  size_t n = 0;
  for (size_t at = 0; at < size; at += static_cast<size_t>(kLanes)) {
    const auto blocks = hn::Load(di, space.blocks + at);  // zero past the end
    n += hn::CompressStore(place, hn::Ne(hn::And(blocks, bit), zero), di, space.list + n);
    place = hn::Add(place, step);
  }
  std::fill_n(space.list + n, 16, static_cast<std::int32_t>(size));
  return static_cast<Index>(n);
}

/// u and w at a block's centre, of the Gaussians of its list.
void make_centers(Index side, const CompositeScene<float>& scene, const BlockJob& job, const Chunk& chunk, Index block,
                  Index n, const BlockWorkspace& space) {
  const Index across = side / kBlockSide;
  const double x = static_cast<double>(job.left + block % across * kBlockSide + kBlockSide / 2);
  const double y = static_cast<double>(job.top + block / across * kBlockSide + kBlockSide / 2);
  for (Index i = 0; i < n; ++i) {
    const auto at = static_cast<size_t>(space.list[i]);
    PackedSplat p;
    pack_splat(scene.records[static_cast<size_t>(chunk.entries[at].index)], x, y, p);
    space.centers[2 * i] = p.u0;
    space.centers[2 * i + 1] = p.w0;
  }
  std::fill_n(space.centers + 2 * n, 32, 0.0f);
}

/// Copies a block out of, or into, rows of a tile.
HWY_INLINE void from_rows(const float* tile, Index side, Index block, float* out) {
  const Index across = side / kBlockSide, x = block % across * kBlockSide, y = block / across * kBlockSide;
  for (Index r = 0; r < 4; ++r) std::memcpy(out + 4 * r, tile + (y + r) * side + x, 4 * sizeof(float));
}
HWY_INLINE void to_rows(const float* in, Index side, Index block, float* tile) {
  const Index across = side / kBlockSide, x = block % across * kBlockSide, y = block / across * kBlockSide;
  for (Index r = 0; r < 4; ++r) std::memcpy(tile + (y + r) * side + x, in + 4 * r, 4 * sizeof(float));
}

/// 1, or −1 past the image's border.
void first_transmittance(Index side, const BlockJob& job, Index block, float* t) {
  const Index across = side / kBlockSide, x = block % across * kBlockSide, y = block / across * kBlockSide;
  for (Index i = 0; i < 16; ++i) t[i] = x + i % 4 < job.width && y + i / 4 < job.height ? 1.0f : -1.0f;
}

// --- forward ---------------------------------------------------------------------------------------------------------

/// Composites a block's list; `state` is T and channels. Returns the positions visited.
template <int kChannels, Form kForm>
Index composite_list(const CompositeScene<float>& scene, const BlockWorkspace& space, const Block& b, Index n,
                     float* state, float* checkpoints, bool keep_first) {
  const D d;
  const Index channels = kChannels > 0 ? kChannels : scene.channels;
  const bool exclusive = scene.rules.exclusive;
  V t[kParts];
  constexpr int kInRegisters = kChannels > 0 ? kChannels : 1;
  V c[kInRegisters][kParts];
  for (int j = 0; j < kParts; ++j) {
    t[j] = hn::Load(d, state + j * kLanes);
    for (int k = 0; k < kChannels; ++k) c[k][j] = hn::Load(d, state + (k + 1) * kBlockPixels + j * kLanes);
  }
  Index at = 0;
  while (at < n) {
    if (checkpoints != nullptr && at % kBlockSegment == 0 && (at > 0 || keep_first)) {
      for (int j = 0; j < kParts; ++j) hn::Store(t[j], d, checkpoints + j * kLanes);
      checkpoints += kBlockPixels;
    }
    for (const Index stop = at + 4; at < stop; ++at) {
      const Index place = space.list[at];
      const PackedSplat& g = space.packed[place];
      const float* const feature = space.features + place * channels;
      for (int j = 0; j < kParts; ++j) {
        const Composited1 one = composite_one<kForm>(space, g, at, b, j, exclusive, t[j]);
        keep_bits(one.drawn, j, space.drawn + at);
        if constexpr (kChannels > 0) {
          for (int k = 0; k < kChannels; ++k) c[k][j] = hn::MulAdd(one.weight, hn::Set(d, feature[k]), c[k][j]);
        } else {
          for (Index k = 0; k < channels; ++k) {
            float* const sum = state + (k + 1) * kBlockPixels + j * kLanes;
            hn::Store(hn::MulAdd(one.weight, hn::Set(d, feature[k]), hn::Load(d, sum)), d, sum);
          }
        }
      }
    }
    bool alive = false;
    for (int j = 0; j < kParts; ++j) alive |= !hn::AllFalse(d, hn::Ge(t[j], b.stop));
    if (!alive) break;
  }
  for (int j = 0; j < kParts; ++j) {
    hn::Store(t[j], d, state + j * kLanes);
    for (int k = 0; k < kChannels; ++k) hn::Store(c[k][j], d, state + (k + 1) * kBlockPixels + j * kLanes);
  }
  return std::min(at, n);
}

/// List positions up to the last one that was composited.
Index last_drawn(const std::uint16_t* words, Index n) {
  while (n > 0 && words[n - 1] == 0) --n;
  return n;
}

Index count_bits(const std::uint16_t* words, Index n) {
  Index count = 0;
  for (Index i = 0; i < n; ++i) count += std::popcount(words[i]);
  return count;
}

template <int kChannels>
BlockCounts forward(Index side, const CompositeScene<float>& scene, const BlockJob& job) {
  const Index channels = scene.channels, blocks = (side / kBlockSide) * (side / kBlockSide);
  const BlockWorkspace space(job.workspace, channels);
  const Index state_size = (1 + channels) * kBlockPixels, chunks = block_chunks(static_cast<Index>(job.entries.size()));
  std::memset(space.state, 0, static_cast<size_t>(blocks * state_size) * sizeof(float));
  bool alive[BlockWorkspace::kMostBlocks];
  for (Index b = 0; b < blocks; ++b) {
    first_transmittance(side, job, b, space.state + b * state_size);
    alive[b] = space.state[b * state_size] >= 0;
  }
  if (job.runs != nullptr) std::fill_n(job.runs, chunks * blocks, BlockRun{0, 0});
  BlockCounts counts{0, 0};
  std::int32_t kept = 0;
  for (Index number = 0; number < chunks; ++number) {
    if (std::none_of(alive, alive + blocks, [](bool a) { return a; })) break;
    const Chunk chunk = pack_chunk(side, scene, job, number, space);
    for (Index b = 0; b < blocks; ++b) {
      if (!alive[b]) continue;
      const Index n = make_list(chunk, b, space);
      if (n == 0) continue;
      if (chunk.form == Form::kExact) make_centers(side, scene, job, chunk, b, n, space);
      const Block block(side, b, scene.rules);
      float* const state = space.state + b * state_size;
      float* const checkpoints = job.runs != nullptr ? job.checkpoints + kept * kBlockPixels : nullptr;
      const auto run = chunk.form == Form::kPlain    ? composite_list<kChannels, Form::kPlain>
                       : chunk.form == Form::kCapped ? composite_list<kChannels, Form::kCapped>
                                                     : composite_list<kChannels, Form::kExact>;
      const Index visited = run(scene, space, block, n, state, checkpoints, number > 0);
      const Index end = last_drawn(space.drawn, visited);
      if (job.runs != nullptr && end > 0) {
        job.runs[number * blocks + b] = {static_cast<std::int32_t>(end), kept};
        kept += static_cast<std::int32_t>((end + kBlockSegment - 1) / kBlockSegment - (number > 0 ? 0 : 1));
      }
      if (end > 0) counts.end = std::max<Index>(counts.end, number * kBlockChunk + space.list[end - 1] + 1);
      counts.fragments += count_bits(space.drawn, end);
      alive[b] = std::any_of(state, state + 16, [&](float t) { return t >= scene.rules.stop_below; });
    }
  }
  for (Index b = 0; b < blocks; ++b) {
    float* const state = space.state + b * state_size;
    for (int i = 0; i < 16; ++i) state[i] = std::abs(state[i]);
    to_rows(state, side, b, job.transmittance);
    for (Index k = 0; k < channels; ++k)
      to_rows(state + (k + 1) * kBlockPixels, side, b, job.channels + k * side * side);
  }
  return counts;
}

// --- lanes of pixels to lanes of Gaussians ---------------------------------------------------------------------------

/// Sixteen numbers, one of each Gaussian of a batch.
struct Sixteen {
  V v[kParts];
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

/// Vectors with lanes [row][Gaussian] for the four quads of a batch, summed over rows.
Sixteen sum_over_rows(const V (&quads)[4][kParts]) {
  Sixteen r;
  for (int i = 0; i < 16; ++i) {
    const V* const of = quads[i / 4] + i % 4;
    r.v[i] = hn::Add(hn::Add(of[0], of[4]), hn::Add(of[8], of[12]));
  }
  return r;
}

/// Four numbers from each of 16 places, as lanes of places.
void load_fours(const float* const (&places)[16], Sixteen (&out)[4]) {
  for (int i = 0; i < 16; ++i) {
    for (int k = 0; k < 4; ++k) out[k].v[i] = hn::Set(D(), places[i][k]);
  }
}

/// Adds four numbers to each of 16 places.
void add_fours(const Sixteen& a, const Sixteen& b, const Sixteen& c, const Sixteen& e, float* const (&places)[16]) {
  for (int i = 0; i < 16; ++i) {
    const V* const of[4] = {&a.v[i], &b.v[i], &c.v[i], &e.v[i]};
    for (int k = 0; k < 4; ++k) places[i][k] += hn::GetLane(*of[k]);
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

/// Vectors with lanes [row][Gaussian] for the four quads of a batch, summed over rows.
HWY_INLINE Sixteen sum_over_rows(const V (&quads)[4][kParts]) {
  Sixteen r;
#if HWY_CAP_GE512
  const V even = sums_of_halves(quads[0][0], quads[2][0]), odd = sums_of_halves(quads[1][0], quads[3][0]);
  // blocks of 128 bits: quads 0 0 2 2, and 1 1 3 3
  r.v[0] = hn::Add(hn::OddEvenBlocks(hn::SwapAdjacentBlocks(odd), even),
                   hn::OddEvenBlocks(odd, hn::SwapAdjacentBlocks(even)));
#elif HWY_CAP_GE256
  for (int q = 0; q < 4; q += 2) {
    r.v[q / 2] = sums_of_halves(hn::Add(quads[q][0], quads[q][1]), hn::Add(quads[q + 1][0], quads[q + 1][1]));
  }
#else
  for (int q = 0; q < 4; ++q) {
    r.v[q] = hn::Add(hn::Add(quads[q][0], quads[q][1]), hn::Add(quads[q][2], quads[q][3]));
  }
#endif
  return r;
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

/// Four numbers from each of 16 places, as lanes of places.
HWY_INLINE void load_fours(const float* const (&places)[16], Sixteen (&out)[4]) {
  for (int j = 0; j < kParts; ++j) {
    for (int i = 0; i < 4; ++i) out[i].v[j] = blocks_from(places + j * kLanes + i);
    transpose4(out[0].v[j], out[1].v[j], out[2].v[j], out[3].v[j]);
  }
}

/// Adds four numbers to each of 16 places.
HWY_INLINE void add_fours(const Sixteen& a, const Sixteen& b, const Sixteen& c, const Sixteen& e,
                          float* const (&places)[16]) {
  const D d;
  const D4 d4;
  for (int j = 0; j < kParts; ++j) {
    V v[4] = {a.v[j], b.v[j], c.v[j], e.v[j]};
    transpose4(v[0], v[1], v[2], v[3]);
    HWY_ALIGN float rows[4][kLanes];
    for (int i = 0; i < 4; ++i) hn::Store(v[i], d, rows[i]);
    for (int g = 0; g < kLanes; ++g) {
      float* const to = places[j * kLanes + g];
      hn::Store(hn::Add(hn::Load(d4, to), hn::Load(d4, rows[g % 4] + g / 4 * 4)), d4, to);
    }
  }
}
#endif

// --- backward --------------------------------------------------------------------------------------------------------

/// α and weights of list positions [begin, end), from T in front of them.
template <Form kForm>
void replay(const CompositeScene<float>& scene, const BlockWorkspace& space, const Block& b, Index begin, Index end,
            const float* first) {
  const D d;
  const bool exclusive = scene.rules.exclusive, pass = scene.rules.pass_cap;
  V t[kParts];
  for (int j = 0; j < kParts; ++j) t[j] = hn::Load(d, first + j * kLanes);
  for (Index at = begin; at < end; ++at) {
    const PackedSplat& g = space.packed[space.list[at]];
    const Index place = (at - begin) * kBlockPixels;
    for (int j = 0; j < kParts; ++j) {
      const V through = t[j];
      const Composited1 one = composite_one<kForm>(space, g, at, b, j, exclusive, t[j]);
      hn::Store(hn::IfThenElseZero(one.drawn, one.alpha), d, space.alpha + place + j * kLanes);
      hn::Store(one.weight, d, space.weight + place + j * kLanes);
      if (kForm != Form::kPlain) {
        const M held = hn::Gt(one.full, b.cap);
        const V passed = pass ? product_or_zero(one.drawn, through, one.full) : hn::Zero(d);
        hn::Store(hn::IfThenElse(held, passed, one.weight), d, space.gradient_weight + place + j * kLanes);
      }
    }
  }
}

/// Gradients of a block's pixels.
struct BlockGradient {
  HWY_ALIGN float g[kMostBlockChannels][16];
  HWY_ALIGN float columns[kMostBlockChannels][4][16];  ///< g of a column of pixels, four times each
  V behind[kParts];                                    ///< S

  void make_columns(Index channels) {
    for (Index k = 0; k < channels; ++k) {
      for (int x = 0; x < 4; ++x) {
        for (int i = 0; i < 16; ++i) columns[k][x][i] = g[k][i / 4 * 4 + x];
      }
    }
  }
};

/// Sums of a batch of up to 16 Gaussians: lanes of Gaussians.
struct BatchSums {
  V moments[kMoments][4][kParts];
  V features[kMostBlockChannels][4][kParts];
};

/// Moments of v over the pixels of each row: 1, x, x², and with y.
HWY_INLINE void quad_moments(const Block& b, V (&v)[4][kParts], int q, BatchSums& sums) {
  const D d;
  transpose4(v);
  for (int j = 0; j < kParts; ++j) {
    const V y = b.row[j];
    const V outer = hn::Add(v[0][j], v[3][j]), inner = hn::Add(v[1][j], v[2][j]);
    const V outer_difference = hn::Sub(v[3][j], v[0][j]), inner_difference = hn::Sub(v[2][j], v[1][j]);
    const V one = hn::Add(outer, inner);
    const V x = hn::MulAdd(hn::Set(d, 1.5f), outer_difference, hn::Mul(hn::Set(d, 0.5f), inner_difference));
    const V xx = hn::MulAdd(hn::Set(d, 2.25f), outer, hn::Mul(hn::Set(d, 0.25f), inner));
    const V of_y = hn::Mul(one, y);
    sums.moments[0][q][j] = one;
    sums.moments[1][q][j] = x;
    sums.moments[2][q][j] = of_y;
    sums.moments[3][q][j] = xx;
    sums.moments[4][q][j] = hn::Mul(x, y);
    sums.moments[5][q][j] = hn::Mul(of_y, y);
  }
}

/// Moments in u and w, formed in each pixel: for Gaussians so thin that those in x and y cancel.
HWY_INLINE void quad_moments_exact(const BlockWorkspace& space, const Block& b, Index at, const V (&v)[4][kParts],
                                   int q, BatchSums& sums) {
  V of[kMoments][4][kParts];
  for (int i = 0; i < 4; ++i) {
    const PackedSplat& g = space.packed[space.list[at + i]];
    for (int j = 0; j < kParts; ++j) {
      const UW uw = uw_at(g, space.centers + 2 * (at + i), b.col[j], b.row[j]);
      const V vu = hn::Mul(v[i][j], uw.u), vw = hn::Mul(v[i][j], uw.w);
      const V moments[kMoments] = {v[i][j], vu, vw, hn::Mul(vu, uw.u), hn::Mul(vu, uw.w), hn::Mul(vw, uw.w)};
      for (int m = 0; m < kMoments; ++m) of[m][i][j] = moments[m];
    }
  }
  for (int m = 0; m < kMoments; ++m) {
    transpose4(of[m]);
    for (int j = 0; j < kParts; ++j) {
      sums.moments[m][q][j] = hn::Add(hn::Add(of[m][0][j], of[m][1][j]), hn::Add(of[m][2][j], of[m][3][j]));
    }
  }
}

/// Moments in x and y about the block's centre to moments in u and w.
HWY_INLINE void to_uw(const float* const (&splats)[16], const Block& b, Sixteen (&m)[kMoments]) {
  const D d;
  Sixteen low[4], high[4];
  const float* upper[16];
  for (int i = 0; i < 16; ++i) upper[i] = splats[i] + 4;
  load_fours(splats, low);
  load_fours(upper, high);
  const V bx = hn::Set(d, b.center_x), by = hn::Set(d, b.center_y);
  for (int j = 0; j < kParts; ++j) {
    const V l11 = low[0].v[j], l21 = low[1].v[j], l22 = low[2].v[j];
    const V u = hn::MulAdd(l11, bx, hn::MulAdd(l21, by, high[0].v[j])), w = hn::MulAdd(l22, by, high[1].v[j]);
    const V one = m[0].v[j], x = m[1].v[j], y = m[2].v[j], xx = m[3].v[j], xy = m[4].v[j], yy = m[5].v[j];
    const V a = hn::MulAdd(l11, x, hn::Mul(l21, y)), c = hn::Mul(l22, y);
    const V axy = hn::MulAdd(l11, xy, hn::Mul(l21, yy));
    const V aa = hn::MulAdd(l11, hn::MulAdd(l11, xx, hn::Mul(l21, xy)), hn::Mul(l21, axy));
    const V of_u = hn::MulAdd(u, one, a), of_w = hn::MulAdd(w, one, c);
    m[1].v[j] = of_u;
    m[2].v[j] = of_w;
    m[3].v[j] = hn::MulAdd(u, hn::Add(a, of_u), aa);
    m[4].v[j] = hn::MulAdd(u, of_w, hn::MulAdd(w, a, hn::Mul(l22, axy)));
    m[5].v[j] = hn::MulAdd(w, hn::Add(c, of_w), hn::Mul(l22, hn::Mul(l22, yy)));
  }
}

/// One batch, from its last Gaussian to its first: `place` in the segment, `size` of them.
template <int kChannels, Form kForm>
HWY_INLINE void adjoint_of_batch(const CompositeScene<float>& scene, const BlockWorkspace& space, const Block& b,
                                 const BlockAdjoint& adjoint, Index begin, Index place, Index size,
                                 BlockGradient& gradient) {
  const D d;
  const std::int32_t* const list = space.list + begin + place;
  const Index channels = kChannels > 0 ? kChannels : scene.channels;
  const int quads = static_cast<int>((size + 3) / 4);
  BatchSums sums;
  for (int q = 3; q >= 0; --q) {
    if (q >= quads) {
      for (int j = 0; j < kParts; ++j) {
        for (auto& m : sums.moments) m[q][j] = hn::Zero(d);
        for (Index k = 0; k < channels; ++k) sums.features[k][q][j] = hn::Zero(d);
      }
      continue;
    }
    V v[4][kParts], weights[4][kParts];
    for (int i = 3; i >= 0; --i) {
      const Index at = place + 4 * q + i;
      const float* const feature = space.features + list[4 * q + i] * channels;
      for (int j = 0; j < kParts; ++j) {
        const Index lane = at * kBlockPixels + j * kLanes;
        V shown = hn::Mul(hn::Load(d, gradient.g[0] + j * kLanes), hn::Set(d, feature[0]));
        for (Index k = 1; k < channels; ++k) {
          shown = hn::MulAdd(hn::Load(d, gradient.g[k] + j * kLanes), hn::Set(d, feature[k]), shown);
        }
        const V difference = hn::Sub(shown, gradient.behind[j]);
        weights[i][j] = hn::Load(d, space.weight + lane);
        v[i][j] =
            hn::Mul(kForm != Form::kPlain ? hn::Load(d, space.gradient_weight + lane) : weights[i][j], difference);
        gradient.behind[j] = hn::MulAdd(hn::Load(d, space.alpha + lane), difference, gradient.behind[j]);
      }
    }
    if (adjoint.wants_shape) {
      if constexpr (kForm == Form::kExact) {
        quad_moments_exact(space, b, begin + place + 4 * q, v, q, sums);
      } else {
        quad_moments(b, v, q, sums);
      }
    }
    if (!adjoint.wants_features) continue;
    transpose4(weights);
    for (int j = 0; j < kParts; ++j) {
      for (Index k = 0; k < channels; ++k) {
        V sum = hn::Zero(d);
        for (int x = 0; x < 4; ++x) {
          sum = hn::MulAdd(weights[x][j], hn::Load(d, gradient.columns[k][x] + j * kLanes), sum);
        }
        sums.features[k][q][j] = sum;
      }
    }
  }
  const Index stride = block_slot(channels);
  const float* splats[16];
  float* places[16];
  for (int i = 0; i < 16; ++i) {
    splats[i] = &space.packed[list[i]].l11;
    places[i] = space.sums + list[i] * stride;
  }
  Sixteen of[kMoments + kMostBlockChannels + 3];
  if (adjoint.wants_shape) {
    Sixteen moments[kMoments];
    for (int m = 0; m < kMoments; ++m) moments[m] = sum_over_rows(sums.moments[m]);
    if constexpr (kForm != Form::kExact) to_uw(splats, b, moments);
    for (int m = 0; m < kMoments; ++m) of[m] = moments[m];
  } else {
    for (int m = 0; m < kMoments; ++m) {
      for (V& part : of[m].v) part = hn::Zero(d);
    }
  }
  Index used = kMoments;
  if (adjoint.wants_features) {
    for (Index k = 0; k < channels; ++k) of[used++] = sum_over_rows(sums.features[k]);
  }
  for (Index i = used; i < (used + 3) / 4 * 4; ++i) {
    for (V& part : of[i].v) part = hn::Zero(d);
  }
  for (Index first = adjoint.wants_shape ? 0 : 4; first < used; first += 4) {
    float* to[16];
    for (int i = 0; i < 16; ++i) to[i] = places[i] + first;
    add_fours(of[first], of[first + 1], of[first + 2], of[first + 3], to);
  }
}

template <int kChannels, Form kForm>
void adjoint_of_list(Index side, const CompositeScene<float>& scene, const BlockJob& job, const BlockWorkspace& space,
                     const Block& b, Index block, const BlockRun& run, bool first_chunk, const BlockAdjoint& adjoint,
                     BlockGradient& gradient) {
  const Index segments = (run.end + kBlockSegment - 1) / kBlockSegment;
  for (Index s = segments - 1; s >= 0; --s) {
    const Index begin = s * kBlockSegment, end = std::min<Index>(begin + kBlockSegment, run.end);
    const Index padded = begin + (end - begin + 3) / 4 * 4;
    HWY_ALIGN float first[16];
    const Index kept = run.checkpoint + s - (first_chunk ? 1 : 0);
    if (s == 0 && first_chunk) {
      first_transmittance(side, job, block, first);
    } else {
      std::memcpy(first, job.checkpoints + kept * kBlockPixels, sizeof first);
    }
    replay<kForm>(scene, space, b, begin, padded, first);
    for (Index batch = (end - begin - 1) / 16 * 16; batch >= 0; batch -= 16) {
      adjoint_of_batch<kChannels, kForm>(scene, space, b, adjoint, begin, batch,
                                         std::min<Index>(16, end - begin - batch), gradient);
    }
  }
}

template <int kChannels>
void backward(Index side, const CompositeScene<float>& scene, const BlockJob& job, const BlockAdjoint& adjoint) {
  const D d;
  const Index channels = scene.channels, blocks = (side / kBlockSide) * (side / kBlockSide), pixels = side * side;
  const BlockWorkspace space(job.workspace, channels);
  const Index stride = block_slot(channels), state_size = (1 + channels) * kBlockPixels;
  for (Index b = 0; b < blocks; ++b) from_rows(adjoint.d_transmittance, side, b, space.state + b * state_size);
  bool reached = false;  // some chunk behind this one was composited: every slot of this one is then read
  for (Index number = block_chunks(static_cast<Index>(job.entries.size())) - 1; number >= 0; --number) {
    const BlockRun* const runs = job.runs + number * blocks;
    const bool used = std::any_of(runs, runs + blocks, [](const BlockRun& run) { return run.end > 0; });
    if (!used && !reached) continue;
    const Chunk chunk = pack_chunk(side, scene, job, number, space);
    const Index size = static_cast<Index>(chunk.entries.size());
    std::memset(space.sums, 0, static_cast<size_t>((size + 1) * stride) * sizeof(float));
    Index chunk_end = reached ? size : 0;
    reached = true;
    for (Index b = 0; b < blocks; ++b) {
      if (runs[b].end == 0) continue;
      const Index n = make_list(chunk, b, space);
      if (chunk.form == Form::kExact) make_centers(side, scene, job, chunk, b, n, space);
      chunk_end = std::max<Index>(chunk_end, space.list[runs[b].end - 1] + 1);
      const Block block(side, b, scene.rules);
      BlockGradient gradient;
      float* const behind = space.state + b * state_size;
      for (int j = 0; j < kParts; ++j) gradient.behind[j] = hn::Load(d, behind + j * kLanes);
      for (Index k = 0; k < channels; ++k) from_rows(adjoint.d_channels + k * pixels, side, b, gradient.g[k]);
      if (adjoint.wants_features) gradient.make_columns(channels);
      const auto run = chunk.form == Form::kPlain    ? adjoint_of_list<kChannels, Form::kPlain>
                       : chunk.form == Form::kCapped ? adjoint_of_list<kChannels, Form::kCapped>
                                                     : adjoint_of_list<kChannels, Form::kExact>;
      run(side, scene, job, space, block, b, runs[b], number == 0, adjoint, gradient);
      for (int j = 0; j < kParts; ++j) hn::Store(gradient.behind[j], d, behind + j * kLanes);
    }
    constexpr Index kAhead = 8;  // slots lie far apart
    for (Index at = 0; at < chunk_end; ++at) {
      if (at + kAhead < chunk_end) {
        const auto slot = static_cast<Index>(chunk.entries[static_cast<size_t>(at + kAhead)].slot);
        __builtin_prefetch(adjoint.sums + slot * adjoint.stride, 1);
      }
      const float* const from = space.sums + at * stride;
      float* const to = adjoint.sums + static_cast<Index>(chunk.entries[static_cast<size_t>(at)].slot) * adjoint.stride;
      for (Index k = 0; k < adjoint.stride; k += 4) std::memcpy(to + k, from + k, 4 * sizeof(float));
    }
  }
}

// --- entry points ----------------------------------------------------------------------------------------------------

BlockCounts forward_blocks(Index side, const CompositeScene<float>& scene, const BlockJob& job) {
  return scene.channels == 3 ? forward<3>(side, scene, job) : forward<0>(side, scene, job);
}
void backward_blocks(Index side, const CompositeScene<float>& scene, const BlockJob& job, const BlockAdjoint& adjoint) {
  scene.channels == 3 ? backward<3>(side, scene, job, adjoint) : backward<0>(side, scene, job, adjoint);
}
PixelAlpha<float> pixel_of_block(Index side, const SplatRecord<float>& record, const CompositeRules<float>& rules,
                                 Index left, Index top, Index row, Index col) {
  const D d;
  const bool exact = wants_exact(rules);
  const Index cell = exact ? kBlockSide : side;  // whose centre u and w are taken from
  const double half = static_cast<double>(cell) / 2;
  PackedSplat g;
  pack_splat(record, static_cast<double>(left + col / cell * cell) + half,
             static_cast<double>(top + row / cell * cell) + half, g);
  const float middle = static_cast<float>(half);
  const V x = hn::Set(d, static_cast<float>(col % cell) + 0.5f - middle);
  const V y = hn::Set(d, static_cast<float>(row % cell) + 0.5f - middle);
  const V p = log2_alpha(g, &g.u0, x, y);
  const float full = hn::GetLane(exact ? exact_alpha(g, &g.u0, x, y) : exp2_of<false>(p));
  const bool drawn = exact ? full >= rules.alpha_min : hn::GetLane(p) >= least_log2(rules.alpha_min);
  return {drawn ? std::min(full, rules.alpha_cap) : 0.0f, drawn, drawn && full > rules.alpha_cap};
}

float behind_pixel(float transmittance, float alpha) {
  const D d;
  const V t = hn::Set(d, transmittance), a = hn::Set(d, alpha);
  return hn::GetLane(dimmed(hn::Eq(t, t), t, a));
}

}  // namespace hsi4d::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hsi4d::detail {
HWY_EXPORT(forward_blocks);
HWY_EXPORT(backward_blocks);
HWY_EXPORT(pixel_of_block);
HWY_EXPORT(behind_pixel);

Index block_workspace(Index channels) { return BlockWorkspace::numbers(channels); }

BlockCounts composite_blocks(Index side, const CompositeScene<float>& scene, const BlockJob& job) {
  return HWY_DYNAMIC_DISPATCH(forward_blocks)(side, scene, job);
}
void composite_blocks_adjoint(Index side, const CompositeScene<float>& scene, const BlockJob& job,
                              const BlockAdjoint& adjoint) {
  HWY_DYNAMIC_DISPATCH(backward_blocks)(side, scene, job, adjoint);
}
PixelAlpha<float> block_pixel_alpha(Index side, const SplatRecord<float>& record, const CompositeRules<float>& rules,
                                    Index left, Index top, Index row, Index col) {
  return HWY_DYNAMIC_DISPATCH(pixel_of_block)(side, record, rules, left, top, row, col);
}
float block_transmittance(float transmittance, float alpha) {
  return HWY_DYNAMIC_DISPATCH(behind_pixel)(transmittance, alpha);
}
}  // namespace hsi4d::detail
#endif
