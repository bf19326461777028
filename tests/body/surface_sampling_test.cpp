#include "body/surface_sampling.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <catch2/catch.hpp>

#include "body/procedural_body.h"
#include "core/check.h"
#include "core/parallel.h"
#include "core/random.h"

namespace surface_sampling_test {

using namespace hsi4d;

namespace {

using Vector = Vector3<double>;

/// A square of side 1 metre in z = 0, of n × n × 2 triangles of unequal sizes.
BodyModel square(int n) {
  BodyModel body;
  const auto place = [n](int i) { return static_cast<float>(std::pow(static_cast<double>(i) / n, 1.5)); };
  for (int y = 0; y <= n; ++y) {
    for (int x = 0; x <= n; ++x) body.vertices.insert(body.vertices.end(), {place(x), place(y), 0});
  }
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      const int a = y * (n + 1) + x, b = a + n + 1;
      body.faces.insert(body.faces.end(), {a, a + 1, b, a + 1, b + 1, b});
    }
  }
  return body;
}

std::vector<double> even(const BodyModel& body) {
  return std::vector<double>(static_cast<std::size_t>(body.vertex_count()), 1.0);
}

/// Distance of each to its nearest neighbour, ascending.
std::vector<double> neighbour_distances(const std::vector<SurfaceSample>& samples) {
  std::vector<double> distances;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    double nearest = 1e9;
    for (std::size_t k = 0; k < samples.size(); ++k) {
      if (k != i) nearest = std::min(nearest, (samples[i].place.point - samples[k].place.point).norm());
    }
    distances.push_back(nearest);
  }
  std::sort(distances.begin(), distances.end());
  return distances;
}

double area_of(const BodyModel& body, std::int32_t face) {
  const std::array<Vector, 3> c = face_corners(body, face);
  return 0.5 * cross(Vector(c[1] - c[0]), Vector(c[2] - c[0])).norm();
}

}  // namespace

TEST_CASE("places on a surface keep their distance and leave no gap") {
  const BodyModel body = square(20);
  const auto samples = sample_surface(body, even(body), 2500, 0);
  REQUIRE(samples.size() == 2500);
  const double spacing = 0.02;
  const std::vector<double> distances = neighbour_distances(samples);
  // Random places are a tenth of the spacing apart in one of thirty cases, and 0.5 in the median.
  CHECK(distances.front() > 0.35 * spacing);
  CHECK(distances[distances.size() / 20] > 0.6 * spacing);
  CHECK(distances[distances.size() / 2] > 0.8 * spacing);
  const Random random(5);
  for (std::uint64_t i = 0; i < 3000; ++i) {
    const Vector p(random.uniform(2 * i), random.uniform(2 * i + 1), 0);
    double nearest = 1e9;
    for (const SurfaceSample& s : samples) nearest = std::min(nearest, (s.place.point - p).norm());
    REQUIRE(nearest < spacing);  // of random places 4 % are farther
  }
  double area = 0;
  for (const SurfaceSample& s : samples) {
    CHECK(s.wanted_spacing == Approx(spacing).epsilon(1e-5));
    CHECK(s.reach < spacing);
    CHECK(s.bend < 1e-6);
    area += s.spacing * s.spacing;
  }
  CHECK(area == Approx(1).epsilon(1e-5));
}

TEST_CASE("places on a surface are as many as its area asks for, everywhere") {
  const BodyModel body = procedural_body();
  const auto samples = sample_surface(body, even(body), 6000, 1);
  const auto cell = [](const Vector& p) {
    return std::array<int, 3>{static_cast<int>(std::floor(6 * p[0])), static_cast<int>(std::floor(6 * p[1])),
                              static_cast<int>(std::floor(6 * p[2]))};
  };
  std::map<std::array<int, 3>, double> area, count;
  double total = 0;
  for (std::int32_t f = 0; f < body.face_count(); ++f) {
    const std::array<Vector, 3> c = face_corners(body, f);
    area[cell(Vector((c[0] + c[1] + c[2]) / 3.0))] += area_of(body, f);
    total += area_of(body, f);
  }
  for (const SurfaceSample& s : samples) count[cell(s.place.point)] += 1;
  for (const auto& [at, part] : area) {
    const double expected = 6000 * part / total;
    // Random places would be off by √expected; these by what crosses the border.
    CHECK(std::abs(count[at] - expected) < 4 + 0.5 * std::sqrt(expected));
  }
}

TEST_CASE("places on a surface are denser where the density says") {
  const BodyModel body = square(20);
  std::vector<double> density = even(body);
  for (std::size_t v = 0; v < density.size(); ++v) density[v] = body.vertices[3 * v] < 0.5F ? 4 : 1;
  const auto samples = sample_surface(body, density, 2000, 0);
  const auto within = [&](double low, double high) {
    return std::count_if(samples.begin(), samples.end(),
                         [&](const SurfaceSample& s) { return s.place.point[0] > low && s.place.point[0] < high; });
  };
  const double ratio = static_cast<double>(within(0.1, 0.4)) / static_cast<double>(within(0.6, 0.9));
  CHECK(ratio == Approx(4).epsilon(0.08));
}

TEST_CASE("places on a surface do not depend on threads, and on nothing but the arguments") {
  const BodyModel body = square(10);
  const auto points = [&](int threads, std::uint64_t seed) {
    std::vector<double> result;
    with_threads(threads, [&] {
      for (const SurfaceSample& s : sample_surface(body, even(body), 3000, seed))
        result.insert(result.end(), {s.place.point[0], s.place.point[1], s.spacing, s.reach});
    });
    return result;
  };
  const std::vector<double> once = points(1, 0);
  CHECK(points(2, 0) == once);
  CHECK(points(3, 0) == once);
  CHECK(points(1, 1) != once);
}

TEST_CASE("places on a surface: sizes are checked, few are found too") {
  const BodyModel body = square(2);
  CHECK(sample_surface(body, even(body), 0, 0).empty());
  CHECK(sample_surface(body, even(body), 1, 0).size() == 1);
  CHECK(sample_surface(body, even(body), 3, 0).size() == 3);
  CHECK_THROWS_AS(sample_surface(BodyModel{}, {}, 3, 0), InternalError);
  CHECK_THROWS_AS(sample_surface(body, std::vector<double>(3, 1.0), 3, 0), InternalError);
  CHECK_THROWS_AS(sample_surface(body, std::vector<double>(9, 0.0), 3, 0), InternalError);
}

}  // namespace surface_sampling_test
