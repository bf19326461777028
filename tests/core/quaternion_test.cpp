#include "core/quaternion.h"

#include <numbers>

#include "core/rotation.h"
#include "tests/core/adjoint_check.h"

namespace quaternion_test {

using namespace hsi4d;
using namespace hsi4d::testing;

namespace {

constexpr double kPi = std::numbers::pi;

Vector4<double> random_rotation(RandomSequence& random) { return random.rotation(); }

template <class S>
Vector4<S> unit_w() {
  return Vector4<S>(S(1), S(0), S(0), S(0));
}

}  // namespace

TEST_CASE("a quaternion is w, x, y, z: a quarter turn about z takes x to y") {
  const Vector4<double> q(std::sqrt(0.5), 0, 0, std::sqrt(0.5));
  CHECK((quaternion_rotate(q, Vector3<double>(1, 0, 0)) - Vector3<double>(0, 1, 0)).norm() < 1e-15);
  CHECK((quaternion_log(q) - Vector3<double>(0, 0, kPi / 2)).norm() < 1e-15);
  const Vector4<double> i = Vector4<double>::Unit(1), j = Vector4<double>::Unit(2);
  CHECK(quaternion_product(i, j) == Vector4<double>(Vector4<double>::Unit(3)));
}

TEST_CASE("the product of quaternions is the product of rotations") {
  RandomSequence random(30);
  for (int repeat = 0; repeat < 50; ++repeat) {
    const Vector4<double> p = random_rotation(random), q = random_rotation(random);
    const Matrix3<double> expected = quaternion_to_matrix(p) * quaternion_to_matrix(q);
    CHECK((quaternion_to_matrix(quaternion_product(p, q)) - expected).cwiseAbs().maxCoeff() < 2e-15);
    CHECK((quaternion_product(p, quaternion_conjugate(p)) - unit_w<double>()).norm() < 1e-15);
  }
}

TEMPLATE_TEST_CASE("A13: only the direction of a quaternion counts, and its gradient is orthogonal to it", "", float,
                   double) {
  using S = TestType;
  RandomSequence random(31);
  for (int repeat = 0; repeat < 20; ++repeat) {
    const Vector4<S> unit = random_rotation(random).template cast<S>();
    const Matrix3<S> r = quaternion_to_matrix(unit);
    const Matrix3<S> g = square(Column<double, 9>(random_column<9>(random))).template cast<S>();
    for (int power = -6; power <= 6; ++power) {
      const auto scale = static_cast<S>(std::pow(10.0, power));
      const Vector4<S> q = unit * scale;
      CHECK((quaternion_to_matrix(q) - r).cwiseAbs().maxCoeff() <= 8 * std::numeric_limits<S>::epsilon());
      Vector4<S> d_q = Vector4<S>::Zero();
      quaternion_to_matrix_adjoint(q, g, d_q);
      CHECK(std::fabs(d_q.dot(q)) <= S(1e-6) * detail::unit_quaternion_gradient(unit, g).norm());
      Vector4<S> d_unit = Vector4<S>::Zero();
      quaternion_to_matrix_adjoint(unit, g, d_unit);
      CHECK((d_q * scale - d_unit).norm() <= S(1e-5) * d_unit.norm());
    }
  }
}

TEMPLATE_TEST_CASE("C8: a quaternion of any length, zero or broken, gives a rotation and a bounded gradient", "", float,
                   double) {
  using S = TestType;
  const Matrix3<S> g = Matrix3<S>::Ones() + hat(Vector3<S>(S(1), S(2), S(3)));
  for (const double length : {1e-45, 1e-38, 1e-30, 1e-20, 1.0, 1e20, 1e38}) {
    const auto s = static_cast<S>(length);
    const Vector4<S> q(s, -s, s, s);
    bool degenerate = true;
    const Matrix3<S> r = quaternion_to_matrix(q, &degenerate);
    CAPTURE(length);
    CHECK_FALSE(degenerate);
    CHECK(orthogonality_error(r) <= 4);
    CHECK((r - quaternion_to_matrix(Vector4<S>(S(1), S(-1), S(1), S(1)))).cwiseAbs().maxCoeff() <=
          4 * std::numeric_limits<S>::epsilon());
    Vector4<S> d_q = Vector4<S>::Zero();
    quaternion_to_matrix_adjoint(q, g, d_q);
    CHECK(d_q.allFinite());
    CHECK(d_q.norm() * std::fmax(q.stableNorm(), smallest_length<S>()) <= 100);
    const bool stopped = q.stableNorm() < smallest_length<S>();
    CHECK(d_q.isZero(0) == stopped);
  }
  const S infinity = std::numeric_limits<S>::infinity();
  const S nan = std::numeric_limits<S>::quiet_NaN();
  for (const Vector4<S>& q : {Vector4<S>(Vector4<S>::Zero()), Vector4<S>(infinity, S(0), S(0), S(1)),
                              Vector4<S>(S(1), nan, S(0), S(0)), Vector4<S>(-infinity, infinity, nan, S(0))}) {
    bool degenerate = false;
    CHECK(quaternion_to_matrix(q, &degenerate) == Matrix3<S>::Identity());
    CHECK(degenerate);
    CHECK(quaternion_normalized(q) == unit_w<S>());
    CHECK(quaternion_log(q).isZero(0));
    Vector4<S> d_q = Vector4<S>::Constant(S(7));
    quaternion_to_matrix_adjoint(q, g, d_q);
    quaternion_log_adjoint(q, Vector3<S>(S(1), S(2), S(3)), d_q);
    quaternion_normalized_adjoint(q, unit_w<S>(), d_q);
    CHECK(d_q == Vector4<S>::Constant(S(7)));  // C11: nothing of the dead branch gets through
  }
}

TEMPLATE_TEST_CASE("C7: q and -q have the same logarithm bit for bit", "", float, double) {
  using S = TestType;
  RandomSequence random(32);
  for (int repeat = 0; repeat < 100; ++repeat) {
    const Vector4<S> q = random_rotation(random).template cast<S>();
    const Vector3<S> w = quaternion_log(q);
    CHECK(quaternion_log(Vector4<S>(-q)) == w);
    CHECK(w.template cast<double>().norm() <= kPi * (1 + std::numeric_limits<S>::epsilon()));
    CHECK((so3_exp(w) - quaternion_to_matrix(q)).cwiseAbs().maxCoeff() <= 8 * std::numeric_limits<S>::epsilon());
  }
  for (const Vector4<S>& q : {Vector4<S>(S(0), S(1), S(0), S(0)), Vector4<S>(S(0), S(0), S(-1), S(1)),
                              Vector4<S>(S(-0.0), S(-0.0), S(0), S(2))}) {
    CHECK(quaternion_log(Vector4<S>(-q)) == quaternion_log(q));
    CHECK(quaternion_log(q).norm() == Approx(kPi).epsilon(1e-6));
  }
}

TEST_CASE("exp and log of quaternions are those of matrices") {
  RandomSequence random(33);
  for (const double angle : {0.0, 1e-20, 1e-9, 1e-4, 0.5, 1.0, 2.0, 3.0, 3.1415}) {
    const Vector3<double> w = random_column<3>(random).normalized() * angle;
    const Vector4<double> q = quaternion_exp(w);
    CHECK(std::fabs(q.norm() - 1) < 5e-16);
    CHECK((quaternion_to_matrix(q) - so3_exp(w)).cwiseAbs().maxCoeff() < 2e-15);
    CHECK((quaternion_log(q) - w).norm() <= 2e-15 * angle);
    const Vector3<float> f = narrow(w);
    CHECK((quaternion_log(quaternion_exp(f)) - f).norm() <= 4e-7f * f.norm());
  }
}

TEST_CASE("C10: the quaternion of a matrix by every pivot, its gradient finite and right") {
  const auto f = [](const auto& v) { return quaternion_from_matrix(square(v)); };
  const auto adjoint = [](const Column<double, 9>& v, const Vector4<double>& g, Column<double, 9>& d_v) {
    Matrix3<double> d_r = square(d_v);
    quaternion_from_matrix_adjoint(square(v), g, d_r);
    d_v = flat(d_r);
  };
  RandomSequence random(34);
  std::array<int, 4> seen{};
  for (int repeat = 0; repeat < 60; ++repeat) {
    const Vector4<double> q = random_rotation(random);
    const Matrix3<double> r = quaternion_to_matrix(q);
    const Vector4<double> found = quaternion_from_matrix(r);
    CHECK(found[0] >= 0);
    CHECK(std::fmin((found - q).norm(), (found + q).norm()) < 8e-16);
    ++seen[static_cast<std::size_t>(detail::pivot_quaternion(r).pivot)];
    if (std::fabs(q[0]) > 1e-3) check_adjoint<4>(f, adjoint, flat(r), random, 1e-12);
  }
  for (const int count : seen) CHECK(count > 0);
  check_adjoint<4>(f, adjoint, flat(Matrix3<double>(Matrix3<double>::Identity())), random, 1e-13);
  for (int i = 0; i < 3; ++i) {
    // Just short of half a turn: w is small and another square root would be of a number near 0.
    const Vector3<double> w = Vector3<double>::Unit(i) * (kPi - 1e-2) + Vector3<double>(1e-3, 2e-3, -1e-3);
    CHECK(detail::pivot_quaternion(so3_exp(w)).pivot == i + 1);
    check_adjoint<4>(f, adjoint, flat(so3_exp(w)), random, 1e-12);
  }
  Matrix3<double> d_r = Matrix3<double>::Zero();
  quaternion_from_matrix_adjoint(Matrix3<double>(Matrix3<double>::Identity()), Vector4<double>(5, 1, 2, 3), d_r);
  CHECK(d_r == hat(Vector3<double>(0.25, 0.5, 0.75)));
}

TEST_CASE("the adjoints of normalise, to matrix, exp, log, product and rotate are their derivatives") {
  RandomSequence random(35);
  for (int repeat = 0; repeat < 20; ++repeat) {
    const double scale = std::pow(10.0, random.uniform(-2, 2));
    const Vector4<double> q = random_rotation(random) * scale;
    check_adjoint<4>([](const auto& x) { return quaternion_normalized(x); },
                     [](const auto& x, const auto& g, auto& d) { quaternion_normalized_adjoint(x, g, d); }, q, random);
    check_adjoint<9>([](const auto& x) { return flat(quaternion_to_matrix(x)); },
                     [](const auto& x, const auto& g, auto& d) { quaternion_to_matrix_adjoint(x, square(g), d); }, q,
                     random);
    check_adjoint<3>([](const auto& x) { return quaternion_log(x); },
                     [](const auto& x, const auto& g, auto& d) { quaternion_log_adjoint(x, g, d); }, q, random);
  }
  for (const double angle : {0.0, 1e-9, 1e-3, 0.7, 2.0, 3.1, 6.0}) {
    const Vector3<double> w = random_column<3>(random).normalized() * angle;
    check_adjoint<4>([](const auto& x) { return quaternion_exp(x); },
                     [](const auto& x, const auto& g, auto& d) { quaternion_exp_adjoint(x, g, d); }, w, random);
  }
  check_adjoint<3>([](const auto& x) { return quaternion_log(x); },
                   [](const auto& x, const auto& g, auto& d) { quaternion_log_adjoint(x, g, d); },
                   Vector4<double>(-2, 0, 0, 0), random);
}

TEST_CASE("the adjoints of product and rotate, both arguments") {
  RandomSequence random(36);
  for (int repeat = 0; repeat < 10; ++repeat) {
    check_adjoint<4>(
        []<class S>(const Column<S, 8>& x) {
          return quaternion_product(Vector4<S>(x.template head<4>()), Vector4<S>(x.template tail<4>()));
        },
        [](const Column<double, 8>& x, const Vector4<double>& g, Column<double, 8>& d) {
          Vector4<double> d_p = d.head<4>(), d_q = d.tail<4>();
          quaternion_product_adjoint(Vector4<double>(x.head<4>()), Vector4<double>(x.tail<4>()), g, d_p, d_q);
          d << d_p, d_q;
        },
        random_column<8>(random), random);
    check_adjoint<3>(
        []<class S>(const Column<S, 7>& x) {
          return quaternion_rotate(Vector4<S>(x.template head<4>()), Vector3<S>(x.template tail<3>()));
        },
        [](const Column<double, 7>& x, const Vector3<double>& g, Column<double, 7>& d) {
          Vector4<double> d_q = d.head<4>();
          Vector3<double> d_point = d.tail<3>();
          quaternion_rotate_adjoint(Vector4<double>(x.head<4>()), Vector3<double>(x.tail<3>()), g, d_q, d_point);
          d << d_q, d_point;
        },
        random_column<7>(random), random);
  }
}

TEST_CASE("the float adjoints of quaternions agree with double to rounding") {
  RandomSequence random(37);
  for (int repeat = 0; repeat < 50; ++repeat) {
    const Vector4<float> q = narrow(Vector4<double>(random_rotation(random) * random.uniform(0.1, 10)));
    const Matrix3<float> g = narrow(square(Column<double, 9>(random_column<9>(random))));
    Vector4<float> d_q = Vector4<float>::Zero();
    Vector4<double> expected = Vector4<double>::Zero();
    quaternion_to_matrix_adjoint(q, g, d_q);
    quaternion_to_matrix_adjoint(widen(q), widen(g), expected);
    CHECK((widen(d_q) - expected).norm() <= 2e-6 * expected.norm());
  }
}

TEST_CASE("slerp goes the shorter way at constant speed and reaches both ends") {
  RandomSequence random(38);
  for (int repeat = 0; repeat < 50; ++repeat) {
    const Vector4<double> p = random_rotation(random), q = random_rotation(random);
    const Matrix3<double> start = quaternion_to_matrix(p), end = quaternion_to_matrix(q);
    CHECK((quaternion_to_matrix(slerp(p, q, 0.0)) - start).cwiseAbs().maxCoeff() < 2e-15);
    CHECK((quaternion_to_matrix(slerp(p, q, 1.0)) - end).cwiseAbs().maxCoeff() < 2e-15);
    const double whole = so3_log(Matrix3<double>(start.transpose() * end)).norm();
    CHECK(whole <= kPi);
    for (const double u : {0.25, 0.5, 0.9}) {
      const Vector4<double> between = slerp(p, q, u);
      CHECK(so3_log(Matrix3<double>(start.transpose() * quaternion_to_matrix(between))).norm() ==
            Approx(u * whole).epsilon(1e-12));
      // C7: the sign of either end changes nothing but perhaps the sign of the result
      const Vector4<double> other = slerp(p, Vector4<double>(-q), u);
      CHECK((quaternion_to_matrix(other) - quaternion_to_matrix(between)).cwiseAbs().maxCoeff() < 2e-15);
    }
  }
}

}  // namespace quaternion_test
