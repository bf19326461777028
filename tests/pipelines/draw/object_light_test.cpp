// Light on objects: the formula and its gradients.
#include "pipelines/draw/object_light.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "autodiff/tape_rows.h"
#include "core/quaternion.h"
#include "core/rotation.h"
#include "tests/support/operator_check.h"
#include "tests/support/random_numbers.h"

namespace object_light_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr Index kRows = 5;
const std::vector<double> kNormals = random_numbers(3 * kRows, 1, 2);

}  // namespace

TEST_CASE("a Gaussian's normal is its shortest axis, away from the middle of the object") {
  Gaussians flat;
  for (const double side : {1.0, -1.0}) {
    const Vector4<double> turn = quaternion_exp(Vector3<double>(0.3, -0.8, 0.5));
    const Vector3<double> normal = side * quaternion_to_matrix(turn).col(1);
    for (Index i = 0; i < 3; ++i) flat.means.push_back(static_cast<float>(2 * normal[i]));
    for (Index i = 0; i < 4; ++i) flat.quats.push_back(static_cast<float>(3 * turn[i]));  // raw: any length
    flat.log_scales.insert(flat.log_scales.end(), {-2, -6, -3});
    flat.opacity_logits.push_back(0);
  }
  Tape<double> tape;
  const Var<double> normals = outward_normals(tape, flat);
  for (Index i = 0; i < 2; ++i) {
    const Vector3<double> mean = Vector3<float>(flat.means.data() + 3 * i).cast<double>();
    for (Index k = 0; k < 3; ++k) CHECK(tape.value(normals)(i, k) == Approx(mean.normalized()[k]).margin(1e-6));
  }
}

TEST_CASE("lit colours are as the formula says") {
  const std::vector<double> colors = random_numbers(3 * kRows, 1, 1), light = random_numbers(6, 1, 3);
  const Matrix3<double> rotation = so3_exp(Vector3<double>(0.4, 1.1, -0.6));
  std::vector<double> turn;
  for (Index i = 0; i < 9; ++i) turn.push_back(rotation(i / 3, i % 3));
  Tape<double> tape;
  const Var<double> lit = lit_colors(constant_rows(tape, "colors", colors, 3), constant_rows(tape, "n", kNormals, 3),
                                     constant_rows(tape, "turn", turn, 9), constant_rows(tape, "light", light, 6));
  tape.forward(lit);
  for (Index i = 0; i < kRows; ++i) {
    const double along = (rotation * Vector3<double>(kNormals.data() + 3 * i)).dot(Vector3<double>(light.data() + 3));
    for (Index k = 0; k < 3; ++k) {
      const double color = colors[static_cast<std::size_t>(3 * i + k)];
      CHECK(tape.value(lit)(i, k) ==
            Approx(color * std::exp(light[static_cast<std::size_t>(k)] + along)).epsilon(1e-12));
    }
  }
}

TEST_CASE("lit colours have the gradients of differences") {
  check_operator("lit_colors", {{"colors", shape_of(kRows, 3)}, {"turn", shape_of(1, 9)}, {"light", shape_of(1, 6)}},
                 [](const auto& in) {
                   return lit_colors(in[0], constant_rows(in[0].owner(), "normals", kNormals, 3), in[1], in[2]);
                 });
}

}  // namespace object_light_test
