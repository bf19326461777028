#include "splat/tiles.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <string>
#include <unistd.h>
#include <utility>

#include "core/check.h"
#include "core/parallel.h"
#include "core/simd.h"
#include "splat/limits.h"

namespace hsi4d::detail {

// --- its tiles -------------------------------------------------------------------------------------------------------

TileGrid tile_grid(Index width, Index height, Index tile) {
  return {width, height, tile, (width + tile - 1) / tile, (height + tile - 1) / tile};
}

namespace {

/// First whole number ≥ x, held in [0, end]; `end` for NaN.
Index first_from(double x, Index end) {
  if (!(x < static_cast<double>(end))) return end;
  if (!(x > 0)) return 0;
  const Index whole = static_cast<Index>(x);
  return whole + (static_cast<double>(whole) < x ? 1 : 0);
}

/// One past the last whole number ≤ x, held in [0, end]; 0 for NaN.
Index last_to(double x, Index end) {
  if (!(x >= 0)) return 0;
  return x < static_cast<double>(end) ? static_cast<Index>(x) + 1 : end;
}

/// A range of pixels.
struct Pixels {
  Index begin = 0, end = 0;
};

/// Those of the tiles of 16 pixels that INRIA's square of half-width `radius` touches along one axis. Its pixel centres
/// are whole numbers.
Pixels square_pixels(double mean, double radius, Index size) {
  constexpr double kTileOfInria = 16;
  const double p = mean - 0.5;
  const double tiles = static_cast<double>(size) / kTileOfInria + 1;
  const double begin = std::floor((p - radius) / kTileOfInria);
  const double end = std::floor((p + radius + (kTileOfInria - 1)) / kTileOfInria);
  if (!(begin < end)) return {};
  const auto pixel = [&](double tile) {
    const double held = tile > 0 ? (tile < tiles ? tile : tiles) : 0;
    return std::min(static_cast<Index>(held * kTileOfInria), size);
  };
  return {pixel(begin), pixel(end)};
}

Extent rectangle(Pixels rows, Pixels cols) {
  Extent result;
  if (rows.begin >= rows.end || cols.begin >= cols.end) return result;
  result.row_begin = static_cast<std::int32_t>(rows.begin);
  result.row_end = static_cast<std::int32_t>(rows.end);
  result.col_begin = static_cast<std::int32_t>(cols.begin / kBlockSide);
  result.col_end = static_cast<std::int32_t>((cols.end + kBlockSide - 1) / kBlockSide);
  return result;
}

Extent square_extent(const Conic& conic, double x, double y, const TileGrid& grid) {
  const double mid = 0.5 * (conic.xx + conic.yy);
  const double radius = std::ceil(3 * std::sqrt(mid + std::sqrt(std::max(0.1, mid * mid - conic.determinant))));
  return rectangle(square_pixels(y, radius, grid.height), square_pixels(x, radius, grid.width));
}

}  // namespace

Extent extent_of(const Conic& conic, double x, double y, double opacity, const TileGrid& grid,
                 const RenderSettings& settings, double epsilon) {
  if (settings.footprint == hsi4d::Footprint::kSquare3Sigma) return square_extent(conic, x, y, grid);
  if (settings.alpha_min <= 0) return rectangle({0, grid.height}, {0, grid.width});
  if (!(opacity >= settings.alpha_min * (1 - 4 * epsilon))) return {};
  // α ≥ alpha_min where u² + w² ≤ 2 ln(o/alpha_min). Rounding: of the exponential and the opacity, and of u, whose two
  // terms are as large as the ellipse is.
  const double exact = std::sqrt(std::max(0.0, 2 * std::log(opacity / settings.alpha_min)) + 32 * epsilon);
  const double width = std::sqrt(conic.xx), height = std::sqrt(conic.yy);
  const double reach = exact * (1 + 8 * epsilon * (1 + conic.l11 * width + std::abs(conic.l21) * height));
  const double half_height = reach * height, half_width = reach * width;
  if (!(x + half_width >= 0.5 && x - half_width <= static_cast<double>(grid.width) - 0.5)) return {};
  const Pixels rows = {first_from(y - half_height - 0.5, grid.height), last_to(y + half_height - 0.5, grid.height)};
  const Pixels cols = {first_from(x - half_width - 0.5, grid.width), last_to(x + half_width - 0.5, grid.width)};
  Extent result = rectangle(rows, cols);
  constexpr double kFar = 1e6;  // pixels: beyond, float is not enough
  if (!(std::abs(x) < kFar && std::abs(y) < kFar && half_width < kFar && half_height < kFar)) return result;
  result.kind = Extent::Kind::kEllipse;
  constexpr double kRoom = 1e-6;  // relative, some units in the last place of float
  const double first_row = static_cast<double>(result.row_begin / grid.tile * grid.tile);
  result.first_dy = static_cast<float>(first_row + 0.5 - y);
  result.lowest_dy = static_cast<float>(std::max(result.row_begin + 0.5 - y, -half_height));
  result.highest_dy = static_cast<float>(std::min(result.row_end - 0.5 - y, half_height));
  result.right_dy = static_cast<float>(reach * conic.xy / width);
  result.x = static_cast<float>(x - 0.5);
  result.slope = static_cast<float>(conic.xy / conic.yy);
  result.half_width = static_cast<float>(1 / conic.l11);
  result.reach_squared = static_cast<float>(reach * reach * (1 + 2 * kRoom));
  result.flatness = static_cast<float>(1 / conic.yy);
  result.room = static_cast<float>(1e-4 + kRoom * (std::abs(x) + half_width));
  return result;
}

// --- order -----------------------------------------------------------------------------------------------------------

std::uint64_t depth_bits(float depth) {
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(depth + 0.0f);  // −0 + 0 = 0
  return bits ^ (bits >> 31 != 0 ? 0xFFFFFFFFu : 0x80000000u);
}

std::uint64_t depth_bits(double depth) {
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(depth + 0.0);
  return bits ^ (bits >> 63 != 0 ? ~std::uint64_t(0) : std::uint64_t(1) << 63);
}

std::span<DepthKeyed> sort_by_depth(std::span<DepthKeyed> keys, std::span<DepthKeyed> room) {
  constexpr int kDigit = 11;
  constexpr std::size_t kValues = std::size_t(1) << kDigit;
  const auto digit = [](std::uint64_t key, int shift) { return static_cast<std::size_t>(key >> shift) % kValues; };
  std::uint64_t all = ~std::uint64_t(0), any = 0;
  for (const DepthKeyed& k : keys) {
    all &= k.key;
    any |= k.key;
  }
  for (int shift = 0; shift < 64; shift += kDigit) {
    if (digit(all, shift) == digit(any, shift)) continue;  // the same in every key
    std::array<std::uint32_t, kValues> place{};
    for (const DepthKeyed& k : keys) ++place[digit(k.key, shift)];
    std::uint32_t sum = 0;
    for (std::uint32_t& p : place) {
      const std::uint32_t count = p;
      p = sum;
      sum += count;
    }
    for (const DepthKeyed& k : keys) room[place[digit(k.key, shift)]++] = k;
    std::swap(keys, room);
  }
  return keys;
}

// --- lists -----------------------------------------------------------------------------------------------------------

Index total_pairs(std::span<const Index> pairs) {
  Index total = 0;
  for (const Index count : pairs) {
    total += count;
    if (total > kMostPairs) {
      throw UserError("more than " + std::to_string(kMostPairs) +
                      " (tile, Gaussian) pairs in one image: use fewer or smaller Gaussians, a smaller image, or an "
                      "alpha_min above 0");
    }
  }
  return total;
}

Index pair_memory_limit() {
  const double bytes = static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE));
  return static_cast<Index>(kPairMemoryShare * bytes);
}

