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
  if (!(x + half_width >= 0.5 && x - half_width <= static_cast<double>(grid.width) - 0.5)) return result;
  result.row_begin = first_from(y - half_height - 0.5, grid.height);
  result.row_end = last_to(y + half_height - 0.5, grid.height);
  return result;
}

TileSpan tile_columns(const Extent& f, const TileGrid& grid, Index tile_row) {
  if (f.kind == Extent::Kind::kAll) return {0, grid.cols};
  if (f.kind == Extent::Kind::kRectangle) return f.cols;
  const Index top = std::max(f.row_begin, tile_row * grid.tile);
  const Index bottom = std::min(f.row_end, (tile_row + 1) * grid.tile);
  if (top >= bottom) return {};
  // The border's x as a function of dy is slope·dy ± half_width sqrt(reach² − dy²/yy); the band's rightmost point is
  // the ellipse's if that lies in the band, else at the band's nearer end.
  const double half_height = f.reach * f.inverse_l22;
  const double low = std::max(static_cast<double>(top) + 0.5 - f.y, -half_height);
  const double high = std::min(static_cast<double>(bottom) - 0.5 - f.y, half_height);
  const auto half_width_at = [&](double dy) {
    const double w = dy / f.inverse_l22;
    return f.half_width * std::sqrt(std::max(0.0, f.reach * f.reach - w * w));
  };
  const double right_dy = std::clamp(f.reach * f.top_x, low, std::max(low, high));
  const double left_dy = std::clamp(-f.reach * f.top_x, low, std::max(low, high));
  const double right = f.slope * right_dy + half_width_at(right_dy), left = f.slope * left_dy - half_width_at(left_dy);
  const double room = 1e-9 * (1 + std::abs(f.x) + std::abs(right) + std::abs(left));
  const Index begin = first_from(f.x + left - room - 0.5, grid.width);
  const Index end = last_to(f.x + right + room - 0.5, grid.width);
  if (begin >= end) return {};
  return {begin / grid.tile, (end - 1) / grid.tile + 1};
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

/// Chunks of the Gaussians, each of which counts its tiles by itself.
Partition list_partition(Index ranks) {
  constexpr Index kGrain = 1024, kMostChunks = 32;
  return {ranks, std::max(kGrain, (ranks + kMostChunks - 1) / kMostChunks)};
}

}  // namespace

void TileLists::count(std::span<const Extent> extents, const TileGrid& grid, Buffer<Index>& counts) {
  const Index ranks = static_cast<Index>(extents.size()), tiles = grid.count();
  const Partition part = list_partition(ranks);
  counts.resize(part.chunks() * tiles);
  slot_begin.resize(ranks + 1);
  tile_begin.resize(tiles + 1);
  parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
    Index* const of_tile = counts.data() + chunk * tiles;
    std::fill_n(of_tile, tiles, Index(0));
    for (Index rank = begin; rank < end; ++rank) {
      Index pairs = 0;
      for_each_tile(extents[static_cast<std::size_t>(rank)], grid, [&](Index tile) {
        ++of_tile[tile];
        ++pairs;
      });
      slot_begin[rank] = pairs;
    }
  });
  total_pairs({slot_begin.data(), static_cast<std::size_t>(ranks)});
  Index slot = 0;
  for (Index rank = 0; rank < ranks; ++rank) slot += std::exchange(slot_begin[rank], slot);
  slot_begin[ranks] = slot;
  Index place = 0;
  for (Index tile = 0; tile < tiles; ++tile) {
    tile_begin[tile] = place;
    for (Index chunk = 0; chunk < part.chunks(); ++chunk) place += std::exchange(counts[chunk * tiles + tile], place);
  }
  tile_begin[tiles] = place;
}

void TileLists::fill(std::span<const Extent> extents, const TileGrid& grid, Buffer<Index>& counts) {
  const Index tiles = grid.count();
  entries.resize(tile_begin[tiles]);
  parallel_chunks(list_partition(static_cast<Index>(extents.size())), [&](Index chunk, Index begin, Index end) {
    Index* const of_tile = counts.data() + chunk * tiles;
    for (Index rank = begin; rank < end; ++rank) {
      Index next = slot_begin[rank];
      for_each_tile(extents[static_cast<std::size_t>(rank)], grid, [&](Index tile) {
        entries[of_tile[tile]++] = {static_cast<std::int32_t>(rank), static_cast<std::uint32_t>(next++)};
      });
    }
  });
}

}  // namespace hsi4d::detail
