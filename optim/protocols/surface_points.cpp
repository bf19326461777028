#include "optim/protocols/surface_points.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "core/linear.h"
#include "core/random.h"

namespace hsi4d {

std::vector<double> surface_points(std::span<const double> vertices, std::span<const std::array<std::int32_t, 3>> faces,
                                   Index count, const SurfaceDraw& draw) {
  const auto corner = [&](std::size_t face, std::size_t i) {
    const std::int32_t vertex = faces[face][i];
    HSI4D_CHECK(vertex >= 0 && 3 * static_cast<std::size_t>(vertex) + 2 < vertices.size(), "a face names no vertex");
    return Vector3<double>(vertices.data() + 3 * static_cast<std::size_t>(vertex));
  };
  std::vector<double> areas;  // of all triangles up to each
  double area = 0;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const Vector3<double> a = corner(f, 1) - corner(f, 0), b = corner(f, 2) - corner(f, 0);
    area += 0.5 * cross(a, b).norm();
    areas.push_back(area);
  }
  HSI4D_CHECK(area > 0 && std::isfinite(area), "the surface has no area");
  const Random random(draw.seed, draw.stream);
  std::vector<double> points;
  points.reserve(static_cast<std::size_t>(3 * count));
  for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(count); ++i) {
    const auto found = std::upper_bound(areas.begin(), areas.end() - 1, random.uniform(3 * i) * area);
    const auto face = static_cast<std::size_t>(found - areas.begin());
    double u = random.uniform(3 * i + 1), v = random.uniform(3 * i + 2);
    if (u + v > 1) {  // the other half of the parallelogram
      u = 1 - u;
      v = 1 - v;
    }
    const Vector3<double> point = corner(face, 0) * (1 - u - v) + corner(face, 1) * u + corner(face, 2) * v;
    points.insert(points.end(), point.data(), point.data() + 3);
  }
  return points;
}

}  // namespace hsi4d
