// Meshes of known shapes for tests.
#pragma once

#include <cmath>
#include <map>

#include "optim/solid/mesh_file.h"

namespace hsi4d::test {

/// A box of 12 triangles, seen from outside.
inline TriangleMesh box_mesh(const Vector3<double>& low, const Vector3<double>& high) {
  TriangleMesh mesh;
  for (int corner = 0; corner < 8; ++corner)
    mesh.vertices.emplace_back((corner & 1) != 0 ? high[0] : low[0], (corner & 2) != 0 ? high[1] : low[1],
                               (corner & 4) != 0 ? high[2] : low[2]);
  const std::int32_t quads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& quad : quads) hsi4d::detail::add_polygon(quad, mesh);
  return mesh;
}

/// The exact signed distance of a box.
inline double box_distance(const Vector3<double>& low, const Vector3<double>& high, const Vector3<double>& p) {
  const Vector3<double> q = ((p - 0.5 * (low + high)).cwiseAbs() - 0.5 * (high - low));
  return q.cwiseMax(0.0).norm() + std::min(0.0, q.maxCoeff());
}

/// A sphere about the origin: an icosahedron whose triangles were cut in four so many times.
inline TriangleMesh sphere_mesh(double radius, int cuts) {
  TriangleMesh mesh;
  const double g = (1 + std::sqrt(5.0)) / 2;
  for (const auto& [x, y, z] : std::vector<std::array<double, 3>>{{-1, g, 0},
                                                                  {1, g, 0},
                                                                  {-1, -g, 0},
                                                                  {1, -g, 0},
                                                                  {0, -1, g},
                                                                  {0, 1, g},
                                                                  {0, -1, -g},
                                                                  {0, 1, -g},
                                                                  {g, 0, -1},
                                                                  {g, 0, 1},
                                                                  {-g, 0, -1},
                                                                  {-g, 0, 1}})
    mesh.vertices.push_back(Vector3<double>(x, y, z).normalized() * radius);
  mesh.faces = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  for (int cut = 0; cut < cuts; ++cut) {
    std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> middles;
    const auto middle = [&](std::int32_t a, std::int32_t b) {
      const auto [at, is_new] = middles.try_emplace(std::minmax(a, b), static_cast<std::int32_t>(mesh.vertices.size()));
      if (is_new) {
        const Vector3<double> sum =
            mesh.vertices[static_cast<std::size_t>(a)] + mesh.vertices[static_cast<std::size_t>(b)];
        mesh.vertices.push_back(sum.normalized() * radius);
      }
      return at->second;
    };
    std::vector<std::array<std::int32_t, 3>> finer;
    for (const auto& [a, b, c] : mesh.faces) {
      const std::int32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    mesh.faces = std::move(finer);
  }
  return mesh;
}

/// The same surface turned inside out.
inline TriangleMesh turned_inwards(TriangleMesh mesh) {
  for (auto& face : mesh.faces) std::swap(face[1], face[2]);
  return mesh;
}

inline void append_mesh(const TriangleMesh& more, TriangleMesh& mesh) {
  const auto first = static_cast<std::int32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), more.vertices.begin(), more.vertices.end());
  for (const auto& [a, b, c] : more.faces) mesh.faces.push_back({a + first, b + first, c + first});
}

}  // namespace hsi4d::test
