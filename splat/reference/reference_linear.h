// Vectors and 3 × 3 matrices of the brute-force renderer, which shares no code with the rest.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace hsi4d::reference {

template <class T>
using Vec3 = std::array<T, 3>;
/// Rows.
template <class T>
using Mat3 = std::array<Vec3<T>, 3>;

template <class T>
T dot(const Vec3<T>& a, const Vec3<T>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

template <class T>
Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

template <class T>
Vec3<T> difference(const Vec3<T>& a, const Vec3<T>& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

/// s a.
template <class T>
Vec3<T> scaled(T s, const Vec3<T>& a) {
  return {s * a[0], s * a[1], s * a[2]};
}

/// sum += s a.
template <class T>
void add(Vec3<T>& sum, T s, const Vec3<T>& a) {
  for (std::size_t i = 0; i < 3; ++i) sum[i] += s * a[i];
}

template <class T>
Mat3<T> transposed(const Mat3<T>& m) {
  return {{{m[0][0], m[1][0], m[2][0]}, {m[0][1], m[1][1], m[2][1]}, {m[0][2], m[1][2], m[2][2]}}};
}

template <class T>
Vec3<T> times(const Mat3<T>& m, const Vec3<T>& v) {
  return {dot(m[0], v), dot(m[1], v), dot(m[2], v)};
}

template <class T>
Mat3<T> times(const Mat3<T>& a, const Mat3<T>& b) {
  const Mat3<T> columns = transposed(b);
  return {times(columns, a[0]), times(columns, a[1]), times(columns, a[2])};
}

/// By Cramer's rule; not finite if m is singular.
template <class T>
Mat3<T> inverse(const Mat3<T>& m) {
  const T det = dot(m[0], cross(m[1], m[2]));
  const Mat3<T> columns = {scaled(1 / det, cross(m[1], m[2])), scaled(1 / det, cross(m[2], m[0])),
                           scaled(1 / det, cross(m[0], m[1]))};
  return transposed(columns);
}

}  // namespace hsi4d::reference
