#include "autodiff/matrix.h"

#include "autodiff/reduce.h"
#include "tests/support/operator_check.h"

namespace matrix_test {

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("matrix operators pass the operator checks", "[parallel]") {
  check_operator("matmul", {{"a", shape_of(300, 5)}, {"b", shape_of(5, 4)}},
                 [](const auto& in) { return matmul(in[0], in[1]); });
  check_operator("matmul, wide", {{"a", shape_of(3, 300)}, {"b", shape_of(300, 2)}},
                 [](const auto& in) { return matmul(in[0], in[1]); });
  check_operator("matmul with itself", {{"a", shape_of(4, 4)}}, [](const auto& in) { return matmul(in[0], in[0]); });
  check_operator("transpose", {{"x", shape_of(3, 5)}}, [](const auto& in) { return transpose(in[0]); });
  check_operator("reshape", {{"x", {2, 3, 5, 8}}}, [](const auto& in) { return reshape(in[0], 15, 2); });
  check_operator("slice_rows", {{"x", shape_of(6, 3)}}, [](const auto& in) { return slice_rows(in[0], 2, 3); });
  check_operator("slice_planes", {{"x", image_shape<double>(5, 4, 7)}},
                 [](const auto& in) { return slice_planes(in[0], 1, 3); });
  check_operator("slice_cols", {{"x", shape_of(6, 3)}}, [](const auto& in) { return slice_cols(in[0], 1, 2); });
  check_operator("concat_rows", {{"x", shape_of(2, 3)}, {"y", shape_of(4, 3)}},
                 [](const auto& in) { return concat_rows(std::span(in)); });
  check_operator("concat_cols", {{"x", shape_of(4, 3)}, {"y", shape_of(4, 1)}},
                 [](const auto& in) { return concat_cols(std::span(in)); });
  check_operator("gather_rows", {{"x", shape_of(5, 3)}}, [](const auto& in) {
    return gather_rows(in[0], {4, 0, 0, 2, 4, 4});
  });
}

TEST_CASE("sums pass the operator checks", "[parallel]") {
  for (const Shape shape : {shape_of(5, 3), Shape{3, 5, 7, 16}, shape_of(9000, 7)}) {
    check_operator("sum", {{"x", shape}}, [](const auto& in) { return sum(in[0]); }, {.entries = 16});
    check_operator("mean", {{"x", shape}}, [](const auto& in) { return mean(in[0]); }, {.entries = 16});
    check_operator("sum_rows", {{"x", shape}}, [](const auto& in) { return sum_rows(in[0]); }, {.entries = 16});
    check_operator("sum_cols", {{"x", shape}}, [](const auto& in) { return sum_cols(in[0]); }, {.entries = 16});
  }
  check_operator("norm_cols", {{"x", shape_of(5, 3)}}, [](const auto& in) { return norm_cols(in[0]); });
}

TEST_CASE("F7, M9: a sum of many floats keeps the accuracy of double") {
  constexpr Index kCount = 1 << 22;
  Tape<float> tape;
  const auto x = tape.parameter("x", shape_of(kCount, 1));
  const Array<float> values = tape.write(x);
  double expected = 0;
  for (Index i = 0; i < kCount; ++i) {
    values.data[i] = 0.1f + static_cast<float>(i % 7) * 1e-3f;
    expected += static_cast<double>(values.data[i]);
  }
  const auto total = sum(x);
  tape.forward(total);
  CHECK(static_cast<double>(tape.value(total).scalar()) == Approx(expected).epsilon(1e-7));
}

TEST_CASE("the gradient at coincident points is zero, not NaN (row D5)") {
  Tape<double> tape;
  const auto x = tape.parameter("x", shape_of(2, 3));
  tape.set(x, {0, 0, 0, 3, 0, 4});
  const auto length = norm_cols(x);
  tape.forward(length);
  tape.backward(length, std::vector<double>{1, 1});
  CHECK(tape.value(length)(1, 0) == 5);
  for (Index c = 0; c < 3; ++c) CHECK(tape.gradient(x)(0, c) == 0);
  CHECK(tape.gradient(x)(1, 2) == Approx(0.8));
}

TEST_CASE("wrong sizes and indices are named") {
  Tape<double> tape;
  const auto a = tape.parameter("a", shape_of(5, 3));
  CHECK_THROWS_WITH(matmul(a, a), Catch::Contains("[5,3] against [5,3]"));
  CHECK_THROWS_WITH(gather_rows(a, {0, 5}), Catch::Contains("index[1] = 5 of 5"));
  CHECK_THROWS_WITH(slice_rows(a, 4, 2), Catch::Contains("[6,3] against [5,3]"));
  CHECK_THROWS_WITH(mean(tape.parameter("nothing", shape_of(0, 3))), Catch::Contains("mean of an empty array"));
}

}  // namespace matrix_test
