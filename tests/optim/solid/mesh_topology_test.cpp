#include "optim/solid/mesh_topology.h"

#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "tests/optim/solid/meshes.h"

namespace mesh_topology_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// A torus of n × n quads.
TriangleMesh torus(int n) {
  TriangleMesh mesh;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const double u = 2 * std::numbers::pi * i / n, v = 2 * std::numbers::pi * j / n, r = 2 + 0.5 * std::cos(v);
      mesh.vertices.emplace_back(r * std::cos(u), r * std::sin(u), 0.5 * std::sin(v));
      const int i1 = (i + 1) % n, j1 = (j + 1) % n;
      mesh.faces.push_back({i * n + j, i1 * n + j, i1 * n + j1});
      mesh.faces.push_back({i * n + j, i1 * n + j1, i * n + j1});
    }
  }
  return mesh;
}

TriangleMesh joined(const TriangleMesh& a, const TriangleMesh& b) {
  TriangleMesh mesh = a;
  const auto first = static_cast<std::int32_t>(a.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const auto& face : b.faces) mesh.faces.push_back({face[0] + first, face[1] + first, face[2] + first});
  return mesh;
}

}  // namespace

TEST_CASE("a sphere and a torus: closed, their volume, their handles") {
  const TriangleMesh sphere = cleaned(sphere_mesh(0.5, 4), "sphere"), ring = torus(24);
  CHECK(bad_vertices(sphere).empty());
  CHECK(genus(sphere) == 0);
  CHECK(signed_volume(sphere) == Approx(4.0 / 3 * std::numbers::pi * 0.125).epsilon(0.02));
  CHECK(bad_vertices(ring).empty());
  CHECK(genus(ring) == 1);
  CHECK(std::abs(signed_volume(ring)) == Approx(2 * std::numbers::pi * std::numbers::pi * 2 * 0.25).epsilon(0.05));
  const std::vector<TriangleMesh> parts = connected_parts(joined(sphere, ring));
  REQUIRE(parts.size() == 2);
  CHECK(parts[0].faces.size() == sphere.faces.size());
  CHECK(parts[1].vertices.size() == ring.vertices.size());
}

TEST_CASE("holes, turned triangles, and surfaces that touch themselves are told by their vertices") {
  TriangleMesh mesh = cleaned(sphere_mesh(0.5, 2), "sphere");
  const auto face = mesh.faces.back();
  mesh.faces.pop_back();
  CHECK(bad_vertices(mesh).size() == 3);
  mesh.faces.push_back({face[1], face[0], face[2]});
  CHECK(bad_vertices(mesh).size() == 3);
  mesh.faces.back() = face;
  CHECK(bad_vertices(mesh).empty());

  // Two spheres that share a vertex.
  TriangleMesh two = joined(mesh, mesh);
  const auto count = static_cast<std::int32_t>(mesh.vertices.size());
  for (auto& corners : two.faces) {
    for (auto& corner : corners) corner = corner == count ? 0 : corner;
  }
  CHECK(bad_vertices(two) == std::vector<std::int32_t>{0});
  CHECK(bad_vertices(TriangleMesh{}).empty());
}

}  // namespace mesh_topology_test
