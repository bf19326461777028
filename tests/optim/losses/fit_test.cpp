#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "autodiff/tape_rows.h"
#include "core/check.h"
#include "tests/support/loss_terms.h"
#include "tests/support/operator_check.h"
#include "tests/support/test_motion.h"

namespace fit_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();
constexpr Index kMoving = kFrames - kStill;

/// Across and along, of all kinds: usual, below the least, unknown, not looked at.
std::vector<double> some_sigmas() {
  std::vector<double> sigmas;
  for (Index i = 0; i < 44 * kFrames; ++i)
    sigmas.push_back(0.005 + 0.2 * std::abs(std::sin(0.7 * static_cast<double>(i))));
  sigmas[0] = 1e-6;
  sigmas[5] = kInfinity;
  sigmas[6] = sigmas[7] = kNotANumber;
  return sigmas;
}

/// Of length 1.
std::vector<double> some_axes() {
  std::vector<double> axes;
  for (Index t = 0; t < kFrames; ++t) {
    const Vector3<double> axis = Vector3<double>(0.3, std::sin(static_cast<double>(t)), 1).normalized();
    axes.insert(axes.end(), axis.data(), axis.data() + 3);
  }
  return axes;
}

template <class S>
LossInputs<S> inputs_of(Var<S> joints, Var<S> start, Var<S> axes, const std::vector<double>& sigmas) {
  LossInputs<S> in;
  in.joints = joints;
  in.joints_start = start;
  in.view_axes = axes;
  in.joints_sigma = constant_rows(joints.owner(), "joints_sigma", sigmas, 44);
  in.motion = std::shared_ptr<const MotionStart>(&motion_of_test().start, [](const MotionStart*) {});
  return in;
}

/// A sequence in which one joint alone is off.
struct OneJoint {
  Vector3<double> way = Vector3<double>::Zero();
  double across = 0.01, along = 0.01;
  Vector3<double> axis = Vector3<double>::UnitZ();

  double value(const std::string& settings, double* slope = nullptr) const {
    Tape<double> tape;
    const auto leaf = [&](const char* name, std::vector<double> numbers, Index cols) {
      const Var<double> var = tape.parameter(name, shape_of(std::ssize(numbers) / cols, cols));
      tape.set(var, numbers);
      return var;
    };
    std::vector<double> joints(66 * kFrames, 0.0), axes, sigmas(44 * kFrames, kNotANumber);
    const auto at = static_cast<std::size_t>(66 * kStill);
    for (std::size_t i = 0; i < 3; ++i) joints[at + i] = way[static_cast<Index>(i)];
    for (Index t = 0; t < kFrames; ++t) axes.insert(axes.end(), axis.data(), axis.data() + 3);
    sigmas[44 * kStill] = across, sigmas[44 * kStill + 1] = along;
    const Var<double> moved = leaf("joints", joints, 66), start = leaf("start", std::vector<double>(66 * kFrames), 66);
    const Var<double> loss = record_term("fit", inputs_of(moved, start, leaf("axes", axes, 3), sigmas), settings);
    tape.forward(loss);
    tape.backward(loss);
    if (slope != nullptr) *slope = Eigen::Map<const Vector3<double>>(tape.gradient(moved).row(kStill)).norm();
    return tape.value(loss).scalar() * kMoving;
  }
};

}  // namespace

TEST_CASE("fit by sigma passes the gradient check", "[parallel]") {
  const std::vector<double> sigmas = some_sigmas();
  check_operator("fit",
                 {{"joints", shape_of(kFrames, 66), -0.05, 0.05},
                  {"joints_start", shape_of(kFrames, 66), -0.05, 0.05},
                  {"view_axes", shape_of(kFrames, 3), 0, 0, some_axes()}},
                 [&](const auto& in) {
                   return record_term("fit", inputs_of(in[0], in[1], in[2], sigmas), R"({"by_sigma": true})");
                 },
                 {.entries = 24});
}

TEST_CASE("fit weighs a joint by its sigmas across and along the view, and lets go of what is far off") {
  const std::string by_sigma = R"({"by_sigma": true, "scale": 1e3})";
  OneJoint joint{{0.003, 0.004, 0}, 0.02, 0.05};
  CHECK(joint.value("{}") == Approx(25e-6));
  CHECK(joint.value(by_sigma) == Approx(25e-6 / 4));  // σ is twice 1 cm
  joint.way = {0, 0, 0.005};
  CHECK(joint.value(by_sigma) == Approx(25e-6 / 25));
  joint.axis = Vector3<double>(0, 0.6, 0.8);
  CHECK(joint.value(by_sigma) == Approx(25e-6 * (0.36 / 4 + 0.64 / 25)));
  joint.across = joint.along = kNotANumber;  // nobody looked
  CHECK(joint.value(by_sigma) == Approx(joint.value("{}")));
  joint.across = joint.along = kInfinity;  // nothing tells
  CHECK(joint.value(by_sigma) == 0);
  joint.across = joint.along = 1e-9;
  CHECK(joint.value(by_sigma) == Approx(25e-6 * 100 / 9).epsilon(1e-3));  // as with 3 mm

  OneJoint far{{0.03, 0, 0}};
  double slope = 0, slope_farther = 0;
  CHECK(far.value(R"({"by_sigma": true})", &slope) == Approx(1e-4 * 9 * 9 / 18));  // 3 sigmas, of a scale of 3
  far.way *= 10;
  far.value(R"({"by_sigma": true})", &slope_farther);
  CHECK(slope_farther < slope / 10);
}

TEST_CASE("settings of fit that nothing reads are refused") {
  const OneJoint joint;
  CHECK_THROWS_WITH(joint.value(R"({"scale": 2})"), Contains("/scale: only by_sigma reads it"));
  CHECK_THROWS_WITH(joint.value(R"({"by_sigma": true, "joints": "mean"})"),
                    Contains("by_sigma counts the sum over joints"));
  CHECK_THROWS_WITH(joint.value(R"({"by_sigma": true, "scale": 0})"), Contains("/scale"));
}

}  // namespace fit_test
