#include "body/blend_shapes.h"

#include <cmath>
#include <limits>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/rotations.h"
#include "core/rotation.h"
#include "tests/support/measures.h"
#include "tests/support/operator_check.h"
#include "tests/support/random_numbers.h"

namespace blend_shapes_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Numbers = std::vector<double>;

/// The same directions for both precisions.
struct BothDirections {
  Directions<float> single;
  Directions<double> full;
  BothDirections(const Numbers& values, Index vertices, Index columns)
      : single(DirectionSource{values, vertices, columns, {0}, columns}),
        full(DirectionSource{values, vertices, columns, {0}, columns}) {}
  const Directions<float>& operator()(const Var<float>&) const { return single; }
  const Directions<double>& operator()(const Var<double>&) const { return full; }
};

struct BothCorrectives {
  PoseDirections<float> single;
  PoseDirections<double> full;
  BothCorrectives(const Numbers& values, Index vertices, Index first, Index count, double packing = 0)
      : single(values, vertices, first, count, packing), full(values, vertices, first, count, packing) {}
  const PoseDirections<float>& operator()(const Var<float>&) const { return single; }
  const PoseDirections<double>& operator()(const Var<double>&) const { return full; }
};

template <class T>
using ScalarOf =
    std::remove_const_t<std::remove_pointer_t<decltype(std::declval<T>().tape->value(std::declval<T>()).data)>>;

template <class S>
std::vector<S> numbers_of(const ConstArray<S>& array) {
  return {array.data, array.data + array.shape.count()};
}

}  // namespace

TEST_CASE("blend shapes and correctives pass the operator checks", "[parallel]") {
  const Index vertices = 2100;
  const Numbers rest = random_numbers(3 * vertices, 1, 1);
  const BothDirections shape(random_numbers(3 * vertices * 4, 0.3, 2), vertices, 4);
  const BothDirections expression(random_numbers(3 * vertices * 2, 0.3, 3), vertices, 2);
  check_operator("blend_shapes", {{"betas", shape_of(1, 4)}, {"expression", shape_of(1, 2)}}, [&](const auto& in) {
    using S = ScalarOf<std::remove_cvref_t<decltype(in[0])>>;
    const std::array<BlendTerm<S>, 2> terms = {{{shape(in[0]), in[0]}, {expression(in[0]), in[1]}}};
    return blend_shapes(rest, std::span<const BlendTerm<S>>(terms));
  });
  const Numbers values = random_numbers(3 * vertices * 36, 0.3, 4);
  const BothCorrectives correctives(values, vertices, 2, 3);
  check_operator("pose_correctives", {{"offsets", shape_of(3, 9)}, {"points", shape_of(vertices, 3)}},
                 [&](const auto& in) { return pose_correctives(correctives(in[0]), in[0], in[1]); });
  check_operator("rotation_offsets", {{"rotations", shape_of(5, 9)}},
                 [](const auto& in) { return rotation_offsets(in[0]); });
  check_operator("rotation_offsets_from_axis_angle", {{"axis_angle", shape_of(7, 3), -2, 2}},
                 [](const auto& in) { return rotation_offsets_from_axis_angle(in[0]); });
  check_operator("rotation_offsets_from_axis_angle at 0", {{"axis_angle", shape_of(2, 3), 0, 0, Numbers(6, 0.0)}},
                 [](const auto& in) { return rotation_offsets_from_axis_angle(in[0]); });
}

TEST_CASE("packed correctives: float values within the bound, gradients of packed numbers") {
  const Index vertices = 700;
  const Numbers values = random_numbers(3 * vertices * 45, 0.004, 5);
  const BothCorrectives both(values, vertices, 1, 5, 1e-5);
  CHECK(both.single.directions().bytes() * 4 == both.full.directions().bytes());
  CHECK(both.single.directions().largest_error() <= 1e-5);
  OperatorCheck options;
  options.float_tolerance = 1e-4;
  check_operator(
      "packed", {{"axis_angle", shape_of(5, 3), -2, 2}, {"points", shape_of(vertices, 3)}},
      [&](const auto& in) { return pose_correctives(both(in[0]), rotation_offsets_from_axis_angle(in[0]), in[1]); },
      options);
}

TEST_CASE("correctives of some joints are those columns of the whole") {
  const Index vertices = 300;
  const Numbers values = random_numbers(3 * vertices * 27, 0.3, 6);
  const PoseDirections<double> all(values, vertices, 1, 3), last(values, vertices, 2, 2), first(values, vertices, 1, 1);
  Tape<double> tape;
  const auto offsets = tape.parameter("offsets", shape_of(3, 9));
  const auto points = tape.parameter("points", shape_of(vertices, 3));
  tape.set(offsets, random_numbers(27, 1, 8));
  tape.set(points, random_numbers(3 * vertices, 1, 7));
  const auto whole = pose_correctives(all, offsets, points);
  const auto moved = pose_correctives(last, slice_rows(offsets, 1, 2), points);
  const auto split = pose_correctives(first, slice_rows(offsets, 0, 1), moved);
  tape.forward(whole);
  tape.forward(split);
  const auto a = numbers_of(tape.value(whole)), b = numbers_of(tape.value(split));
  for (std::size_t i = 0; i < a.size(); ++i) CHECK(std::abs(a[i] - b[i]) < 1e-14);
}

TEST_CASE("arrays that do not fit the directions are refused") {
  const Numbers values = random_numbers(3 * 4 * 18, 1, 11), rest = random_numbers(12, 1, 12);
  const PoseDirections<double> correctives(values, 4, 1, 2);
  Tape<double> tape;
  const auto offsets = tape.parameter("offsets", shape_of(2, 9)), points = tape.parameter("points", shape_of(4, 3));
  CHECK_THROWS_WITH(pose_correctives(correctives, points, points), Catch::Contains("[4,3] against [2,9]"));
  CHECK_THROWS_WITH(pose_correctives(correctives, offsets, offsets), Catch::Contains("[2,9] against [4,3]"));
  CHECK_THROWS_AS(PoseDirections<double>(values, 4, 0, 1), InternalError);
  CHECK_THROWS_AS(PoseDirections<double>(values, 4, 1, 0), InternalError);
  CHECK_THROWS_AS(PoseDirections<double>(values, 4, 2, 2), InternalError);
  CHECK_THROWS_AS(PoseDirections<double>(values, 5, 1, 1), InternalError);
  CHECK_THROWS_AS(PoseDirections<double>(values, 0, 1, 1), InternalError);
  const Directions<double> shape(DirectionSource{values, 4, 18, {0}, 18});
  const std::array<BlendTerm<double>, 1> wrong = {{{shape, offsets}}};
  CHECK_THROWS_WITH(blend_shapes(rest, std::span<const BlendTerm<double>>(wrong)),
                    Catch::Contains("[2,9] against [1,18]"));
  CHECK_THROWS_AS(blend_shapes(rest, std::span<const BlendTerm<double>>()), InternalError);
}

}  // namespace blend_shapes_test
