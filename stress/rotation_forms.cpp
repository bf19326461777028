// Rows C7 to C13: quaternions, pairs of columns, chains, views.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "autodiff/map.h"
#include "body/kinematics.h"
#include "core/angles.h"
#include "core/camera.h"
#include "core/check.h"
#include "core/quaternion.h"
#include "core/random.h"
#include "core/rotation.h"
#include "core/rotation_6d.h"
#include "stress/rotation_measures.h"
#include "stress/rows.h"
#include "stress/tape_numbers.h"

namespace hsi4d::stress {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

/// A cotangent of matrices with symmetric and skew part.
Matrix3<float> cotangent() { return Matrix3<float>::Ones() + hat(Vector3<float>(1, 2, 3)); }

Vector3<double> normal_vector(RandomSequence& random) {
  const double x = random.normal(), y = random.normal();
  return {x, y, random.normal()};
}

/// 2 atan2(|v|, w) v/|v|, on whichever side of the sphere q is.
Vector3<float> one_sided_log(const Vector4<float>& q) {
  const Vector3<float> v(q[1], q[2], q[3]);
  const float length = v.norm();
  return v * (2 * std::atan2(length, q[0]) / length);
}

Vector4<float> one_sided_slerp(const Vector4<float>& p, const Vector4<float>& q, float u) {
  const Vector4<float> step = quaternion_product(quaternion_conjugate(p), q);
  return quaternion_product(p, quaternion_exp(Vector3<float>(one_sided_log(step) * u)));
}

/// Angle between two rotations, 0 to π.
double angle_between(const Vector4<float>& p, const Vector4<float>& q) {
  const Vector4<double> d = quaternion_product(quaternion_conjugate(widen(p)), widen(q));
  return 2 * std::atan2(Vector3<double>(d[1], d[2], d[3]).norm(), std::abs(d[0]));
}

// --- what is done without the remedies

/// q/|q| with |q|² as it comes, and its adjoint.
Matrix3<float> plainly_normalised(const Vector4<float>& q, const Matrix3<float>& g, Vector4<float>& d_q) {
  const float length = std::sqrt(q.squaredNorm());
  const Vector4<float> unit = q / length;
  const Vector4<float> d = detail::unit_quaternion_gradient(unit, g);
  d_q = (d - unit * unit.dot(d)) / length;
  return detail::unit_quaternion_to_matrix(unit);
}

/// Gram and Schmidt with lengths held above 1e-12, and the gradient of the second column.
Matrix3<float> plain_columns(const Vector3<float>& a, const Vector3<float>& b, const Matrix3<float>& g,
                             Vector3<float>& d_b) {
  const Vector3<float> b1 = a / std::max(a.norm(), 1e-12f);
  const Vector3<float> v = b - b1 * b1.dot(b);
  const float length = std::max(v.norm(), 1e-12f);
  const Vector3<float> b2 = v / length;
  Matrix3<float> r;
  r << b1, b2, cross(b1, b2);
  const Vector3<float> d_b2 = g.col(1) + cross(Vector3<float>(g.col(2)), b1);
  const Vector3<float> d_v = (d_b2 - b2 * b2.dot(d_b2)) / length;
  d_b = d_v - b1 * b1.dot(d_v);
  return r;
}

/// |q_i| = ½ √(1 ± r00 ± r11 ± r22), signs from the skew part, and the adjoint of that.
Vector4<float> quaternion_by_roots(const Matrix3<float>& r, const Vector4<float>& d_q, Matrix3<float>& d_r) {
  constexpr float kSigns[4][3] = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  const Vector3<float> skew = axial(r);
  Vector4<float> q;
  for (int i = 0; i < 4; ++i) {
    float square = 1;
    for (int k = 0; k < 3; ++k) square += kSigns[i][k] * r(k, k);
    const float root = std::sqrt(std::max(0.0f, square));
    const float sign = i == 0 ? 1 : std::copysign(1.0f, skew[i - 1]);
    q[i] = sign * root / 2;
    for (int k = 0; k < 3; ++k) d_r(k, k) += d_q[i] * sign * kSigns[i][k] / (4 * root);
  }
  return q;
}

}  // namespace

