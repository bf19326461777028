// Rows C: rotations. Here exponential and logarithm; the others are in rotation_forms.cpp.
#include "autodiff/rotations.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "autodiff/dual.h"
#include "core/angles.h"
#include "core/rotation.h"
#include "core/stumpff.h"
#include "stress/rotation_measures.h"
#include "stress/rows.h"
#include "stress/tape_numbers.h"

namespace hsi4d::stress {

namespace {

/// A rotation by rows, and its derivative by the axis-angle vector.
struct Turn {
  Eigen::Matrix<double, 9, 1> value;
  Eigen::Matrix<double, 9, 3> slope;
};

/// By the operator.
Turn taped_turn(const Vector3<float>& w) {
  Tape<float> tape;
  const Var<float> x = leaf(tape, "w", shape_of(1, 3), {w[0], w[1], w[2]});
  const Var<float> r = rotations_from_axis_angle(x);
  tape.forward(r);
  Turn turn;
  for (int i = 0; i < 9; ++i) {
    std::array<float, 9> one{};
    one[static_cast<std::size_t>(i)] = 1;
    tape.backward(r, one);
    turn.value[i] = static_cast<double>(tape.value(r).data[i]);
    for (int k = 0; k < 3; ++k) turn.slope(i, k) = static_cast<double>(tape.gradient(x).data[k]);
  }
  return turn;
}

/// As it stands in books, with angle and unit axis: R = I + sin t K + (1 − cos t) K².
/// @param root  of the squared angle, a dual number
template <class Root>
Turn textbook_turn(const Vector3<float>& w, const Root& root) {
  const auto x = dual_variable<0>(w[0]);
  const auto y = dual_variable<1>(w[1]);
  const auto z = dual_variable<2>(w[2]);
  const auto t = root(x * x + y * y + z * z);
  const auto length = max(t, 1e-12f);
  using Number = Dual<float, 7>;
  const std::array<Number, 3> a = {Number(x / length), Number(y / length), Number(z / length)};
  const Number square = a[0] * a[0] + a[1] * a[1] + a[2] * a[2];
  Turn turn;
  for (std::size_t i = 0; i < 9; ++i) {
    const std::size_t row = i / 3, column = i % 3, third = 3 - row - column;
    Number entry = (1.0f - cos(t)) * (a[row] * a[column]);
    if (row == column) entry = entry - (1.0f - cos(t)) * square + 1.0f;
    if (row != column) entry = entry + sin(t) * a[third] * (column == (row + 1) % 3 ? -1.0f : 1.0f);
    const auto at = static_cast<Eigen::Index>(i);
    turn.value[at] = static_cast<double>(entry.value);
    for (std::size_t k = 0; k < 3; ++k) {
      turn.slope(at, static_cast<Eigen::Index>(k)) = static_cast<double>(entry.partial(k));
    }
  }
  return turn;
}

/// dR/dw_i = c1 E_i + c2 (E_i K + K E_i) + 2 w_i (c1' K + c2' K²), E_i the generators.
Eigen::Matrix<double, 9, 3> exact_rotation_slope(const Vector3<double>& w) {
  const long double x = static_cast<long double>(w[0]) * w[0] + static_cast<long double>(w[1]) * w[1] +
                        static_cast<long double>(w[2]) * w[2];
  const auto c = [x](int k, bool derivative) { return static_cast<double>(stumpff_series(k, x, derivative)); };
  const Matrix3<double> k = hat(w);
  Eigen::Matrix<double, 9, 3> slope;
  for (int i = 0; i < 3; ++i) {
    const Matrix3<double> e = hat(Vector3<double>(Vector3<double>::Unit(i)));
    const Matrix3<double> d =
        e * c(1, false) + (e * k + k * e) * c(2, false) + (k * c(1, true) + k * k * c(2, true)) * (2 * w[i]);
    for (int entry = 0; entry < 9; ++entry) slope(entry, i) = d(entry / 3, entry % 3);
  }
  return slope;
}

/// The root as the chain rule has it, infinite at 0.
constexpr auto kBareRoot = [](const auto& x) {
  const float root = std::sqrt(x.value);
  return x.chain(root, 0.5f / root);
};
/// The root with the gradient 0 at 0.
constexpr auto kGuardedRoot = [](const auto& x) { return sqrt(x); };

/// The first terms of c_k, as many as do for small angles.
double short_series(int k, double x) {
  double sum = 0, term = detail::inverse_factorial<double>(k);
  for (int j = 0; j < 4; ++j) {
    sum += term;
    term *= -x / ((2 * j + k + 1) * (2 * j + k + 2));
  }
  return sum;
}

/// acos of the trace, the axis from the skew part over sin t.
Vector3<float> textbook_log(const Matrix3<float>& r) {
  const float t = std::acos(std::clamp((r.trace() - 1) / 2, -1.0f, 1.0f));
  return axial(r) * (t / (2 * std::sin(t)));
}

/// (1 − t/2 cot(t/2))/t² = Σ_n 2 ζ(2n) x^(n−1) / (2π)^(2n), or its derivative by x = t².
long double cotangent_series(long double x, bool derivative) {
  static const auto kScales = [] {
    constexpr long double kFull = 2 * std::numbers::pi_v<long double>;
    std::array<long double, 60> scales{kFull * kFull / 24};  // ζ(2), which converges slowly
    for (std::size_t n = 2; n <= scales.size(); ++n) {
      for (int i = 400; i >= 1; --i) scales[n - 1] += std::pow(static_cast<long double>(i), -2.0L * n);
    }
    for (std::size_t n = 1; n <= scales.size(); ++n) scales[n - 1] *= 2 * std::pow(kFull, -2.0L * n);
    return scales;
  }();
  long double sum = 0, power = 1;
  for (std::size_t n = derivative ? 1 : 0; n < kScales.size(); ++n) {
    sum += kScales[n] * power * (derivative ? n : 1);
    power *= x;
  }
  return sum;
}

}  // namespace

/// C1: at no rotation and near it.
std::vector<StressFigure> gradient_at_identity(Remedy remedy) {
  double value = 0, at_zero = 0, near_zero = 0;
  for (const float size : {0.0f, 1e-45f, 1e-40f, 1e-30f, 1e-20f, 1e-10f, 1e-8f, 1e-5f, 1e-3f, 1e-1f}) {
    for (const float s : {size, -size}) {
      const Vector3<float> w(s, -s, s / 2);
      const Turn turn = remedy == Remedy::kOn ? taped_turn(w) : textbook_turn(w, kBareRoot);
      const double off = largest(Eigen::Matrix<double, 9, 3>(turn.slope - exact_rotation_slope(widen(w))));
      (size <= 1e-8f ? at_zero : near_zero) = larger(size <= 1e-8f ? at_zero : near_zero, off);
      Matrix3<double> r;
      for (int i = 0; i < 9; ++i) r(i / 3, i % 3) = turn.value[i];
      value = larger(value, orthogonality_error(Matrix3<float>(narrow(r))));
    }
  }
  return {{"R R^T - I, units of eps", value, 4},
          {"error of dR/dw for |w| <= 1e-8", at_zero, 1e-7},
          {"error of dR/dw up to |w| = 0.1", near_zero, 1e-6}};
}

/// C2: the gradient's value at no rotation, and where 60 steps down ‖R − R*‖² get from there.
std::vector<StressFigure> gradient_leaves_identity(Remedy remedy) {
  const auto turn_of = [remedy](const Vector3<float>& w) {
    return remedy == Remedy::kOn ? taped_turn(w) : textbook_turn(w, kGuardedRoot);
  };
  const Vector3<float> zero = Vector3<float>::Zero();
  const double value =
      largest(Eigen::Matrix<double, 9, 3>(turn_of(zero).slope - exact_rotation_slope(Vector3<double>::Zero())));
  const Vector3<double> truth(0.3, -0.2, 0.4);
  const Matrix3<double> r = axis_turn(truth.normalized(), truth.norm());
  Vector3<double> w = Vector3<double>::Zero();
  for (int step = 0; step < 60; ++step) {
    const Turn turn = turn_of(narrow(w));
    Eigen::Matrix<double, 9, 1> off = turn.value;
    for (int i = 0; i < 9; ++i) off[i] -= r(i / 3, i % 3);
    w -= 0.3 * turn.slope.transpose() * off;
  }
  return {{"error of dR/dw at 0, where it is 1", value, 1e-7},
          {"what is left of 0.54 rad after 60 steps, rad", largest(Vector3<double>(w - truth)), 1e-5}};
}

/// C3: coefficients of a rotation and their derivatives by the squared angle.
std::vector<StressFigure> coefficients(Remedy remedy) {
  double value = 0, slope = 0;
  for (double t = 1e-8; t < 3.1; t *= 1.05) {
    const float angle = static_cast<float>(t), x = angle * angle;
    float c2, d_c2;
    if (remedy == Remedy::kOn) {
      const Stumpff<float> s = stumpff(x);
      c2 = s.c2;
      d_c2 = s.d_c2();
    } else {  // (1 − cos t)/t² and what it gives when it is differentiated
      c2 = (1 - std::cos(angle)) / x;
      d_c2 = (std::sin(angle) / angle / 2 - c2) / x;
    }
    value = larger(value, relative(c2, stumpff_series(2, x)));
    slope = larger(slope, relative(d_c2, stumpff_series(2, x, true)));
  }
  return {{"relative error of (1 - cos t)/t^2", value, 4 * 1.19e-7}, {"relative error of its derivative", slope, 1e-5}};
}

/// C4: the formulas on either side of each switch, from half of it to twice.
std::vector<StressFigure> switches(Remedy remedy) {
  const bool on = remedy == Remedy::kOn;
  double sines = 0, series = 0, doubled = 0, step = 0;
  for (double u = 0.5; u <= 2; u *= 1.003) {
    double x = u * kStumpffSines;
    const Stumpff<double> angles = detail::stumpff_from_sines(x);
    const double c1 = on ? 1 - x * detail::stumpff_series<3>(x) : short_series(1, x);
    const double c2 = on ? 0.5 - x * detail::stumpff_series<4>(x) : short_series(2, x);
    for (const auto& [c, k] : {std::pair{angles.c1, 1}, {angles.c2, 2}, {c1, 1}, {c2, 2}}) {
      sines = larger(sines, ulps(c, stumpff_series(k, x)));
    }
    x = u * kStumpffSeries;
    Stumpff<double> half{};
    detail::add_doubled(stumpff(x / 4), half);
    const double c3 = on ? detail::stumpff_series<3>(x) : short_series(3, x);
    for (const auto& [c, k] : {std::pair{half.c3, 3}, {half.c4, 4}, {half.c5, 5}, {c3, 3}}) {
      series = larger(series, ulps(c, stumpff_series(k, x)));
    }
    x = u * kStumpffDouble;
    detail::add_doubled(stumpff(x / 4), half);
    Stumpff<double> quotients = detail::stumpff_from_sines(x);
    detail::add_quotients(x, quotients);
    for (const Stumpff<double>& c : {half, quotients}) {
      doubled = larger(doubled, ulps(c.c3, stumpff_series(3, x)));
      doubled = larger(doubled, ulps(c.c5, stumpff_series(5, x)));
    }
  }
  const double below = std::nextafter(kStumpffSines, 0.0);
  const double c2_below = on ? stumpff(below).c2 : short_series(2, below);
  step = ulps(c2_below, static_cast<long double>(stumpff(kStumpffSines).c2));
  return {{"c1, c2 about the switch to sines, ulp", sines, 4},
          {"c3, c4, c5 about the end of the series, ulp", series, 4},
          {"c3, c5 about the end of doubling, ulp", doubled, 4},
          {"jump of c2 at the switch to sines, ulp", step, 2}};
}

/// C5: angle and axis of rotations at and near half a turn.
std::vector<StressFigure> log_near_half_turn(Remedy remedy) {
  double angle_error = 0, axis_error = 0, round_trip = 0;
  std::vector<double> angles{kPi};
  for (int digit = 1; digit <= 8; ++digit) angles.push_back(kPi - std::pow(10.0, -digit));
  for (const double angle : angles) {
    for (const Vector3<double>& axis : cube_directions()) {
      const Matrix3<float> r = narrow(axis_turn(axis, angle));
      const Vector3<double> w = widen(remedy == Remedy::kOn ? so3_log(r) : textbook_log(r));
      const Vector3<double> found = w / w.norm();
      // At π to the rounding of floats both axes are right.
      const double sign = kPi - angle > 1e-6 || axis.dot(found) > 0 ? 1 : -1;
      angle_error = larger(angle_error, std::abs(w.norm() - angle));
      axis_error = larger(axis_error, (found - sign * axis).norm());
      round_trip = larger(round_trip, largest(Matrix3<double>(axis_turn(found, w.norm()) - widen(r))));
    }
  }
  return {{"error of the angle, rad", angle_error, 2 * 1.19e-7 * kPi},
          {"error of the axis", axis_error, 1e-6},
          {"exp(log R) - R, units of eps", round_trip / 1.19e-7, 4}};
}

/// C6: the coefficient of the inverse Jacobian and its derivative in float, 0 to π.
std::vector<StressFigure> inverse_jacobian(Remedy remedy) {
  std::vector<double> angles;
  for (double t = 1e-8; t < kPi; t *= 1.6) angles.push_back(t);
  for (int digit = 1; digit <= 7; ++digit) angles.push_back(kPi - std::pow(10.0, -digit));
  double value = 0, slope = 0;
  for (const double t : angles) {
    const float x = static_cast<float>(t * t);
    float d, d_d;
    if (remedy == Remedy::kOn) {
      detail::inverse_jacobian_coefficient(x, d, d_d);
    } else {  // 1/t² − (1 + cos t)/(2 t sin t)
      const auto squared = dual_variable<0>(x);
      const auto angle = sqrt(squared);
      const auto textbook = 1.0f / squared - (cos(angle) + 1.0f) / (angle * sin(angle) * 2.0f);
      d = textbook.value;
      d_d = textbook.partial(0);
    }
    value = larger(value, relative(d, cotangent_series(x, false)));
    slope = larger(slope, relative(d_d, cotangent_series(x, true)));
  }
  return {{"relative error of the coefficient", value, 1e-5}, {"relative error of its derivative", slope, 1e-5}};
}

}  // namespace hsi4d::stress
