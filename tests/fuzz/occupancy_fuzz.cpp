// Occupancy grids. What is taken has a distance everywhere in it.
#include <cmath>

#include "core/check.h"
#include "core/npz.h"
#include "optim/solid/occupancy_grid.h"
#include "tests/fuzz/archive_list.h"

namespace hsi4d::fuzz::occupancy_fuzz {

namespace {

Bytes small_grid() {
  NpzWriter file;
  file.add<std::uint8_t>("occupancy", {2, 3, 2}, {1, 0, 0, 1, 0, 0, 1, 1, 0, 0, 0, 0});
  file.add<double>("origin", {3}, {-1, 0, 0.5});
  file.add_scalar("voxel_size", 0.25);
  file.add_text("up", "y");
  return file.encode();
}

}  // namespace

std::vector<Bytes> corpus() { return {list_of(small_grid()), small_grid()}; }

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    const OccupancyGrid grid = decode_occupancy(archive_of(file), "fuzz.npz");
    if (grid.occupied.size() > 4096) return;
    const OccupancyDistance distance(grid);
    const Vector3<double> own = grid.origin + Vector3<double>::Constant(0.5 * grid.voxel_size);
    const Vector3<double> place = grid.is_y_up ? Vector3<double>(own[0], -own[2], own[1]) : own;
    HSI4D_CHECK(std::isfinite(distance.at(place)), "the first voxel has no distance");
  });
}

const Target target("occupancy", corpus, accepts);

}  // namespace hsi4d::fuzz::occupancy_fuzz
