#include "body/surface_index.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "body/procedural_body.h"
#include "core/check.h"
#include "core/random.h"

namespace surface_index_test {

using namespace hsi4d;

namespace {

using Vector = Vector3<double>;

/// Triangles of very different sizes: a large square in z = 0 and a fan of slivers and points above it.
BodyModel uneven() {
  BodyModel body;
  body.vertices = {-9, -9, 0, 9, -9, 0, 9, 9, 0, -9, 9, 0, 0, 0, 1, 0.001F, 0, 1, 0, 0.001F, 1, 0.5F, 0, 1, 1, 0, 1};
  body.faces = {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 7, 8, 4, 4, 4, 6, 8, 5};
  return body;
}

double brute_force(const BodyModel& body, const Vector& point) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::int32_t f = 0; f < body.face_count(); ++f)
    nearest = std::min(nearest, (nearest_on_triangle(face_corners(body, f), point).point - point).norm());
  return nearest;
}

void check_against_brute_force(const BodyModel& body, double size, int count) {
  const SurfaceIndex index(body);
  const Random random(3);
  for (int i = 0; i < count; ++i) {
    const auto at = [&](int axis) { return random.uniform(static_cast<std::uint64_t>(3 * i + axis), -size, size); };
    const Vector point(at(0), at(1), at(2));
    const SurfacePlace place = index.nearest(point);
    CHECK((place.point - point).norm() == Approx(brute_force(body, point)).epsilon(1e-12));
    const std::array<Vector, 3> c = face_corners(body, place.face);
    const Vector again = c[0] * place.shares[0] + c[1] * place.shares[1] + c[2] * place.shares[2];
    CHECK((again - place.point).norm() < 1e-12);
    CHECK(place.shares[0] + place.shares[1] + place.shares[2] == Approx(1).epsilon(1e-12));
    CHECK(std::min({place.shares[0], place.shares[1], place.shares[2]}) >= 0);
  }
}

}  // namespace

TEST_CASE("the nearest place of a triangle is at its inside, an edge or a corner") {
  const std::array<Vector, 3> c = {Vector(0, 0, 0), Vector(2, 0, 0), Vector(0, 2, 0)};
  CHECK((nearest_on_triangle(c, {0.5, 0.5, 7}).point - Vector(0.5, 0.5, 0)).norm() < 1e-15);
  CHECK((nearest_on_triangle(c, {1, -3, 1}).point - Vector(1, 0, 0)).norm() < 1e-15);
  CHECK((nearest_on_triangle(c, {3, 3, 0}).point - Vector(1, 1, 0)).norm() < 1e-15);
  CHECK((nearest_on_triangle(c, {-1, -2, 5}).point - Vector(0, 0, 0)).norm() < 1e-15);
  CHECK((nearest_on_triangle(c, {9, -1, 0}).point - Vector(2, 0, 0)).norm() < 1e-15);
  // No dense set of places is nearer.
  const Random random(1);
  for (std::uint64_t i = 0; i < 300; ++i) {
    const Vector p(random.uniform(3 * i, -3, 3), random.uniform(3 * i + 1, -3, 3), random.uniform(3 * i + 2, -3, 3));
    const double nearest = (nearest_on_triangle(c, p).point - p).norm();
    for (int u = 0; u <= 20; ++u) {
      for (int v = 0; u + v <= 20; ++v) REQUIRE((Vector(0.1 * u, 0.1 * v, 0) - p).norm() >= nearest - 1e-12);
    }
  }
}

TEST_CASE("a triangle without area is its longest edge or a point") {
  const std::array<Vector, 3> edge = {Vector(0, 0, 0), Vector(1, 0, 0), Vector(4, 0, 0)};
  CHECK((nearest_on_triangle(edge, {3, 1, 0}).point - Vector(3, 0, 0)).norm() < 1e-15);
  const std::array<Vector, 3> point = {Vector(1, 2, 3), Vector(1, 2, 3), Vector(1, 2, 3)};
  CHECK((nearest_on_triangle(point, {0, 0, 0}).point - Vector(1, 2, 3)).norm() == 0);
}

