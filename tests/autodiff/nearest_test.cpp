// The nearest pairs of sets of points.
#include "autodiff/nearest.h"

#include <limits>

#include "tests/support/operator_check.h"

namespace nearest_test {

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("nearest_pairs passes the operator checks", "[parallel]") {
  check_operator("nearest_pairs", {{"points", shape_of(6, 3)}, {"targets", shape_of(9, 3)}}, [](const auto& in) {
    return nearest_pairs(in[0], in[1], {{0, 4, 2, 7}, {4, 2, 0, 1}, {1, 5, 0, 9}});
  });
  check_operator("nearest_pairs of large sets", {{"points", shape_of(300, 3)}, {"targets", shape_of(500, 3)}},
                 [](const auto& in) {
                   return nearest_pairs(in[0], in[1], {{0, 300, 0, 500}});
                 },
                 {.entries = 8});
}

TEST_CASE("nearest_pairs takes the first of pairs that are as near, and none whose distance is no number") {
  Tape<double> tape;
  const auto points = tape.parameter("points", shape_of(3, 3)), targets = tape.parameter("targets", shape_of(3, 3));
  tape.write(points)(0, 0) = std::numeric_limits<double>::quiet_NaN();
  tape.write(points)(1, 0) = 1;
  tape.write(points)(2, 0) = -1;
  tape.write(targets)(0, 1) = std::numeric_limits<double>::quiet_NaN();
  const auto apart = nearest_pairs(points, targets, {{0, 3, 0, 3}});
  tape.forward(apart);
  CHECK(tape.value(apart)(0, 0) == 1);
  CHECK(tape.value(apart)(0, 1) == 0);
  tape.backward(apart, std::vector<double>{2, 3, 4});
  CHECK(tape.gradient(points)(1, 1) == 3);
  CHECK(tape.gradient(points)(2, 1) == 0);
  CHECK(tape.gradient(targets)(1, 2) == -4);
  CHECK(tape.gradient(targets)(2, 2) == 0);

  // Another pair, where the points have moved.
  tape.write(points)(2, 0) = -0.5;
  tape.forward(apart);
  CHECK(tape.value(apart)(0, 0) == -0.5);
}

TEST_CASE("nearest_pairs refuses sets without a pair, or beyond the arrays") {
  Tape<float> tape;
  const auto points = tape.parameter("points", shape_of(3, 3)), targets = tape.parameter("targets", shape_of(2, 3));
  CHECK_THROWS_WITH(nearest_pairs(points, targets, {{0, 0, 0, 2}}), Catch::Contains("a set without a pair"));
  CHECK_THROWS_WITH(nearest_pairs(points, targets, {{1, 3, 0, 2}}), Catch::Contains("points beyond the array"));
  CHECK_THROWS_WITH(nearest_pairs(points, targets, {{0, 3, 1, 2}}), Catch::Contains("targets beyond the array"));
}

}  // namespace nearest_test
