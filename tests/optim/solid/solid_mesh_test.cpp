// Grids of what is solid: cleaned up, as occupancy, and their closed surfaces.
#include "optim/solid/solid_mesh.h"

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/file.h"
#include "core/parallel.h"
#include "optim/solid/mesh_distance.h"
#include "optim/solid/mesh_topology.h"
#include "stress/scratch_folder.h"

namespace solid_mesh_test {

using namespace hsi4d;

namespace {

using Distance = std::function<double(const Vector3<double>&)>;

/// A grid over [0, 1]³ and a block of the outside at each end, with the distances of a function.
SolidGrid grid_of(const Distance& distance, Index across, bool is_outside_free) {
  SolidGrid grid;
  grid.voxel = 1.0 / static_cast<double>(8 * across);
  grid.origin = Vector3<double>::Constant(-8 * grid.voxel);
  const auto blocks = static_cast<std::int32_t>(across + 2);
  grid.blocks = {blocks, blocks, blocks};
  grid.is_outside_free = is_outside_free;
  grid.block.assign(static_cast<std::size_t>(grid.block_count()),
                    is_outside_free ? SolidGrid::kFree : SolidGrid::kSolid);
  for (Index b = 0; b < grid.block_count(); ++b) {
    const NodePlace place = grid.place_of_block(b);
    bool is_inside = true;
    for (const std::int32_t i : place) is_inside &= i > 0 && i + 1 < blocks;
    if (!is_inside) continue;
    SolidGrid::Values values;
    bool free = true, solid = true;
    for (std::int32_t n = 0; n < kSolidBlockNodes; ++n) {
      const NodePlace node = {8 * place[0] + n / 64, 8 * place[1] + n / 8 % 8, 8 * place[2] + n % 8};
      const double voxels = distance(grid.place_of_node(node)) / grid.voxel;
      values[static_cast<std::size_t>(n)] = static_cast<float>(std::clamp(voxels, -grid.truncation, grid.truncation));
      free &= voxels >= grid.truncation;
      solid &= voxels <= -grid.truncation;
    }
    grid.block[static_cast<std::size_t>(b)] = free ? SolidGrid::kFree : SolidGrid::kSolid;
    if (free || solid) continue;
    grid.block[static_cast<std::size_t>(b)] = static_cast<std::int32_t>(grid.values.size());
    grid.values.push_back(values);
  }
  return grid;
}

Distance ball(const Vector3<double>& center, double radius) {
  return [=](const Vector3<double>& x) { return Vector3<double>(x - center).norm() - radius; };
}

Distance ring(double large, double small) {
  return [=](const Vector3<double>& x) {
    const Vector3<double> p = x - Vector3<double>::Constant(0.5);
    return std::hypot(std::hypot(p[0], p[1]) - large, p[2]) - small;
  };
}

Distance both(const Distance& a, const Distance& b) {
  return [=](const Vector3<double>& x) { return std::min(a(x), b(x)); };
}

void check_closed(const TriangleMesh& mesh) {
  CHECK(bad_vertices(mesh).empty());
  CHECK(count_edges(mesh).open == 0);
}

}  // namespace

TEST_CASE("a ball, a ring and a hollow have closed surfaces of their size, turned to what is free") {
  for (const double adaptivity : {0.0, 0.3}) {
    CAPTURE(adaptivity);
    SolidGrid grid = grid_of(ball({0.5, 0.5, 0.5}, 0.3), 6, true);
    const TriangleMesh mesh = surface_of(grid, adaptivity);
    check_closed(mesh);
    CHECK(genus(mesh) == 0);
    CHECK(signed_volume(mesh) == Approx(4.0 / 3 * std::numbers::pi * 0.027).epsilon(0.01 + 0.3 * adaptivity));
    for (const Vector3<double>& v : mesh.vertices)
      CHECK(std::abs(Vector3<double>(v - Vector3<double>::Constant(0.5)).norm() - 0.3) < 0.003 + 0.01 * adaptivity);

    SolidGrid of_ring = grid_of(ring(0.3, 0.1), 6, true);
    const TriangleMesh ring_mesh = surface_of(of_ring, adaptivity);
    check_closed(ring_mesh);
    CHECK(genus(ring_mesh) == 1);

    const Distance inside = ball({0.5, 0.5, 0.5}, 0.3);
    SolidGrid hollow = grid_of([&](const Vector3<double>& x) { return -inside(x); }, 6, false);
    const TriangleMesh hollow_mesh = surface_of(hollow, adaptivity);
    check_closed(hollow_mesh);
    CHECK(signed_volume(hollow_mesh) == Approx(-signed_volume(mesh)).epsilon(0.01));
    const MeshDistance distance(hollow_mesh, 0.1);
    CHECK(distance.at({0.5, 0.5, 0.5}) > 0.25);
    CHECK(distance.at({0.5, 0.5, 0.9}) < -0.05);
  }
}

TEST_CASE("free space that reaches the end of a grid whose outside is solid is closed there") {
  SolidGrid grid = grid_of([](const Vector3<double>& x) { return x[2] - 0.5; }, 4, false);
  const TriangleMesh mesh = surface_of(grid, 0);
  check_closed(mesh);
  CHECK(signed_volume(mesh) == Approx(-0.5).epsilon(0.08));
}

TEST_CASE("solids that touch in lines and points are mended to a manifold") {
  std::mt19937 random(1);
  for (int round = 0; round < 6; ++round) {
    SolidGrid grid = grid_of(ball({0.5, 0.5, 0.5}, 0.4), 2, true);
    for (Index b = 0; b < grid.block_count(); ++b) {
      if (grid.block[static_cast<std::size_t>(b)] != SolidGrid::kFree) with_values(grid, b);
    }
    for (SolidGrid::Values& values : grid.values) {
      for (float& value : values) value = random() % 2 == 0 ? 1.0F : -1.0F;
    }
    const TriangleMesh mesh = surface_of(grid, 0);
    check_closed(mesh);
    for (const TriangleMesh& part : connected_parts(mesh)) CHECK(genus(part) >= 0);
  }
}

TEST_CASE("pockets that nobody reaches are filled, specks are removed") {
  const Distance far = ball({0.2, 0.2, 0.2}, 0.05);
  SolidGrid specked = grid_of(both(ball({0.6, 0.6, 0.6}, 0.3), far), 6, true);
  SolidGrid kept = specked;
  CleanUp result = clean_up(specked, {}, 2000);
  CHECK(result.removed_specks == 1);
  CHECK(result.removed_nodes > 40);
  CHECK(result.closed_pockets == 0);
  CHECK(specked.at(Vector3<double>(0.2, 0.2, 0.2)) > 0);
  CHECK(connected_parts(surface_of(specked, 0)).size() == 1);
  CHECK(clean_up(kept, {}, 20).removed_specks == 0);
  CHECK(connected_parts(surface_of(kept, 0)).size() == 2);

  // A room with a second one that has no door.
  const Distance rooms = both(ball({0.3, 0.5, 0.5}, 0.2), ball({0.8, 0.5, 0.5}, 0.12));
  SolidGrid hollow = grid_of([&](const Vector3<double>& x) { return -rooms(x); }, 6, false);
  const std::vector<Vector3<double>> seeds = {{0.3, 0.5, 0.5}, {0.01, 0.01, 0.01}, {70, 0, 0}};
  result = clean_up(hollow, seeds, 0);
  CHECK(result.closed_pockets == 1);
  CHECK(result.closed_nodes > 300);
  CHECK(hollow.at(Vector3<double>(0.8, 0.5, 0.5)) < 0);
  CHECK(hollow.at(Vector3<double>(0.3, 0.5, 0.5)) > 0);
  CHECK(connected_parts(surface_of(hollow, 0)).size() == 1);
}

TEST_CASE("occupancy is what is solid in the middle of voxels, on either kind of axes") {
  const SolidGrid grid = grid_of(ball({0.5, 0.4, 0.6}, 0.3), 6, true);
  for (const bool is_y_up : {false, true}) {
    const OccupancyGrid occupancy = occupancy_of(grid, 0.05, is_y_up);
    CHECK(occupancy.cells == std::array<Index, 3>{20, 20, 20});
    const OccupancyDistance distance(occupancy);
    Index wrong = 0;
    for (int n = 0; n < 1000; ++n) {
      const Vector3<double> at(0.05 + 0.9 * (n % 10) / 9.0, 0.05 + 0.9 * (n / 10 % 10) / 9.0,
                               0.05 + 0.9 * (n / 100) / 9.0);
      const double truth = Vector3<double>(at - Vector3<double>(0.5, 0.4, 0.6)).norm() - 0.3;
      if (std::abs(truth) > 0.06) wrong += (distance.at(at) < 0) == (truth < 0) ? 0 : 1;
    }
    CHECK(wrong == 0);
  }
  CHECK_THROWS_WITH(occupancy_of(grid, 0.001, false), Catch::Contains("0.001 m are too small"));
}

TEST_CASE("an occupancy grid that is written is read again") {
  const ScratchFolder folder;
  const std::string file = folder.path() + "/grid.npz";
  const OccupancyGrid grid = occupancy_of(grid_of(ball({0.5, 0.4, 0.6}, 0.3), 3, true), 0.07, true);
  write_occupancy(file, grid);
  const OccupancyGrid again = read_occupancy(file);
  CHECK(again.cells == grid.cells);
  CHECK(again.origin == grid.origin);
  CHECK(again.voxel_size == grid.voxel_size);
  CHECK(again.is_y_up);
  CHECK(again.occupied == grid.occupied);
}

TEST_CASE("a level set is written whole or not at all") {
  const ScratchFolder folder;
  const std::string file = folder.path() + "/distances.vdb";
  SolidGrid grid = grid_of(ball({0.5, 0.5, 0.5}, 0.3), 4, true);
  add_values_at_borders(grid);
  write_distances(file, grid, 4);
  const Bytes bytes = read_file(file);
  REQUIRE(bytes.size() > 10000);
  CHECK(std::string(bytes.begin(), bytes.begin() + 4) == " BDV");  // the magic number of OpenVDB
  CHECK_THROWS_AS(write_distances(folder.path() + "/distances.vdb/below.vdb", grid, 4), UserError);
  CHECK(read_file(file) == bytes);
}

TEST_CASE("without a surface there is no mesh") {
  SolidGrid grid = grid_of([](const Vector3<double>&) { return 1.0; }, 2, true);
  CHECK_THROWS_WITH(surface_of(grid, 0), Catch::Contains("no surface"));
}

}  // namespace solid_mesh_test
