// Of the block kernel: a chunk of a tile's list packed for the loops, the lists of its blocks, and one Gaussian
// composited in one block. Compiled once for each instruction set.
#ifndef HSI4D_SPLAT_BLOCK_CHUNK_ONCE
#define HSI4D_SPLAT_BLOCK_CHUNK_ONCE

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <span>

#include "splat/limits.h"
#include "splat/render/block_kernel.h"

namespace hsi4d::detail {

/// A Gaussian as the loops of one tile use it.
struct PackedSplat {
  float l11, l21, l22, log2_opacity, u0, w0, opacity;
  float padding;  ///< to 32 bytes: two vectors of four
};

/// Parts of a tile's workspace.
struct BlockWorkspace {
  static constexpr Index kMostBlocks = 16;
  PackedSplat* packed;     ///< [kBlockChunk + 1], the last never drawn
  std::int32_t* blocks;    ///< [kBlockChunk + 16] masks of the chunk
  std::int32_t* list;      ///< [kBlockChunk + 32]
  float* centers;          ///< [kBlockChunk + 32][2] u and w at the block's centre, of the list; only kExact
  std::uint16_t* drawn;    ///< [kBlockChunk + 4] pixels that a Gaussian of the list was composited in
  float* behind;           ///< [blocks][16] S
  float* features;         ///< [kBlockChunk + 1][C]
  float *alpha, *weight;   ///< [kBlockSegment][16]
  float* gradient_weight;  ///< [kBlockSegment][16] ∂(w · …)/∂ log α: 0 where the cap holds
  float* sums;             ///< [kBlockChunk + 1][block_slot(C)]

  static Index numbers(Index channels) {
    const Index numbers = (kBlockChunk + 1) * 8 + 4 * (kBlockChunk + 32) + (kBlockChunk + 32) / 2 +
                          kMostBlocks * kBlockPixels + (kBlockChunk + 1) * channels + 3 * kBlockSegment * kBlockPixels +
                          (kBlockChunk + 1) * block_slot(channels);
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
    behind = take(kMostBlocks * kBlockPixels);
    features = take((kBlockChunk + 1) * channels);
    alpha = take(kBlockSegment * kBlockPixels);
    weight = take(kBlockSegment * kBlockPixels);
    gradient_weight = take(kBlockSegment * kBlockPixels);
    sums = take((kBlockChunk + 1) * block_slot(channels));
  }
};

/// kPlain: no α reaches the cap, and the stop is inclusive. kCapped: with a cap and either stop. kExact: as kCapped,
/// with u and w from the block's centre, and the better exponential: for settings without cuts, and small blurs.
enum class Form { kPlain, kCapped, kExact };

/// T in front of all Gaussians of the pixels of a block: 1, or −1 past the image's border.
inline void first_transmittance(Index side, Index width, Index height, Index block, float* t) {
  const Index across = side / kBlockSide, x = block % across * kBlockSide, y = block / across * kBlockSide;
  for (Index i = 0; i < kBlockPixels; ++i) t[i] = x + i % 4 < width && y + i / 4 < height ? 1.0f : -1.0f;
}

inline bool wants_exact(const CompositeRules<float>& rules) {
  return rules.alpha_min < kExactBelowAlpha || rules.stop_below < kExactBelowStop || rules.blur < kExactBelowBlur;
}

/// log₂ of the least α that is composited; what is below kLeastAlpha never is.
inline float least_log2(float alpha_min) { return std::log2(std::max(alpha_min, kLeastAlpha)); }

}  // namespace hsi4d::detail

#endif

#if defined(HSI4D_SPLAT_BLOCK_CHUNK_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef HSI4D_SPLAT_BLOCK_CHUNK_INL_H
#undef HSI4D_SPLAT_BLOCK_CHUNK_INL_H
#else
#define HSI4D_SPLAT_BLOCK_CHUNK_INL_H
#endif

#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include "splat/render/block_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace hsi4d::detail::HWY_NAMESPACE {

