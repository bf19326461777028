#include "splat/reference/pixel_walk.h"

#include <algorithm>

#include "splat/render/pixel_step.h"

namespace hsi4d::detail {

namespace {

/// What is drawn, with what it may touch; to be sorted by key.
template <class S>
struct Candidate {
  std::uint64_t key;
  RecordOfRow<S> splat;
  Extent extent;
};

/// Nearest first; equal depths in the order of the inputs.
template <class S>
std::vector<Candidate<S>> candidates(const SplatArrays<S>& splats, const RenderSettings& settings,
                                     const TileGrid& grid) {
  std::vector<Candidate<S>> all;
  for (Index n = 0; n < splats.rows(); ++n) {
    Candidate<S> c{};
    if (!make_record(splats, settings, grid, n, c.splat.record, c.extent)) continue;
    c.key = depth_key(splats, settings, n);
    c.splat.row = n;
    all.push_back(c);
  }
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.key < b.key; });
  return all;
}

}  // namespace

template <class S>
PixelWalk<S>::PixelWalk(const SplatArrays<S>& splats, const SplatView& view, std::optional<Index> tile)
    : grid_(tile_grid(view.camera.width, view.camera.height, view.settings.tile)),
      rules_(composite_rules<S>(view.settings)),
      in_blocks_(composites_in_blocks<S>(splats.features.shape.cols)) {
  const std::vector<Candidate<S>> all = candidates(splats, view.settings, grid_);
  records_.reserve(all.size());  // the lists point into it
  lists_.resize(static_cast<std::size_t>(grid_.count()));
  for (const Candidate<S>& c : all) {
    const RecordOfRow<S>* kept = nullptr;
    for_each_tile(c.extent, grid_, [&](Index reached, std::uint32_t) {
      if (tile.value_or(reached) != reached) return;
      if (kept == nullptr) kept = &records_.emplace_back(c.splat);
      lists_[static_cast<std::size_t>(reached)].push_back(kept);
    });
  }
}

template <class S>
PixelStep<S> PixelWalk<S>::step_at(const RecordOfRow<S>& splat, Index row, Index col, S transmittance) const {
  const Index left = col / grid_.tile * grid_.tile, top = row / grid_.tile * grid_.tile;
  TileJob<S> place{};
  place.left = left;
  place.top = top;
  const auto [pixel, behind] =
      pixel_of(in_blocks_, grid_.tile, splat.record, rules_, place, row - top, col - left, transmittance);
  const bool stops = pixel.drawn && behind < rules_.stop_below;
  return {&splat.record, splat.row,     pixel.alpha,
          pixel.drawn,   pixel.capped,  pixel.drawn && !(stops && rules_.exclusive),
          stops,         transmittance, behind};
}

template class PixelWalk<float>;
template class PixelWalk<double>;

}  // namespace hsi4d::detail
