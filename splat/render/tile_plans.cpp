#include "splat/render/tile_plans.h"

#include <bit>
#include <type_traits>

#include "core/parallel.h"

namespace hsi4d::detail {

void TilePlans::reset(Index tiles) {
  still.count = still.visible = 0;
  layers.resize(static_cast<std::size_t>(tiles));
  for (TileLayer& layer : layers) layer.made = false;
}

template <class S>
void TilePlans::plan(const SplatRows<S>& rows, const RenderSettings& settings, const TileGrid& tiles,
                     const PlanRules& rules) {
  constexpr Index kTogether = 64;
  plans.resize(tiles.count());
  parallel_for(tiles.count(), kTogether, [&](Index begin, Index end) {
    for (Index tile = begin; tile < end; ++tile) plans[tile] = plan_of(rows, settings, rules, tiles.tile, tile);
  });
  Index place = 0;
  for (TilePlan& plan : plans.span()) {
    if (plan.merged < 0) continue;
    plan.merged = place;
    place += static_cast<Index>(plan.entries.size());
  }
  merged.resize(place);
}

template <class S>
TilePlan TilePlans::plan_of(const SplatRows<S>& rows, const RenderSettings& settings, const PlanRules& rules,
                            Index side, Index tile) {
  TilePlan plan;
  const std::span<const TileEntry> moved = moving.of_tile(tile), kept = still.of_tile(tile);
  if (moved.empty()) return plan;
  for (const TileEntry& e : moved) plan.blocks |= e.blocks;
  if (!rules.in_blocks) plan.blocks = all_blocks(side);
  plan.groups = moving.lists.tile_groups[tile];
  plan.entries = moved;
  if (kept.empty()) return plan;
  if constexpr (std::is_same_v<S, float>) {
    if (rules.in_layers) {
      place_layer(rows, settings, kept, moved, layer(tile));
      plan.behind = kept.subspan(static_cast<std::size_t>(layer(tile).after));
    }
  }
  const std::span<const TileEntry> between = among(rules, tile);
  if (between.empty()) return plan;
  for (const TileEntry& e : between) plan.groups += std::popcount(e.blocks);
  plan.merged = 0;
  plan.entries = {moved.data(), moved.size() + between.size()};
  return plan;
}

/// Those that stand still among what moves in a tile; without layers all that stand still.
std::span<const TileEntry> TilePlans::among(const PlanRules& rules, Index tile) const {
  const std::span<const TileEntry> kept = still.of_tile(tile);
  if (!rules.in_layers) return kept;
  const TileLayer& of = layer(tile);
  return kept.subspan(static_cast<std::size_t>(of.first), static_cast<std::size_t>(of.after - of.first));
}

template <class S>
void TilePlans::merge(const SplatRows<S>& rows, const RenderSettings& settings, const PlanRules& rules, Index tile) {
  TilePlan& plan = plans[tile];
  if (plan.merged < 0) return;
  TileEntry* const to = merged.data() + plan.merged;
  merge_entries(rows, settings, among(rules, tile), moving.of_tile(tile), to);
  plan.entries = {to, plan.entries.size()};
}

Index TilePlans::capacity_bytes() const {
  Index bytes = still.capacity_bytes() + moving.capacity_bytes() + plans.capacity_bytes() + merged.capacity_bytes();
  for (const TileLayer& layer : layers) bytes += layer.capacity_bytes();
  return bytes;
}

#define HSI4D_INSTANTIATE(S)                                                                                    \
  template void TilePlans::plan(const SplatRows<S>&, const RenderSettings&, const TileGrid&, const PlanRules&); \
  template void TilePlans::merge(const SplatRows<S>&, const RenderSettings&, const PlanRules&, Index);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d::detail
