#include "optim/object_centres.h"

#include <cmath>
#include <numbers>

#include <catch2/catch.hpp>

#include "core/random.h"
#include "core/rotation.h"
#include "tests/support/seeds.h"

namespace object_centres_test {

using namespace hsi4d;

namespace {

/// Gaussians of which the centres alone are of interest.
Gaussians centres(std::vector<float> means) {
  Gaussians gaussians;
  gaussians.means = std::move(means);
  gaussians.opacity_logits.resize(gaussians.means.size() / 3);
  return gaussians;
}

}  // namespace

TEST_CASE("the nearest centre among objects that are turned and moved, if it is near enough") {
  const Gaussians first = centres({0, 0, 0, 1, 0, 0}), second = centres({0, 0, 0.25F});
  const ObjectCentres objects({&first, &second});
  // The first turned by a quarter about z: its centres are at (2, 0, 0) and (2, 1, 0); the second's at (0, 0, 1.25).
  const std::vector<Rigid<double>> poses = {{so3_exp(Vector3<double>(0, 0, std::numbers::pi / 2)), {2, 0, 0}},
                                            {Matrix3<double>::Identity(), {0, 0, 1}}};
  const auto found = objects.nearest({2, 1.5, 0}, poses, 1);
  REQUIRE(found);
  CHECK(found->object == 0);
  CHECK(found->row == 1);
  CHECK(found->distance == Approx(0.5).epsilon(1e-12));
  const auto other = objects.nearest({0, 0, 1}, poses, 1);
  REQUIRE(other);
  CHECK(other->object == 1);
  CHECK(other->row == 0);
  CHECK(other->distance == 0.25);
  CHECK_FALSE(objects.nearest({0, 0, 1}, poses, 0.25));  // nearer than, not as near as
  CHECK_FALSE(objects.nearest({50, 0, 0}, poses, 10));
}

TEST_CASE("of centres that are equally near the first of the first object is taken") {
  const Gaussians twice = centres({0, 0, 1, 0, 0, -1, 0, 0, -1});
  const ObjectCentres objects({&twice, &twice});
  const std::vector<Rigid<double>> poses(2, {Matrix3<double>::Identity(), Vector3<double>::Zero()});
  const auto found = objects.nearest({0, 0, -0.5}, poses, 1);
  REQUIRE(found);
  CHECK(found->object == 0);
  CHECK(found->row == 1);
}

TEST_CASE("rounding in the tree loses no centre") {
  RandomSequence random(test::fresh_seed());
  const std::vector<Rigid<double>> poses = {{Matrix3<double>::Identity(), Vector3<double>::Zero()}};
  for (int round = 0; round < 400; ++round) {
    std::vector<float> means(3 * 30);  // a corner of eight centres and more is often the nearest, as seen from outside
    for (float& x : means) x = 0.05F * std::round(static_cast<float>(1.2 * random.normal()));
    const Gaussians object = centres(means);
    const ObjectCentres objects({&object});
    for (int k = 0; k < 500; ++k) {
      const Vector3<double> place = 0.3 * Vector3<double>(random.normal(), random.normal(), random.normal());
      const auto distance = [&](Index row) {
        return (Vector3<float>(means.data() + 3 * row).cast<double>() - place).norm();
      };
      double least = HUGE_VAL;
      for (Index i = 0; i < object.count(); ++i) least = std::min(least, distance(i));
      const auto found = objects.nearest(place, poses, 10);
      REQUIRE(found);
      REQUIRE(found->row >= 0);
      REQUIRE(found->row < object.count());
      REQUIRE(distance(found->row) <= (1 + 1e-12) * least);
    }
  }
}

TEST_CASE("without objects nothing is near") { CHECK_FALSE(ObjectCentres({}).nearest({0, 0, 0}, {}, 1)); }

}  // namespace object_centres_test
