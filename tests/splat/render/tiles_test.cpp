#include "splat/render/tiles.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/parallel.h"
#include "core/random.h"
#include "splat/render/block_kernel.h"

namespace tiles_test {

using namespace hsi4d;
using namespace hsi4d::detail;

namespace {

/// Random factor of a needle of the given length and width, turned by any angle; numbers are floats.
std::array<double, 6> needle(RandomSequence& random, double length, double width) {
  const double angle = random.uniform(0, 3.141592653589793), mix = random.uniform(0, 6.283185307179586);
  const double c = std::cos(angle), s = std::sin(angle);
  // V = rotation · diag(length, width) · rows of a rotation in three dimensions
  const double a[3] = {std::cos(mix), std::sin(mix), 0}, b[3] = {-0.6 * std::sin(mix), 0.6 * std::cos(mix), 0.8};
  std::array<double, 6> v;
  for (std::size_t k = 0; k < 3; ++k) {
    v[k] = static_cast<float>(c * length * a[k] - s * width * b[k]);
    v[3 + k] = static_cast<float>(s * length * a[k] + c * width * b[k]);
  }
  return v;
}

template <class S>
SplatRecord<S> record_of(const Conic& conic, double x, double y, double opacity) {
  SplatRecord<S> r{};
  r.x = x, r.y = y;
  r.l11 = static_cast<S>(conic.l11), r.l21 = static_cast<S>(conic.l21), r.l22 = static_cast<S>(conic.l22);
  r.opacity = static_cast<S>(opacity);
  r.log2_opacity = static_cast<S>(std::log2(std::max(opacity, kLeastOpacity)));
  return r;
}

Extent extent_of(const Conic& conic, double x, double y, double opacity, const TileGrid& grid,
                 const RenderSettings& settings, double epsilon) {
  const double log2_opacity = std::log2(std::max(opacity, kLeastOpacity));
  const ExtentRules rules = extent_rules(settings, epsilon);
  return detail::extent_of(conic, x, y, opacity, reach_of(conic, x, log2_opacity, rules), grid, rules);
}

/// What α is at a pixel of the image, in the tile that it lies in.
template <class S>
PixelAlpha<S> alpha_at(const SplatRecord<S>& record, const RenderSettings& settings, Index row, Index col) {
  const CompositeRules<S> rules{static_cast<S>(settings.alpha_cap), static_cast<S>(settings.alpha_min), 0, false, false,
                                static_cast<S>(settings.blur)};
  TileJob<S> job{};
  job.left = col / 16 * 16, job.top = row / 16 * 16;
  if constexpr (std::is_same_v<S, float>) {
    return block_pixel_alpha(16, record, rules, job.left, job.top, row - job.top, col - job.left);
  }
  return pixel_alpha(record, rules, job, row - job.top, col - job.left);
}

/// A projected Gaussian with its covariance, blur included.
struct Ellipse {
  std::array<double, 6> v;
  double x, y, opacity;
  double xx, xy, yy;

