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

/// Tiles of 16 pixels that INRIA's square of half-width `radius` touches along one axis, as rows or columns of pixels.
/// Its pixel centres are whole numbers.
TileSpan square_pixels(double mean, double radius, Index size) {
  constexpr double kBlock = 16;
  const double p = mean - 0.5;
  const double blocks = static_cast<double>(size) / kBlock + 1;
  const double begin = std::floor((p - radius) / kBlock), end = std::floor((p + radius + (kBlock - 1)) / kBlock);
  if (!(begin < end)) return {};
  const auto pixel = [&](double block) {
    const double held = block > 0 ? (block < blocks ? block : blocks) : 0;
    return std::min(static_cast<Index>(held * kBlock), size);
  };
  return {pixel(begin), pixel(end)};
}

Extent square_extent(const Conic& conic, double x, double y, const TileGrid& grid) {
  const double mid = 0.5 * (conic.xx + conic.yy);
  const double radius = std::ceil(3 * std::sqrt(mid + std::sqrt(std::max(0.1, mid * mid - conic.determinant))));
  const TileSpan cols = square_pixels(x, radius, grid.width), rows = square_pixels(y, radius, grid.height);
  Extent result;
  result.kind = Extent::Kind::kRectangle;
  if (cols.begin >= cols.end) return result;
  result.row_begin = rows.begin;
  result.row_end = rows.end;
  result.cols = {cols.begin / grid.tile, (cols.end + grid.tile - 1) / grid.tile};
  return result;
}

}  // namespace

Extent extent_of(const Conic& conic, double x, double y, double opacity, const TileGrid& grid,
                 const RenderSettings& settings, double epsilon) {
  if (settings.footprint == hsi4d::Footprint::kSquare3Sigma) return square_extent(conic, x, y, grid);
  Extent result;
  if (settings.alpha_min <= 0) {
    result.row_end = grid.height;
    return result;
  }
  result.kind = Extent::Kind::kEllipse;
  if (!(opacity >= settings.alpha_min * (1 - 4 * epsilon))) return result;
  // α ≥ alpha_min where u² + w² ≤ 2 ln(o/alpha_min). Rounding: of the exponential and the opacity, and of u, whose two
  // terms are as large as the ellipse is.
  const double exact = std::sqrt(std::max(0.0, 2 * std::log(opacity / settings.alpha_min)) + 32 * epsilon);
  const double width = std::sqrt(conic.xx), height = std::sqrt(conic.yy);
  result.reach = exact * (1 + 8 * epsilon * (1 + conic.l11 * width + std::abs(conic.l21) * height));
  result.x = x;
  result.y = y;
  result.slope = conic.xy / conic.yy;
  result.half_width = 1 / conic.l11;
  result.top_x = conic.xy / width;
  result.inverse_l22 = height;
  const double half_height = result.reach * height, half_width = result.reach * width;
  result.box_half_width = half_width;
  if (!(x + half_width >= 0.5 && x - half_width <= static_cast<double>(grid.width) - 0.5)) return result;
  result.row_begin = first_from(y - half_height - 0.5, grid.height);
  result.row_end = last_to(y + half_height - 0.5, grid.height);
  return result;
}

TileSpan block_columns(const Extent& f, const TileGrid& grid, Index band) {
  const Index across = grid.tile / kBlockSide;
  const Index top = std::max(f.row_begin, band * kBlockSide);
  const Index bottom = std::min(f.row_end, (band + 1) * kBlockSide);
  if (top >= bottom) return {};
  if (f.kind == Extent::Kind::kAll) return {0, grid.cols * across};
  if (f.kind == Extent::Kind::kRectangle) return {f.cols.begin * across, f.cols.end * across};
  // The border's x as a function of dy is slope·dy ± half_width sqrt(reach² − dy²/yy); the band's rightmost point is
  // the ellipse's if that lies in the band, else at the band's nearer end.
  const double half_height = f.reach * f.inverse_l22;
  const double low = std::max(static_cast<double>(top) + 0.5 - f.y, -half_height);
  const double high = std::max(std::min(static_cast<double>(bottom) - 0.5 - f.y, half_height), low);
  const auto half_width_at = [&](double dy) {
    const double w = dy / f.inverse_l22;
    return f.half_width * std::sqrt(std::max(0.0, f.reach * f.reach - w * w));
  };
  const double right_dy = std::clamp(f.reach * f.top_x, low, high);
  const double left_dy = std::clamp(-f.reach * f.top_x, low, high);
  const double right = f.slope * right_dy + half_width_at(right_dy), left = f.slope * left_dy - half_width_at(left_dy);
  const double room = 1e-9 * (1 + std::abs(f.x) + std::abs(right) + std::abs(left));
  const Index begin = first_from(f.x + left - room - 0.5, grid.width);
  const Index end = last_to(f.x + right + room - 0.5, grid.width);
  if (begin >= end) return {};
  return {begin / kBlockSide, (end - 1) / kBlockSide + 1};
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
  tile_begin.resize(tiles + 1);
  tile_groups.resize(tiles);
  Index place = 0;
  for (Index tile = 0; tile < tiles; ++tile) {
    tile_begin[tile] = place;
    tile_groups[tile] = 0;
    for (Index chunk = 0; chunk < part.chunks(); ++chunk) {
      const Index count = counts_[chunk * tiles + tile];
      counts_[chunk * tiles + tile] = static_cast<std::uint32_t>(place);
      place += count;
      tile_groups[tile] += groups_[chunk * tiles + tile];
    }
  }
  tile_begin[tiles] = place;
  return total;
}

void TileLists::fill(std::span<const DepthKeyed> order, const TileGrid& grid) {
  const Index tiles = grid.count();
  const Partition part = list_partition(static_cast<Index>(order.size()));
  entries.resize(tile_begin[tiles]);
  tile_of.resize(tile_begin[tiles]);
  std::array<std::uint32_t, kMostChunks> first{};
  for (Index chunk = 1; chunk < part.chunks(); ++chunk) {
    const auto c = static_cast<std::size_t>(chunk);
    first[c] = first[c - 1] + static_cast<std::uint32_t>(found_[c - 1].size());
  }
  parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
    std::uint32_t* const of_tile = counts_.data() + chunk * tiles;
    const FoundPair* pair = found_[static_cast<std::size_t>(chunk)].data();
    std::uint32_t slot = first[static_cast<std::size_t>(chunk)];
    for (Index rank = begin; rank < end; ++rank) {
      const std::int32_t n = order[static_cast<std::size_t>(rank)].index;
      const std::uint32_t size = slots[n].end - slots[n].begin;
      slots[n] = {slot, slot + size};
      for (const std::uint32_t after = slot + size; slot < after; ++slot, ++pair) {
        entries[of_tile[pair->tile]++] = {n, slot, pair->blocks};
        tile_of[slot] = pair->tile;
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
