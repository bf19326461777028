#include "splat/render/static_layer.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "core/simd.h"

namespace hsi4d::detail {

namespace {

constexpr DepthRange kAllDepths = {std::numeric_limits<std::int32_t>::min(), std::numeric_limits<std::int32_t>::max()};

double depth_of_step(std::int32_t step) { return std::exp2(static_cast<double>(step) / kDepthSteps); }

/// The key of a depth in a render in float.
std::uint64_t key_of(const RenderSettings& settings, double depth) {
  return key_of_depth(settings, static_cast<float>(depth), depth);
}

Index state_of_block(Index channels) { return (1 + channels) * kBlockPixels; }

/// The range that holds what moves.
DepthRange depth_range(const SplatRows<float>& rows, const RenderSettings& settings,
                       std::span<const TileEntry> moving) {
  const auto depth = [&](const TileEntry& e) { return depth_of(rows.set_of(e.index), rows.in_set(e.index)); };
  const double nearest = depth(moving.front()), farthest = depth(moving.back());
  if (!(nearest > 0) || !(farthest > 0)) return kAllDepths;
  DepthRange range = {static_cast<std::int32_t>(std::floor(kDepthSteps * std::log2(nearest))),
                      static_cast<std::int32_t>(std::ceil(kDepthSteps * std::log2(farthest)))};
  // Logarithm and keys are rounded.
  while (key_of(settings, depth_of_step(range.near)) > rows.key(settings, moving.front().index)) --range.near;
  while (key_of(settings, depth_of_step(range.far)) < rows.key(settings, moving.back().index)) ++range.far;
  return range;
}

/// Positions of those that lie in the range.
void place_range(const SplatRows<float>& rows, const RenderSettings& settings, std::span<const TileEntry> still,
                 TileLayer& layer) {
  layer.first = 0;
  layer.after = static_cast<Index>(still.size());
  if (layer.range == kAllDepths) return;
  const std::uint64_t near = key_of(settings, depth_of_step(layer.range.near));
  const std::uint64_t far = key_of(settings, depth_of_step(layer.range.far));
  const auto key = [&](const TileEntry& e) { return rows.key(settings, e.index); };
  const auto first = std::partition_point(still.begin(), still.end(), [&](const auto& e) { return key(e) < near; });
  const auto after = std::partition_point(first, still.end(), [&](const auto& e) { return key(e) <= far; });
  layer.first = first - still.begin();
  if (settings.alpha_cap < 1) layer.after = after - still.begin();  // else T can be 0, and nothing is relative to it
}

}  // namespace

void place_layer(const SplatRows<float>& rows, const RenderSettings& settings, std::span<const TileEntry> still,
                 std::span<const TileEntry> moving, TileLayer& layer) {
  const DepthRange range = depth_range(rows, settings, moving);
  if (layer.made && layer.range == range) return;
  layer.made = false;
  layer.range = range;
  place_range(rows, settings, still, layer);
}

template <class S>
void merge_entries(const SplatRows<S>& rows, const RenderSettings& settings, std::span<const TileEntry> still,
                   std::span<const TileEntry> moving, TileEntry* merged) {
  std::size_t s = 0;
  for (const TileEntry& m : moving) {
    const std::uint64_t key = rows.key(settings, m.index);
    for (; s < still.size() && rows.key(settings, still[s].index) <= key; ++s) {
      *merged++ = {still[s].index, kNoSlot, still[s].blocks};
    }
    *merged++ = m;
  }
  for (; s < still.size(); ++s) *merged++ = {still[s].index, kNoSlot, still[s].blocks};
}

template void merge_entries(const SplatRows<float>&, const RenderSettings&, std::span<const TileEntry>,
                            std::span<const TileEntry>, TileEntry*);
template void merge_entries(const SplatRows<double>&, const RenderSettings&, std::span<const TileEntry>,
                            std::span<const TileEntry>, TileEntry*);

Index make_layer(Index side, const CompositeScene<float>& scene, BlockJob job, std::span<const TileEntry> still,
                 TileLayer& layer) {
  Index fragments = 0;
  if (layer.first > 0) {
    layer.front.resize(block_state(side, scene.channels));
    job.entries = still.first(static_cast<std::size_t>(layer.first));
    job.blocks = all_blocks(side);
    job.state = layer.front.data();
    job.runs = nullptr;
    begin_blocks(side, job.width, job.height, scene.channels, job.state);
    fragments = composite_blocks(side, scene, job).fragments;
  }
  const std::span<const TileEntry> behind = still.subspan(static_cast<std::size_t>(layer.after));
  if (!behind.empty()) {
    job.entries = behind;
    pack_blocks(side, scene, job, layer.behind);
  }
  layer.seen.resize(block_state(side, scene.channels));
  layer.made = true;
  return fragments;
}

namespace {

/// Calls f(block) for the blocks of a set.
template <class F>
void for_each_block(std::uint32_t blocks, const F& f) {
  for (; blocks != 0; blocks &= blocks - 1) f(static_cast<Index>(std::countr_zero(blocks)));
}

/// Adds what is behind a block to its state, and tells what of it is seen.
///
/// @param own    T and channels of what is behind, over the state's T
/// @param state  T and channels, in: behind what moves, out: behind everything
void add_behind(const float* own, Index channels, float stop, float* state, float* seen) {
  float relative[kBlockPixels], absolute[kBlockPixels];  // factors of `own`; 0 where a pixel is finished
  for (Index p = 0; p < kBlockPixels; ++p) {
    const float front = state[p];
    const bool alive = front >= stop && front > 0;
    relative[p] = alive ? 1 / front : 0.0f;
    absolute[p] = alive ? 1.0f : 0.0f;
    seen[p] = alive ? std::abs(own[p]) * relative[p] : 1.0f;
    state[p] = alive ? own[p] * absolute[p] : front;
  }
  for (Index k = 1; k <= channels; ++k) {
    for (Index p = 0; p < kBlockPixels; ++p) {
      const Index at = k * kBlockPixels + p;
      seen[at] = own[at] * relative[p];
      state[at] += own[at] * absolute[p];
    }
  }
}

}  // namespace

Index composite_behind(Index side, const CompositeScene<float>& scene, const BlockJob& job,
                       std::span<const TileEntry> behind, float* memory, TileLayer& layer) {
  const Index size = state_of_block(scene.channels);
  BlockJob rest = job;
  rest.entries = behind;
  rest.packed = &layer.behind;
  rest.state = memory;
  rest.runs = nullptr;
  for_each_block(job.blocks, [&](Index b) {
    std::copy_n(job.state + b * size, kBlockPixels, memory + b * size);
    std::fill_n(memory + b * size + kBlockPixels, size - kBlockPixels, 0.0f);
  });
  const Index fragments = composite_blocks(side, scene, rest).fragments;
  on_best_isa([&] {
    for_each_block(job.blocks, [&](Index b) {
      add_behind(memory + b * size, scene.channels, scene.rules.stop_below, job.state + b * size,
                 layer.seen.data() + b * size);
    });
  });
  return fragments;
}

void see_behind(Index side, Index channels, std::uint32_t blocks, const TileLayer& layer, const float* d_channels,
                float* behind) {
  const Index across = side / kBlockSide;
  on_best_isa([&] {
    for_each_block(blocks, [&](Index b) {
      const float* const seen = layer.seen.data() + b * state_of_block(channels);
      for (Index r = 0; r < kBlockSide; ++r) {
        const Index p = (b / across * kBlockSide + r) * side + b % across * kBlockSide;
        float sum[kBlockSide];
        for (Index c = 0; c < kBlockSide; ++c) sum[c] = behind[p + c] * seen[r * kBlockSide + c];
        for (Index k = 0; k < channels; ++k) {
          const float* const d = d_channels + k * side * side + p;
          const float* const of = seen + (k + 1) * kBlockPixels + r * kBlockSide;
          for (Index c = 0; c < kBlockSide; ++c) sum[c] += d[c] * of[c];
        }
        std::copy_n(sum, kBlockSide, behind + p);
      }
    });
  });
}

}  // namespace hsi4d::detail
