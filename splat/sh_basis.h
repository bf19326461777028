// The real spherical harmonics of INRIA's 3DGS files, with their signs, as polynomials.
#pragma once

#include "core/lanes.h"

namespace hsi4d {

/// Y_0, the constant basis function.
inline constexpr double kShC0 = 0.28209479177387814;

inline constexpr double kSh1 = 0.4886025119029199;
inline constexpr double kSh2[5] = {1.0925484305920792, -1.0925484305920792, 0.31539156525252005, -1.0925484305920792,
                                   0.5462742152960396};
inline constexpr double kSh3[7] = {-0.5900435899266435, 2.890611442640554, -0.4570457994644658, 0.3731763325901154,
                                   -0.4570457994644658, 1.445305721320277, -0.5900435899266435};

/// Y_k(r) for all k of `degree`; a polynomial in the components of r, which need not be of unit length. Of one number
/// or of lanes.
template <class S>
void sh_basis(int degree, S x, S y, S z, S* basis) {
  basis[0] = lane_constant<S>(kShC0);
  if (degree < 1) return;
  basis[1] = -lane_constant<S>(kSh1) * y;
  basis[2] = lane_constant<S>(kSh1) * z;
  basis[3] = -lane_constant<S>(kSh1) * x;
  if (degree < 2) return;
  const S xx = x * x, yy = y * y, zz = z * z;
  basis[4] = lane_constant<S>(kSh2[0]) * (x * y);
  basis[5] = lane_constant<S>(kSh2[1]) * (y * z);
  basis[6] = lane_constant<S>(kSh2[2]) * (lane_constant<S>(2) * zz - xx - yy);
  basis[7] = lane_constant<S>(kSh2[3]) * (x * z);
  basis[8] = lane_constant<S>(kSh2[4]) * (xx - yy);
  if (degree < 3) return;
  basis[9] = lane_constant<S>(kSh3[0]) * y * (lane_constant<S>(3) * xx - yy);
  basis[10] = lane_constant<S>(kSh3[1]) * x * y * z;
  basis[11] = lane_constant<S>(kSh3[2]) * y * (lane_constant<S>(4) * zz - xx - yy);
  basis[12] =
      lane_constant<S>(kSh3[3]) * z * (lane_constant<S>(2) * zz - lane_constant<S>(3) * xx - lane_constant<S>(3) * yy);
  basis[13] = lane_constant<S>(kSh3[4]) * x * (lane_constant<S>(4) * zz - xx - yy);
  basis[14] = lane_constant<S>(kSh3[5]) * z * (xx - yy);
  basis[15] = lane_constant<S>(kSh3[6]) * x * (xx - lane_constant<S>(3) * yy);
}

/// d_r += Σ_k d_Y_k ∂Y_k/∂r.
template <class S>
void sh_basis_adjoint(int degree, S x, S y, S z, const S* d, S* d_r) {
  if (degree < 1) return;
  S dx = -lane_constant<S>(kSh1) * d[3], dy = -lane_constant<S>(kSh1) * d[1], dz = lane_constant<S>(kSh1) * d[2];
  if (degree >= 2) {
    const S d4 = lane_constant<S>(kSh2[0]) * d[4], d5 = lane_constant<S>(kSh2[1]) * d[5],
            d6 = lane_constant<S>(kSh2[2]) * d[6], d7 = lane_constant<S>(kSh2[3]) * d[7];
    const S d8 = lane_constant<S>(kSh2[4]) * d[8];
    dx += d4 * y - lane_constant<S>(2) * d6 * x + d7 * z + lane_constant<S>(2) * d8 * x;
    dy += d4 * x + d5 * z - lane_constant<S>(2) * d6 * y - lane_constant<S>(2) * d8 * y;
    dz += d5 * y + lane_constant<S>(4) * d6 * z + d7 * x;
  }
  if (degree >= 3) {
    const S xx = x * x, yy = y * y, zz = z * z;
    const S d9 = lane_constant<S>(kSh3[0]) * d[9], d10 = lane_constant<S>(kSh3[1]) * d[10],
            d11 = lane_constant<S>(kSh3[2]) * d[11], d12 = lane_constant<S>(kSh3[3]) * d[12];
    const S d13 = lane_constant<S>(kSh3[4]) * d[13], d14 = lane_constant<S>(kSh3[5]) * d[14],
            d15 = lane_constant<S>(kSh3[6]) * d[15];
    dx += lane_constant<S>(6) * d9 * x * y + d10 * y * z - lane_constant<S>(2) * d11 * x * y -
          lane_constant<S>(6) * d12 * x * z + d13 * (lane_constant<S>(4) * zz - lane_constant<S>(3) * xx - yy) +
          lane_constant<S>(2) * d14 * x * z + lane_constant<S>(3) * d15 * (xx - yy);
    dy += lane_constant<S>(3) * d9 * (xx - yy) + d10 * x * z +
          d11 * (lane_constant<S>(4) * zz - xx - lane_constant<S>(3) * yy) - lane_constant<S>(6) * d12 * y * z -
          lane_constant<S>(2) * d13 * x * y - lane_constant<S>(2) * d14 * y * z - lane_constant<S>(6) * d15 * x * y;
    dz += d10 * x * y + lane_constant<S>(8) * d11 * y * z +
          lane_constant<S>(3) * d12 * (lane_constant<S>(2) * zz - xx - yy) + lane_constant<S>(8) * d13 * x * z +
          d14 * (xx - yy);
  }
  d_r[0] += dx, d_r[1] += dy, d_r[2] += dz;
}

}  // namespace hsi4d
