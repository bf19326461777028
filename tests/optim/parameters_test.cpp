#include "optim/parameters.h"

#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "core/rotation.h"

using namespace hsi4d;

TEST_CASE("axis-angle rows beyond half a turn are wrapped, others stay as they are") {
  Tape<double> tape;
  const auto w = tape.parameter("w", shape_of(3, 3));
  const double turn = 2 * std::numbers::pi;
  tape.set(w, {0.1, 0.2, 0.3, 0, turn - 1e-3, 0, -3, 2, 1});
  const Matrix3<double> before = so3_exp(Vector3<double>(0, turn - 1e-3, 0));
  CHECK(wrap_axis_angles(w) == std::vector<Index>{1, 2});
  const auto now = tape.value(w);
  CHECK(now(0, 1) == 0.2);
  CHECK(now(1, 1) == Approx(-1e-3).epsilon(1e-9));
  CHECK((so3_exp(Vector3<double>(now(1, 0), now(1, 1), now(1, 2))) - before).norm() < 1e-14);
  CHECK(wrap_axis_angles(w).empty());
  CHECK_THROWS_AS(wrap_axis_angles(tape.parameter("a", shape_of(3, 4))), InternalError);
}

TEST_CASE("wrapping that changes nothing does not make results stale") {
  Tape<float> tape;
  const auto w = tape.parameter("w", shape_of(1, 3));
  const auto before = tape.mark();
  tape.forward(w);
  wrap_axis_angles(w);
  CHECK_NOTHROW(tape.backward(w, std::vector<float>{1, 1, 1}));
  CHECK(tape.mark().arrays == before.arrays);
}
