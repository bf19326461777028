#include "core/rotation_6d.h"

#include "core/rotation.h"
#include "tests/core/adjoint_check.h"

namespace rotation_6d_test {

using namespace hsi4d;
using namespace hsi4d::testing;

namespace {

template <class S>
Vector3<S> head(const Column<S, 6>& x) {
  return x.template head<3>();
}
template <class S>
Vector3<S> tail(const Column<S, 6>& x) {
  return x.template tail<3>();
}

const auto kForward = []<class S>(const Column<S, 6>& x) { return flat(rotation_from_6d(head(x), tail(x))); };
const auto kAdjoint = [](const Column<double, 6>& x, const Column<double, 9>& g, Column<double, 6>& d_x) {
  Vector3<double> d_a = head(d_x), d_b = tail(d_x);
  rotation_from_6d_adjoint(head(x), tail(x), square(g), d_a, d_b);
  d_x << d_a, d_b;
};

}  // namespace

TEST_CASE("6D: the first two columns of a rotation, scaled and sheared, give the rotation back") {
  RandomSequence random(40);
  for (int repeat = 0; repeat < 50; ++repeat) {
    const Matrix3<double> r = so3_exp(Vector3<double>(random_column<3>(random)));
    const Vector3<double> a = r.col(0) * random.uniform(0.01, 100);
    const Vector3<double> b = r.col(1) * random.uniform(0.1, 10) + a * random.uniform(-1, 1);
    bool degenerate = true;
    const Matrix3<double> found = rotation_from_6d(a, b, &degenerate);
    if (degenerate) continue;  // a shear of 100/0.1 may be within the limit of parallel
    CHECK((found - r).cwiseAbs().maxCoeff() < 1e-11);
  }
  bool degenerate = true;
  CHECK(rotation_from_6d(Vector3<double>(3, 0, 0), Vector3<double>(-5, 2, 0), &degenerate) ==
        Matrix3<double>::Identity());
  CHECK_FALSE(degenerate);
}

TEMPLATE_TEST_CASE("C9: 6D gives a rotation at every angle between the columns and flags parallel ones", "", float,
                   double) {
  using S = TestType;
  RandomSequence random(41);
  for (int digit = 0; digit <= 8; ++digit) {
    for (int repeat = 0; repeat < 50; ++repeat) {
      const double angle = std::pow(10.0, -digit);
      const Matrix3<double> frame = so3_exp(Vector3<double>(random_column<3>(random)));
      const double side = repeat % 2 == 0 ? 1 : -1;  // parallel and antiparallel
      const Vector3<S> a = (frame.col(0) * random.uniform(0.1, 10)).template cast<S>();
      const Vector3<S> b =
          ((frame.col(0) * (side * std::cos(angle)) + frame.col(1) * std::sin(angle)) * random.uniform(0.1, 10))
              .template cast<S>();
      bool degenerate = false;
      const Matrix3<S> r = rotation_from_6d(a, b, &degenerate);
      CAPTURE(angle, repeat);
      CHECK(orthogonality_error(r) <= 4);
      CHECK(stress::determinant(widen(r)) == Approx(1).epsilon(1e-6));
      if (digit != 4) CHECK(degenerate == (digit > 4));
      Vector3<S> d_a = Vector3<S>::Zero(), d_b = Vector3<S>::Zero();
      rotation_from_6d_adjoint(a, b, Matrix3<S>(Matrix3<S>::Ones()), d_a, d_b);
      CHECK(d_a.allFinite());
      CHECK(d_b.allFinite());
      CHECK(d_b.norm() * b.norm() * S(kParallel6d) <= 20);
      if (degenerate) CHECK(d_b.isZero(0));
    }
  }
}

TEMPLATE_TEST_CASE("C9: zero, tiny, huge and non-finite columns give a rotation, the replaced ones have no gradient",
                   "", float, double) {
  using S = TestType;
  const S nan = std::numeric_limits<S>::quiet_NaN(), infinity = std::numeric_limits<S>::infinity();
  const Vector3<S> good(S(1), S(-2), S(0.5)), zero = Vector3<S>::Zero();
  const Vector3<S> broken(S(1), nan, S(0)), endless(infinity, S(0), S(0));
  const Matrix3<S> g = Matrix3<S>::Ones() + hat(Vector3<S>(S(1), S(2), S(3)));
  for (const Vector3<S>& bad : {zero, broken, endless}) {
    for (const bool first : {true, false}) {
      bool degenerate = false;
      const Matrix3<S> r = first ? rotation_from_6d(bad, good, &degenerate) : rotation_from_6d(good, bad, &degenerate);
      CHECK(degenerate);
      CHECK(orthogonality_error(r) <= 4);
      Vector3<S> d_bad = Vector3<S>::Constant(S(7)), d_good = Vector3<S>::Zero();
      if (first) {
        rotation_from_6d_adjoint(bad, good, g, d_bad, d_good);
      } else {
        rotation_from_6d_adjoint(good, bad, g, d_good, d_bad);
      }
      CHECK(d_bad == Vector3<S>::Constant(S(7)));  // C11: no NaN from the dead branch
      CHECK(d_good.allFinite());
      CHECK(d_good.norm() > 0);
    }
    bool degenerate = false;
    CHECK(rotation_from_6d(bad, bad, &degenerate) == Matrix3<S>::Identity());
    CHECK(degenerate);
  }
  for (const S size : {std::numeric_limits<S>::denorm_min(), std::numeric_limits<S>::min(), S(1e30)}) {
    bool degenerate = true;
    const Matrix3<S> r = rotation_from_6d(Vector3<S>(size, S(0), S(0)), Vector3<S>(size, size, S(0)), &degenerate);
    CHECK_FALSE(degenerate);
    CHECK((r - Matrix3<S>::Identity()).cwiseAbs().maxCoeff() <= 4 * std::numeric_limits<S>::epsilon());
    Vector3<S> d_a = Vector3<S>::Zero(), d_b = Vector3<S>::Zero();
    rotation_from_6d_adjoint(Vector3<S>(size, S(0), S(0)), Vector3<S>(size, size, S(0)), g, d_a, d_b);
    CHECK(d_a.allFinite());
    CHECK(d_b.allFinite());
  }
}

TEST_CASE("the adjoint of 6D is its derivative, the branch of parallel columns included") {
  RandomSequence random(42);
  for (int repeat = 0; repeat < 30; ++repeat) {
    Column<double, 6> x = random_column<6>(random);
    check_adjoint<9>(kForward, kAdjoint, x, random, 1e-12);
    x.tail<3>() = x.head<3>() * 2;  // replaced; central differences would leave the branch, complex steps do not
    const Column<double, 9> g = random_column<9>(random);
    Column<double, 6> d_x = Column<double, 6>::Zero();
    kAdjoint(x, g, d_x);
    const Column<double, 6> expected = complex_step_gradient<6>(kForward, x, g);
    CHECK((d_x - expected).norm() <= 1e-12 * expected.norm());
    CHECK(d_x.tail<3>().isZero(0));
    // Nearly parallel columns, above the limit: gradients of the size 1/angle, still right.
    x.tail<3>() = x.head<3>() + 1e-2 * random_column<3>(random);
    d_x.setZero();
    kAdjoint(x, g, d_x);
    CHECK((d_x - complex_step_gradient<6>(kForward, x, g)).norm() <= 1e-9 * d_x.norm());
  }
}

TEST_CASE("the float adjoint of 6D agrees with double") {
  RandomSequence random(43);
  for (int repeat = 0; repeat < 50; ++repeat) {
    const Vector3<float> a = narrow(random_column<3>(random)), b = narrow(random_column<3>(random));
    if (cross(Vector3<float>(a.normalized()), Vector3<float>(b.normalized())).norm() < 0.1f) continue;
    const Matrix3<float> g = narrow(square(Column<double, 9>(random_column<9>(random))));
    Vector3<float> d_a = Vector3<float>::Zero(), d_b = Vector3<float>::Zero();
    Vector3<double> expected_a = Vector3<double>::Zero(), expected_b = Vector3<double>::Zero();
    rotation_from_6d_adjoint(a, b, g, d_a, d_b);
    rotation_from_6d_adjoint(widen(a), widen(b), widen(g), expected_a, expected_b);
    CHECK((widen(d_a) - expected_a).norm() <= 1e-5 * (expected_a.norm() + expected_b.norm()));
    CHECK((widen(d_b) - expected_b).norm() <= 1e-5 * (expected_a.norm() + expected_b.norm()));
  }
}

}  // namespace rotation_6d_test
