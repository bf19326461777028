#include "optim/protocols/surface_points.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/check.h"

namespace surface_points_test {

using namespace hsi4d;

namespace {

/// A square of 2 by 2 in z = 1 as one triangle of half of it and two of a quarter, and one without area.
const std::vector<double> kVertices = {0, 0, 1, 2, 0, 1, 2, 2, 1, 0, 2, 1, 1, 1, 1};
const std::vector<std::array<std::int32_t, 3>> kFaces = {{0, 1, 2}, {1, 1, 4}, {0, 2, 3}};

}  // namespace

TEST_CASE("points of a surface are drawn evenly") {
  constexpr Index kCount = 40000;
  const std::vector<double> points = surface_points(kVertices, kFaces, kCount, {5, 6});
  REQUIRE(points.size() == 3 * kCount);
  std::array<int, 16> cells = {};  // of half a metre
  for (std::size_t i = 0; i < points.size(); i += 3) {
    REQUIRE((points[i] >= 0 && points[i] < 2 && points[i + 1] >= 0 && points[i + 1] < 2));
    REQUIRE(points[i + 2] == Approx(1).margin(1e-15));
    ++cells[static_cast<std::size_t>(points[i] / 0.5) + 4 * static_cast<std::size_t>(points[i + 1] / 0.5)];
  }
  for (const int cell : cells) CHECK(cell == Approx(kCount / 16).margin(5 * std::sqrt(kCount / 16.0)));
}

TEST_CASE("points of a surface follow from seed and stream") {
  const auto drawn = [](std::uint64_t seed, std::uint64_t stream) {
    return surface_points(kVertices, kFaces, 10, {seed, stream});
  };
  CHECK(drawn(1, 2) == drawn(1, 2));
  CHECK(drawn(1, 2) != drawn(2, 2));
  CHECK(drawn(1, 2) != drawn(1, 3));
  CHECK(surface_points(kVertices, kFaces, 0, {}).empty());
}

TEST_CASE("a surface without area, and faces that name no vertex, are mistakes") {
  const std::vector<std::array<std::int32_t, 3>> flat = {{1, 1, 4}}, beyond = {{0, 1, 5}}, below = {{0, 1, -1}};
  CHECK_THROWS_AS(surface_points(kVertices, flat, 1, {}), InternalError);
  CHECK_THROWS_AS(surface_points(kVertices, {}, 1, {}), InternalError);
  CHECK_THROWS_AS(surface_points(kVertices, beyond, 1, {}), InternalError);
  CHECK_THROWS_AS(surface_points(kVertices, below, 1, {}), InternalError);
}

}  // namespace surface_points_test