struct UW {
  V u, w;
};

/// @param origin  u and w where x = y = 0
HWY_INLINE UW uw_at(const PackedSplat& g, const float* origin, V x, V y) {
  const D d;
  return {hn::MulAdd(hn::Set(d, g.l21), y, hn::MulAdd(hn::Set(d, g.l11), x, hn::Set(d, origin[0]))),
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

/// Vectors that x of a block's pixels takes: the parts are rows, whose x are the same.
constexpr int kColumns = kLanes < 4 ? 4 : 1;

/// A block's pixels: centres from the tile's centre, and the constants of compositing.
struct Block {
  V x[kColumns], y[kParts];
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
      if (j < kColumns) x[j] = hn::Load(d, xs + j * kLanes);
      y[j] = hn::Load(d, ys + j * kLanes);
      col[j] = hn::Sub(x[j % kColumns], hn::Set(d, center_x));
      row[j] = hn::Sub(y[j], hn::Set(d, center_y));
    }
    least = hn::Set(d, least_log2(rules.alpha_min));
    least_alpha = hn::Set(d, std::max(rules.alpha_min, kLeastAlpha));
    stop = hn::Set(d, rules.stop_below);
    cap = hn::Set(d, rules.alpha_cap);
  }
};

/// What a Gaussian is in one part of a block, whatever lies in front of it.
struct Shade {
  V alpha;   ///< masked
  V full;    ///< before the cap
  M passed;  ///< where α is not below the least
};

/// One Gaussian at part j of a block, at list position `at`.
template <Form kForm>
HWY_INLINE Shade shade(const BlockWorkspace& space, const Block& b, Index at, int j) {
  const PackedSplat& g = space.packed[space.list[at]];
  Shade s;
  if constexpr (kForm == Form::kExact) {
    s.full = exact_alpha(g, space.centers + 2 * at, b.col[j], b.row[j]);
    s.passed = hn::Ge(s.full, b.least_alpha);
  } else {
    const V p = log2_alpha(g, &g.u0, b.x[j % kColumns], b.y[j]);
    s.full = exp2_of<false>(p);
    s.passed = hn::Ge(p, b.least);
  }
  s.alpha = masked(s.passed, kForm == Form::kPlain ? s.full : hn::Min(s.full, b.cap));
  return s;
}

/// Four Gaussians from list position `at` on: none waits for another.
template <Form kForm>
HWY_INLINE void shade_four(const BlockWorkspace& space, const Block& b, Index at, Shade (&shades)[4][kParts]) {
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < kParts; ++j) shades[i][j] = shade<kForm>(space, b, at + i, j);
  }
}

/// What compositing a Gaussian makes of one part of a block.
struct Blended {
  Drawn drawn;
  V weight;
};

template <Form kForm>
HWY_INLINE Blended blend(const Shade& s, const Block& b, bool exclusive, V& t) {
  Blended r;
  r.drawn = drawn_where(s.passed, s.alpha, t, b.stop);
  M past;
  if (kForm != Form::kPlain && exclusive) {
    past = hn::And(is_drawn(r.drawn), hn::Lt(behind(r.drawn, t), b.stop));
    r.drawn = without(r.drawn, past);
  }
  r.weight = weight_of(r.drawn, t);
  t = behind(r.drawn, t);
  if (kForm != Form::kPlain && exclusive) t = hn::IfThenElse(past, hn::Neg(t), t);  // finished pixels are negative
  return r;
}

// --- a chunk of a tile's list ----------------------------------------------------------------------------------------

struct Chunk {
  std::span<const TileEntry> entries;
  bool near_cap = false;  ///< some α may reach the cap
  Form form = Form::kPlain;
};

inline Form form_of(const CompositeRules<float>& rules, bool near_cap) {
  return wants_exact(rules) ? Form::kExact : near_cap || rules.exclusive ? Form::kCapped : Form::kPlain;
}