void check_pair_memory(Index pairs, double bytes, Index limit) {
  if (bytes <= static_cast<double>(limit)) return;
  const auto gigabytes = [](double x) {
    char text[32];
    std::snprintf(text, sizeof text, "%.1f", x / 1e9);
    return std::string(text);
  };
  throw UserError("one image would take " + gigabytes(bytes) + " GB for " + std::to_string(pairs) +
                  " (tile, Gaussian) pairs, allowed are " + gigabytes(static_cast<double>(limit)) +
                  " GB: use fewer or smaller Gaussians, a smaller image, or an alpha_min above 0");
}

namespace {

constexpr Index kMostChunks = 32;

/// Gaussians are visited in depth order and lie far apart: one is fetched so many before its turn.
constexpr Index kAhead = 12;

template <class T>
void fetch(const T* object) {
  constexpr std::size_t kLine = 64;
  const char* const bytes = reinterpret_cast<const char*>(object);
  for (std::size_t i = 0; i < sizeof(T); i += kLine) __builtin_prefetch(bytes + i);
}

/// Chunks of the Gaussians, each of which counts its tiles by itself.
Partition list_partition(Index ranks) {
  constexpr Index kGrain = 1024;
  return {ranks, std::max(kGrain, (ranks + kMostChunks - 1) / kMostChunks)};
}

}  // namespace

