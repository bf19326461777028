// Small vectors and matrices, and the few products of them that stay analytic for complex scalars: Eigen's dot(),
// cross() and norm() conjugate, which breaks derivatives by complex step.
#pragma once

#include <cmath>
#include <limits>
#include <type_traits>

#include <Eigen/Core>

namespace hsi4d {

template <class S>
using Vector2 = Eigen::Matrix<S, 2, 1>;
template <class S>
using Vector3 = Eigen::Matrix<S, 3, 1>;
template <class S>
using Vector4 = Eigen::Matrix<S, 4, 1>;
template <class S>
using Vector6 = Eigen::Matrix<S, 6, 1>;
template <class S>
using Matrix3 = Eigen::Matrix<S, 3, 3>;
template <class S>
using Matrix4 = Eigen::Matrix<S, 4, 4>;
template <class S>
using Matrix6 = Eigen::Matrix<S, 6, 6>;

namespace detail {

/// The plain number that comparisons look at: x itself, the real part of a complex number, the value of a dual one.
template <class S>
auto real_part(const S& x) {
  if constexpr (std::is_floating_point_v<S>) {
    return x;
  } else if constexpr (requires { x.real(); }) {
    return x.real();
  } else {
    return value_of(x);
  }
}

template <class S>
using Real = decltype(real_part(std::declval<S>()));

/// The scalar for coefficients that cost nothing beside the rest: double for float, else S itself.
template <class S>
using Wide = std::conditional_t<std::is_same_v<S, float>, double, S>;

/// atan2 for any scalar whose derivatives are of first order: the plain angle plus its differential,
/// (x dy − y dx) / (x² + y²).
template <class S>
S angle_of(const S& y, const S& x) {
  if constexpr (std::is_floating_point_v<S>) {
    return std::atan2(y, x);
  } else {
    const auto y0 = real_part(y);
    const auto x0 = real_part(x);
    const auto squared = x0 * x0 + y0 * y0;
    return S(std::atan2(y0, x0)) + (y - S(y0)) * S(x0 / squared) - (x - S(x0)) * S(y0 / squared);
  }
}

}  // namespace detail

/// Σ aᵢ bᵢ, without conjugation.
template <class S, int N>
S dot(const Eigen::Matrix<S, N, 1>& a, const Eigen::Matrix<S, N, 1>& b) {
  S sum = a[0] * b[0];
  for (int i = 1; i < N; ++i) sum += a[i] * b[i];
  return sum;
}

/// a × b, without conjugation.
template <class S>
Vector3<S> cross(const Vector3<S>& a, const Vector3<S>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// The matrix K of the cross product: hat(v) p = v × p.
template <class S>
Matrix3<S> hat(const Vector3<S>& v) {
  Matrix3<S> k;
  k << S(0), -v[2], v[1], v[2], S(0), -v[0], -v[1], v[0], S(0);
  return k;
}

/// The adjoint of hat: Σᵢⱼ mᵢⱼ hat(v)ᵢⱼ = axial(m) · v. For a skew matrix it is twice the vector.
template <class S>
Vector3<S> axial(const Matrix3<S>& m) {
  return {m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1)};
}

/// A vector split into unit vector and length.
template <class S, int N>
struct Direction {
  Eigen::Matrix<S, N, 1> unit;
  S length;
  bool usable;  ///< false for the zero vector and non-finite ones; unit and length are then 0
};

/// Shortest vector through whose normalisation a gradient passes: below, 1/length could overflow.
template <class S>
detail::Real<S> smallest_length() {
  return std::sqrt(std::numeric_limits<detail::Real<S>>::min());
}

/// v / |v| and |v|, for any length: v is divided by its largest component first, so nothing under- or overflows.
///
/// Adjoint: direction_adjoint.
template <class S, int N>
Direction<S, N> direction_of(const Eigen::Matrix<S, N, 1>& v) {
  using R = detail::Real<S>;
  R largest = 0;
  bool finite = true;
  for (int i = 0; i < N; ++i) {
    const R magnitude = std::fabs(detail::real_part(v[i]));
    finite = finite && magnitude <= std::numeric_limits<R>::max();
    if (magnitude > largest) largest = magnitude;
  }
  if (!finite || !(largest > 0)) return {Eigen::Matrix<S, N, 1>::Zero(), S(0), false};
  using std::sqrt;
  const Eigen::Matrix<S, N, 1> scaled = v / S(largest);
  const S norm = sqrt(dot(scaled, scaled));
  return {scaled / norm, norm * S(largest), true};
}

/// d_v += (d_unit − unit (unit · d_unit)) / |v|, always orthogonal to v.
///
/// The gradient is stopped (nothing is added) where the vector is not usable or shorter than smallest_length().
template <class S, int N>
void direction_adjoint(const Direction<S, N>& direction, const Eigen::Matrix<S, N, 1>& d_unit,
                       Eigen::Matrix<S, N, 1>& d_v) {
  if (!direction.usable || !(detail::real_part(direction.length) >= smallest_length<S>())) return;
  d_v += (d_unit - direction.unit * dot(direction.unit, d_unit)) / direction.length;
}

}  // namespace hsi4d
