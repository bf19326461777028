#include "splat/render/covariance.h"

#include <cmath>
#include <limits>

#include "splat/limits.h"
#include "tests/support/operator_check.h"
#include "tests/support/taped_splats.h"

namespace covariance_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

const double kInf = std::numeric_limits<double>::infinity(), kNan = std::numeric_limits<double>::quiet_NaN();

/// Axes and gradients (cotangent: ones) of one Gaussian.
template <class S>
struct OneGaussian {
  Tape<S> tape;
  Var<S> quats = tape.parameter("quats", shape_of(1, 4)), log_scales = tape.parameter("log_scales", shape_of(1, 3));
  Var<S> axes = gaussian_axes(quats, log_scales);

  void run(const std::vector<double>& q, const std::vector<double>& l, std::vector<S> cotangent = {}) {
    tape.set(quats, std::vector<S>(q.begin(), q.end()));
    tape.set(log_scales, std::vector<S>(l.begin(), l.end()));
    tape.forward(axes);
    if (cotangent.empty()) cotangent.assign(9, S(1));
    tape.backward(axes, cotangent);
  }
  std::vector<double> value() { return numbers_of<S>(tape.value(axes)); }
  std::vector<double> d(Var<S> of) { return numbers_of<S>(tape.gradient(of)); }
};

}  // namespace

TEST_CASE("axes of Gaussians pass the operator checks", "[parallel]") {
  check_operator("gaussian_axes", {{"quats", shape_of(30, 4)}, {"log_scales", shape_of(30, 3), -3, 2}},
                 [](const auto& in) { return gaussian_axes(in[0], in[1]); });
  check_operator("gaussian_axes, some scales held",
                 {{"quats", shape_of(30, 4)}, {"log_scales", shape_of(30, 3), -24, -18}},
                 [](const auto& in) { return gaussian_axes(in[0], in[1]); });
  check_operator("transform_axes", {{"transforms", shape_of(40, 12)}, {"axes", shape_of(40, 9)}},
                 [](const auto& in) { return transform_axes(in[0], in[1]); });
  check_operator("transform_axes, one transform", {{"transforms", shape_of(1, 12)}, {"axes", shape_of(2100, 9)}},
                 [](const auto& in) { return transform_axes(in[0], in[1]); });
}

TEST_CASE("axes are rotation times scale") {
  OneGaussian<double> g;
  g.run({1, 0, 0, 0}, {0, std::log(2), std::log(3)});
  CHECK(largest_difference(g.value(), {1, 0, 0, 0, 2, 0, 0, 0, 3}) <= 1e-15);
  const double h = std::sqrt(0.5);  // a quarter turn about z: x to y, y to −x
  g.run({h, 0, 0, h}, {0, std::log(2), std::log(3)});
  CHECK(largest_difference(g.value(), {0, -2, 0, 1, 0, 0, 0, 0, 3}) <= 1e-15);
}

TEST_CASE("log-scales are held within their limits, and have no gradient there [A5]") {
  for (const double l : {-kInf, -200., -88., -40., -20.5, 20.5, 40., 88., 200., kInf}) {
    OneGaussian<float> g;
    g.run({1, 0.2, 0, 0}, {l, 0.5, -0.5});
    OneGaussian<float> held;
    held.run({1, 0.2, 0, 0}, {l < 0 ? -kLogScaleLimit : kLogScaleLimit, 0.5, -0.5});
    INFO("log-scale " << l);
    CHECK(g.value() == held.value());
    CHECK(g.d(g.log_scales)[0] == 0);
    CHECK(g.d(g.log_scales)[1] == held.d(held.log_scales)[1]);
    CHECK(held.d(held.log_scales)[0] != 0);
    for (const double x : g.value()) CHECK(std::isfinite(x));
  }
}

TEST_CASE("a Gaussian without a rotation or a scale has nine zeros and no gradient [C8]") {
  const std::vector<double> q = {1, 0.2, 0.1, 0}, l = {0.1, 0.2, 0.3};
  OneGaussian<float> g;
  for (const std::vector<double>& broken :
       {std::vector<double>{0, 0, 0, 0}, {kNan, 1, 0, 0}, {kInf, 0, 0, 0}, {1, -kInf, 0, 0}}) {
    g.run(broken, l);
    CHECK(g.value() == std::vector<double>(9, 0.0));
    CHECK(g.d(g.quats) == std::vector<double>(4, 0.0));
    CHECK(g.d(g.log_scales) == std::vector<double>(3, 0.0));
  }
  g.run(q, {0.1, kNan, 0.3});
  CHECK(g.value() == std::vector<double>(9, 0.0));
  CHECK(g.d(g.log_scales) == std::vector<double>(3, 0.0));
}

TEST_CASE("axes of wrong shapes are refused") {
  Tape<double> tape;
  const auto q = tape.parameter("q", shape_of(3, 4)), l = tape.parameter("l", shape_of(2, 3));
  CHECK_THROWS_AS(gaussian_axes(q, l), InternalError);
  const auto t = tape.parameter("t", shape_of(2, 12)), axes = tape.parameter("axes", shape_of(3, 9));
  CHECK_THROWS_AS(transform_axes(t, axes), InternalError);
}

}  // namespace covariance_test