TEST_CASE("D6: a kilometre away the nearest place is the same, and of places that tie the first") {
  BodyModel far = uneven();
  for (std::size_t i = 0; i < far.vertices.size(); ++i) far.vertices[i] += i % 3 == 0 ? 1024.0F : -512.0F;
  const SurfaceIndex index(far);
  const Random random(4);
  for (std::uint64_t i = 0; i < 200; ++i) {
    const Vector near(random.uniform(3 * i, -2, 2), random.uniform(3 * i + 1, -2, 2), random.uniform(3 * i + 2, -2, 2));
    const Vector point = near + Vector(1024, -512, -512);
    CHECK((index.nearest(point).point - point).norm() == Approx(brute_force(far, point)).epsilon(1e-9));
  }
  // Above the diagonal of the square two triangles tie.
  for (const double at : {-8.0, -3.5, 2.25, 7.0}) {
    CHECK(index.nearest(Vector(1024 + at, -512 + at, -512.5)).face == 0);
  }
}

TEST_CASE("the nearest place of a surface is that of all its triangles") {
  check_against_brute_force(uneven(), 12, 400);
  check_against_brute_force(uneven(), 1.2, 400);
  check_against_brute_force(procedural_body(), 1.5, 40);
  CHECK_THROWS_AS(SurfaceIndex(BodyModel{}), InternalError);
  const BodyModel body = uneven();
  CHECK_THROWS_AS(SurfaceIndex(body).nearest({std::nan(""), 0, 0}), InternalError);
}

TEST_CASE("of equally near triangles the lowest is taken") {
  const BodyModel body = uneven();
  CHECK(SurfaceIndex(body).nearest({-9, -9, -1}).face == 0);  // a corner of faces 0 and 1
  CHECK(SurfaceIndex(body).nearest({0, 0, 1.5}).face == 2);   // a corner of four
}

TEST_CASE("weights at a place are interpolated, the largest four kept and normalised") {
  BodyModel body;
  body.vertices = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  body.faces = {0, 1, 2};
  body.weights = {3, 6, 3, {0, 1, 2, 1, 3, 0, 4, 5, 0}, {0.5, 0.3, 0.2, 0.6, 0.4, 0, 0.8, 0.2, 0}};
  SparseWeights weights{2, 6, 4, {}, {}};
  append_weights(body, {0, {1, 0, 0}, Vector::Zero()}, weights);
  append_weights(body, {0, {0.25, 0.5, 0.25}, Vector::Zero()}, weights);
  // At the corner its own weights; then 0: .125, 1: .075 + .3, 2: .05, 3: .2, 4: .2, 5: .05.
  CHECK(weights.indices == std::vector<std::int32_t>{0, 1, 2, 3, 1, 3, 4, 0});
  const std::vector<double> expected = {0.5, 0.3, 0.2, 0, 0.375 / 0.9, 0.2 / 0.9, 0.2 / 0.9, 0.125 / 0.9};
  for (std::size_t i = 0; i < expected.size(); ++i) CHECK(weights.weights[i] == Approx(expected[i]).margin(1e-15));
}

TEST_CASE("normals of vertices are those of the faces around them, by area, and zero where there are none") {
  BodyModel body;  // a square corner: one triangle in z = 0, one of three times its area in x = 0; then a point
  body.vertices = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 3, 5, 5, 5, 2, 0, 0};
  body.faces = {0, 1, 2, 0, 2, 3, 0, 1, 5};
  const std::vector<Vector> normals = vertex_normals(body);
  REQUIRE(normals.size() == 6);
  CHECK((normals[1] - Vector(0, 0, 1)).norm() < 1e-15);
  CHECK((normals[3] - Vector(1, 0, 0)).norm() < 1e-15);
  CHECK((normals[0] - Vector(3, 0, 1) / std::sqrt(10.0)).norm() < 1e-15);
  CHECK((normals[2] - normals[0]).norm() < 1e-15);
  CHECK(normals[4] == Vector(0, 0, 0));  // of no face
  CHECK(normals[5] == Vector(0, 0, 0));  // of a face without area
}

}  // namespace surface_index_test
