#include "autodiff/rotations.h"

#include <cmath>
#include <numbers>

#include "core/linear.h"
#include "core/rotation.h"
#include "core/rotation_6d.h"
#include "tests/support/operator_check.h"

namespace rotations_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Numbers = std::vector<double>;

const auto kAxisAngle = [](const auto& in) { return rotations_from_axis_angle(in[0]); };
const auto k6d = [](const auto& in) { return rotations_from_6d(in[0]); };

template <class S>
std::vector<S> numbers_of(const ConstArray<S>& array) {
  return {array.data, array.data + array.shape.count()};
}

/// Value and gradient of row 0 for a cotangent that is 1 in one entry.
struct Result {
  Numbers value, gradient;
};
template <class F>
Result run(const Numbers& x, Index entry, const F& record) {
  Tape<double> tape;
  const std::vector<Var<double>> in = {tape.parameter("x", shape_of(1, static_cast<Index>(x.size())))};
  tape.set(in[0], x);
  const auto r = record(in);
  tape.forward(r);
  Numbers cotangent(9, 0.0);
  cotangent[static_cast<std::size_t>(entry)] = 1;
  tape.backward(r, cotangent);
  return {numbers_of(tape.value(r)), numbers_of(tape.gradient(in[0]))};
}

/// Rows of rotations, orthogonal to `tolerance`.
void check_rotations(const Numbers& rows, double tolerance) {
  for (std::size_t j = 0; j < rows.size() / 9; ++j) {
    Matrix3<double> r;
    for (std::size_t i = 0; i < 9; ++i) r(static_cast<Index>(i / 3), static_cast<Index>(i % 3)) = rows[9 * j + i];
    CHECK((r * r.transpose() - Matrix3<double>::Identity()).cwiseAbs().maxCoeff() < tolerance);
    CHECK(dot(Vector3<double>(r.col(0)), cross(Vector3<double>(r.col(1)), Vector3<double>(r.col(2)))) > 0.5);
  }
}

}  // namespace

TEST_CASE("rotations from axis-angle pass the operator checks") {
  check_operator("axis-angle", {{"w", shape_of(55, 3), -2, 2}}, kAxisAngle);
  check_operator("small axis-angle", {{"w", shape_of(5, 3), -1e-4, 1e-4}}, kAxisAngle);
  check_operator("zero axis-angle", {{"w", shape_of(3, 3), 0, 0, Numbers(9, 0.0)}}, kAxisAngle);
  const float pi = static_cast<float>(std::numbers::pi);
  check_operator("half and full turns",
                 {{"w", shape_of(5, 3), 0, 0, {pi, 0, 0, 0, -pi, 0, 0, 1e-7F, pi, 2 * pi, 0, 0, 1.75, -1.75, 1.875}}},
                 kAxisAngle);
}

TEST_CASE("C1, C2: the gradient at no rotation is that of the generators") {
  // hat(e_i): entry (row, col) and its derivative along x, y, z.
  const double generators[9][3] = {{0, 0, 0},  {0, 0, -1}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0},
                                   {-1, 0, 0}, {0, -1, 0}, {1, 0, 0}, {0, 0, 0}};
  for (const double size : {0.0, 1e-310, 1e-30, 1e-12}) {
    for (Index entry = 0; entry < 9; ++entry) {
      const Result r = run({size, -size, size}, entry, kAxisAngle);
      for (std::size_t i = 0; i < 3; ++i) CHECK(std::fabs(r.gradient[i] - generators[entry][i]) <= 1e-11);
    }
  }
  const Result identity = run({0, 0, 0}, 0, kAxisAngle);
  CHECK(identity.value == Numbers{1, 0, 0, 0, 1, 0, 0, 0, 1});
}

TEST_CASE("rotations near half a turn are the textbook's") {
  const double angle = std::numbers::pi - 1e-6;
  const Result r = run({0, 0, angle}, 0, kAxisAngle);
  const Numbers expected = {std::cos(angle), -std::sin(angle), 0, std::sin(angle), std::cos(angle), 0, 0, 0, 1};
  for (std::size_t i = 0; i < 9; ++i) CHECK(std::fabs(r.value[i] - expected[i]) < 1e-15);
  CHECK(r.gradient[2] == Approx(-std::sin(angle)).epsilon(1e-9));
}

