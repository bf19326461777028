#include "optim/standing_feet.h"

#include <catch2/catch.hpp>

#include "body/body_model.h"
#include "core/check.h"

namespace standing_feet_test {

using namespace hsi4d;

namespace {

/// 22 joints of which the feet alone are on the ground, the ankles 8 cm above it.
struct Joints {
  std::vector<double> numbers = std::vector<double>(66, 1.0);

  Joints() {
    for (const char* name : {"left_ankle", "right_ankle"}) at(name)[2] = 0.08;
    for (const char* name : {"left_foot", "right_foot"}) at(name)[2] = 0;
  }
  double* at(const char* name) { return numbers.data() + 3 * smplx_joint(name); }
};

}  // namespace

TEST_CASE("the lower foot's range is that of medians over five frames of the lowest joint of the feet") {
  std::vector<std::vector<double>> frames(12, Joints().numbers);
  CHECK(lower_foot_range(frames) == 0);
  const auto lift = [&frames](std::size_t t, double by, std::initializer_list<const char*> names) {
    for (const char* name : names) frames[t][static_cast<std::size_t>(3 * smplx_joint(name) + 2)] += by;
  };
  for (std::size_t t = 0; t < 12; ++t) lift(t, 0.5, {"left_foot", "left_ankle", "head"});  // the other foot stands
  CHECK(lower_foot_range(frames) == 0);
  lift(4, 0.4, {"right_foot", "right_ankle"});
  lift(5, 0.4, {"right_foot", "right_ankle"});  // two frames are noise
  CHECK(lower_foot_range(frames) == 0);
  lift(6, 0.4, {"right_foot", "right_ankle"});
  CHECK(lower_foot_range(frames) == Approx(0.4));
  CHECK(lower_foot_range(std::span(frames).first(1)) == 0);
  CHECK(lower_foot_range(std::span(frames).subspan(5)) == Approx(0.4));  // the first of them has two after it alone
}

TEST_CASE("sliding is the mean horizontal step of the feet that stand, in a tenth of a second") {
  const Joints first;
  Joints after;
  CHECK(foot_sliding_mm(first.numbers, after.numbers, first.numbers, 10) == 0.0);
  after.at("left_ankle")[0] += 0.012;
  after.at("left_ankle")[1] -= 0.016;  // 20 mm
  after.at("left_ankle")[2] += 0.005;  // lifted: no sliding
  after.at("pelvis")[0] += 0.1;        // no foot
  CHECK(*foot_sliding_mm(first.numbers, after.numbers, first.numbers, 10) == Approx(20 / 4.0));
  // The same motion at 20 frames a second is twice as fast; four steps of a quarter at 40 are as fast as one at 10.
  CHECK(*foot_sliding_mm(first.numbers, after.numbers, first.numbers, 20) == Approx(2 * 20 / 4.0));
  Joints quarter;
  for (int i = 0; i < 3; ++i)
    quarter.at("left_ankle")[i] += (after.at("left_ankle")[i] - quarter.at("left_ankle")[i]) / 4;
  CHECK(*foot_sliding_mm(first.numbers, quarter.numbers, first.numbers, 40) == Approx(20 / 4.0));
}

TEST_CASE("feet that are high or fast do not stand") {
  const Joints first;
  Joints before, after;
  after.at("right_foot")[1] += 0.03;
  before.at("left_foot")[2] = after.at("left_ankle")[2] = 0.14;  // more than 5 cm higher than in the first frame
  after.at("right_ankle")[0] += 0.051;                           // 0.51 m/s
  CHECK(*foot_sliding_mm(before.numbers, after.numbers, first.numbers, 10) == Approx(30));  // the right ball alone
  CHECK_FALSE(foot_sliding_mm(before.numbers, after.numbers, first.numbers, 20));           // 0.6 m/s
  CHECK_THROWS_AS(foot_sliding_mm(before.numbers, std::vector<double>(63), first.numbers, 10), InternalError);
}

}  // namespace standing_feet_test
