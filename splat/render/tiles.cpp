#include "splat/render/tiles.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <string>
#include <unistd.h>
#include <utility>

#include "core/check.h"
#include "core/parallel.h"
#include "core/simd.h"
#include "splat/limits.h"
#include "splat/render/tile_finder.h"

namespace hsi4d::detail {

// --- its tiles -------------------------------------------------------------------------------------------------------

TileGrid tile_grid(Index width, Index height, Index tile) {
  return {width, height, tile, (width + tile - 1) / tile, (height + tile - 1) / tile};
}

namespace {

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

}  // namespace

ExtentRules extent_rules(const RenderSettings& settings, double epsilon) {
  return {settings.footprint, settings.alpha_min, settings.alpha_min > 0 ? std::log2(settings.alpha_min) : 0, epsilon};
}

Extent square_extent(const Conic& conic, double x, double y, const TileGrid& grid) {
  const double mid = 0.5 * (conic.xx + conic.yy);
  const double radius = std::ceil(3 * std::sqrt(mid + std::sqrt(std::max(0.1, mid * mid - conic.determinant))));
  return rectangle_extent(square_pixels(y, radius, grid.height), square_pixels(x, radius, grid.width));
}

// --- order -----------------------------------------------------------------------------------------------------------

namespace {

/// Numbers of a radix's digits, turned into the places of the first of each.
template <class Count>
void places_of(Count& counts) {
  std::uint32_t sum = 0;
  for (std::uint32_t& c : counts) sum += std::exchange(c, sum);
}

/// Sorts by the difference from the least key, of 32 bits: packed with the index into one word, up to
/// three digits.
void sort_near_keys(std::span<DepthKeyed> keys, std::span<DepthKeyed> room, std::uint64_t least, std::uint64_t most) {
  constexpr int kMostBits = 11;  // of a digit: few enough places that all of them stay in the first-level cache
  const int bits = static_cast<int>(std::bit_width(most - least)), digits = (bits + kMostBits - 1) / kMostBits;
  const int width = (bits + digits - 1) / digits;
  const std::uint64_t mask = (std::uint64_t(1) << width) - 1;
  std::array<std::array<std::uint32_t, std::size_t(1) << kMostBits>, 3> place;
  for (int i = 0; i < digits; ++i) place[static_cast<std::size_t>(i)].fill(0);
  static_assert(sizeof(DepthKeyed) == 2 * sizeof(std::uint64_t));
  std::uint64_t *from = reinterpret_cast<std::uint64_t*>(room.data()), *to = from + keys.size();
  const auto digit = [&](std::uint64_t word, int i) {
    return static_cast<std::size_t>(word >> (32 + i * width) & mask);
  };
  for (std::size_t n = 0; n < keys.size(); ++n) {
    const std::uint64_t word = (keys[n].key - least) << 32 | static_cast<std::uint32_t>(keys[n].index);
    from[n] = word;
    for (int i = 0; i < digits; ++i) ++place[static_cast<std::size_t>(i)][digit(word, i)];
  }
  for (int i = 0; i < digits; ++i) {
    auto& next = place[static_cast<std::size_t>(i)];
    places_of(next);
    for (std::size_t n = 0; n < keys.size(); ++n) to[next[digit(from[n], i)]++] = from[n];
    std::swap(from, to);
  }
  for (std::size_t n = 0; n < keys.size(); ++n) {
    keys[n] = {least + (from[n] >> 32), static_cast<std::int32_t>(from[n] & 0xFFFFFFFF)};
  }
}

}  // namespace

std::span<DepthKeyed> sort_by_depth(std::span<DepthKeyed> keys, std::span<DepthKeyed> room) {
  constexpr int kDigit = 11;
  constexpr std::size_t kValues = std::size_t(1) << kDigit;
  const auto digit = [](std::uint64_t key, int shift) { return static_cast<std::size_t>(key >> shift) % kValues; };
  std::uint64_t least = ~std::uint64_t(0), most = 0;
  for (const DepthKeyed& k : keys) {
    least = std::min(least, k.key);
    most = std::max(most, k.key);
  }
  if (keys.empty() || least == most) return keys;
  if (most - least <= 0xFFFFFFFF) {
    sort_near_keys(keys, room, least, most);
    return keys;
  }
  // Digits that are the same in every key lie above the first in which least and most differ.
  const int bits = static_cast<int>(std::bit_width(least ^ most));
  for (int shift = 0; shift < bits; shift += kDigit) {
    std::array<std::uint32_t, kValues> place{};
    for (const DepthKeyed& k : keys) ++place[digit(k.key, shift)];
    places_of(place);
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

/// Most parts that work is cut into.
constexpr Index kMostParts = 32;

/// Cut for the threads at hand: where the lists do not depend on it.
Partition cut(Index n) {
  constexpr Index kGrain = 1024;
  const Index threads = thread_count(), parts = threads == 1 ? 1 : std::min(2 * threads, kMostParts);
  return {n, std::max(kGrain, (n + parts - 1) / parts)};
}

}  // namespace

Index TileLists::find(std::span<const Extent> extents, const TileGrid& grid, Index most, Index bound) {
  const Index tiles = grid.count();
  const Partition part = cut(static_cast<Index>(extents.size()));
  const Index room = count_room(grid);
  totals_.resize(std::max<Index>(part.chunks(), 1) * room);
  slots.resize(static_cast<Index>(extents.size()));
  if (static_cast<Index>(of_part_.size()) < part.chunks()) of_part_.resize(static_cast<std::size_t>(part.chunks()));
  std::array<Index, kMostParts> sizes{};
  const auto run = [&](Index keep) {
    std::fill_n(totals_.data(), totals_.size(), std::uint64_t(0));
    parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
      const auto number = static_cast<std::size_t>(chunk);
      const auto rows = extents.subspan(static_cast<std::size_t>(begin), static_cast<std::size_t>(end - begin));
      sizes[number] = find_pairs(
          rows, grid, keep,
          {part.chunks() == 1 ? found_ : of_part_[number], totals_.data() + chunk * room, slots.data() + begin});
    });
    return total_pairs(sizes);
  };
  pairs_ = run(bound <= most ? most : 0);
  if (pairs_ > most) return pairs_;
  if (bound > most) run(most);
  tile_begin.resize(tiles + 1);
  tile_groups.resize(tiles);
  tile_begin[0] = 0;
  for (Index tile = 0; tile < tiles; ++tile) {
    std::uint64_t total = totals_[tile];
    for (Index chunk = 1; chunk < part.chunks(); ++chunk) total += totals_[chunk * room + tile];
    tile_begin[tile + 1] = tile_begin[tile] + static_cast<Index>(total & 0xFFFFFFFF);
    tile_groups[tile] = static_cast<Index>(total >> 32);
  }
  if (part.chunks() > 1) join(part, sizes);
  return pairs_;
}

