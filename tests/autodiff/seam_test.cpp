#include "autodiff/seam.h"

#include <cmath>

#include <Eigen/Core>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "core/check.h"
#include "tests/support/operator_check.h"
#include "tests/support/patched_image.h"

namespace seam_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

const SeamMode kGradient{};
const Shape kImage = {2, 21, 37, 48};

/// y_i = sin(x_0 + i x_1) x_2, loss Σ w (y − c)².
struct Model {
  Tape<double> tape;
  Var<double> x = tape.parameter("x", shape_of(1, 3));
  SeamMode mode;
  Var<double> loss;
  static constexpr Index kResiduals = 5;

  Model() {
    tape.set(x, {0.3, 0.2, 0.7});
    const Var<double> i = tape.constant("i", shape_of(kResiduals, 1)), w = tape.constant("w", i.shape());
    tape.set(i, {0.0, 1.0, 2.0, 3.0, 4.0});
    tape.set(w, {1.0, 0.5, 2.0, 1.5, 0.25});
    const Var<double> y = sin(slice_cols(x, 0, 1) + i * slice_cols(x, 1, 1)) * slice_cols(x, 2, 1);
    loss = sum(w * square(seam(y, mode) - 0.2));
  }
  /// Row i of J.
  static Eigen::RowVector3d row(Index i) {
    const double at = 0.3 + 0.2 * static_cast<double>(i);
    return {0.7 * std::cos(at), 0.7 * static_cast<double>(i) * std::cos(at), std::sin(at)};
  }
};

}  // namespace

TEST_CASE("a seam passes the operator checks", "[parallel]") {
  check_operator("seam", {{"x", shape_of(5, 3)}}, [](const auto& in) { return seam(in[0], kGradient); });
  check_operator("seam of an image", {{"x", kImage}}, [](const auto& in) { return seam(in[0], kGradient); });
}

TEST_CASE("a mean of reweighted differences passes the operator checks", "[parallel]") {
  check_operator("reweighted_l1", {{"x", kImage}}, [](const auto& in) {
    return reweighted_l1(in[0], in[0].owner().constant("target", in[0].shape()), 0.1, kGradient);
  });
}

TEST_CASE("a seam that tells of the change multiplies by the Gauss-Newton matrix") {
  Model model;
  model.tape.forward(model.loss);
  model.tape.backward(model.loss);
  Eigen::Matrix3d expected = Eigen::Matrix3d::Zero();
  const double weights[] = {1.0, 0.5, 2.0, 1.5, 0.25};
  for (Index i = 0; i < Model::kResiduals; ++i) expected += 2 * weights[i] * Model::row(i).transpose() * Model::row(i);
  for (Index k = 0; k < 3; ++k) {
    const double h = 1e-6;
    model.mode = {true, 1 / h};
    model.tape.write(model.x).data[k] += h;
    model.tape.forward(model.loss);
    model.tape.backward(model.loss);
    for (Index j = 0; j < 3; ++j)
      CHECK(model.tape.gradient(model.x).data[j] == Approx(expected(j, k)).epsilon(1e-4).margin(1e-5));
    model.tape.write(model.x).data[k] -= h;
  }
}

TEST_CASE("absolute differences have the curvature of weighted squares") {
  Tape<double> tape;
  const Var<double> x = tape.parameter("x", shape_of(1, 4)), goal = tape.constant("goal", x.shape());
  tape.set(x, {0.5, -0.02, 3.0, 0.0});
  SeamMode mode;
  const double floor = 0.1;
  const Var<double> loss = reweighted_l1(seam(x, mode), goal, floor, mode);
  tape.forward(loss);
  tape.backward(loss);
  CHECK(tape.value(loss).scalar() == Approx((0.45 + 0.002 + 2.95 + 0) / 4));
  const double slopes[] = {1, -0.2, 1, 0}, weights[] = {2, 10, 1 / 3.0, 10};
  for (Index i = 0; i < 4; ++i) CHECK(tape.gradient(x).data[i] == Approx(slopes[i] / 4));
  const double h = 1e-3;
  mode = {true, 1 / h};
  for (Index i = 0; i < 4; ++i) tape.write(x).data[i] += h;
  tape.forward(loss);
  tape.backward(loss);
  for (Index i = 0; i < 4; ++i) CHECK(tape.gradient(x).data[i] == Approx(weights[i] / 4));
}

TEST_CASE("a seam asked for the change of a gradient that it has not seen says so") {
  Model model;
  model.mode = {true, 1};
  model.tape.forward(model.loss);
  CHECK_THROWS_AS(model.tape.backward(model.loss), InternalError);
}

TEST_CASE("reweighted differences refuse what they cannot compare") {
  Tape<double> tape;
  const Var<double> a = tape.parameter("a", shape_of(2, 3)), b = tape.constant("b", shape_of(3, 2));
  CHECK_THROWS_AS(reweighted_l1(a, b, 0.1, kGradient), InternalError);
  CHECK_THROWS_AS(reweighted_l1(a, a, 0.0, kGradient), InternalError);
}

TEST_CASE("a seam passes on which squares of an image changed and are read, and knows what it has not kept") {
  const Shape image = {2, 40, 48, 48};
  Tape<double> tape;
  const Var<double> base = tape.constant("base", image), x = tape.parameter("x", kScalarShape);
  for (Index i = 0; i < image.memory(); ++i) tape.write(base).data[i] = std::sin(static_cast<double>(i));
  tape.write(x).data[0] = 0.4;
  const auto patch = std::make_shared<Patch>(Patch{2, 3, 10});
  SeamMode mode;
  const Var<double> drawn = patched_image(base, x, patch), target = tape.constant("target", image);
  const Var<double> loss = l2(seam(drawn, mode), target), plain = l2(drawn, target);
  const auto evaluate = [&](const Var<double> of) {
    tape.write(x);
    tape.forward(of);
    tape.backward(of);
    return std::pair(tape.value(of).scalar(), tape.gradient(x).scalar());
  };
  for (const Index col : {3, 20, 33, 5}) {
    patch->col = col;
    CHECK(evaluate(loss) == evaluate(plain));
  }
  evaluate(loss);
  const double h = 1e-3, share = 2 * 100 / static_cast<double>(image.count());
  mode = {true, 1 / h};
  tape.write(x).data[0] += h;
  CHECK(evaluate(loss).second == Approx(2 * share).epsilon(1e-6));
  patch->col = 30;  // squares whose gradient was not read when it was kept
  CHECK(evaluate(loss).second == 0);
}

}  // namespace seam_test
