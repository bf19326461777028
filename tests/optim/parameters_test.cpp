#include "optim/parameters.h"

#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "core/rotation.h"

namespace parameters_test {

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

TEST_CASE("numbers beyond a range are put on its ends, others stay as they are") {
  Tape<float> tape;
  const auto x = tape.parameter("x", image_shape<float>(2, 2, 3));  // rows with padding
  const std::vector<float> given = {0.2F, 0.9F, 0.5F, -3, 7, 0.1F, 0.5F, 0.6F, 0.7F, 0.3F, 1e30F, -0.0F};
  const std::vector<float> held = {0.2F, 0.8F, 0.5F, 0.2F, 0.8F, 0.2F, 0.5F, 0.6F, 0.7F, 0.3F, 0.8F, 0.2F};
  tape.set(x, given);
  CHECK(hold_in_range(x, {0.2, 0.8}));
  std::vector<float> now;
  for (Index r = 0; r < 4; ++r) now.insert(now.end(), tape.value(x).row(r), tape.value(x).row(r) + 3);
  CHECK(now == held);
  tape.forward(x);
  CHECK_FALSE(hold_in_range(x, {0.2, 0.8}));
  CHECK_NOTHROW(tape.backward(x, std::vector<float>(12, 1)));  // nothing was written: nothing is stale
}

}  // namespace parameters_test