TEST_CASE("rotations from 6D pass the operator checks") {
  check_operator("6D", {{"x", shape_of(300, 6)}}, k6d, {.tolerance = 1e-5, .float_tolerance = 1e-3});
  check_operator("6D of rotations", {{"x", shape_of(2, 6), 0, 0, {1, 0, 0, 0, 1, 0, 0, 0, -2, 0.5, 0, 0}}}, k6d);
}

TEST_CASE("C9: parallel, zero and infinite columns give a rotation, and no gradient where one was replaced") {
  const double inf = std::numeric_limits<double>::infinity();
  for (const Numbers& x : {Numbers{1, 2, 3, 2, 4, 6},
                           {1, 2, 3, -1, -2, -3},
                           {0, 0, 0, 1, 0, 0},
                           {1, 0, 0, 0, 0, 0},
                           {0, 0, 0, 0, 0, 0},
                           {1, 2, 3, inf, 0, 0},
                           {inf, 0, 0, 0, 1, 0},
                           {1, 0, 0, 1, 1e-5, 0}}) {
    for (Index entry = 0; entry < 9; ++entry) {
      const Result r = run(x, entry, k6d);
      check_rotations(r.value, 1e-15);
      for (const double g : r.gradient) CHECK(std::isfinite(g));
    }
  }
  const Result parallel = run({1, 2, 3, 2, 4, 6}, 4, k6d);
  CHECK(Numbers(parallel.gradient.begin() + 3, parallel.gradient.end()) == Numbers{0, 0, 0});
  // A column that counts has a gradient, however near to parallel.
  const Result near = run({1, 0, 0, 1, 1e-3, 0}, 7, k6d);
  CHECK(near.gradient[5] == Approx(1e3).epsilon(1e-6));
}

TEST_CASE("the signature of 6D rotations tells replaced columns") {
  Tape<double> tape;
  const auto x = tape.parameter("x", shape_of(1, 6));
  const auto r = rotations_from_6d(x);
  tape.set(x, {1, 0, 0, 0, 1, 0});
  tape.forward(r);
  const std::uint64_t regular = tape.signature(r);
  tape.set(x, {1, 0, 0, 1, 0, 0});
  tape.forward(r);
  CHECK(tape.signature(r) != regular);
}

TEST_CASE("rotations refuse rows of another length") {
  Tape<double> tape;
  CHECK_THROWS_WITH(rotations_from_axis_angle(tape.parameter("x", shape_of(4, 6))),
                    Catch::Contains("[4,6] against [4,3]"));
  CHECK_THROWS_WITH(rotations_from_6d(tape.parameter("x", shape_of(4, 3))), Catch::Contains("[4,3] against [4,6]"));
}

namespace {

const auto kLog = [](const auto& in) { return axis_angle_from_rotations(in[0]); };

/// Matrices [J,9] of axis-angle vectors.
Numbers matrices_of(const Numbers& axis_angle) {
  Numbers rows;
  for (std::size_t j = 0; j < axis_angle.size() / 3; ++j) {
    const double* w = axis_angle.data() + 3 * j;
    const Matrix3<double> r = so3_exp(Vector3<double>(w[0], w[1], w[2]));
    for (int i = 0; i < 9; ++i) rows.push_back(r(i / 3, i % 3));
  }
  return rows;
}

}  // namespace

TEST_CASE("axis-angle vectors of rotations pass the operator checks, and are the inverse") {
  Numbers w;
  std::mt19937_64 random(30);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int i = 0; i < 60; ++i) w.push_back(1.7 * uniform(random));
  for (const double size : {0.0, 1e-9, 1e-4, 3.0}) {
    w.insert(w.end(), {size, 0, 0, 0, -size, 0, 0, size / 2, size / 3});
  }
  const Numbers rows = matrices_of(w);
  const auto joints = static_cast<Index>(w.size() / 3);
  check_operator("log", {{"r", shape_of(joints, 9), 0, 0, rows}}, kLog);
  const Result back = run({rows.begin(), rows.begin() + 9}, 0,
                          [](const auto& in) { return rotations_from_axis_angle(axis_angle_from_rotations(in[0])); });
  for (std::size_t i = 0; i < 9; ++i) CHECK(back.value[i] == Approx(rows[i]).margin(1e-15));
  Tape<double> tape;
  const auto r = tape.parameter("r", shape_of(joints, 9));
  tape.set(r, rows);
  const auto log = kLog(std::vector{r});
  tape.forward(log);
  for (std::size_t i = 0; i < w.size(); ++i) CHECK(tape.value(log).data[i] == Approx(w[i]).margin(1e-14));
}

}  // namespace rotations_test