std::span<const TileEntry> entries_of_chunk(const BlockJob& job, Index number) {
  const auto begin = static_cast<size_t>(number * kBlockChunk);
  return job.entries.subspan(begin, std::min(job.entries.size() - begin, static_cast<size_t>(kBlockChunk)));
}

#if HWY_CAP_GE256
/// The numbers of a Gaussian in one vector, in double where the mean takes part. Vectors are rounded to float where it
/// is written, so that both passes have the same bits (row B13: two passes).
HWY_INLINE void pack_splat(const SplatRecord<float>& r, const double* center, PackedSplat& p) {
  static_assert(offsetof(SplatRecord<float>, y) == offsetof(SplatRecord<float>, x) + sizeof(double) &&
                offsetof(SplatRecord<float>, l22) == offsetof(SplatRecord<float>, l11) + 2 * sizeof(float) &&
                offsetof(SplatRecord<float>, opacity) == offsetof(SplatRecord<float>, l22) + sizeof(float));
  const D4 d4;
  const hn::CappedTag<double, 4> dd;
  const hn::CappedTag<double, 2> dd2;
  const auto conic = hn::Mul(hn::PromoteTo(dd, hn::LoadU(d4, &r.l11)), hn::Set(dd, kLog2Scale));
  const auto rounded = hn::DemoteTo(d4, conic);  // l11, l21, l22, –
  const auto offset = hn::Sub(hn::LoadU(dd2, center), hn::LoadU(dd2, &r.x));
  const auto parts =
      hn::Mul(hn::PromoteTo(dd, rounded), hn::Combine(dd, hn::InterleaveUpper(dd2, offset, offset), offset));
  const auto u = hn::LowerHalf(parts), w = hn::UpperHalf(dd2, parts);  // l11 dx, l21 dy; l22 dy, –
  const auto uw = hn::DemoteTo(hn::CappedTag<float, 2>(), hn::InterleaveLower(dd2, hn::Add(u, hn::Reverse(dd2, u)), w));
  hn::StoreU(rounded, d4, &p.l11);
  p.log2_opacity = r.log2_opacity;
  hn::StoreU(uw, hn::CappedTag<float, 2>(), &p.u0);
  p.opacity = r.opacity;
  p.padding = 0;
}
#else
/// Not inlined: g++ 12 may carry on with the double where a float was rounded, in one caller and not in another, and
/// both passes need the same bits (row B13: two passes).
HWY_NOINLINE void pack_splat(const SplatRecord<float>& r, const double* center, PackedSplat& p) {
  const double l11 = r.l11 * kLog2Scale, l21 = r.l21 * kLog2Scale, l22 = r.l22 * kLog2Scale;
  const double dx = center[0] - r.x, dy = center[1] - r.y;
  p.l11 = static_cast<float>(l11);
  p.l21 = static_cast<float>(l21);
  p.l22 = static_cast<float>(l22);
  p.log2_opacity = r.log2_opacity;
  p.u0 = static_cast<float>(static_cast<double>(p.l11) * dx + static_cast<double>(p.l21) * dy);
  p.w0 = static_cast<float>(static_cast<double>(p.l22) * dy);
  p.opacity = r.opacity;
  p.padding = 0;
}
#endif

