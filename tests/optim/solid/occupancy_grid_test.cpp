#include "optim/solid/occupancy_grid.h"

#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/npz.h"
#include "core/parallel.h"
#include "core/random.h"
#include "tests/optim/solid/meshes.h"
#include "tests/support/measures.h"
#include "tests/support/temporary_folder.h"

namespace occupancy_grid_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

using Point = Vector3<double>;

std::size_t at(const std::array<Index, 3>& cells, Index i, Index j, Index k) {
  return static_cast<std::size_t>((i * cells[1] + j) * cells[2] + k);
}

/// Every pair of voxels.
std::vector<std::int32_t> slow_distances(const std::vector<std::uint8_t>& set, const std::array<Index, 3>& cells) {
  std::vector<std::int32_t> squared(set.size(), std::numeric_limits<std::int32_t>::max());
  const auto place = [&](std::size_t n) {
    const auto i = static_cast<Index>(n);
    return std::array<Index, 3>{i / (cells[1] * cells[2]), i / cells[2] % cells[1], i % cells[2]};
  };
  for (std::size_t p = 0; p < set.size(); ++p) {
    for (std::size_t q = 0; q < set.size(); ++q) {
      if (set[q] == 0) continue;
      Index sum = 0;
      for (std::size_t a = 0; a < 3; ++a) sum += (place(p)[a] - place(q)[a]) * (place(p)[a] - place(q)[a]);
      squared[p] = std::min(squared[p], static_cast<std::int32_t>(sum));
    }
  }
  return squared;
}

OccupancyGrid grid_of_box(const std::array<Index, 3>& cells, double voxel, const Point& origin,
                          const std::array<Index, 3>& low, const std::array<Index, 3>& high) {
  OccupancyGrid grid;
  grid.cells = cells;
  grid.voxel_size = voxel;
  grid.origin = origin;
  grid.occupied.assign(static_cast<std::size_t>(cells[0] * cells[1] * cells[2]), 0);
  for (Index i = low[0]; i < high[0]; ++i) {
    for (Index j = low[1]; j < high[1]; ++j) {
      for (Index k = low[2]; k < high[2]; ++k) grid.occupied[at(cells, i, j, k)] = 1;
    }
  }
  return grid;
}

Bytes archive(const std::vector<std::int64_t>& shape, const std::vector<std::uint8_t>& numbers,
              const std::vector<double>& origin, const std::vector<double>& voxel, const std::string& up = "") {
  NpzWriter file;
  file.add<std::uint8_t>("occupancy", std::span(shape), std::span<const std::uint8_t>(numbers));
  file.add<double>("origin", {std::ssize(origin)}, origin);
  file.add<double>("voxel_size", {std::ssize(voxel)}, voxel);
  if (!up.empty()) file.add_text("up", up);
  return file.encode();
}

