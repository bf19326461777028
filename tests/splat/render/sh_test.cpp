#include "splat/render/sh.h"

#include <cmath>
#include <limits>

#include "tests/support/operator_check.h"
#include "tests/support/taped_splats.h"

namespace sh_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

SplatView some_view() {
  SplatView view;
  view.camera = tilted_camera({40, 30});
  return view;
}

/// Colours of Gaussians with the given numbers.
template <class S>
struct Run {
  Tape<S> tape;
  Var<S> sh, means, xi, transform, colors;

  Run(const SplatView& view, Index coefficients, const std::vector<double>& s, const std::vector<double>& m,
      const std::vector<double>& t = {}) {
    sh = leaf("sh", 3 * coefficients, s);
    means = leaf("means", 3, m);
    xi = leaf("xi", 6, std::vector<double>(6, 0.0));
    if (!t.empty()) transform = leaf("transform", 12, t);
    colors = sh_colors(sh, means, xi, view, transform);
    tape.forward(colors);
    tape.backward(colors, std::vector<S>(static_cast<std::size_t>(colors.shape().count()), S(1)));
  }
  std::vector<double> value() { return numbers_of<S>(tape.value(colors)); }
  std::vector<double> d(Var<S> of) { return numbers_of<S>(tape.gradient(of)); }

 private:
  Var<S> leaf(const char* name, Index cols, const std::vector<double>& numbers) {
    const Var<S> var = tape.parameter(name, shape_of(static_cast<Index>(numbers.size()) / cols, cols));
    tape.set(var, std::vector<S>(numbers.begin(), numbers.end()));
    return var;
  }
};

}  // namespace

TEST_CASE("colours pass the operator checks at every degree [B19]", "[parallel]") {
  // Small coefficients, so that no colour comes near 0: a number of xi moves all of them, and would meet a kink always.
  for (const Index k : {1, 4, 9, 16}) {
    const std::vector<OperatorInput> inputs = {{"sh", shape_of(600, 3 * k), -0.05, 0.05},
                                               {"means", shape_of(600, 3)},
                                               {"xi", shape_of(1, 6), -0.2, 0.2},
                                               {"transform", shape_of(1, 12)}};
    check_operator("sh_colors, " + std::to_string(k), {inputs.begin(), inputs.begin() + 3},
                   [](const auto& in) { return sh_colors(in[0], in[1], in[2], some_view()); });
    check_operator("sh_colors of a moved object, " + std::to_string(k), inputs,
                   [](const auto& in) { return sh_colors(in[0], in[1], in[2], some_view(), in[3]); });
  }
}

TEST_CASE("a colour is held at 0 as its gradient is [B18]") {
  for (const double color : {-0.1, -1e-6, 0.1, 3.0}) {
    const double c = (color - 0.5) / kShC0;
    Run<double> run(some_view(), 1, {c, c, c}, {0, 0, 0});
    CHECK(run.value()[0] == Approx(std::max(0.0, color)).margin(1e-15));
    CHECK(run.d(run.sh)[0] == (color > 0 ? kShC0 : 0));
  }
}

TEST_CASE("a mean at the camera's centre has the colour along z and no gradient of direction [B19]") {
  SplatView view;
  view.camera = plain_camera({40, 30});
  std::vector<double> sh(48, 0.02);
  Run<double> at(view, 16, sh, {0, 0, 0}), ahead(view, 16, sh, {0, 0, 1});
  CHECK(at.value() == ahead.value());
  CHECK(at.d(at.means) == std::vector<double>(3, 0.0));
  CHECK(at.d(at.sh) == ahead.d(ahead.sh));
}

TEST_CASE("coefficients above the degree in use are not touched") {
  SplatView view = some_view();
  std::vector<double> sh(48, 0.05);
  view.settings.sh_degree = 1;
  Run<double> clean(view, 16, sh, {0.3, 0.2, 0.1});
  for (std::size_t i = 12; i < 48; ++i) sh[i] = std::numeric_limits<double>::quiet_NaN();
  Run<double> run(view, 16, sh, {0.3, 0.2, 0.1});
  CHECK(run.value() == clean.value());
  CHECK(run.d(run.means) == clean.d(clean.means));
  for (std::size_t i = 0; i < 48; ++i) CHECK((run.d(run.sh)[i] != 0) == (i < 12));
}

TEST_CASE("the colours of an object turn with it") {
  const Matrix3<double> turn = so3_exp(Vector3<double>(0.4, -0.7, 0.3));
  const Vector3<double> shift(0.2, 0.1, -0.3), mean(0.3, -0.1, 0.2);
  SplatView view = some_view();
  std::vector<double> sh = random_cotangent(48, 3), transform;
  for (double& x : sh) x *= 0.1;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) transform.push_back(turn(r, c));
    transform.push_back(shift[r]);
  }
  const Vector3<double> placed = turn * mean + shift;
  Run<double> moved(view, 16, sh, {placed[0], placed[1], placed[2]}, transform);
  SplatView from_object = view;  // the same camera as the object sees it
  from_object.camera.camera_from_world = compose(view.camera.camera_from_world, Rigid<double>{turn, shift});
  Run<double> still(from_object, 16, sh, {mean[0], mean[1], mean[2]});
  CHECK(largest_difference(moved.value(), still.value()) <= 1e-14);
}

TEST_CASE("numbers that are not finite make a colour that is not drawn, without harm to the others") {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, inf, -inf}) {
    std::vector<double> sh(24, 0.1);
    sh[4] = bad;
    Run<double> run(some_view(), 4, sh, {0.1, 0.2, 0.3, 0.3, 0.2, 0.1});
    CHECK(std::isnan(run.value()[1]));
    CHECK(std::isfinite(run.value()[3]));
    for (const double d : run.d(run.xi)) CHECK(std::isfinite(d));
  }
}

TEST_CASE("wrong numbers of coefficients are refused") {
  Tape<double> tape;
  const auto sh = tape.parameter("sh", shape_of(2, 15)), means = tape.parameter("means", shape_of(2, 3));
  const auto xi = tape.parameter("xi", shape_of(1, 6));
  CHECK_THROWS_AS(sh_colors(sh, means, xi, some_view()), InternalError);
}

}  // namespace sh_test
