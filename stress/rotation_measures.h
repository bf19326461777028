// What cases measure with: errors of small matrices in which a number that is not one is the largest, and series in
// long double.
#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include "core/linear.h"
#include "stress/measures.h"

namespace hsi4d::stress {

/// The 26 directions to the faces, edges and corners of a cube.
inline std::vector<Vector3<double>> cube_directions() {
  std::vector<Vector3<double>> all;
  for (int i = 0; i < 27; ++i) {
    const Vector3<double> v(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
    if (!v.isZero()) all.push_back(v.normalized());
  }
  return all;
}

/// |value − exact| / |exact|.
inline double relative(long double value, long double exact) {
  return static_cast<double>(std::abs((value - exact) / exact));
}

/// Distance in units in the last place of `exact`.
template <class S>
double ulps(S value, long double exact) {
  const long double unit = std::ldexp(1.0L, std::ilogb(exact) + 1 - std::numeric_limits<S>::digits);
  return static_cast<double>(std::abs(static_cast<long double>(value) - exact) / unit);
}

/// Casts that are not inlined: g++ 12's vectoriser sometimes turns double → float → double within a function into
/// nothing.
template <int R, int C>
[[gnu::noinline]] Eigen::Matrix<float, R, C> narrow(const Eigen::Matrix<double, R, C>& m) {
  return m.template cast<float>();
}
template <class S, int R, int C>
[[gnu::noinline]] Eigen::Matrix<double, R, C> widen(const Eigen::Matrix<S, R, C>& m) {
  return m.template cast<double>();
}

/// The largest |entry|.
template <int R, int C>
double largest(const Eigen::Matrix<double, R, C>& m) {
  double size = 0;
  for (Eigen::Index i = 0; i < m.size(); ++i) size = larger(size, std::abs(m.data()[i]));
  return size;
}

/// Largest entry of |R Rᵀ − I|, computed in double, in units of S's ε.
template <class S>
double orthogonality_error(const Matrix3<S>& r) {
  const Matrix3<double> d = widen(r);
  return largest(Matrix3<double>(d * d.transpose() - Matrix3<double>::Identity())) /
         static_cast<double>(std::numeric_limits<S>::epsilon());
}

inline double determinant(const Matrix3<double>& r) {
  return dot(Vector3<double>(r.col(0)), cross(Vector3<double>(r.col(1)), Vector3<double>(r.col(2))));
}

/// The rotation about a unit axis, in its textbook form, whose cancellation is of absolute size 1e-16.
inline Matrix3<double> axis_turn(const Vector3<double>& axis, double angle) {
  const double half = std::sin(angle / 2);
  return Matrix3<double>(Matrix3<double>::Identity() * std::cos(angle) + hat(axis) * std::sin(angle) +
                         axis * axis.transpose() * (2 * half * half));
}

/// c_k(x) = Σ (−x)^j / (2j + k)! of core/stumpff.h, and its derivative: the plain series, whose terms stay small for
/// x ≤ 130.
inline long double stumpff_series(int k, long double x, bool derivative = false) {
  long double term = 1, sum = 0;
  for (int n = 1; n <= (derivative ? k + 2 : k); ++n) term /= n;
  for (int j = derivative ? 1 : 0; j < 60; ++j) {
    sum += derivative ? -j * term : term;
    term *= -x / (static_cast<long double>(2 * j + k + 1) * (2 * j + k + 2));
  }
  return sum;
}

}  // namespace hsi4d::stress