/// C7: logarithms of q and −q, and the way from one rotation to another.
std::vector<StressFigure> quaternion_signs(Remedy remedy) {
  const bool on = remedy == Remedy::kOn;
  RandomSequence random(32, random_stream("stress.C7"));
  double difference = 0, beyond = 0, longer = 0;
  for (int repeat = 0; repeat < 200; ++repeat) {
    const Vector4<float> p = narrow(random.rotation()), q = narrow(random.rotation());
    const auto log = [on](const Vector4<float>& x) { return widen(on ? quaternion_log(x) : one_sided_log(x)); };
    difference = larger(difference, largest(Vector3<double>(log(q) - log(Vector4<float>(-q)))));
    beyond = larger(beyond, log(q).norm() - kPi);
    const Vector4<float> middle = on ? slerp(p, q, 0.5f) : one_sided_slerp(p, q, 0.5f);
    longer = larger(longer, angle_between(p, middle) - angle_between(p, q) / 2);
  }
  return {{"log(q) - log(-q), rad", difference, 0},
          {"angle beyond half a turn, rad", beyond, 4e-7},
          {"way to the middle beyond half of the way, rad", longer, 2e-6}};
}

/// C8: quaternions of every length, and those that are none.
std::vector<StressFigure> quaternion_lengths(Remedy remedy) {
  const Matrix3<float> g = cotangent();
  double off = 0, gradient = 0, untold = 0;
  const auto try_one = [&](const Vector4<float>& q, bool is_broken) {
    bool degenerate = false;
    Vector4<float> d_q = Vector4<float>::Zero();
    Matrix3<float> r;
    if (remedy == Remedy::kOn) {
      r = quaternion_to_matrix(q, &degenerate);
      quaternion_to_matrix_adjoint(q, g, d_q);
    } else {
      r = plainly_normalised(q, g, d_q);
    }
    off = larger(off, orthogonality_error(r));
    const double length = is_broken ? 1 : std::max(widen(q).norm(), static_cast<double>(smallest_length<float>()));
    gradient = larger(gradient, largest(widen(d_q)) * length);
    if (is_broken && !degenerate) ++untold;
  };
  for (const float s : {1e-45f, 1e-38f, 1e-30f, 1e-20f, 1.0f, 1e20f, 1e38f}) try_one({s, -s, s, s}, false);
  for (const float x : {kInfinity, kNaN, 0.0f}) try_one({x, 0, 0, 0}, true);
  return {{"R R^T - I, units of eps", off, 4},
          {"gradient times length", gradient, 100},
          {"zero and broken ones that are not told", untold, 0}};
}

/// C9: two columns at angles down to 1e-8, both ways.
std::vector<StressFigure> parallel_columns(Remedy remedy) {
  RandomSequence random(41, random_stream("stress.C9"));
  const Matrix3<float> g = cotangent();
  double off = 0, det = 0, gradient = 0, untold = 0;
  for (int repeat = 0; repeat < 9 * 40; ++repeat) {
    const int digit = repeat / 40;
    const double angle = std::pow(10.0, -digit), side = repeat % 2 == 0 ? 1 : -1;
    const Vector3<double> w = normal_vector(random);
    const Matrix3<double> frame = axis_turn(w.normalized(), w.norm());
    const Vector3<float> a = narrow(Vector3<double>(frame.col(0)));
    const Vector3<float> b =
        narrow(Vector3<double>(frame.col(0) * (side * std::cos(angle)) + frame.col(1) * std::sin(angle)));
    bool degenerate = false;
    Vector3<float> d_a = Vector3<float>::Zero(), d_b = Vector3<float>::Zero();
    Matrix3<float> r;
    if (remedy == Remedy::kOn) {
      r = rotation_from_6d(a, b, &degenerate);
      rotation_from_6d_adjoint(a, b, g, d_a, d_b);
    } else {
      r = plain_columns(a, b, g, d_b);
    }
    off = larger(off, orthogonality_error(r));
    det = larger(det, std::abs(determinant(widen(r)) - 1));
    gradient = larger(gradient, largest(widen(d_a)));
    gradient = larger(gradient, largest(widen(d_b)));
    if (digit > 4 && !degenerate) ++untold;
  }
  return {{"R R^T - I, units of eps", off, 4},
          {"determinant - 1", det, 1e-6},
          {"largest gradient", gradient, 20 / kParallel6d},
          {"parallel ones that are not told", untold, 0}};
}

