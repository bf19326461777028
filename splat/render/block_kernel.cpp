// Vector code of compositing in blocks; the mathematics is in splat/render/composite.h and splat/render/block_kernel.h.
//
// A block of 4×4 pixels is 16 lanes: one vector of 512 bits, two of 256, four of 128. For each block the list of its
// Gaussians is taken from the tile's by the entries' masks. Forward keeps T and colours of a block in registers.
//
// The backward pass replays a segment of a block's list from a kept T, by the same functions in the same order, so
// that it finds the same α, the same T and the same end (row B13), and keeps α and w = T α of the segment. From the
// back, v = w (g·f − S) and S ← S + α (g·f − S): nothing is divided (row B2). Sums over the pixels of a block are
// made of as many Gaussians at a time as there are lanes: 4×4 transposes make lanes of Gaussians, and the moments
// {1, x, y, x², xy, y²} of v follow by rows. About the block's centre they are small numbers; they are moved to u and w
// there (row A1: needles).
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "splat/render/block_kernel.cpp"
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)
// clang-format off
#include <hwy/foreach_target.h>
// clang-format on
#include "splat/render/block_kernel.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <type_traits>

#include <hwy/highway.h>

#include "splat/render/block_chunk-inl.h"
#include "splat/render/block_moments-inl.h"

