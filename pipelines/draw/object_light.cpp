#include "pipelines/draw/object_light.h"

#include <algorithm>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/tape_rows.h"
#include "core/quaternion.h"

namespace hsi4d {

template <class S>
Var<S> outward_normals(Tape<S>& tape, const Gaussians& gaussians) {
  const Var<S> normals = tape.constant("outward_normals", shape_of(gaussians.count(), 3));
  const Array<S> rows = tape.write(normals);
  for (Index i = 0; i < gaussians.count(); ++i) {
    const float* const scales = gaussians.log_scales.data() + 3 * i;
    const float* const mean = gaussians.means.data() + 3 * i;
    const float* const quat = gaussians.quats.data() + 4 * i;
    const Index shortest = std::min_element(scales, scales + 3) - scales;
    Vector3<double> normal =
        quaternion_to_matrix(Vector4<double>(quat[0], quat[1], quat[2], quat[3])).col(shortest).normalized();
    if (normal.dot(Vector3<double>(mean[0], mean[1], mean[2])) < 0) normal = -normal;
    for (Index k = 0; k < 3; ++k) rows(i, k) = static_cast<S>(normal[k]);
  }
  return normals;
}

template <class S>
Var<S> lit_colors(Var<S> colors, Var<S> normals, Var<S> turn, Var<S> light) {
  const Var<S> in_object = matmul(slice_cols(light, 3, 3), reshape(turn, 3, 3));
  return colors * exp(matmul(normals, reshape(in_object, 3, 1)) + slice_cols(light, 0, 3));
}

template Var<float> outward_normals(Tape<float>&, const Gaussians&);
template Var<double> outward_normals(Tape<double>&, const Gaussians&);
template Var<float> lit_colors(Var<float>, Var<float>, Var<float>, Var<float>);
template Var<double> lit_colors(Var<double>, Var<double>, Var<double>, Var<double>);

}  // namespace hsi4d
