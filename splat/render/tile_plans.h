// What every tile of a composite does in one run: which of its Gaussians are composited, and over what. Used by
// composite.h; not part of the public interface.
#pragma once

#include <span>
#include <vector>

#include "core/buffer.h"
#include "splat/render/splat_lists.h"
#include "splat/render/static_layer.h"

namespace hsi4d::detail {

struct TilePlan {
  std::span<const TileEntry> entries;  ///< that have an adjoint, or stand still among these
  std::span<const TileEntry> behind;   ///< that stand still behind all of them
  Index merged = -1;                   ///< place of `entries` among the merged ones; −1: they are a list's own
  Index groups = 0;                    ///< (block, Gaussian) pairs of `entries`, at most
  std::uint32_t blocks = 0;            ///< that `entries` touch
};

/// How tiles are planned.
struct PlanRules {
  bool in_blocks;  ///< by the block kernel: blocks that nothing touches which moves are left alone
  bool in_layers;  ///< with static layers; only with in_blocks
};

/// The lists of an image and the plans of its tiles.
struct TilePlans {
  SplatLists still, moving;
  std::vector<TileLayer> layers;  ///< of each tile
  Buffer<TilePlan> plans;         ///< of each tile
  Buffer<TileEntry> merged;

  /// Forgets what stands still: there is none, until `still` is listed.
  void reset(Index tiles);
  /// Plans every tile, and places its layer. `entries` of a plan that is to be merged tells only how many they are.
  template <class S>
  void plan(const SplatRows<S>& rows, const RenderSettings& settings, const TileGrid& tiles, const PlanRules& rules);
  /// Merges the entries of a tile's plan, if they are to be.
  template <class S>
  void merge(const SplatRows<S>& rows, const RenderSettings& settings, const PlanRules& rules, Index tile);

  TileLayer& layer(Index tile) { return layers[static_cast<std::size_t>(tile)]; }
  const TileLayer& layer(Index tile) const { return layers[static_cast<std::size_t>(tile)]; }
  Index capacity_bytes() const;

 private:
  template <class S>
  TilePlan plan_of(const SplatRows<S>& rows, const RenderSettings& settings, const PlanRules& rules, Index side,
                   Index tile);
  std::span<const TileEntry> among(const PlanRules& rules, Index tile) const;
};

}  // namespace hsi4d::detail
