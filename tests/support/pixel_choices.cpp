#include "tests/support/pixel_choices.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "splat/block_kernel.h"
#include "splat/conic.h"
#include "splat/tiles.h"

namespace hsi4d::test {

namespace {

using hsi4d::detail::CompositeRules;
using hsi4d::detail::Conic;
using hsi4d::detail::Extent;
using hsi4d::detail::SplatRecord;
using hsi4d::detail::TileGrid;
using hsi4d::detail::TileJob;

/// FNV-1a over numbers.
struct Hash {
  std::uint64_t value = 0xcbf29ce484222325u;
  void add(std::uint64_t number) { value = (value ^ number) * 0x100000001b3u; }
};

/// What is drawn, with what it may touch; to be sorted by (key, row).
template <class S>
struct Candidate {
  std::uint64_t key;
  Index row;  ///< of the inputs
  SplatRecord<S> record;
  Extent extent;
};

/// α and the transmittance behind it, by the kernel that composites up to kMostBlockChannels features.
template <class S>
hsi4d::detail::PixelAlpha<S> alpha_at(Index side, const SplatRecord<S>& record, const CompositeRules<S>& rules,
                                      const TileJob<S>& job, Index row, Index col) {
  if constexpr (std::is_same_v<S, float>) {
    return hsi4d::detail::block_pixel_alpha(side, record, rules, job.left, job.top, row, col);
  } else {
    return hsi4d::detail::pixel_alpha(record, rules, job, row, col);
  }
}

template <class S>
S behind(S transmittance, S alpha) {
  if constexpr (std::is_same_v<S, float>) {
    return hsi4d::detail::block_transmittance(transmittance, alpha);
  } else {
    return transmittance * (S(1) - alpha);
  }
}

template <class S>
std::vector<Candidate<S>> candidates(const Tape<S>& tape, const Projected<S>& projected, Var<S> opacities,
                                     const SplatView& view, const TileGrid& tiles) {
  const hsi4d::detail::SplatArrays<S> splats = {tape.value(projected.means_px),   tape.value(projected.factors),
                                                tape.value(projected.depths),     tape.value(projected.depth_rest),
                                                tape.value(projected.means_rest), tape.value(opacities),
                                                tape.value(projected.depths)};
  std::vector<Candidate<S>> all;
  for (Index n = 0; n < splats.rows(); ++n) {
    Candidate<S> c{};
    if (!hsi4d::detail::make_record(splats, view.settings, tiles, n, c.record, c.extent)) continue;
    c.key = hsi4d::detail::depth_key(splats, view.settings, n);
    c.row = n;
    all.push_back(c);
  }
  std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.key < b.key; });
  return all;
}

/// The choices at one pixel of a tile, given what reaches the tile in depth order.
template <class S>
std::uint64_t choices_at(Index side, const std::vector<const Candidate<S>*>& list, const CompositeRules<S>& rules,
                         const TileJob<S>& job, Index row, Index col, PixelChoices& count) {
  Hash hash;
  S transmittance = 1;
  for (const Candidate<S>* splat : list) {
    const SplatRecord<S>& record = splat->record;
    if (job.top + row < record.row_begin || job.top + row >= record.row_end) continue;
    const auto pixel = alpha_at(side, record, rules, job, row, col);
    if (!pixel.drawn) {
      ++count.skipped;
      continue;
    }
    const S next = behind(transmittance, pixel.alpha);
    const bool past = next < rules.stop_below;
    const auto name = 4 * static_cast<std::uint64_t>(splat->row);
    hash.add(name + (past ? 2 : 0) + (pixel.capped ? 1 : 0));
    count.stopped += past ? 1 : 0;
    if (past && rules.exclusive) break;
    count.fragments += pixel.alpha >= std::numeric_limits<S>::min() ? 1 : 0;  // below, the compositor's threads have 0
    count.capped += pixel.capped ? 1 : 0;
    if (past) break;
    transmittance = next;
  }
  return hash.value;
}

}  // namespace

template <class S>
PixelChoices pixel_choices(const Tape<S>& tape, const Projected<S>& projected, Var<S> opacities,
                           const SplatView& view) {
  const TileGrid tiles = hsi4d::detail::tile_grid(view.camera.width, view.camera.height, view.settings.tile);
  const std::vector<Candidate<S>> all = candidates(tape, projected, opacities, view, tiles);
  std::vector<std::vector<const Candidate<S>*>> lists(static_cast<std::size_t>(tiles.count()));
  for (const Candidate<S>& c : all) {
    hsi4d::detail::for_each_tile(
        c.extent, tiles, [&](Index tile, std::uint32_t) { lists[static_cast<std::size_t>(tile)].push_back(&c); });
  }
  const CompositeRules<S> rules = hsi4d::detail::composite_rules<S>(view.settings);
  PixelChoices result;
  result.hashes.resize(static_cast<std::size_t>(tiles.width * tiles.height));
  for (Index tile = 0; tile < tiles.count(); ++tile) {
    TileJob<S> job{};
    job.left = tile % tiles.cols * tiles.tile;
    job.top = tile / tiles.cols * tiles.tile;
    job.width = std::min(tiles.tile, tiles.width - job.left);
    job.height = std::min(tiles.tile, tiles.height - job.top);
    const auto& list = lists[static_cast<std::size_t>(tile)];
    for (Index row = 0; row < job.height; ++row) {
      for (Index col = 0; col < job.width; ++col) {
        const Index pixel = (job.top + row) * tiles.width + job.left + col;
        result.hashes[static_cast<std::size_t>(pixel)] = choices_at(tiles.tile, list, rules, job, row, col, result);
      }
    }
  }
  return result;
}

template PixelChoices pixel_choices(const Tape<float>&, const Projected<float>&, Var<float>, const SplatView&);
template PixelChoices pixel_choices(const Tape<double>&, const Projected<double>&, Var<double>, const SplatView&);

std::vector<std::size_t> flipped_pixels(const PixelChoices& a, const PixelChoices& b) {
  std::vector<std::size_t> flipped;
  for (std::size_t p = 0; p < a.hashes.size(); ++p) {
    if (a.hashes[p] != b.hashes[p]) flipped.push_back(p);
  }
  return flipped;
}

}  // namespace hsi4d::test