  /// 2 log(o/alpha_min): α ≥ alpha_min where dᵀ cov⁻¹ d is at most this.
  double squared_reach(const RenderSettings& settings) const { return 2 * std::log(opacity / settings.alpha_min); }
  /// dᵀ cov⁻¹ d at a pixel's centre.
  double squared_distance(Index row, Index col) const {
    const double dx = static_cast<double>(col) + 0.5 - x, dy = static_cast<double>(row) + 0.5 - y;
    return (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy);
  }
};

/// Anywhere, or with a pixel's centre just within the ellipse where it reaches farthest up, down, left or right.
Ellipse random_ellipse(RandomSequence& random, const TileGrid& grid, const RenderSettings& settings) {
  const double length = std::pow(10, random.uniform(-1, 1.5)), width = length * std::pow(10, random.uniform(-1.5, 0));
  Ellipse e{};
  e.v = needle(random, length, width);
  for (std::size_t k = 0; k < 3; ++k) {
    e.xx += e.v[k] * e.v[k], e.xy += e.v[k] * e.v[3 + k], e.yy += e.v[3 + k] * e.v[3 + k];
  }
  e.xx += settings.blur, e.yy += settings.blur;
  e.opacity = static_cast<float>(random.uniform(0.01, 1));
  e.x = random.uniform(-10, static_cast<double>(grid.width + 10));
  e.y = random.uniform(-10, static_cast<double>(grid.height + 10));
  const std::uint64_t kind = random.below(5);
  if (kind == 0) return e;
  const double col = static_cast<double>(random.below(static_cast<std::uint64_t>(grid.width))) + 0.5;
  const double row = static_cast<double>(random.below(static_cast<std::uint64_t>(grid.height))) + 0.5;
  const double within = 1 - std::pow(10, random.uniform(-9, -3)), side = kind % 2 == 0 ? within : -within;
  const double reach = side * std::sqrt(e.squared_reach(settings));
  const double root = std::sqrt(kind < 3 ? e.yy : e.xx);
  e.x = col - reach * (kind < 3 ? e.xy : e.xx) / root;
  e.y = row - reach * (kind < 3 ? e.yy : e.xy) / root;
  return e;
}

/// Blocks of every tile that entries name, of each row: [rows][tiles].
std::vector<std::uint32_t> listed_blocks(const std::vector<Extent>& extents, const TileGrid& grid) {
  Index bound = 0;
  std::vector<DepthKeyed> order;
  for (std::size_t n = 0; n < extents.size(); ++n) {
    bound += tiles_around(extents[n], grid);
    if (extents[n].row_begin < extents[n].row_end) order.push_back({0, static_cast<std::int32_t>(n)});
  }
  TileLists lists;
  lists.find(extents, grid, bound, bound);
  lists.deal(order, grid, 0);
  std::vector<std::uint32_t> blocks(extents.size() * static_cast<std::size_t>(grid.count()), 0);
  for (Index tile = 0; tile < grid.count(); ++tile) {
    for (Index at = lists.tile_begin[tile]; at < lists.tile_begin[tile + 1]; ++at)
      blocks[static_cast<std::size_t>(lists.entries[at].index * grid.count() + tile)] = lists.entries[at].blocks;
  }
  return blocks;
}

}  // namespace

TEST_CASE("a Gaussian without area has the antialias factor 0 and no gradient, and nothing without a blur [A7]") {
  const std::array<double, 6> flat = {1, 0, 0, 2, 0, 0};
  Conic conic;
  REQUIRE(conic_of(flat.data(), 0.3, conic));
  CHECK(blur_compensation(conic) == 0);
  std::array<double, 6> d{};
  blur_compensation_adjoint(flat.data(), 0.3, conic, 1, d.data());
  CHECK(d == std::array<double, 6>{});
  CHECK_FALSE(conic_of(flat.data(), 0, conic));
}

TEST_CASE("a factor that is left out of a tile has no pixel there that it would be drawn at [B7]", "[release]") {
  RandomSequence random(4, 2);
  const TileGrid grid = tile_grid(75, 50, 16);
  RenderSettings settings;
  Index left_out = 0, kept = 0, empty = 0;
  for (int i = 0; i < 12000; ++i) {
    settings.alpha_min = i % 3 == 0 ? 1e-5 : 1.0 / 255;
    const double length = std::pow(10, random.uniform(-1, 2)), width = length * std::pow(10, random.uniform(-3, 0));
    const auto v = needle(random, length, width);
    const double x = static_cast<float>(random.uniform(-40, 115)), y = static_cast<float>(random.uniform(-40, 90));
    const double opacity =
        static_cast<float>(i % 5 == 0 ? settings.alpha_min * random.uniform(0.9, 1.5) : random.uniform(0, 1));
    Conic conic;
    REQUIRE(conic_of(v.data(), 0.3, conic));
    const Extent extent = extent_of(conic, x, y, opacity, grid, settings, std::numeric_limits<float>::epsilon());
    std::vector<std::uint32_t> listed(static_cast<std::size_t>(grid.count()), 0);
    for_each_tile(extent, grid, [&](Index tile, std::uint32_t blocks) {
      REQUIRE(listed[static_cast<std::size_t>(tile)] == 0);
      listed[static_cast<std::size_t>(tile)] = blocks;
    });
    for (Index tile = 0; tile < grid.count(); ++tile) {
      const Index tile_row = tile / grid.cols, tile_col = tile % grid.cols;
      for (Index block = 0; block < 16; ++block) {
        bool drawn = false, drawn_in_rows = false;
        for (Index p = 0; p < 16; ++p) {
          const Index row = tile_row * 16 + block / 4 * 4 + p / 4, col = tile_col * 16 + block % 4 * 4 + p % 4;
          if (row >= grid.height || col >= grid.width) continue;
          const bool here = alpha_at(record_of<float>(conic, x, y, opacity), settings, row, col).drawn ||
                            alpha_at(record_of<double>(conic, x, y, opacity), settings, row, col).drawn;
          drawn = drawn || here;
          drawn_in_rows = drawn_in_rows || (here && row >= extent.row_begin && row < extent.row_end);
        }
        const bool is_listed = (listed[static_cast<std::size_t>(tile)] >> block & 1) != 0;
        REQUIRE(drawn == drawn_in_rows);
        if (drawn) REQUIRE(is_listed);
        is_listed ? (drawn ? ++kept : ++empty) : ++left_out;
      }
    }
  }
  CHECK(left_out > 50000);
  CHECK(static_cast<double>(empty) < 0.1 * static_cast<double>(kept));  // and the test is sharp
}

TEST_CASE("a pixel that a footprint only just reaches is in the lists [B7]") {
  RandomSequence random(8, 2);
  const RenderSettings settings;
  // Of renders in float, and in double, whose extents have less room for other rounding.
  for (const auto& [side, epsilon] : {std::pair{Index(8), 1.2e-7}, {Index(16), 1.2e-7}, {Index(16), 2.2e-16}}) {
    const TileGrid grid = tile_grid(150, 90, side);
    std::vector<Ellipse> ellipses;
    std::vector<Extent> extents;
    for (int i = 0; i < 8000; ++i) {
      const Ellipse& e = ellipses.emplace_back(random_ellipse(random, grid, settings));
      Conic conic;
      REQUIRE(conic_of(e.v.data(), settings.blur, conic));
      extents.push_back(extent_of(conic, e.x, e.y, e.opacity, grid, settings, epsilon));
    }
    const std::vector<std::uint32_t> listed = listed_blocks(extents, grid);
    std::vector<std::uint32_t> drawn(listed.size(), 0), plain(listed.size(), 0);
    const auto at = [&grid](std::size_t n, Index tile) {
      return n * static_cast<std::size_t>(grid.count()) + static_cast<std::size_t>(tile);
    };
    for (std::size_t n = 0; n < ellipses.size(); ++n) {
      const Ellipse& e = ellipses[n];
      const auto visit = [&](Index tile, std::uint32_t blocks) { plain[at(n, tile)] = blocks; };
      for_each_tile(extents[n], grid, visit);
      const double reach = e.squared_reach(settings);
      const double high = std::sqrt(reach * e.yy) + 2, wide = std::sqrt(reach * e.xx) + 2;
      const auto rows = pixels_within(e.y - high, e.y + high, grid.height);
      const auto cols = pixels_within(e.x - wide, e.x + wide, grid.width);
      for (Index row = rows.begin; row < rows.end; ++row) {
        for (Index col = cols.begin; col < cols.end; ++col) {
          if (e.squared_distance(row, col) > reach) continue;
          const Index block = row % side / kBlockSide * (side / kBlockSide) + col % side / kBlockSide;
          drawn[at(n, row / side * grid.cols + col / side)] |= 1u << block;
        }
      }
    }
    Index missed = 0, missed_plain = 0, needed = 0, beside = 0;
    for (std::size_t i = 0; i < drawn.size(); ++i) {
      missed += std::popcount(drawn[i] & ~listed[i]);
      missed_plain += std::popcount(drawn[i] & ~plain[i]);
      needed += std::popcount(drawn[i]);
      beside += std::popcount(listed[i] & ~drawn[i]);
    }
    INFO("tiles of " << side << " px, epsilon " << epsilon << ": " << needed << " blocks, " << beside
                     << " beside them");
    CHECK(missed == 0);
    CHECK(missed_plain == 0);
    CHECK(needed > 100000);
    CHECK(static_cast<double>(beside) < 0.1 * static_cast<double>(needed));  // and the lists are sharp
  }
}

TEST_CASE("depth keys are in the order of the depths [B9]") {
  const float depths[] = {-std::numeric_limits<float>::infinity(), -1, -1e-38f, 0, 1e-38f, 0.5f, 1, 1e30f,
                          std::numeric_limits<float>::infinity()};
  for (std::size_t i = 0; i + 1 < std::size(depths); ++i) {
    CHECK(depth_bits(depths[i]) < depth_bits(depths[i + 1]));
    CHECK(depth_bits(static_cast<double>(depths[i])) < depth_bits(static_cast<double>(depths[i + 1])));
  }
  CHECK(depth_bits(-0.0f) == depth_bits(0.0f));
  CHECK(depth_bits(-0.0) == depth_bits(0.0));
}

TEST_CASE("the sort by depth is stable [B8]") {
  RandomSequence random(5, 2);
  for (const bool floats : {false, true}) {
    for (const int kinds : {1, 3, 1000, 1 << 30}) {
      std::vector<DepthKeyed> keys, room(20000);
      for (std::int32_t i = 0; i < 20000; ++i) {
        const double z = kinds == 1 ? 2.5 : std::floor(random.uniform(0, kinds)) / 7 - 3;
        keys.push_back({floats ? depth_bits(static_cast<float>(z)) : depth_bits(z), i});
      }
      std::vector<DepthKeyed> expected = keys;
      std::stable_sort(expected.begin(), expected.end(),
                       [](const DepthKeyed& a, const DepthKeyed& b) { return a.key < b.key; });
      const auto sorted = sort_by_depth(keys, room);
      CHECK(std::equal(sorted.begin(), sorted.end(), expected.begin(), expected.end(),
                       [](const DepthKeyed& a, const DepthKeyed& b) { return a.key == b.key && a.index == b.index; }));
    }
  }
  std::vector<DepthKeyed> none;
  CHECK(sort_by_depth(none, none).empty());
}

TEST_CASE("more pairs than fit are refused before memory is taken [B10]") {
  const std::vector<Index> pairs = {1'000'000'000, 1'000'000'000, 1'000'000'000};
  CHECK_THROWS_WITH(total_pairs(pairs), Catch::Contains("more than 2147483647 (tile, Gaussian) pairs"));
  CHECK_THROWS_AS(total_pairs(pairs), UserError);
  CHECK(total_pairs(std::span(pairs).first(2)) == 2'000'000'000);
  CHECK_THROWS_WITH(check_pair_memory(2'000'000'000, 96e9, 12'000'000'000),
                    Catch::Contains("96.0 GB for 2000000000 (tile, Gaussian) pairs, allowed are 12.0 GB"));
  CHECK_THROWS_AS(check_pair_memory(1, 1001, 1000), UserError);
  CHECK_NOTHROW(check_pair_memory(1, 1000, 1000));
  CHECK(pair_memory_limit() > 100'000'000);
}

TEST_CASE("tile lists hold every pair once, in depth order, on any number of threads", "[parallel]") {
  RandomSequence random(6, 2);
  const TileGrid grid = tile_grid(150, 90, 16);
  RenderSettings settings;
  std::vector<Extent> extents;
  for (int i = 0; i < 5000; ++i) {
    const auto v = needle(random, random.uniform(0.1, 10), random.uniform(0.1, 3));
    Conic conic;
    REQUIRE(conic_of(v.data(), 0.3, conic));
    extents.push_back(extent_of(conic, random.uniform(-10, 160), random.uniform(-10, 100), random.uniform(0, 1), grid,
                                settings, 1e-7));
  }
  for (std::size_t n = 0; n < extents.size(); n += 7) extents[n] = {};
  // In depth order: every row but each seventh, backwards.
  std::vector<DepthKeyed> order;
  for (std::int32_t n = 4999; n >= 0; --n) {
    if (n % 7 != 0) order.push_back({0, n});
  }
  std::vector<std::vector<TileEntry>> expected(static_cast<std::size_t>(grid.count()));
  std::vector<Index> groups(static_cast<std::size_t>(grid.count()), 0);
  std::vector<std::uint32_t> next_slot(extents.size() + 1, 0);  // slots are in the order of rows
  for (std::size_t n = 0; n < extents.size(); ++n) {
    next_slot[n + 1] = next_slot[n];
    for_each_tile(extents[n], grid, [&](Index, std::uint32_t) { ++next_slot[n + 1]; });
  }
  const std::uint32_t slot = next_slot.back();
  for (const DepthKeyed& d : order) {
    for_each_tile(extents[static_cast<std::size_t>(d.index)], grid, [&](Index tile, std::uint32_t blocks) {
      expected[static_cast<std::size_t>(tile)].push_back(
          {d.index, next_slot[static_cast<std::size_t>(d.index)]++, blocks});
      groups[static_cast<std::size_t>(tile)] += std::popcount(blocks);
    });
  }
  Index bound = 0;
  for (const Extent& extent : extents) bound += tiles_around(extent, grid);
  REQUIRE(bound > slot);
  for (const auto& [threads, most] :
       {std::pair(1, bound), {2, bound}, {8, bound}, {1, Index(slot)}, {8, Index(slot)}}) {
    TileLists lists;
    with_threads(threads, [&] {
      CHECK(lists.find(extents, grid, most, bound) == slot);
      lists.deal(order, grid, 0);
    });
    REQUIRE(lists.pairs() == slot);
    for (Index tile = 0; tile < grid.count(); ++tile) {
      const auto& of_tile = expected[static_cast<std::size_t>(tile)];
      REQUIRE(lists.tile_begin[tile + 1] - lists.tile_begin[tile] == static_cast<Index>(of_tile.size()));
      CHECK(lists.tile_groups[tile] == groups[static_cast<std::size_t>(tile)]);
      for (std::size_t i = 0; i < of_tile.size(); ++i) {
        const TileEntry entry = lists.entries[lists.tile_begin[tile] + static_cast<Index>(i)];
        CHECK(entry.index == of_tile[i].index);
        CHECK(entry.slot == of_tile[i].slot);
        CHECK(entry.blocks == of_tile[i].blocks);
        CHECK(lists.tile_of(entry.slot) == tile);
        CHECK((entry.slot >= lists.slots[entry.index].begin && entry.slot < lists.slots[entry.index].end));
      }
    }
    for (Index n = 0; n < 5000; n += 7) CHECK(lists.slots[n].begin == lists.slots[n].end);
  }
  TileLists lists;
  CHECK(lists.find(extents, grid, slot - 1, bound) == slot);  // counted, though not kept
  TileLists none;
  none.find({}, grid, 0, 0);
  const Index pair_bytes = lists.capacity_bytes() - none.capacity_bytes() - std::ssize(extents) * 8;
  CHECK(pair_bytes < 10000);  // no memory is taken for them [B10]
}

}  // namespace tiles_test
