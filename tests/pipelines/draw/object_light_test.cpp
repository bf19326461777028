// Light on objects: the formula and its gradients.
#include "pipelines/draw/object_light.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/gradcheck.h"
#include "autodiff/reduce.h"
#include "core/quaternion.h"
#include "core/rotation.h"

namespace object_light_test {

using namespace hsi4d;

namespace {

Var<double> random_array(Tape<double>& tape, bool is_leaf, Shape shape, std::uint64_t seed) {
  const Var<double> var = is_leaf ? tape.parameter("numbers", shape) : tape.constant("numbers", shape);
  RandomSequence random(seed);
  const Array<double> numbers = tape.write(var);
  for (Index r = 0; r < numbers.total_rows(); ++r) {
    for (Index c = 0; c < numbers.shape.cols; ++c) numbers.row(r)[c] = random.uniform(-1, 1);
  }
  return var;
}

Var<double> weighed(Tape<double>& tape, Var<double> x) { return sum(x * random_array(tape, false, x.shape(), 7)); }

std::vector<double> numbers_in(Tape<double>& tape, Var<double> x) {
  tape.forward(x);
  const ConstArray<double> array = tape.value(x);
  std::vector<double> numbers;
  for (Index r = 0; r < array.total_rows(); ++r)
    numbers.insert(numbers.end(), array.row(r), array.row(r) + array.shape.cols);
  return numbers;
}

GradcheckReport checked(Tape<double>& tape, Var<double> loss) {
  GradcheckOptions options;
  options.tolerance = 1e-6;
  options.step = 1e-6;
  options.kink_share = 0.2;
  options.each_node = false;
  return gradcheck(tape, loss, options);
}

}  // namespace

TEST_CASE("a Gaussian's normal is its shortest axis, away from the middle of the object") {
  Gaussians flat;
  for (const double side : {1.0, -1.0}) {
    const Vector4<double> turn = quaternion_exp(Vector3<double>(0.3, -0.8, 0.5));
    const Vector3<double> normal = side * quaternion_to_matrix(turn).col(1);
    for (const double x : {2.0 * normal[0], 2.0 * normal[1], 2.0 * normal[2]}) flat.means.push_back(float(x));
    for (Index i = 0; i < 4; ++i) flat.quats.push_back(float(3 * turn[i]));  // raw: any length
    for (const float scale : {-2.0F, -6.0F, -3.0F}) flat.log_scales.push_back(scale);
    flat.opacity_logits.push_back(0);
  }
  Tape<double> tape;
  const Var<double> normals = outward_normals(tape, flat);
  for (Index i = 0; i < 2; ++i) {
    const float* const at = flat.means.data() + 3 * i;
    const Vector3<double> mean = Vector3<float>(at).cast<double>();
    for (Index k = 0; k < 3; ++k) CHECK(tape.value(normals)(i, k) == Approx(mean.normalized()[k]).margin(1e-6));
  }
}

TEST_CASE("lit colours are as the formula says, and their gradients are right") {
  constexpr Index kRows = 5;
  Tape<double> tape;
  const Var<double> colors = random_array(tape, true, shape_of(kRows, 3), 1);
  const Var<double> normals = random_array(tape, false, shape_of(kRows, 3), 2);
  const Var<double> turn = tape.parameter("turn", shape_of(1, 9));
  const Matrix3<double> rotation = so3_exp(Vector3<double>(0.4, 1.1, -0.6));
  for (Index i = 0; i < 9; ++i) tape.write(turn)(0, i) = rotation(i / 3, i % 3);
  const Var<double> light = random_array(tape, true, shape_of(1, 6), 3);
  const Var<double> lit = lit_colors(colors, normals, turn, light);
  const std::vector<double> found = numbers_in(tape, lit), c = numbers_in(tape, colors), n = numbers_in(tape, normals),
                            l = numbers_in(tape, light);
  for (std::size_t i = 0; i < kRows; ++i) {
    const Vector3<double> normal = rotation * Vector3<double>(n.data() + 3 * i);
    for (std::size_t k = 0; k < 3; ++k) {
      const double factor = std::exp(l[k] + normal.dot(Vector3<double>(l.data() + 3)));
      CHECK(found[3 * i + k] == Approx(c[3 * i + k] * factor).epsilon(1e-12));
    }
  }
  const GradcheckReport report = checked(tape, weighed(tape, lit));
  INFO(report.text());
  CHECK(report.ok());
}

}  // namespace object_light_test
