// The spherical harmonics of the brute-force renderer, their normalisation written as formulas.
#include <numbers>

#include "splat/reference/reference_gaussian.h"

namespace hsi4d::reference {
namespace {

/// What the polynomials of x, y, z on the unit sphere are multiplied by.
template <class T>
struct Norms {
  static constexpr T kPi = std::numbers::pi_v<T>;
  T zero = std::sqrt(1 / kPi) / 2;            // 0.28209479177387814
  T one = std::sqrt(3 / kPi) / 2;             // 0.4886025119029199
  T two_a = std::sqrt(15 / kPi) / 2;          // 1.0925484305920792; half of it 0.5462742152960396
  T two_b = std::sqrt(5 / kPi) / 4;           // 0.31539156525252005
  T three_a = std::sqrt(35 / (2 * kPi)) / 4;  // 0.5900435899266435
  T three_b = std::sqrt(105 / kPi) / 2;       // 2.890611442640554; half of it 1.445305721320277
  T three_c = std::sqrt(21 / (2 * kPi)) / 4;  // 0.4570457994644658
  T three_d = std::sqrt(7 / kPi) / 4;         // 0.3731763325901154
};

}  // namespace

template <class T>
std::array<T, 16> sh_basis(int degree, const Vec3<T>& direction) {
  const Norms<T> n;
  const auto [x, y, z] = direction;
  std::array<T, 16> basis{};
  basis[0] = n.zero;
  if (degree < 1) return basis;
  basis[1] = -n.one * y;
  basis[2] = n.one * z;
  basis[3] = -n.one * x;
  if (degree < 2) return basis;
  basis[4] = n.two_a * x * y;
  basis[5] = -n.two_a * y * z;
  basis[6] = n.two_b * (2 * z * z - x * x - y * y);
  basis[7] = -n.two_a * x * z;
  basis[8] = n.two_a / 2 * (x * x - y * y);
  if (degree < 3) return basis;
  basis[9] = -n.three_a * y * (3 * x * x - y * y);
  basis[10] = n.three_b * x * y * z;
  basis[11] = -n.three_c * y * (4 * z * z - x * x - y * y);
  basis[12] = n.three_d * z * (2 * z * z - 3 * x * x - 3 * y * y);
  basis[13] = -n.three_c * x * (4 * z * z - x * x - y * y);
  basis[14] = n.three_b / 2 * z * (x * x - y * y);
  basis[15] = -n.three_a * x * (x * x - 3 * y * y);
  return basis;
}

template <class T>
std::array<Vec3<T>, 16> sh_basis_gradient(int degree, const Vec3<T>& direction) {
  const Norms<T> n;
  const auto [x, y, z] = direction;
  std::array<Vec3<T>, 16> gradient{};
  if (degree < 1) return gradient;
  gradient[1] = {0, -n.one, 0};
  gradient[2] = {0, 0, n.one};
  gradient[3] = {-n.one, 0, 0};
  if (degree < 2) return gradient;
  gradient[4] = {n.two_a * y, n.two_a * x, 0};
  gradient[5] = {0, -n.two_a * z, -n.two_a * y};
  gradient[6] = {-2 * n.two_b * x, -2 * n.two_b * y, 4 * n.two_b * z};
  gradient[7] = {-n.two_a * z, 0, -n.two_a * x};
  gradient[8] = {n.two_a * x, -n.two_a * y, 0};
  if (degree < 3) return gradient;
  gradient[9] = {-6 * n.three_a * x * y, -3 * n.three_a * (x * x - y * y), 0};
  gradient[10] = {n.three_b * y * z, n.three_b * x * z, n.three_b * x * y};
  gradient[11] = {2 * n.three_c * x * y, -n.three_c * (4 * z * z - x * x - 3 * y * y), -8 * n.three_c * y * z};
  gradient[12] = {-6 * n.three_d * x * z, -6 * n.three_d * y * z, 3 * n.three_d * (2 * z * z - x * x - y * y)};
  gradient[13] = {-n.three_c * (4 * z * z - 3 * x * x - y * y), 2 * n.three_c * x * y, -8 * n.three_c * x * z};
  gradient[14] = {n.three_b * x * z, -n.three_b * y * z, n.three_b / 2 * (x * x - y * y)};
  gradient[15] = {-3 * n.three_a * (x * x - y * y), 6 * n.three_a * x * y, 0};
  return gradient;
}

template std::array<double, 16> sh_basis(int, const Vec3<double>&);
template std::array<long double, 16> sh_basis(int, const Vec3<long double>&);
template std::array<Vec3<double>, 16> sh_basis_gradient(int, const Vec3<double>&);
template std::array<Vec3<long double>, 16> sh_basis_gradient(int, const Vec3<long double>&);

}  // namespace hsi4d::reference
