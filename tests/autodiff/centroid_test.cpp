#include "autodiff/centroid.h"

#include <cmath>

#include "tests/support/operator_check.h"

namespace centroid_test {

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("centroids pass the operator checks", "[parallel]") {
  check_operator("centroids", {{"masks", image_shape<double>(3, 7, 19), 0, 1}},
                 [](const auto& in) { return centroids(in[0]); });
  check_operator("centroids of a large image", {{"masks", image_shape<double>(2, 300, 170), 0, 1}},
                 [](const auto& in) { return centroids(in[0]); }, {.entries = 8});
}

TEST_CASE("the centroid of one pixel is its centre") {
  Tape<float> tape;
  const auto masks = tape.parameter("masks", image_shape<float>(2, 5, 7));
  tape.write(masks)(1, 3, 2) = 0.25f;  // the first image is empty
  const auto centres = centroids(masks);
  tape.forward(centres);
  const auto value = tape.value(centres);
  CHECK(value(0, 0) == 0);
  CHECK(value(0, 1) == 0);
  CHECK(value(0, 2) == 0);
  CHECK(value(1, 0) == 2.5f);
  CHECK(value(1, 1) == 3.5f);
  CHECK(value(1, 2) == 0.25f);
}

TEST_CASE("an empty image has a gradient of its mass only") {
  Tape<double> tape;
  const auto masks = tape.parameter("masks", image_shape<double>(1, 5, 7));
  const auto centres = centroids(masks);
  tape.forward(centres);
  tape.backward(centres, std::vector<double>{1e3, -1e3, 0.5});
  for (Index i = 0; i < 5; ++i) {
    for (Index j = 0; j < 7; ++j) CHECK(tape.gradient(masks)(i, j) == 0.5);
  }
}

TEST_CASE("centroids of a large faint image keep their digits in float") {
  Tape<float> tape;
  const Shape shape = image_shape<float>(1, 1080, 1920);
  const auto masks = tape.parameter("masks", shape);
  const auto image = tape.write(masks);
  for (Index r = 0; r < shape.rows; ++r) std::fill_n(image.row(r), shape.cols, 0.1f);
  const auto centres = centroids(masks);
  tape.forward(centres);
  CHECK(std::fabs(tape.value(centres)(0, 0) - 960) < 1e-4);
  CHECK(std::fabs(tape.value(centres)(0, 1) - 540) < 1e-4);
}

}  // namespace centroid_test