std::string fault(const Bytes& file) {
  try {
    decode_occupancy(file, "g.npz");
  } catch (const DataError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("the distance transform is exact") {
  RandomSequence random(7);
  for (const std::array<Index, 3>& cells :
       {std::array<Index, 3>{9, 7, 11}, {1, 1, 40}, {1, 25, 1}, {13, 1, 6}, {2, 3, 2}, {16, 16, 4}}) {
    for (const double share : {0.002, 0.05, 0.5, 0.98}) {
      std::vector<std::uint8_t> set(static_cast<std::size_t>(cells[0] * cells[1] * cells[2]));
      for (std::uint8_t& voxel : set) voxel = random.uniform(0, 1) < share ? 1 : 0;
      set[set.size() / 3] = 1;
      INFO(cells[0] << "x" << cells[1] << "x" << cells[2] << ", " << share);
      CHECK(squared_voxel_distances(set, cells) == slow_distances(set, cells));
    }
  }
  CHECK_THROWS_AS(squared_voxel_distances({0, 0}, {1, 1, 2}), InternalError);
}

TEST_CASE("the distance transform has the same bits for any number of threads") {
  RandomSequence random(8);
  const std::array<Index, 3> cells = {40, 30, 50};
  std::vector<std::uint8_t> set(60000);
  for (std::uint8_t& voxel : set) voxel = random.uniform(0, 1) < 0.01 ? 1 : 0;
  const std::vector<std::int32_t> expected = squared_voxel_distances(set, cells);
  for (const int threads : {1, 3, 8})
    with_threads(threads, [&] { CHECK(squared_voxel_distances(set, cells) == expected); });
}

TEST_CASE("the distance of a box of voxels is that of the box, and of its faces exactly") {
  const double h = 0.05;
  const Point origin(-1, -0.5, 0);
  const OccupancyGrid grid = grid_of_box({40, 30, 30}, h, origin, {10, 8, 6}, {24, 20, 18});
  const OccupancyDistance distance(grid);
  const Point low = origin + h * Point(10, 8, 6), high = origin + h * Point(24, 20, 18);
  CHECK(distance.at({-0.5 + 0.35, 0.1, 1.2}) == Approx(0.3).margin(1e-6));  // over its top at 0.9
  CHECK(distance.at({-0.5 + 0.35, 0.1, 0.85}) == Approx(-0.05).margin(1e-6));
  CHECK(distance.at({-0.5 + 0.35, 0.1, 0.9}) == Approx(0).margin(1e-6));
  RandomSequence random(9);
  double farthest = 0;
  for (int i = 0; i < 2000; ++i) {
    const Point place(random.uniform(-0.95, 0.95), random.uniform(-0.45, 0.95), random.uniform(0.05, 1.45));
    farthest = larger(farthest, std::fabs(distance.at(place) - box_distance(low, high, place)));
  }
  CHECK(farthest < h);
  CHECK(std::isnan(distance.at({-1.01, 0, 0.5})));
  CHECK(std::isnan(distance.at({0, 0, 1.6})));
  CHECK(std::isfinite(distance.at({-1, -0.5, 0})));
}

TEST_CASE("a grid with y up is turned") {
  // A floor of two layers at the bottom, 0.2 m thick, and a post in the corner of small x and large z.
  OccupancyGrid grid = grid_of_box({10, 12, 8}, 0.1, {0, 0, 0}, {0, 0, 0}, {10, 2, 8});
  for (Index j = 2; j < 12; ++j) grid.occupied[at(grid.cells, 0, j, 7)] = 1;
  grid.is_y_up = true;
  const OccupancyDistance distance(grid);
  CHECK(distance.at({0.75, -0.25, 0.5}) == Approx(0.3).margin(1e-6));
  CHECK(distance.at({0.75, -0.25, 0.15}) == Approx(-0.05).margin(1e-6));
  CHECK(distance.at({0.05, -0.75, 0.8}) < 0);
  CHECK(std::isnan(distance.at({0.75, 0.25, 0.5})));
}

TEST_CASE("a grid that claims too much is refused before memory is taken for it") {
  // 3 MB of noise that claim to unpack to 2 GiB and 17 MB: the size stands in the archive's directory.
  RandomSequence random(10);
  std::vector<std::uint8_t> noise(3000000);
  for (std::uint8_t& voxel : noise) voxel = static_cast<std::uint8_t>(random.uniform(0, 256));
  NpzWriter file;
  file.add<std::uint8_t>("occupancy", {100, 100, 300}, noise);
  Bytes bytes = file.encode(NpzPacking::deflated);
  const std::array<std::uint8_t, 4> size = {0x40, 0xC7, 0x2D, 0x00}, claim = {0x00, 0x00, 0x10, 0x81};  // with a header
  const auto at = std::find_end(bytes.begin(), bytes.end(), size.begin(), size.end());
  REQUIRE(at != bytes.end());
  std::copy(claim.begin(), claim.end(), at);
  CHECK(fault(bytes) == "g.npz: array 'occupancy': brings the arrays to 2165309440 bytes; at most 2148532224 are read");
}

TEST_CASE("occupancy files are read, and what is wrong with them is told") {
  const TemporaryFolder here;
  const std::vector<std::uint8_t> numbers = {1, 0, 0, 1, 0, 0};
  const Bytes good = archive({1, 2, 3}, numbers, {-3, 0, -4}, {0.02}, "y");
  here.write("g.npz", std::string(good.begin(), good.end()));
  const OccupancyGrid grid = read_occupancy("g.npz");
  CHECK(grid.cells == std::array<Index, 3>{1, 2, 3});
  CHECK(grid.occupied == numbers);
  CHECK(grid.origin == Point(-3, 0, -4));
  CHECK(grid.voxel_size == 0.02);
  CHECK(grid.is_y_up);
  CHECK_FALSE(decode_occupancy(archive({1, 2, 3}, numbers, {0, 0, 0}, {0.1, 0.1, 0.1}), "g").is_y_up);
  CHECK(fault(archive({1, 2, 3}, numbers, {0, 0, 0}, {0.1, 0.1, 0.2})) ==
        "g.npz: array 'voxel_size': has shape [3]; allowed: one number, or three that are equal: voxels are cubes");
  CHECK(fault(archive({1, 2, 3}, numbers, {0, 0, 0}, {0})) ==
        "g.npz: array 'voxel_size': is 0 metres; allowed: 1e-04 to 10");
  CHECK(fault(archive({1, 2, 3}, numbers, {0, 1e7, 0}, {0.1})) ==
        "g.npz: array 'origin': has 10000000; allowed: -1e6 to 1e6 metres");
  CHECK(fault(archive({1, 2, 3}, {1, 0, 2, 0, 0, 0}, {0, 0, 0}, {0.1})) ==
        "g.npz: array 'occupancy': element 2 is 2; allowed: 0 (free) and 1 (occupied)");
  CHECK(fault(archive({1, 2, 3}, {1, 1, 1, 1, 1, 1}, {0, 0, 0}, {0.1})) ==
        "g.npz: array 'occupancy': every voxel is occupied, and there is no surface to be near to");
  CHECK_THAT(fault(archive({6}, numbers, {0, 0, 0}, {0.1})), Contains("has shape [6]; [*,*,*] is needed"));
  CHECK_THAT(fault(archive({0, 2, 3}, {}, {0, 0, 0}, {0.1})), Contains("has shape [0,2,3]; allowed: 1 to 16384"));
  CHECK(fault(archive({1, 2, 3}, numbers, {0, 0, 0}, {0.1}, "x")) == "g.npz: array 'up': is \"x\"; allowed: y, z");
}

}  // namespace occupancy_grid_test