HWY_BEFORE_NAMESPACE();
namespace hsi4d::detail::HWY_NAMESPACE {

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
    Shade shades[4][kParts];
    shade_four<kForm>(space, b, at, shades);
    for (int i = 0; i < 4; ++i, ++at) {
      const float* const feature = space.features + space.list[at] * channels;
      for (int j = 0; j < kParts; ++j) {
        const Blended one = blend<kForm>(shades[i][j], b, exclusive, t[j]);
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
  for (; n >= 4; n -= 4, words += 4) {
    std::uint64_t four;
    std::memcpy(&four, words, sizeof four);
    count += std::popcount(four);
  }
  for (Index i = 0; i < n; ++i) count += std::popcount(words[i]);
  return count;
}

/// Whether a pixel of a block is not finished.
bool any_alive(const CompositeRules<float>& rules, const float* transmittance) {
  return std::any_of(transmittance, transmittance + kBlockPixels, [&](float t) { return t >= rules.stop_below; });
}

template <int kChannels>
BlockCounts forward(Index side, const CompositeScene<float>& scene, const BlockJob& job) {
  const Index channels = scene.channels, blocks = (side / kBlockSide) * (side / kBlockSide);
  BlockWorkspace space(job.workspace, channels);
  const Index state_size = (1 + channels) * kBlockPixels, chunks = block_chunks(static_cast<Index>(job.entries.size()));
  std::uint32_t alive = 0;  // bits of blocks
  for (Index b = 0; b < blocks; ++b) {
    if ((job.blocks >> b & 1u) != 0 && any_alive(scene.rules, job.state + b * state_size)) alive |= 1u << b;
  }
  if (job.runs != nullptr) std::fill_n(job.runs, chunks * blocks, BlockRun{0, 0});
  BlockCounts counts{0, 0};
  std::int32_t kept = 0;
  for (Index number = 0; number < chunks; ++number) {
    if (alive == 0) break;
    const Chunk chunk = job.packed != nullptr ? packed_chunk(scene, job, number, space)
                                              : pack_chunk<kChannels>(side, scene, job, number, alive, space);
    for (Index b = 0; b < blocks; ++b) {
      if ((alive >> b & 1u) == 0) continue;
      const Index n = make_list(chunk, b, space);
      if (n == 0) continue;
      if (chunk.form == Form::kExact) make_centers(side, scene, job, chunk, b, n, space);
      const Block block(side, b, scene.rules);
      float* const state = job.state + b * state_size;
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
      if (!any_alive(scene.rules, state)) alive &= ~(1u << b);
    }
  }
  return counts;
}

// --- backward --------------------------------------------------------------------------------------------------------

/// α and weights of list positions [begin, end), a multiple of four, from T in front of them.
template <Form kForm>
void replay(const CompositeScene<float>& scene, const BlockWorkspace& space, const Block& b, Index begin, Index end,
            const float* first) {
  const D d;
  const bool exclusive = scene.rules.exclusive, pass = scene.rules.pass_cap;
  V t[kParts];
  for (int j = 0; j < kParts; ++j) t[j] = hn::Load(d, first + j * kLanes);
  for (Index at = begin; at < end;) {
    Shade shades[4][kParts];
    shade_four<kForm>(space, b, at, shades);
    for (int i = 0; i < 4; ++i, ++at) {
      for (int j = 0; j < kParts; ++j) {
        const Index lane = (at - begin) * kBlockPixels + j * kLanes;
        const V through = t[j], full = shades[i][j].full;
        const Blended one = blend<kForm>(shades[i][j], b, exclusive, t[j]);
        hn::Store(alpha_of(one.drawn), d, space.alpha + lane);
        hn::Store(one.weight, d, space.weight + lane);
        if (kForm != Form::kPlain) {
          const V passed = pass ? hn::IfThenElseZero(is_drawn(one.drawn), hn::Mul(through, full)) : hn::Zero(d);
          hn::Store(hn::IfThenElse(hn::Gt(full, b.cap), passed, one.weight), d, space.gradient_weight + lane);
        }
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
  V behind[kParts];
  for (int j = 0; j < kParts; ++j) behind[j] = gradient.behind[j];
  for (int q = kQuads - 1; q >= 0; --q) {
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
        const V difference = hn::Sub(shown, behind[j]);
        weights[i][j] = hn::Load(d, space.weight + lane);
        v[i][j] =
            hn::Mul(kForm != Form::kPlain ? hn::Load(d, space.gradient_weight + lane) : weights[i][j], difference);
        behind[j] = hn::MulAdd(hn::Load(d, space.alpha + lane), difference, behind[j]);
      }
    }
    if (adjoint.wants_shape) {
      if constexpr (kForm == Form::kExact) {
        quad_moments_exact(space, b, begin + place + 4 * q, v, q, sums);
      } else {
        quad_moments(v, q, sums);
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
  for (int j = 0; j < kParts; ++j) gradient.behind[j] = behind[j];
  const Index stride = block_slot(channels);
  const float* splats[kBatch];
  float* places[kBatch];
  for (int i = 0; i < kBatch; ++i) {
    splats[i] = &space.packed[list[i]].l11;
    places[i] = space.sums + list[i] * stride;
  }
  const Index used = kMoments + (adjoint.wants_features ? channels : 0);
  OfBatch of[(kMoments + kMostBlockChannels + 3) / 4 * 4];
  for (Index i = used; i < (used + 3) / 4 * 4; ++i) {
    for (V& part : of[i].v) part = hn::Zero(d);
  }
  if (adjoint.wants_shape) {
    if constexpr (kForm == Form::kExact) {
      for (int m = 0; m < kMoments; ++m) sum_over_rows(sums.moments[m], of[m]);
    } else {
      block_moments(b, sums, of);
      to_uw(splats, b, of);
    }
  } else {
    for (int m = 0; m < kMoments; ++m) {
      for (V& part : of[m].v) part = hn::Zero(d);
    }
  }
  for (Index k = kMoments; k < used; ++k) sum_over_rows(sums.features[k - kMoments], of[k]);
  Index first = adjoint.wants_shape ? 0 : 4;
#if HWY_CAP_GE256
  if (first == 0) {
    add_eights(of, places);
    first = 8;
  }
#endif
  for (; first < used; first += 4) add_fours(of + first, places, first);
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
    if (s == 0 && first_chunk && job.start != nullptr) {
      std::memcpy(first, job.start + block * (1 + scene.channels) * kBlockPixels, sizeof first);
    } else if (s == 0 && first_chunk) {
      first_transmittance(side, job.width, job.height, block, first);
    } else {
      std::memcpy(first, job.checkpoints + kept * kBlockPixels, sizeof first);
    }
    replay<kForm>(scene, space, b, begin, padded, first);
    for (Index batch = (end - begin - 1) / kBatch * kBatch; batch >= 0; batch -= kBatch) {
      adjoint_of_batch<kChannels, kForm>(scene, space, b, adjoint, begin, batch,
                                         std::min<Index>(kBatch, end - begin - batch), gradient);
    }
  }
}

/// Fetches the slots of a share of a chunk's entries.
void fetch_slots(const Chunk& chunk, Index part, Index parts, const BlockAdjoint& adjoint) {
  const Index size = static_cast<Index>(chunk.entries.size());
  for (const TileEntry& entry :
       chunk.entries.subspan(static_cast<size_t>(size * part / parts),
                             static_cast<size_t>(size * (part + 1) / parts - size * part / parts))) {
    if (entry.slot != kNoSlot) __builtin_prefetch(adjoint.sums + static_cast<Index>(entry.slot) * adjoint.stride, 1);
  }
}

/// Sums of list positions to their slots, which lie far apart.
void scatter_sums(std::span<const TileEntry> entries, const BlockAdjoint& adjoint, const float* sums, Index stride) {
  for (size_t at = 0; at < entries.size(); ++at) {
    if (entries[at].slot == kNoSlot) continue;
    const float* const from = sums + static_cast<Index>(at) * stride;
    float* const to = adjoint.sums + static_cast<Index>(entries[at].slot) * adjoint.stride;
    for (Index k = 0; k < adjoint.stride; k += 4) std::memcpy(to + k, from + k, 4 * sizeof(float));
  }
}

template <int kChannels>
void backward(Index side, const CompositeScene<float>& scene, const BlockJob& job, const BlockAdjoint& adjoint) {
  const D d;
  const Index channels = scene.channels, blocks = (side / kBlockSide) * (side / kBlockSide), pixels = side * side;
  const BlockWorkspace space(job.workspace, channels);
  const Index stride = block_slot(channels);
  for (Index b = 0; b < blocks; ++b) from_rows(adjoint.behind, side, b, space.behind + b * kBlockPixels);
  bool reached = false;  // some chunk behind this one was composited: every slot of this one is then read
  for (Index number = block_chunks(static_cast<Index>(job.entries.size())) - 1; number >= 0; --number) {
    const BlockRun* const runs = job.runs + number * blocks;
    std::uint32_t used = 0;  // bits of blocks
    for (Index b = 0; b < blocks; ++b) used |= (runs[b].end > 0 ? 1u : 0u) << b;
    if (used == 0 && !reached) continue;
    const Chunk chunk = pack_chunk<kChannels>(side, scene, job, number, used, space);
    const Index size = static_cast<Index>(chunk.entries.size());
    std::memset(space.sums, 0, static_cast<size_t>((size + 1) * stride) * sizeof(float));
    Index chunk_end = reached ? size : 0;
    reached = true;
    for (Index b = 0; b < blocks; ++b) {
      fetch_slots(chunk, b, blocks, adjoint);  // one after the other beside the work: they lie far apart
      if (runs[b].end == 0) continue;
      const Index n = make_list(chunk, b, space);
      if (chunk.form == Form::kExact) make_centers(side, scene, job, chunk, b, n, space);
      chunk_end = std::max<Index>(chunk_end, space.list[runs[b].end - 1] + 1);
      const Block block(side, b, scene.rules);
      BlockGradient gradient;
      float* const behind = space.behind + b * kBlockPixels;
      for (int j = 0; j < kParts; ++j) gradient.behind[j] = hn::Load(d, behind + j * kLanes);
      for (Index k = 0; k < channels; ++k) from_rows(adjoint.d_channels + k * pixels, side, b, gradient.g[k]);
      if (adjoint.wants_features) gradient.make_columns(channels);
      const auto run = chunk.form == Form::kPlain    ? adjoint_of_list<kChannels, Form::kPlain>
                       : chunk.form == Form::kCapped ? adjoint_of_list<kChannels, Form::kCapped>
                                                     : adjoint_of_list<kChannels, Form::kExact>;
      run(side, scene, job, space, block, b, runs[b], number == 0, adjoint, gradient);
      for (int j = 0; j < kParts; ++j) hn::Store(gradient.behind[j], d, behind + j * kLanes);
    }
    scatter_sums(chunk.entries.first(static_cast<size_t>(chunk_end)), adjoint, space.sums, stride);
  }
}

// --- entry points ----------------------------------------------------------------------------------------------------

/// Calls f with the number of channels as a constant where loops over them are worth unrolling, else with 0: colours,
/// and colours with a depth, opacities of groups or both.
template <class F>
auto with_channels(Index channels, const F& f) {
  switch (channels) {
    case 3:
      return f(std::integral_constant<int, 3>());
    case 4:
      return f(std::integral_constant<int, 4>());
    case 5:
      return f(std::integral_constant<int, 5>());
    default:
      return f(std::integral_constant<int, 0>());
  }
}

BlockCounts forward_blocks(Index side, const CompositeScene<float>& scene, const BlockJob& job) {
  return with_channels(scene.channels, [&](auto channels) { return forward<channels>(side, scene, job); });
}
void backward_blocks(Index side, const CompositeScene<float>& scene, const BlockJob& job, const BlockAdjoint& adjoint) {
  with_channels(scene.channels, [&](auto channels) { backward<channels>(side, scene, job, adjoint); });
}
void pack_list(Index side, const CompositeScene<float>& scene, const BlockJob& job, PackedBlocks& packed) {
  const Index chunks = block_chunks(static_cast<Index>(job.entries.size()));
  const Index room = static_cast<Index>(job.entries.size()) + chunks * PackedBlocks::kRoom;
  packed.splats.resize(room * 8);
  packed.features.resize(room * scene.channels);
  packed.blocks.resize(room);
  packed.near_cap = false;
  BlockJob from = job;
  from.packed = &packed;
  BlockWorkspace space(job.workspace, scene.channels);
  for (Index number = 0; number < chunks; ++number) {
    packed_chunk(scene, from, number, space);
    packed.near_cap |= pack_chunk<0>(side, scene, job, number, all_blocks(side), space).near_cap;
  }
}
PixelAlpha<float> pixel_of_block(Index side, const SplatRecord<float>& record, const CompositeRules<float>& rules,
                                 Index left, Index top, Index row, Index col) {
  const D d;
  const bool exact = wants_exact(rules);
  const Index cell = exact ? kBlockSide : side;  // whose centre u and w are taken from
  const double half = static_cast<double>(cell) / 2;
  PackedSplat g;
  const double center[2] = {static_cast<double>(left + col / cell * cell) + half,
                            static_cast<double>(top + row / cell * cell) + half};
  pack_splat(record, center, g);
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
  return hn::GetLane(hn::NegMulAdd(t, a, t));
}

}  // namespace hsi4d::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hsi4d::detail {
HWY_EXPORT(forward_blocks);
HWY_EXPORT(backward_blocks);
HWY_EXPORT(pack_list);
HWY_EXPORT(pixel_of_block);
HWY_EXPORT(behind_pixel);

void begin_blocks(Index side, Index width, Index height, Index channels, float* state) {
  const Index blocks = (side / kBlockSide) * (side / kBlockSide), size = (1 + channels) * kBlockPixels;
  for (Index b = 0; b < blocks; ++b) {
    first_transmittance(side, width, height, b, state + b * size);
    std::fill_n(state + b * size + kBlockPixels, size - kBlockPixels, 0.0f);
  }
}

Index block_workspace(Index channels) { return BlockWorkspace::numbers(channels); }

BlockCounts composite_blocks(Index side, const CompositeScene<float>& scene, const BlockJob& job) {
  return HWY_DYNAMIC_DISPATCH(forward_blocks)(side, scene, job);
}
void pack_blocks(Index side, const CompositeScene<float>& scene, const BlockJob& job, PackedBlocks& packed) {
  HWY_DYNAMIC_DISPATCH(pack_list)(side, scene, job, packed);
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