/// C10: the quaternion of a matrix and its adjoint, along turns e_k: dR = E_k R and dq = ½ (0, e_k) q.
std::vector<StressFigure> pivots(Remedy remedy) {
  std::vector<Vector3<double>> turns = {Vector3<double>::Zero()};
  for (int i = 0; i < 3; ++i) {
    turns.emplace_back(Vector3<double>::Unit(i) * (kPi / 2));
    turns.emplace_back(Vector3<double>::Unit(i) * (kPi - 1e-2) + Vector3<double>(1e-3, 2e-3, -1e-3));
  }
  double value = 0, slope = 0;
  for (const Vector3<double>& w : turns) {
    const Matrix3<double> exact =
        w.isZero(0) ? Matrix3<double>(Matrix3<double>::Identity()) : axis_turn(w.normalized(), w.norm());
    const double half = w.norm() / 2, share = half > 0 ? std::sin(half) / w.norm() : 0.5;
    const Vector4<double> truth(std::cos(half), share * w[0], share * w[1], share * w[2]);
    const Matrix3<float> r = narrow(exact);
    for (int i = 0; i < 4; ++i) {
      const Vector4<float> g = Vector4<float>::Unit(i);
      Matrix3<float> d_r = Matrix3<float>::Zero();
      Vector4<float> q;
      if (remedy == Remedy::kOn) {
        q = quaternion_from_matrix(r);
        quaternion_from_matrix_adjoint(r, g, d_r);
      } else {
        q = quaternion_by_roots(r, g, d_r);
      }
      value = larger(value, largest(Vector4<double>(widen(q) - truth)));
      for (int k = 0; k < 3; ++k) {
        const Matrix3<double> turned = hat(Vector3<double>(Vector3<double>::Unit(k))) * exact;
        double along = 0;
        for (int n = 0; n < 9; ++n) along += widen(d_r)(n / 3, n % 3) * turned(n / 3, n % 3);
        const Vector4<double> step = quaternion_product(Vector4<double>(Vector4<double>::Unit(1 + k)), truth);
        slope = larger(slope, std::abs(along - step[i] / 2));
      }
    }
  }
  return {{"error of q", value, 4e-7}, {"error of dq along turns", slope, 2e-6}};
}

/// C11: x log x for x > 0, else 2 x.
std::vector<StressFigure> dead_branches(Remedy remedy) {
  const std::vector<float> numbers = {0, -1, 0.25f, kNaN, -kInfinity, 3, -1e-30f, 1e-30f};
  const auto count = static_cast<Index>(numbers.size());
  Tape<float> tape;
  const Var<float> x = leaf(tape, "x", shape_of(1, count), numbers);
  const auto blended = [](const auto& v) {  // both branches, weighted by 1 and 0
    const float taken = value_of(v) > 0 ? 1.0f : 0.0f;
    return v * log(v) * taken + v * 2.0f * (1 - taken);
  };
  const auto chosen = [](const auto& v) { return select(value_of(v) > 0, v * log(v), v * 2.0f); };
  const Var<float> y = remedy == Remedy::kOn ? map({x}, chosen) : map({x}, blended);
  tape.forward(y);
  tape.backward(y, std::vector<float>(numbers.size(), 1));
  double broken = 0, error = 0;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const double d = static_cast<double>(tape.gradient(x).data[i]), at = static_cast<double>(numbers[i]);
    if (!std::isfinite(d)) ++broken;
    error = larger(error, std::abs(d - (at > 0 ? std::log(at) + 1 : 2)));
  }
  return {{"gradients that are not finite", broken, 0}, {"error of the gradient", error, 1e-5}};
}

