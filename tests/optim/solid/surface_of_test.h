// Sheets of flat Gaussians for tests.
#pragma once

#include <cmath>

#include "core/quaternion.h"
#include "splat/gaussians.h"

namespace hsi4d::test {

/// Adds an opaque disc.
inline void add_disc(Gaussians& gaussians, const Vector3<double>& center, const Vector3<double>& normal, double width) {
  const Vector3<double> side =
      direction_of(cross(normal, Vector3<double>(std::fabs(normal[0]) < 0.5 ? Vector3<double>(1, 0, 0)
                                                                            : Vector3<double>(0, 1, 0))))
          .unit;
  Matrix3<double> axes;
  axes.col(0) = side;
  axes.col(1) = cross(normal, side);
  axes.col(2) = normal;
  const Vector4<double> q = quaternion_from_matrix(axes);
  for (int i = 0; i < 3; ++i) gaussians.means.push_back(static_cast<float>(center[i]));
  for (int i = 0; i < 4; ++i) gaussians.quats.push_back(static_cast<float>(q[i]));
  for (const double scale : {width, width, 0.05 * width})
    gaussians.log_scales.push_back(static_cast<float>(std::log(scale)));
  gaussians.opacity_logits.push_back(5);
  for (int i = 0; i < 3; ++i) gaussians.sh.push_back(0);
}

/// Covers a parallelogram with discs about `spacing` metres apart.
inline void add_sheet(Gaussians& gaussians, const Vector3<double>& corner, const Vector3<double>& u,
                      const Vector3<double>& v, double spacing) {
  const Vector3<double> normal = direction_of(cross(u, v)).unit;
  const auto along_u = static_cast<int>(u.norm() / spacing), along_v = static_cast<int>(v.norm() / spacing);
  for (int j = 0; j < along_v; ++j) {
    for (int i = 0; i < along_u; ++i)
      add_disc(gaussians, corner + u * ((i + 0.5) / along_u) + v * ((j + 0.5) / along_v), normal, 0.66 * spacing);
  }
}

}  // namespace hsi4d::test
