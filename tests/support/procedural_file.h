// The program's own body as a file.
#pragma once

#include <optional>

#include "body/pose_layout.h"
#include "body/procedural_body.h"
#include "tests/support/smplx_reference.h"

namespace hsi4d::test {

/// The procedural body in the layout of SMPL-X files.
/// @param shift  where the first beta moves all of it, metres; none: it has no betas
inline NpzWriter procedural_file(const std::optional<Vector3<double>>& shift = {}) {
  const BodyModel body = procedural_body();
  SmplxArrays a;
  a.vertices = body.vertex_count();
  a.columns = shift ? 20 : 0;
  a.shapedirs.resize(static_cast<std::size_t>(3 * a.vertices * a.columns));
  for (std::size_t row = 0; shift && row < static_cast<std::size_t>(3 * a.vertices); ++row)
    a.shapedirs[20 * row] = (*shift)[static_cast<Index>(row % 3)];
  a.v_template.assign(body.vertices.begin(), body.vertices.end());
  a.f.assign(body.faces.begin(), body.faces.end());
  a.parents.assign(body.parents.begin(), body.parents.end());
  a.weights.resize(static_cast<std::size_t>(55 * a.vertices));
  for (std::size_t i = 0; i < body.weights.indices.size(); ++i) {
    a.weights[55 * (i / 4) + static_cast<std::size_t>(body.weights.indices[i])] += body.weights.weights[i];
  }
  NpzWriter file = smplx_writer(a);
  file.add<double>("J_template", {55, 3}, body.joints);
  std::vector<double> joint_shape;
  for (Index i = 0; shift && i < 3 * kSmplxJoints; ++i) joint_shape.push_back((*shift)[i % 3]);
  file.add<double>("J_shapedirs", {55, 3, shift ? 1 : 0}, joint_shape);
  return file;
}

}  // namespace hsi4d::test
