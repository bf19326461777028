#include "splat/render/median_rows.h"

#include "core/parallel.h"
#include "splat/render/pixel_step.h"
#include "splat/render/splat_lists.h"

namespace hsi4d {

namespace {

using detail::SplatRecord;
using detail::TileEntry;

/// One tile of the image with what may touch it.
template <class S>
struct MedianTile {
  Index side;
  detail::TileJob<S> job;
  std::span<const SplatRecord<S>> records;
  const detail::CompositeRules<S>& rules;
};

/// @param row, col  in the tile
template <class S>
std::int32_t median_row(const MedianTile<S>& tile, Index row, Index col) {
  const bool in_blocks = detail::composites_in_blocks<S>(1);
  const Index across = tile.side / detail::kBlockSide, image_row = tile.job.top + row;
  const Index block = row / detail::kBlockSide * across + col / detail::kBlockSide;
  S transmittance = 1;
  for (const TileEntry& entry : tile.job.entries) {
    const SplatRecord<S>& record = tile.records[static_cast<std::size_t>(entry.index)];
    if ((entry.blocks >> block & 1U) == 0 || image_row < record.row_begin || image_row >= record.row_end) continue;
    const auto [pixel, behind] =
        detail::pixel_of(in_blocks, tile.side, record, tile.rules, tile.job, row, col, transmittance);
    if (!pixel.drawn) continue;
    const bool stops = behind < tile.rules.stop_below;
    if (stops && tile.rules.exclusive) return -1;
    if (behind <= S(0.5)) return entry.index;
    if (stops) return -1;
    transmittance = behind;
  }
  return -1;
}

}  // namespace

template <class S>
std::vector<std::int32_t> median_rows(const Tape<S>& tape, const Projected<S>& projected, Var<S> opacities,
                                      const SplatView& view) {
  const ConstArray<S> alphas = tape.value(opacities);
  const detail::SplatArrays<S> splats = {tape.value(projected.means_px),
                                         tape.value(projected.factors),
                                         tape.value(projected.depths),
                                         tape.value(projected.depth_low),
                                         tape.value(projected.means_low),
                                         alphas,
                                         alphas};  // some feature
  const Index width = view.camera.width, height = view.camera.height;
  const detail::TileGrid grid = detail::tile_grid(width, height, view.settings.tile);
  const detail::CompositeRules<S> rules = detail::composite_rules<S>(view.settings);
  std::vector<SplatRecord<S>> records(static_cast<std::size_t>(splats.rows()));
  detail::SplatLists lists;
  RenderTimes times;
  detail::list_splats<S>({{}, splats, 0}, 0, splats.rows(), view.settings, grid, records, sizeof(TileEntry), lists,
                         times);
  std::vector<std::int32_t> rows(static_cast<std::size_t>(width * height), -1);
  parallel_for(grid.count(), 1, [&](Index begin, Index end) {
    for (Index t = begin; t < end; ++t) {
      MedianTile<S> tile{grid.tile, {}, records, rules};
      tile.job.entries = lists.of_tile(t);
      tile.job.left = t % grid.cols * grid.tile;
      tile.job.top = t / grid.cols * grid.tile;
      tile.job.width = std::min(grid.tile, width - tile.job.left);
      tile.job.height = std::min(grid.tile, height - tile.job.top);
      for (Index y = 0; y < tile.job.height; ++y) {
        std::int32_t* const line = rows.data() + (tile.job.top + y) * width + tile.job.left;
        for (Index x = 0; x < tile.job.width; ++x) line[x] = median_row(tile, y, x);
      }
    }
  });
  return rows;
}

template std::vector<std::int32_t> median_rows(const Tape<float>&, const Projected<float>&, Var<float>,
                                               const SplatView&);
template std::vector<std::int32_t> median_rows(const Tape<double>&, const Projected<double>&, Var<double>,
                                               const SplatView&);

}  // namespace hsi4d
