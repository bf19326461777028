#include "autodiff/weighted_image.h"

#include <limits>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "core/check.h"
#include "tests/support/operator_check.h"

namespace weighted_image_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

const Shape kImage = {2, 21, 37, 48}, kWeight = {1, 21, 37, 48};

/// 0 in the first columns, then rising.
template <class S>
Var<S> some_weight(Tape<S>& tape) {
  const Var<S> weight = tape.constant("weight", kWeight);
  const Array<S> w = tape.write(weight);
  for (Index r = 0; r < kWeight.rows; ++r) {
    for (Index c = 18; c < kWeight.cols; ++c) w(0, r, c) = static_cast<S>(0.01 * static_cast<double>(r + c));
  }
  return weight;
}

}  // namespace

TEST_CASE("a weighted image passes the operator checks", "[parallel]") {
  check_operator("weighted_image", {{"a", kImage}},
                 [](const auto& in) { return weighted_image(in[0], some_weight(in[0].owner())); });
  check_operator("weighted_image of any weights", {{"a", kImage}, {"weight", kWeight}},
                 [](const auto& in) { return weighted_image(in[0], in[1]); });
}

TEST_CASE("a weighted image is the product, and 0 where the weight is, whatever is there") {
  Tape<float> tape;
  const auto a = tape.parameter("a", kImage), weight = some_weight(tape);
  const Array<float> x = tape.write(a);
  for (Index r = 0; r < x.total_rows(); ++r) {
    for (Index c = 0; c < kImage.cols; ++c) x.row(r)[c] = 0.3f + 0.1f * static_cast<float>(r - c);
  }
  const auto product = a * weight, weighted = weighted_image(a, weight);
  tape.forward(product);
  tape.forward(weighted);
  const auto is_equal = [&] {
    for (Index r = 0; r < x.total_rows(); ++r) {
      for (Index c = 0; c < kImage.cols; ++c) {
        if (tape.value(weighted).row(r)[c] != tape.value(product).row(r)[c]) return false;
      }
    }
    return true;
  };
  CHECK(is_equal());
  tape.write(a)(1, 20, 17) = std::numeric_limits<float>::quiet_NaN();
  const auto all = sum(weighted);
  tape.forward(all);
  tape.backward(all);
  CHECK(tape.value(weighted)(1, 20, 17) == 0);
  CHECK(tape.gradient(a)(1, 20, 17) == 0);
  CHECK(tape.gradient(a)(1, 20, 36) == tape.value(weight)(0, 20, 36));
}

TEST_CASE("weights of another size are refused") {
  Tape<float> tape;
  const auto a = tape.parameter("a", kImage);
  CHECK_THROWS_AS(weighted_image(a, tape.constant("narrow", image_shape<float>(1, 21, 36))), InternalError);
  CHECK_THROWS_AS(weighted_image(a, a), InternalError);
}

}  // namespace weighted_image_test
