// Rotation from two column vectors ("6D"), without singularities of its own. [Zhou et al. 2019, section B]
//
//   b1 = a/|a|,   v = b − (b1·b) b1,   b2 = v/|v|,   b3 = b1 × b2,   R = [b1 b2 b3]
//
// The projection is done twice, which makes the result orthogonal to rounding for nearly parallel columns ("twice is
// enough", Kahan and Parlett). Where v is too short to mean anything (row C9), the world axis least aligned with b1
// stands in for b.
#pragma once

#include "core/linear.h"

namespace hsi4d {

/// Sine of the angle between the columns below which the second is replaced.
inline constexpr double kParallel6d = 1e-4;

namespace detail {

template <class S>
struct Frame6d {
  Direction<S, 3> first, second;  // b1 with |a|; b2 with |v|/|b|
  Vector3<S> source;              // b/|b|, or the axis that replaced it
  S source_length;                // |b|
  bool first_replaced, second_replaced;
};

template <class S>
Direction<S, 3> perpendicular_part(const Vector3<S>& b1, const Vector3<S>& source) {
  using std::sqrt;
  const Vector3<S> once = source - b1 * dot(b1, source);
  const S length = sqrt(dot(once, once));
  if (!(real_part(length) >= kParallel6d)) return {Vector3<S>::Zero(), length, false};
  const Vector3<S> twice = once - b1 * dot(b1, once);
  return {twice / sqrt(dot(twice, twice)), length, true};
}

template <class S>
Vector3<S> least_aligned_axis(const Vector3<S>& direction) {
  int least = 0;
  for (int i = 1; i < 3; ++i) {
    if (std::fabs(real_part(direction[i])) < std::fabs(real_part(direction[least]))) least = i;
  }
  return Vector3<S>::Unit(least);
}

template <class S>
Frame6d<S> frame_6d(const Vector3<S>& a, const Vector3<S>& b) {
  Frame6d<S> frame;
  frame.first = direction_of(a);
  frame.first_replaced = !frame.first.usable;
  if (frame.first_replaced) frame.first.unit = Vector3<S>::Unit(0);
  const Direction<S, 3> second = direction_of(b);
  frame.source = second.unit;
  frame.source_length = second.length;
  frame.second = perpendicular_part(frame.first.unit, frame.source);
  frame.second_replaced = !second.usable || !frame.second.usable;
  if (frame.second_replaced) {
    frame.source = least_aligned_axis(frame.first.unit);
    frame.second = perpendicular_part(frame.first.unit, frame.source);
  }
  return frame;
}

}  // namespace detail

/// Rotation matrix of two column vectors; only their directions count, and only b's part across a.
///
/// How the six numbers of a file are laid out is the caller's business: VPoser's decoder output x, for one, is a 3×2
/// matrix by rows, so a = x[0,2,4] and b = x[1,3,5]; others store a = x[0..2], b = x[3..5].
///
/// @param a, b        any lengths
/// @param degenerate  set to whether a vector had to be replaced: a zero or non-finite (then the x axis), b zero,
/// non-finite or
///                    within kParallel6d radians of ±a (then the world axis least aligned with a)
/// @return            a rotation in every case, orthogonal to 4 eps
/// Adjoint: rotation_from_6d_adjoint, a and b. None to a vector that was replaced or is shorter than smallest_length().
template <class S>
Matrix3<S> rotation_from_6d(const Vector3<S>& a, const Vector3<S>& b, bool* degenerate = nullptr) {
  const auto frame = detail::frame_6d(a, b);
  if (degenerate != nullptr) *degenerate = frame.first_replaced || frame.second_replaced;
  Matrix3<S> rotation;
  rotation.col(0) = frame.first.unit;
  rotation.col(1) = frame.second.unit;
  rotation.col(2) = cross(frame.first.unit, frame.second.unit);
  return rotation;
}

template <class S>
void rotation_from_6d_adjoint(const Vector3<S>& a, const Vector3<S>& b, const Matrix3<S>& d_rotation, Vector3<S>& d_a,
                              Vector3<S>& d_b) {
  const auto frame = detail::frame_6d(a, b);
  const Vector3<S>& b1 = frame.first.unit;
  const Vector3<S>& b2 = frame.second.unit;
  const Vector3<S> d_b3 = d_rotation.col(2);
  Vector3<S> d_b1 = d_rotation.col(0) + cross(b2, d_b3);
  const Vector3<S> d_b2 = d_rotation.col(1) + cross(d_b3, b1);
  // v = source − (b1·source) b1; the second projection changes nothing but rounding
  const Vector3<S> d_v = (d_b2 - b2 * dot(b2, d_b2)) / frame.second.length;
  d_b1 -= frame.source * dot(b1, d_v) + d_v * dot(b1, frame.source);
  if (!frame.first_replaced) direction_adjoint(frame.first, d_b1, d_a);
  if (frame.second_replaced || !(detail::real_part(frame.source_length) >= smallest_length<S>())) return;
  d_b += (d_v - b1 * dot(b1, d_v)) / frame.source_length;
}

}  // namespace hsi4d
