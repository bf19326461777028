#include "splat/files/transform.h"

#include <cmath>

#include "core/check.h"
#include "core/quaternion.h"
#include "splat/files/sh_rotation.h"

namespace hsi4d {
namespace {

double deviation(const Matrix3<double>& r) {
  return (r.transpose() * r - Matrix3<double>::Identity()).cwiseAbs().maxCoeff();
}

double determinant(const Matrix3<double>& m) {
  return dot(Vector3<double>(m.col(0)), cross(Vector3<double>(m.col(1)), Vector3<double>(m.col(2))));
}

/// The orthogonal factor of a matrix that is nearly a rotation, by Newton's iteration R ← (R + R⁻ᵀ)/2. [Higham 1986]
Matrix3<double> nearest_rotation(Matrix3<double> r) {
  for (int i = 0; i < 10 && deviation(r) > 1e-15; ++i) {
    Matrix3<double> cofactors;
    for (int c = 0; c < 3; ++c)
      cofactors.col(c) = cross(Vector3<double>(r.col((c + 1) % 3)), Vector3<double>(r.col((c + 2) % 3)));
    r = 0.5 * (r + cofactors / determinant(r));
  }
  return r;
}

}  // namespace

Similarity compose(const Similarity& outer, const Similarity& inner) {
  return {outer.scale * inner.scale, outer.rotation * inner.rotation, transform_point(outer, inner.translation)};
}

Similarity inverse(const Similarity& s) {
  const Matrix3<double> back = s.rotation.transpose();
  return {1 / s.scale, back, -(back * s.translation) / s.scale};
}

Vector3<double> transform_point(const Similarity& s, const Vector3<double>& point) {
  return s.scale * (s.rotation * point) + s.translation;
}

Similarity similarity_from_matrix(const Matrix4<double>& matrix, const std::string& where) {
  if (!matrix.allFinite()) throw UserError(where + ": a number is not finite");
  if (matrix.row(3) != Vector4<double>(0, 0, 0, 1).transpose())
    throw UserError(where + ": the last row is not 0 0 0 1, so this is no similarity");
  const Matrix3<double> linear = matrix.topLeftCorner<3, 3>();
  const double det = determinant(linear);
  if (det < 0)
    throw UserError(where + ": the matrix mirrors (its determinant is negative), which Gaussians cannot follow: " +
                    "allowed are rotations with one scale");
  const double scale = std::cbrt(det);
  if (!(scale > 0) || !std::isfinite(scale))
    throw UserError(where + ": the matrix has no extent: its determinant is 0");
  const Matrix3<double> rotation = linear / scale;
  if (!(deviation(rotation) <= 1e-4))
    throw UserError(where +
                    ": the matrix shears, or scales the axes differently; allowed are rotations with one scale");
  return {scale, nearest_rotation(rotation), matrix.topRightCorner<3, 1>()};
}

Gaussians transformed(const Gaussians& gaussians, const Similarity& s) {
  check_sizes(gaussians);
  HSI4D_CHECK(s.scale > 0 && std::isfinite(s.scale), "a similarity's scale is " + std::to_string(s.scale));
  HSI4D_CHECK(deviation(s.rotation) <= 1e-6 && determinant(s.rotation) > 0, "a similarity's rotation is none");
  Gaussians g = gaussians;
  g.origin_world = transform_point(s, gaussians.origin_world);
  const Vector4<double> turn = quaternion_from_matrix(s.rotation);
  const double log_scale = std::log(s.scale);
  const bool turned = s.rotation != Matrix3<double>::Identity();  // else harmonics keep their bits
  const ShRotation rotation(s.rotation, g.sh_degree);
  const auto sh_count = static_cast<std::size_t>(3 * g.sh_coefficients());
  for (Index n = 0; n < g.count(); ++n) {
    float* m = g.means.data() + 3 * n;
    const Vector3<double> mean = s.scale * (s.rotation * Vector3<double>(m[0], m[1], m[2]));
    float* q = g.quats.data() + 4 * n;
    const Vector4<double> quat = quaternion_product(turn, Vector4<double>(q[0], q[1], q[2], q[3]));
    float* log_scales = g.log_scales.data() + 3 * n;
    for (int c = 0; c < 3; ++c) {
      m[c] = static_cast<float>(mean[c]);
      log_scales[c] = static_cast<float>(log_scales[c] + log_scale);
    }
    for (int c = 0; c < 4; ++c) q[c] = static_cast<float>(quat[c]);
    if (turned) rotation.apply(std::span(g.sh).subspan(sh_count * static_cast<std::size_t>(n), sh_count));
  }
  return g;
}

}  // namespace hsi4d
