#include "optim/solid/occupancy_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"
#include "core/npz.h"
#include "core/parallel.h"
#include "core/text.h"

namespace hsi4d {
namespace {

constexpr double kSmallestVoxel = 1e-4, kLargestVoxel = 10, kFarthest = 1e6;  // metres
constexpr std::int32_t kNone = std::numeric_limits<std::int32_t>::max();      // no voxel of the set in this row yet
constexpr Index kMostAlong = 16384;                                           // voxels: 3 n² stays below 2³¹
constexpr Index kRowGrain = 64;                                               // rows
constexpr std::int64_t kMostBytes = 8 * kMostVoxels + (1 << 20);              // of a file's arrays: doubles at most

// ---- Reading ----

std::array<Index, 3> cells_of(const NpyArray& array) {
  const auto& shape = array.require_shape({-1, -1, -1}).shape();
  Index voxels = 1;
  for (const std::int64_t count : shape) {
    if (count < 1 || count > kMostAlong || (voxels *= count) > kMostVoxels)
      throw DataError(array.source() + ": has shape " + shape_text(shape) + "; allowed: 1 to " +
                      std::to_string(kMostAlong) + " voxels along each axis, and " + std::to_string(kMostVoxels) +
                      " together");
  }
  return {shape[0], shape[1], shape[2]};
}

std::vector<std::uint8_t> occupied_of(const NpyArray& array) {
  std::vector<std::uint8_t> occupied = array.as<std::uint8_t>();
  const auto other = std::find_if(occupied.begin(), occupied.end(), [](std::uint8_t value) { return value > 1; });
  if (other != occupied.end())
    throw DataError(array.source() + ": element " + std::to_string(other - occupied.begin()) + " is " +
                    std::to_string(*other) + "; allowed: 0 (free) and 1 (occupied)");
  const bool has_solid = std::find(occupied.begin(), occupied.end(), 1) != occupied.end();
  if (!has_solid || std::find(occupied.begin(), occupied.end(), 0) == occupied.end())
    throw DataError(array.source() + ": every voxel is " + (has_solid ? "occupied" : "free") +
                    ", and there is no surface to be near to");
  return occupied;
}

double voxel_size_of(const NpyArray& array) {
  const std::vector<double> sizes = array.as<double>();
  const bool is_cube = sizes.size() == 1 || (sizes.size() == 3 && sizes[0] == sizes[1] && sizes[0] == sizes[2]);
  if (!is_cube)
    throw DataError(array.source() + ": has shape " + shape_text(array.shape()) +
                    "; allowed: one number, or three that are equal: voxels are cubes");
  if (!(sizes[0] >= kSmallestVoxel && sizes[0] <= kLargestVoxel))
    throw DataError(array.source() + ": is " + number_text(sizes[0]) +
                    " metres; allowed: " + number_text(kSmallestVoxel) + " to " + number_text(kLargestVoxel));
  return sizes[0];
}

Vector3<double> origin_of(const NpyArray& array) {
  const std::vector<double> x = array.require_shape({3}).as<double>();
  for (const double number : x) {
    if (!(std::fabs(number) <= kFarthest))
      throw DataError(array.source() + ": has " + number_text(number) + "; allowed: -1e6 to 1e6 metres");
  }
  return {x[0], x[1], x[2]};
}

bool is_y_up(const Npz& file) {
  if (!file.has("up")) return false;
  const std::string up = file.array("up").text();
  if (up != "y" && up != "z")
    throw DataError(file.array("up").source() + ": is \"" + with_escapes(up) + "\"; allowed: y, z");
  return up == "y";
}

OccupancyGrid grid_of(const Npz& file) {
  OccupancyGrid grid;
  const NpyArray& array = file.array("occupancy");
  grid.cells = cells_of(array);
  grid.occupied = occupied_of(array);
  grid.origin = origin_of(file.array("origin"));
  grid.voxel_size = voxel_size_of(file.array("voxel_size"));
  grid.is_y_up = is_y_up(file);
  return grid;
}

// ---- Distances ----

/// Working memory of one row.
struct Envelope {
  std::vector<std::int64_t> values;  // of the row, before
  std::vector<Index> places;         // of the parabolas of the lower envelope
  std::vector<double> from;          // where each begins to be the lowest
};

/// Replaces f of a row by min_q (f(q) + (p − q)²), the lower envelope of parabolas. Their crossings are fractions of
/// integers below 2³², which no rounding moves over a whole number.
/// @param row  first element, each `stride` after the other
void transform_row(std::int32_t* row, Index count, Index stride, Envelope& envelope) {
  envelope.places.clear();
  envelope.from.clear();
  envelope.values.resize(static_cast<std::size_t>(count));
  const auto value = [&envelope](Index q) { return envelope.values[static_cast<std::size_t>(q)] + q * q; };
  for (Index q = 0; q < count; ++q) {
    envelope.values[static_cast<std::size_t>(q)] = row[q * stride];
    if (row[q * stride] == kNone) continue;
    double crossing = -std::numeric_limits<double>::infinity();
    while (!envelope.places.empty()) {
      const Index v = envelope.places.back();
      crossing = static_cast<double>(value(q) - value(v)) / static_cast<double>(2 * (q - v));
      if (crossing > envelope.from.back()) break;
      envelope.places.pop_back();
      envelope.from.pop_back();
      crossing = -std::numeric_limits<double>::infinity();
    }
    envelope.places.push_back(q);
    envelope.from.push_back(crossing);
  }
  if (envelope.places.empty()) return;
  std::size_t k = 0;
  for (Index p = 0; p < count; ++p) {
    while (k + 1 < envelope.places.size() && envelope.from[k + 1] < static_cast<double>(p)) ++k;
    const Index q = envelope.places[k];
    row[p * stride] = static_cast<std::int32_t>(envelope.values[static_cast<std::size_t>(q)] + (p - q) * (p - q));
  }
}

/// The first element of row `number` along an axis.
Index row_begin(Index number, int axis, const std::array<Index, 3>& cells) {
  if (axis == 2) return number * cells[2];
  if (axis == 1) return number / cells[2] * cells[1] * cells[2] + number % cells[2];
  return number;
}

double signed_distance(std::int32_t squared, bool is_solid, double voxel_size) {
  const double distance = voxel_size * (std::sqrt(static_cast<double>(squared)) - 0.5);
  return is_solid ? -distance : distance;
}

}  // namespace

OccupancyGrid read_occupancy(const std::string& path) { return grid_of(Npz::read(path, kMostBytes)); }

OccupancyGrid decode_occupancy(std::span<const std::uint8_t> file, const std::string& name) {
  return grid_of(Npz::decode(file, name, kMostBytes));
}

void write_occupancy(const std::string& path, const OccupancyGrid& grid) {
  HSI4D_CHECK_EQ(std::ssize(grid.occupied), grid.cells[0] * grid.cells[1] * grid.cells[2]);
  NpzWriter file;
  file.add("occupancy", {grid.cells[0], grid.cells[1], grid.cells[2]}, grid.occupied);
  file.add("origin", {3}, std::vector<double>(grid.origin.data(), grid.origin.data() + 3));
  file.add_scalar("voxel_size", grid.voxel_size);
  file.add_text("up", grid.is_y_up ? "y" : "z");
  file.write(path, NpzPacking::deflated);
}

std::vector<std::int32_t> squared_voxel_distances(const std::vector<std::uint8_t>& set,
                                                  const std::array<Index, 3>& cells) {
  const Index voxels = cells[0] * cells[1] * cells[2];
  HSI4D_CHECK_EQ(std::ssize(set), voxels);
  HSI4D_CHECK(std::find(set.begin(), set.end(), 1) != set.end(), "the set of voxels is empty");
  std::vector<std::int32_t> squared(set.size());
  for (std::size_t i = 0; i < set.size(); ++i) squared[i] = set[i] == 1 ? 0 : kNone;
  const std::array<Index, 3> strides = {cells[1] * cells[2], cells[2], 1};
  for (int axis = 2; axis >= 0; --axis) {
    const auto a = static_cast<std::size_t>(axis);
    parallel_for(voxels / cells[a], kRowGrain, [&](Index begin, Index end) {
      Envelope envelope;
      for (Index row = begin; row < end; ++row)
        transform_row(squared.data() + row_begin(row, axis, cells), cells[a], strides[a], envelope);
    });
  }
  return squared;
}

OccupancyDistance::OccupancyDistance(const OccupancyGrid& grid)
    : cells_(grid.cells), origin_(grid.origin), voxel_size_(grid.voxel_size), is_y_up_(grid.is_y_up) {
  nodes_.resize(grid.occupied.size());
  std::vector<std::uint8_t> set = grid.occupied;
  for (const bool is_solid : {false, true}) {  // the free voxels by the solid ones, and the other way round
    const std::vector<std::int32_t> squared = squared_voxel_distances(set, cells_);
    for (std::size_t i = 0; i < set.size(); ++i) {
      if ((grid.occupied[i] == 1) == is_solid)
        nodes_[i] = static_cast<float>(signed_distance(squared[i], is_solid, voxel_size_));
      set[i] ^= 1U;
    }
  }
}

double OccupancyDistance::node(Index i, Index j, Index k) const {
  return static_cast<double>(nodes_[static_cast<std::size_t>((i * cells_[1] + j) * cells_[2] + k)]);
}

double OccupancyDistance::at(const Vector3<double>& point) const {
  // z up from y up is (x, y, z) → (x, −z, y).
  const Vector3<double> own = is_y_up_ ? Vector3<double>(point[0], point[2], -point[1]) : point;
  std::array<Index, 3> low{}, high{};
  std::array<double, 3> share{};
  for (int a = 0; a < 3; ++a) {
    const auto axis = static_cast<std::size_t>(a);
    const double place = (own[a] - origin_[a]) / voxel_size_;
    if (!(place >= 0 && place <= static_cast<double>(cells_[axis]))) return std::numeric_limits<double>::quiet_NaN();
    const double centred = std::clamp(place - 0.5, 0.0, static_cast<double>(cells_[axis] - 1));
    low[axis] = static_cast<Index>(centred);
    high[axis] = std::min(low[axis] + 1, cells_[axis] - 1);
    share[axis] = centred - static_cast<double>(low[axis]);
  }
  double sum = 0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    double weight = 1;
    std::array<Index, 3> at{};
    for (std::size_t a = 0; a < 3; ++a) {
      const bool is_high = (corner >> a & 1U) != 0;
      weight *= is_high ? share[a] : 1 - share[a];
      at[a] = is_high ? high[a] : low[a];
    }
    if (weight > 0) sum += weight * node(at[0], at[1], at[2]);
  }
  return sum;
}

}  // namespace hsi4d