Index TileLists::find(std::span<const DepthKeyed> order, std::span<const Extent> extents, const TileGrid& grid,
                      Index most) {
  const Index tiles = grid.count();
  const Partition part = list_partition(static_cast<Index>(order.size()));
  if (static_cast<Index>(found_.size()) < part.chunks()) found_.resize(static_cast<std::size_t>(part.chunks()));
  counts_.resize(part.chunks() * tiles);
  groups_.resize(part.chunks() * tiles);
  slots.resize(static_cast<Index>(extents.size()));
  std::fill_n(slots.data(), slots.size(), Slots{0, 0});
  std::array<Index, kMostChunks> pairs{};
  parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
    std::uint32_t *const of_tile = counts_.data() + chunk * tiles, *const groups = groups_.data() + chunk * tiles;
    std::fill_n(of_tile, tiles, 0u);
    std::fill_n(groups, tiles, 0u);
    std::vector<FoundPair>& found = found_[static_cast<std::size_t>(chunk)];
    found.clear();
    Index count = 0;
    on_best_isa([&] {
      for (Index rank = begin; rank < end; ++rank) {
        const Index n = order[static_cast<std::size_t>(rank)].index;
        if (rank + kAhead < end)
          fetch(&extents[static_cast<std::size_t>(order[static_cast<std::size_t>(rank + kAhead)].index)]);
        const Index first = count;
        for_each_tile(extents[static_cast<std::size_t>(n)], grid, [&](Index tile, std::uint32_t blocks) {
          if (count++ < most) found.push_back({static_cast<std::uint32_t>(tile), blocks});
          ++of_tile[tile];
          groups[tile] += static_cast<std::uint32_t>(std::popcount(blocks));
        });
        slots[n] = {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(count)};
      }
    });
    pairs[static_cast<std::size_t>(chunk)] = count;
  });
  const Index total = total_pairs(pairs);
  place_tiles(tiles, part.chunks());
  return total;
}

/// tile_begin, tile_groups; counts_ become where each chunk's entries of a tile begin. Row by row: a column of counts_
/// lies in as many cache lines as there are chunks.
void TileLists::place_tiles(Index tiles, Index chunks) {
  tile_begin.resize(tiles + 1);
  tile_groups.resize(tiles);
  std::fill_n(tile_begin.data(), tiles + 1, Index(0));
  std::fill_n(tile_groups.data(), tiles, Index(0));
  for (Index chunk = 0; chunk < chunks; ++chunk) {
    for (Index tile = 0; tile < tiles; ++tile) {
      tile_begin[tile + 1] += counts_[chunk * tiles + tile];
      tile_groups[tile] += groups_[chunk * tiles + tile];
    }
  }
  for (Index tile = 0; tile < tiles; ++tile) tile_begin[tile + 1] += tile_begin[tile];
  // The groups are added up, and their first row serves as the running place.
  std::uint32_t* const next = groups_.data();
  for (Index tile = 0; tile < tiles && chunks > 0; ++tile) next[tile] = static_cast<std::uint32_t>(tile_begin[tile]);
  for (Index chunk = 0; chunk < chunks; ++chunk) {
    std::uint32_t* const counts = counts_.data() + chunk * tiles;
    for (Index tile = 0; tile < tiles; ++tile) {
      const std::uint32_t count = counts[tile];
      counts[tile] = next[tile];
      next[tile] += count;
    }
  }
}

void TileLists::fill(std::span<const DepthKeyed> order, const TileGrid& grid, std::int32_t first) {
  const Index tiles = grid.count();
  const Partition part = list_partition(static_cast<Index>(order.size()));
  entries.resize(tile_begin[tiles]);
  tile_of.resize(tile_begin[tiles]);
  // Slots in the order of the inputs: those of Gaussians that follow each other are then read one after the other.
  std::uint32_t slot = 0;
  for (Slots& s : slots.span()) {
    const std::uint32_t size = s.end - s.begin;
    s = {slot, slot + size};
    slot += size;
  }
  parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
    std::uint32_t* const of_tile = counts_.data() + chunk * tiles;
    const FoundPair* pair = found_[static_cast<std::size_t>(chunk)].data();
    const auto index_at = [&](Index rank) { return order[static_cast<std::size_t>(rank)].index; };
    for (Index rank = begin; rank < end; ++rank) {
      if (rank + 2 * kAhead < end) fetch(&slots[index_at(rank + 2 * kAhead)]);
      if (rank + kAhead < end) fetch(&tile_of[slots[index_at(rank + kAhead)].begin]);
      const std::int32_t n = index_at(rank);
      for (std::uint32_t at = slots[n].begin; at < slots[n].end; ++at, ++pair) {
        entries[of_tile[pair->tile]++] = {first + n, at, pair->blocks};
        tile_of[at] = pair->tile;
      }
    }
  });
}

Index TileLists::capacity_bytes() const {
  Index bytes = tile_begin.capacity_bytes() + tile_groups.capacity_bytes() + slots.capacity_bytes() +
                tile_of.capacity_bytes() + entries.capacity_bytes() + counts_.capacity_bytes() +
                groups_.capacity_bytes();
  for (const auto& found : found_) bytes += static_cast<Index>(found.capacity() * sizeof(FoundPair));
  return bytes;
}

}  // namespace hsi4d::detail
