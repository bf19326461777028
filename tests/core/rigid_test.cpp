#include "core/rigid.h"

#include <cmath>

#include "tests/core/adjoint_check.h"

namespace rigid_test {

using namespace hsi4d;
using namespace hsi4d::testing;

namespace {

template <class S>
Column<S, 12> flat12(const Rigid<S>& t) {
  Column<S, 12> v;
  v << flat(t.rotation), t.translation;
  return v;
}
template <class S>
Rigid<S> rigid12(const Column<S, 12>& v) {
  return {square(Column<S, 9>(v.template head<9>())), v.template tail<3>()};
}

/// A tangent vector whose rotation has the given angle.
Vector6<double> tangent(RandomSequence& random, double angle) {
  Vector6<double> xi;
  xi << random_column<3>(random), random_column<3>(random).normalized() * angle;
  return xi;
}

/// exp of the 4×4 matrix of ξ by its power series, scaled and squared: shares nothing with se3_exp.
Matrix4<double> matrix_exponential(const Vector6<double>& xi) {
  Matrix4<double> m = Matrix4<double>::Zero();
  m.topLeftCorner<3, 3>() = hat(Vector3<double>(xi.tail<3>())) / 1024;
  m.topRightCorner<3, 1>() = xi.head<3>() / 1024;
  Matrix4<double> sum = Matrix4<double>::Identity(), term = sum;
  for (int k = 1; k < 12; ++k) {
    term = (term * m / k).eval();
    sum += term;
  }
  for (int k = 0; k < 10; ++k) sum = (sum * sum).eval();
  return sum;
}

const auto kZero = Rigid<double>::zero;

}  // namespace

TEST_CASE("SE(3): Exp is the exponential of the matrix, Log its inverse") {
  RandomSequence random(50);
  for (const double angle : {0.0, 1e-12, 1e-6, 1e-2, 0.5, 1.0, 2.0, 3.0, 3.14}) {
    const Vector6<double> xi = tangent(random, angle);
    const Rigid<double> t = se3_exp(xi);
    const Matrix4<double> expected = matrix_exponential(xi);
    CHECK((t.rotation - expected.topLeftCorner<3, 3>()).cwiseAbs().maxCoeff() < 1e-12);
    CHECK((t.translation - expected.topRightCorner<3, 1>()).norm() < 1e-12 * xi.norm());
    CHECK((se3_log(t) - xi).norm() <= 1e-14 * xi.norm());
  }
}

TEST_CASE("SE(3): compose, inverse and transform agree with each other") {
  RandomSequence random(51);
  for (int repeat = 0; repeat < 20; ++repeat) {
    const Rigid<double> a = se3_exp(tangent(random, 1)), b = se3_exp(tangent(random, 2));
    const Vector3<double> p = random_column<3>(random);
    CHECK((transform_point(compose(a, b), p) - transform_point(a, transform_point(b, p))).norm() < 1e-14);
    CHECK((transform_point(inverse(a), transform_point(a, p)) - p).norm() < 1e-14);
    const Vector6<double> xi = tangent(random, 0.3);
    CHECK((transform_point(se3_update(xi, a), p) - se3_transform_point(xi, transform_point(a, p))).norm() < 1e-14);
  }
  const Rigid<double> a = se3_exp(tangent(random, 1));
  CHECK(flat12(se3_update(Vector6<double>(Vector6<double>::Zero()), a)) == flat12(a));
}

TEST_CASE("SE(3): the adjoints of Exp and Log are their derivatives") {
  RandomSequence random(52);
  for (const double angle : {0.0, 1e-9, 1e-3, 0.5, 1.0, 2.0, 3.0, 3.1}) {
    const Vector6<double> xi = tangent(random, angle);
    check_adjoint<12>([](const auto& x) { return flat12(se3_exp(x)); },
                      [](const auto& x, const auto& g, auto& d) { se3_exp_adjoint(x, rigid12(g), d); }, xi, random,
                      1e-13);
    check_adjoint<6>([](const auto& v) { return se3_log(rigid12(v)); },
                     [](const Column<double, 12>& v, const Vector6<double>& g, Column<double, 12>& d) {
                       Rigid<double> d_t = rigid12(d);
                       se3_log_adjoint(rigid12(v), g, d_t);
                       d = flat12(d_t);
                     },
                     flat12(se3_exp(xi)), random, 1e-12);
  }
}

TEST_CASE("SE(3): the adjoints of transform, compose and inverse are their derivatives") {
  RandomSequence random(53);
  for (int repeat = 0; repeat < 5; ++repeat) {
    Column<double, 24> both;
    both << flat12(se3_exp(tangent(random, 1))), flat12(se3_exp(tangent(random, 2)));
    check_adjoint<12>(
        []<class S>(const Column<S, 24>& x) {
          return flat12(
              compose(rigid12(Column<S, 12>(x.template head<12>())), rigid12(Column<S, 12>(x.template tail<12>()))));
        },
        [](const Column<double, 24>& x, const Column<double, 12>& g, Column<double, 24>& d) {
          Rigid<double> d_a = rigid12(Column<double, 12>(d.head<12>())),
                        d_b = rigid12(Column<double, 12>(d.tail<12>()));
          compose_adjoint(rigid12(Column<double, 12>(x.head<12>())), rigid12(Column<double, 12>(x.tail<12>())),
                          rigid12(g), d_a, d_b);
          d << flat12(d_a), flat12(d_b);
        },
        both, random);
    const Column<double, 12> one = both.head<12>();
    check_adjoint<12>([](const auto& x) { return flat12(inverse(rigid12(x))); },
                      [](const Column<double, 12>& x, const Column<double, 12>& g, Column<double, 12>& d) {
                        Rigid<double> d_t = rigid12(d);
                        inverse_adjoint(rigid12(x), rigid12(g), d_t);
                        d = flat12(d_t);
                      },
                      one, random);
    Column<double, 15> with_point;
    with_point << one, random_column<3>(random);
    check_adjoint<3>(
        []<class S>(const Column<S, 15>& x) {
          return transform_point(rigid12(Column<S, 12>(x.template head<12>())), Vector3<S>(x.template tail<3>()));
        },
        [](const Column<double, 15>& x, const Vector3<double>& g, Column<double, 15>& d) {
          Rigid<double> d_t = rigid12(Column<double, 12>(d.head<12>()));
          Vector3<double> d_p = d.tail<3>();
          transform_point_adjoint(rigid12(Column<double, 12>(x.head<12>())), Vector3<double>(x.tail<3>()), g, d_t, d_p);
          d << flat12(d_t), d_p;
        },
        with_point, random);
  }
}

TEST_CASE("SE(3): the adjoint of a transformed point for any tangent vector, translation through V") {
  RandomSequence random(54);
  for (const double angle : {0.0, 1e-6, 0.5, 2.0, 3.1}) {
    Column<double, 9> x;
    x << tangent(random, angle), random_column<3>(random);
    check_adjoint<3>(
        []<class S>(const Column<S, 9>& v) {
          return se3_transform_point(Vector6<S>(v.template head<6>()), Vector3<S>(v.template tail<3>()));
        },
        [](const Column<double, 9>& v, const Vector3<double>& g, Column<double, 9>& d) {
          Vector6<double> d_xi = d.head<6>();
          Vector3<double> d_p = d.tail<3>();
          se3_transform_point_adjoint(Vector6<double>(v.head<6>()), Vector3<double>(v.tail<3>()), g, d_xi, d_p);
          d << d_xi, d_p;
        },
        x, random, 1e-13);
  }
}

TEST_CASE("SE(3): the short adjoints at zero equal the general ones") {
  RandomSequence random(55);
  const Vector6<double> zero = Vector6<double>::Zero();
  for (int repeat = 0; repeat < 20; ++repeat) {
    const Vector3<double> p = random_column<3>(random), g = random_column<3>(random);
    Vector6<double> general = Vector6<double>::Zero(), at_zero = random_column<6>(random);
    const Vector6<double> before = at_zero;
    Vector3<double> d_p = Vector3<double>::Zero();
    se3_transform_point_adjoint(zero, p, g, general, d_p);
    se3_transform_point_adjoint_at_zero(p, g, at_zero);
    CHECK((at_zero - before - general).norm() < 1e-14);
    CHECK(d_p == g);

    const Rigid<double> t = se3_exp(tangent(random, 1));
    const Rigid<double> d_updated = rigid12(random_column<12>(random));
    Rigid<double> d_step = kZero(), d_t = kZero();
    compose_adjoint(se3_exp(zero), t, d_updated, d_step, d_t);
    general.setZero();
    se3_exp_adjoint(zero, d_step, general);
    at_zero = before;
    se3_update_adjoint_at_zero(t, d_updated, at_zero);
    CHECK((at_zero - before - general).norm() < 1e-13);
  }
}

TEST_CASE("SE(3) in float agrees with double") {
  RandomSequence random(56);
  for (const double angle : {0.0, 1e-4, 1.0, 3.0}) {
    const Vector6<float> xi = narrow(tangent(random, angle));
    const Rigid<float> t = se3_exp(xi);
    const Rigid<double> expected = se3_exp(widen(xi));
    CHECK((widen(t.rotation) - expected.rotation).cwiseAbs().maxCoeff() < 6e-8);
    CHECK((widen(t.translation) - expected.translation).norm() < 1e-6);
    CHECK((se3_log(t) - xi).norm() < 4e-6f);
  }
}

}  // namespace rigid_test