/// Packs the Gaussians of a chunk and their features; only those that may touch one of the blocks asked for.
template <int kChannels>
Chunk pack_chunk(Index side, const CompositeScene<float>& all, const BlockJob& job, Index number, std::uint32_t blocks,
                 const BlockWorkspace& workspace) {
  // Copies, whose pointers need not be read again after each number that is written.
  const CompositeScene<float> scene = all;
  const BlockWorkspace space = workspace;
  const Index channels = kChannels > 0 ? kChannels : scene.channels;
  Chunk chunk{entries_of_chunk(job, number)};
  const double center[2] = {static_cast<double>(job.left) + static_cast<double>(side) / 2,
                            static_cast<double>(job.top) + static_cast<double>(side) / 2};
  const float cap = std::log2(scene.rules.alpha_cap) - 1e-5f;
  const std::span<const TileEntry> entries = chunk.entries;
  const size_t size = entries.size();
  constexpr size_t kAhead = 12;
  constexpr bool kInRecords = kChannels > 0 && kChannels <= RecordFeatures<float>::kCount;
  for (size_t at = 0; at < size; ++at) {
    if (at + kAhead < size && (entries[at + kAhead].blocks & blocks) != 0) {
      const auto next = entries[at + kAhead].index;
      hwy::Prefetch(&scene.records[static_cast<size_t>(next)]);  // one cache line
      if (!kInRecords) hwy::Prefetch(scene.feature(next));
    }
    const std::uint32_t touched = entries[at].blocks & blocks;
    space.blocks[at] = static_cast<std::int32_t>(touched);
    if (touched == 0) continue;
    const std::int32_t index = entries[at].index;
    const SplatRecord<float>& r = scene.records[static_cast<size_t>(index)];
    pack_splat(r, center, space.packed[at]);
    chunk.near_cap |= r.log2_opacity > cap;
    const float* const feature = kInRecords ? r.features.numbers : scene.feature(index);
    float* const to = space.features + static_cast<Index>(at) * channels;
    for (Index k = 0; k < channels; ++k) to[k] = feature[k];
  }
  std::fill_n(space.blocks + size, 16, 0);
  space.packed[size] = {0, 0, 0, -1e4f, 0, 0, 0, 0};
  std::fill_n(space.features + static_cast<Index>(size) * channels, channels, 0.0f);
  chunk.form = form_of(scene.rules, chunk.near_cap);
  return chunk;
}

/// Points `space` at a chunk that was packed before.
Chunk packed_chunk(const CompositeScene<float>& scene, const BlockJob& job, Index number, BlockWorkspace& space) {
  const Index begin = PackedBlocks::begin(number);
  // Forward only reads them.
  space.packed = reinterpret_cast<PackedSplat*>(const_cast<float*>(job.packed->splats.data()) + begin * 8);
  space.blocks = const_cast<std::int32_t*>(job.packed->blocks.data()) + begin;
  space.features = const_cast<float*>(job.packed->features.data()) + begin * scene.channels;
  return {entries_of_chunk(job, number), job.packed->near_cap, form_of(scene.rules, job.packed->near_cap)};
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
    n += store_chosen(place, hn::Ne(hn::And(blocks, bit), zero), space.list + n);
    place = hn::Add(place, step);
  }
  std::fill_n(space.list + n, 16, static_cast<std::int32_t>(size));
  return static_cast<Index>(n);
}

/// u and w at a block's centre, of the Gaussians of its list.
void make_centers(Index side, const CompositeScene<float>& scene, const BlockJob& job, const Chunk& chunk, Index block,
                  Index n, const BlockWorkspace& space) {
  const Index across = side / kBlockSide;
  const double center[2] = {static_cast<double>(job.left + block % across * kBlockSide + kBlockSide / 2),
                            static_cast<double>(job.top + block / across * kBlockSide + kBlockSide / 2)};
  for (Index i = 0; i < n; ++i) {
    const auto at = static_cast<size_t>(space.list[i]);
    PackedSplat p;
    pack_splat(scene.records[static_cast<size_t>(chunk.entries[at].index)], center, p);
    space.centers[2 * i] = p.u0;
    space.centers[2 * i + 1] = p.w0;
  }
  std::fill_n(space.centers + 2 * n, 32, 0.0f);
}

/// Copies a block out of rows of a tile.
HWY_INLINE void from_rows(const float* tile, Index side, Index block, float* out) {
  const Index across = side / kBlockSide, x = block % across * kBlockSide, y = block / across * kBlockSide;
  for (Index r = 0; r < 4; ++r) std::memcpy(out + 4 * r, tile + (y + r) * side + x, 4 * sizeof(float));
}

}  // namespace hsi4d::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // HSI4D_SPLAT_BLOCK_CHUNK_INL_H
