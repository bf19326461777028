// What the compositor does at single pixels, step by step: rebuilt with the functions that the compositor is made of.
// For looking (splat/reference/debug_pixel.h) and for tests; not part of the public interface.
#pragma once

#include <optional>
#include <vector>

#include "splat/render/splat_records.h"

namespace hsi4d::detail {

/// A Gaussian with its row of the inputs.
template <class S>
struct RecordOfRow {
  SplatRecord<S> record;
  Index row;
};

/// A Gaussian that a pixel's tile has in its list, as the pixel comes to it.
template <class S>
struct PixelStep {
  const SplatRecord<S>* record;
  Index row;        ///< of the inputs
  S alpha;          ///< after the cap
  bool drawn;       ///< α ≥ alpha_min
  bool capped;      ///< the cap holds α
  bool composited;  ///< it is added
  bool stops;       ///< the pixel is finished, with it or before it
  S transmittance;  ///< in front of it
  S behind;         ///< behind it if it is added
};

/// The tile that a pixel lies in.
inline Index tile_of(const TileGrid& grid, Index row, Index col) {
  return row / grid.tile * grid.cols + col / grid.tile;
}

template <class S>
class PixelWalk {
 public:
  /// @param splats  the inputs of composite; the number of features decides on the kernel in use
  /// @param tile    the only one that will be walked in; none: any
  PixelWalk(const SplatArrays<S>& splats, const SplatView& view, std::optional<Index> tile = {});
  PixelWalk(const PixelWalk&) = delete;
  PixelWalk& operator=(const PixelWalk&) = delete;

  const TileGrid& grid() const { return grid_; }

  /// Calls visit(const PixelStep<S>&) for every Gaussian of the pixel's list, front to back, up to the one at which it
  /// stops. Returns how many of the list are behind that one.
  template <class F>
  Index visit(Index row, Index col, const F& visit) const {
    const std::vector<const RecordOfRow<S>*>& list = lists_[static_cast<std::size_t>(tile_of(grid_, row, col))];
    S transmittance = 1;
    for (std::size_t i = 0; i < list.size(); ++i) {
      if (row < list[i]->record.row_begin || row >= list[i]->record.row_end) continue;
      const PixelStep<S> step = step_at(*list[i], row, col, transmittance);
      visit(step);
      if (step.stops) return static_cast<Index>(list.size() - i) - 1;
      transmittance = step.drawn ? step.behind : transmittance;
    }
    return 0;
  }

 private:
  PixelStep<S> step_at(const RecordOfRow<S>& splat, Index row, Index col, S transmittance) const;

  TileGrid grid_;
  CompositeRules<S> rules_;
  bool in_blocks_;
  std::vector<RecordOfRow<S>> records_;                    // of what is drawn, in depth order
  std::vector<std::vector<const RecordOfRow<S>*>> lists_;  // of every tile
};

}  // namespace hsi4d::detail