/// Pairs of all parts into one array; slots of a part are then counted from its first.
void TileLists::join(const Partition& part, std::span<const Index> sizes) {
  if (static_cast<Index>(found_.size()) < pairs_) found_.resize(static_cast<std::size_t>(pairs_ + pairs_ / 2));
  parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
    const auto number = static_cast<std::size_t>(chunk);
    const Index place = std::accumulate(sizes.begin(), sizes.begin() + chunk, Index(0));
    std::copy_n(of_part_[number].begin(), sizes[number], found_.begin() + place);
    const auto shift = static_cast<std::uint32_t>(place);
    for (Index n = begin; n < end; ++n) slots[n] = {slots[n].begin + shift, slots[n].end + shift};
  });
}

void TileLists::deal(std::span<const DepthKeyed> order, const TileGrid& grid, std::int32_t first) {
  const Index tiles = grid.count();
  const Partition part = cut(static_cast<Index>(order.size()));
  entries.resize(pairs_);
  next_.resize(std::max<Index>(part.chunks(), 1) * tiles);
  // Rows in depth order lie far apart: slots, and pairs, are fetched before their turn.
  constexpr Index kAhead = 12;
  const Slots* const of_row = slots.data();
  const FoundPair* const found = found_.data();
  const auto visit = [&](Index begin, Index end, const auto& visit_pair) {
    const DepthKeyed* const rows = order.data();
    for (Index rank = begin; rank < end; ++rank) {
      if (rank + 2 * kAhead < end) __builtin_prefetch(of_row + rows[rank + 2 * kAhead].index);
      if (rank + kAhead < end) __builtin_prefetch(found + of_row[rows[rank + kAhead].index].begin);
      const std::int32_t n = rows[rank].index;
      const Slots s = of_row[n];
      for (std::uint32_t slot = s.begin; slot < s.end; ++slot) visit_pair(n, slot, found[slot]);
    }
  };
  if (part.chunks() > 1) {
    parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
      std::uint32_t* const count = next_.data() + chunk * tiles;
      std::fill_n(count, tiles, 0u);
      visit(begin, end, [count](std::int32_t, std::uint32_t, FoundPair pair) { ++count[pair.tile]; });
    });
  } else {
    std::fill_n(next_.data(), tiles, 0u);
  }
  // Numbers of entries become places; part by part, as a tile's lie far apart.
  totals_.resize(tiles);
  std::uint64_t* const place = totals_.data();
  for (Index tile = 0; tile < tiles; ++tile) place[tile] = static_cast<std::uint64_t>(tile_begin[tile]);
  for (Index chunk = 0; chunk < std::max<Index>(part.chunks(), 1); ++chunk) {
    std::uint32_t* const next = next_.data() + chunk * tiles;
    for (Index tile = 0; tile < tiles; ++tile) {
      const std::uint32_t count = next[tile];
      next[tile] = static_cast<std::uint32_t>(place[tile]);
      place[tile] += count;
    }
  }
  parallel_chunks(part, [&](Index chunk, Index begin, Index end) {
    std::uint32_t* const next = next_.data() + chunk * tiles;
    TileEntry* const to = entries.data();
    visit(begin, end, [next, to, first](std::int32_t n, std::uint32_t slot, FoundPair pair) {
      to[next[pair.tile]++] = {first + n, slot, pair.blocks};
    });
  });
}

Index TileLists::capacity_bytes() const {
  Index bytes = tile_begin.capacity_bytes() + tile_groups.capacity_bytes() + slots.capacity_bytes() +
                entries.capacity_bytes() + totals_.capacity_bytes() + next_.capacity_bytes();
  bytes += static_cast<Index>(found_.capacity() * sizeof(FoundPair));
  for (const auto& part : of_part_) bytes += static_cast<Index>(part.capacity() * sizeof(FoundPair));
  return bytes;
}

}  // namespace hsi4d::detail
