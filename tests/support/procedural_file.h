// The program's own body as a file.
#pragma once

#include "body/procedural_body.h"
#include "tests/support/smplx_reference.h"

namespace hsi4d::test {

/// The procedural body in the layout of SMPL-X files.
inline NpzWriter procedural_file() {
  const BodyModel body = procedural_body();
  SmplxArrays a;
  a.vertices = body.vertex_count();
  a.columns = 0;
  a.v_template.assign(body.vertices.begin(), body.vertices.end());
  a.f.assign(body.faces.begin(), body.faces.end());
  a.parents.assign(body.parents.begin(), body.parents.end());
  a.weights.resize(static_cast<std::size_t>(55 * a.vertices));
  for (std::size_t i = 0; i < body.weights.indices.size(); ++i) {
    a.weights[55 * (i / 4) + static_cast<std::size_t>(body.weights.indices[i])] += body.weights.weights[i];
  }
  NpzWriter file = smplx_writer(a);
  file.add<double>("J_template", {55, 3}, body.joints);
  file.add<double>("J_shapedirs", {55, 3, 0}, {});
  return file;
}

}  // namespace hsi4d::test