/// C12: 55 joints one after the other, in matrices of floats, against the same product in double.
std::vector<StressFigure> chains(Remedy remedy) {
  constexpr Index kJoints = 55;
  std::vector<int> parents(kJoints);
  std::iota(parents.begin(), parents.end(), -1);
  RandomSequence random(64, random_stream("stress.C12"));
  double rotation_error = 0, place_error = 0, off = 0;
  for (int repeat = 0; repeat < 20; ++repeat) {
    std::vector<double> rest;
    std::vector<float> rotations;
    Vector3<double> place = Vector3<double>::Zero();
    for (Index j = 0; j < kJoints; ++j) {
      place += widen(narrow(Vector3<double>(0.05 * normal_vector(random))));
      rest.insert(rest.end(), place.begin(), place.end());
      const Matrix3<float> r = so3_exp(narrow(normal_vector(random)));
      for (int i = 0; i < 9; ++i) rotations.push_back(r(i / 3, i % 3));
    }
    Tape<float> tape;
    const Var<float> r = leaf(tape, "r", shape_of(kJoints, 9), rotations);
    const auto posed = kinematic_chain(r, tape.constant("transl", shape_of(1, 3)), parents, rest);
    tape.forward(posed.transforms);
    Matrix3<double> exact = Matrix3<double>::Identity();
    Matrix3<float> single = Matrix3<float>::Identity();
    Vector3<double> exact_place(rest.data());
    Vector3<float> single_place = narrow(exact_place);
    for (Index j = 0; j < kJoints; ++j) {
      Matrix3<float> local;
      for (int i = 0; i < 9; ++i) local(i / 3, i % 3) = rotations[static_cast<std::size_t>(9 * j + i)];
      if (j > 0) {
        const Vector3<double> bone = Vector3<double>(&rest[3 * j]) - Vector3<double>(&rest[3 * j - 3]);
        exact_place += exact * bone;
        single_place += single * narrow(bone);
      }
      exact = (exact * widen(local)).eval();
      single = (single * local).eval();
      Matrix3<double> found = widen(single);
      Vector3<double> found_place = widen(single_place);
      if (remedy == Remedy::kOn) {
        const float* a = tape.value(posed.transforms).row(j);
        for (int i = 0; i < 9; ++i) found(i / 3, i % 3) = static_cast<double>(a[4 * (i / 3) + i % 3]);
        for (int i = 0; i < 3; ++i) found_place[i] = static_cast<double>(tape.value(posed.joints)(j, i));
      }
      rotation_error = larger(rotation_error, largest(Matrix3<double>(found - exact)));
      place_error = larger(place_error, largest(Vector3<double>(found_place - exact_place)));
      off = larger(off, orthogonality_error(Matrix3<float>(narrow(found))));
    }
  }
  return {{"R - product in double, units of eps", rotation_error / 1.19e-7, 0.5},
          {"places of joints - those in double, m", place_error, 1e-7},
          {"R R^T - I, units of eps", off, 20}};
}

/// Axes by cross products alone.
Rigid<double> front_view(const Vector3<double>& eye, const Vector3<double>& target, const Vector3<double>& up) {
  const Vector3<double> z = (target - eye).normalized();
  Vector3<double> x = cross(z, up);
  x /= x.norm();
  Rigid<double> view;
  view.rotation << x.transpose(), cross(z, x).transpose(), z.transpose();
  view.translation = -(view.rotation * eye);
  return view;
}

/// C13: views along all axes with each axis for up, and a little beside them; then a view that swings around.
std::vector<StressFigure> views_along_up(Remedy remedy) {
  const auto look = [remedy](const Vector3<double>& eye, const Vector3<double>& target, const Vector3<double>& up) {
    return remedy == Remedy::kOn ? look_at(eye, target, up) : front_view(eye, target, up);
  };
  RandomSequence random(60, random_stream("stress.C13"));
  const Vector3<double> eye(0.3, -0.2, 0.7), above = Vector3<double>::UnitZ();
  double off = 0, axis = 0, jump = 0, accepted = 0;
  for (int i = 0; i < 6 * 3 * 4; ++i) {
    const double beside[] = {0.0, 1e-9, 1e-7, 1e-3};
    const Vector3<double> direction = Vector3<double>::Unit(i / 24) * (i / 12 % 2 == 0 ? 1 : -1);
    const Vector3<double> target = eye + direction + beside[i % 4] * normal_vector(random);
    const Matrix3<double> r = look(eye, target, Vector3<double>::Unit(i / 4 % 3)).rotation;
    off = larger(off, largest(Matrix3<double>(r * r.transpose() - Matrix3<double>::Identity())));
    off = larger(off, std::abs(determinant(r) - 1));
    axis = larger(axis, largest(Vector3<double>(r * (target - eye).normalized() - above)));
  }
  Matrix3<double> before = look(eye, eye + Vector3<double>(1, 0, 0), above).rotation;
  for (double angle = 0; angle < 1.3; angle += 1e-4) {
    const Vector3<double> direction(std::cos(angle), 0.1 * std::sin(5 * angle), std::sin(angle));
    const Matrix3<double> r = look(eye, eye + direction, above).rotation;
    jump = larger(jump, largest(Matrix3<double>(r - before)));
    before = r;
  }
  try {
    look(eye, eye, above);
    ++accepted;
  } catch (const UserError&) {
  }
  return {{"R R^T - I, determinant - 1; units of eps32", off / 1.19e-7, 4},
          {"error of the view's axis", axis, 1e-12},
          {"jump of a pose in a step of 1e-4 rad", jump, 1e-3},
          {"eyes at their targets accepted", accepted, 0}};
}

}  // namespace hsi4d::stress
