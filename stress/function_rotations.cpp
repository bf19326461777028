// The coefficients of rotations (core/stumpff.h), their derivatives, and the exponential and logarithm made of them.
#include <numbers>

#include "core/rotation.h"
#include "stress/function_table.h"
#include "stress/rotation_measures.h"

namespace hsi4d::stress {

namespace {

constexpr double kHalfTurn = std::numbers::pi * std::numbers::pi, kTurn = 4 * kHalfTurn;  ///< t² of
constexpr double kSwitches[] = {kStumpffSines, kStumpffSeries, kStumpffDouble, kHalfTurn};

/// A coefficient as a function of t², and up to where units in the last place of its own value make sense: beyond, it
/// has a zero.
struct Coefficient {
  const char* name;
  double (*value)(double);
  long double (*exact)(long double);
  double largest;  ///< its value at 0
  double own_until, bound;
  double bound_beyond;  ///< 0: it is not asked for beyond
};

template <int K, bool kDerivative>
long double series(long double x) {
  return stumpff_series(K, x, kDerivative);
}

/// D = (1 − (t/2) cot(t/2))/t², from series at t²/4, and its derivative.
long double exact_inverse(long double x) {
  return (series<2, false>(x / 4) - series<3, false>(x / 4)) / (4 * series<1, false>(x / 4));
}
long double exact_inverse_slope(long double x) {
  const long double y = x / 4, c1 = series<1, false>(y), over = series<2, false>(y) - series<3, false>(y);
  return (series<2, true>(y) - series<3, true>(y) - over * series<1, true>(y) / c1) / (16 * c1);
}

double inverse(double x, bool is_slope) {
  double value = 0, slope = 0;
  detail::inverse_jacobian_coefficient(x, value, slope);
  return is_slope ? slope : value;
}

constexpr Coefficient kCoefficients[] = {
    {"c1 = sin t/t", [](double x) { return stumpff_12(x).c1; }, series<1, false>, 1, 6.25, 5, 1},
    {"c2 = (1 - cos t)/t^2", [](double x) { return stumpff_12(x).c2; }, series<2, false>, 0.5, kHalfTurn, 5, 1},
    {"c3 = (t - sin t)/t^3", [](double x) { return stumpff(x).c3; }, series<3, false>, 1.0 / 6, kTurn, 4.5, 0},
    {"c4", [](double x) { return stumpff(x).c4; }, series<4, false>, 1.0 / 24, kTurn, 5, 0},
    {"c5", [](double x) { return stumpff(x).c5; }, series<5, false>, 1.0 / 120, kTurn, 4.5, 0},
    {"c1'", [](double x) { return stumpff(x).d_c1(); }, series<1, true>, 1.0 / 6, kHalfTurn, 8, 3},
    {"c2'", [](double x) { return stumpff(x).d_c2(); }, series<2, true>, 1.0 / 24, kHalfTurn, 11, 4},
    {"c3'", [](double x) { return stumpff(x).d_c3(); }, series<3, true>, 1.0 / 120, kHalfTurn, 11, 5},
    {"D of the inverse Jacobian", [](double x) { return inverse(x, false); }, exact_inverse, 1.0 / 12, kHalfTurn, 7, 0},
    {"D'", [](double x) { return inverse(x, true); }, exact_inverse_slope, 1.0 / 720, kHalfTurn, 40, 0},
};

void add_coefficients(FunctionTable& table, Index points) {
  for (const Coefficient& c : kCoefficients) {
    add_plain<double>(table, {c.name, "t^2", 0, c.own_until, c.bound}, points, kSwitches, c.value, c.exact);
    if (c.bound_beyond > 0)
      add_plain<double>(table, {c.name, "t^2", c.own_until, kTurn, c.bound_beyond, c.largest}, points, kSwitches,
                        c.value, c.exact);
  }
}

using LongVector = std::array<long double, 3>;

/// exp(w) = I + c1 K + c2 K², entry (i, j).
long double exact_rotation(const LongVector& w, long double c1, long double c2, int i, int j) {
  const long double x = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
  const auto at = [&w](int k) { return w[static_cast<std::size_t>(k)]; };
  if (i == j) return 1 + c2 * (at(i) * at(i) - x);
  const int k = 3 - i - j;
  const long double sign = (i + 1) % 3 == j ? -1 : 1;
  return sign * c1 * at(k) + c2 * at(i) * at(j);
}

/// Axis-angle vectors of some angles, about random axes. In memory, so that all who read them see them rounded
/// (docs/numerics.md).
template <class S>
[[gnu::noinline]] std::vector<Vector3<S>> turned_about(const std::vector<S>& angles) {
  RandomSequence random(20);
  std::vector<Vector3<S>> vectors;
  for (const S angle : angles) {
    Vector3<double> axis(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    axis *= static_cast<double>(angle) / std::sqrt(dot(axis, axis));
    vectors.push_back(axis.cast<S>());
  }
  return vectors;
}

/// The largest error of the entries, and of the axis-angle vector that comes back from the matrix or the quaternion.
template <class S>
void add_turns(FunctionTable& table, Index points) {
  const double switches[] = {0.5, 2, std::numbers::pi / 2, std::numbers::pi};
  const std::vector<S> angles = arguments<S>(0, std::numbers::pi * (1 - 1e-6), points, switches);
  ErrorSum<S> exponential, logarithm, quaternion;
  const std::vector<Vector3<S>> vectors = turned_about(angles);
  for (std::size_t n = 0; n < angles.size(); ++n) {
    const auto t = static_cast<double>(angles[n]);
    const Vector3<S>& w = vectors[n];
    const LongVector exact = {w[0], w[1], w[2]};
    const long double square = exact[0] * exact[0] + exact[1] * exact[1] + exact[2] * exact[2];
    const long double c1 = series<1, false>(square), c2 = series<2, false>(square);
    const Matrix3<S> r = so3_exp(w);
    double off = 0;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        const long double entry = exact_rotation(exact, c1, c2, i, j);
        off = larger(off, static_cast<double>(std::abs(r(i, j) - entry) / ulp_of<S>(1)));
      }
    }
    exponential.add_error(t, off);
    if (square == 0) continue;
    const auto away = [&](const Vector3<S>& back) {
      double most = 0;
      for (std::size_t i = 0; i < 3; ++i) {
        const long double difference = std::abs(back[static_cast<Eigen::Index>(i)] - exact[i]);
        most = larger(most, static_cast<double>(difference / ulp_of<S>(std::sqrt(square))));
      }
      return most;
    };
    logarithm.add_error(t, away(so3_log(r)));
    quaternion.add_error(t, away(quaternion_log(quaternion_exp(w))));
  }
  const double end = std::numbers::pi;
  table.push_back(
      exponential.row({"exp of SO(3), entries", "t", 0, end, std::is_same_v<S, float> ? 0.3 : 7, 1}, "all"));
  table.push_back(logarithm.row({"log exp w - w, of |w|, matrix", "t", 0, end, 5}, "all"));
  table.push_back(quaternion.row({"log exp w - w, of |w|, quaternion", "t", 0, end, 5}, "all"));
}

}  // namespace

void add_rotations(FunctionTable& table, Index points) {
  add_coefficients(table, points);
  add_turns<float>(table, points);
  add_turns<double>(table, points);
}

}  // namespace hsi4d::stress
