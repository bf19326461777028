#include "pipelines/synthetic/scene.h"

#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/rotation.h"
#include "pipelines/synthetic/object.h"
#include "splat/files/io_ply.h"
#include "tests/support/temporary_folder.h"

namespace scene_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

ScenePlan plan_with(bool table, bool stand) {
  ScenePlan plan;
  plan.has_table = table;
  plan.has_stand = stand;
  return plan;
}

/// What no Gaussian of a scene may be. @return the first fault, or nothing
std::string fault_of(const Gaussians& scene) {
  for (std::size_t i = 0; i < scene.means.size(); ++i)
    if (!std::isfinite(scene.means[i]) || !std::isfinite(scene.log_scales[i])) return "a number is not finite";
  if (!std::all_of(scene.sh.begin(), scene.sh.end(), [](float x) { return std::isfinite(x) && std::abs(x) < 3; }))
    return "a colour is no colour";
  if (!std::all_of(scene.quats.begin(), scene.quats.end(), [](float x) { return std::isfinite(x); }))
    return "a quaternion is not finite";
  return "";
}

double mean_color(const Gaussians& scene, std::size_t channel) {
  double sum = 0;
  const auto numbers = static_cast<std::size_t>(3 * scene.sh_coefficients());
  for (std::size_t i = channel; i < scene.sh.size(); i += numbers) sum += 0.5 + 0.28209479 * double(scene.sh[i]);
  return sum / double(scene.count());
}

}  // namespace

TEST_CASE("scenes have about as many Gaussians as asked for and all of them are sound") {
  for (const auto& kind : kSyntheticSceneKinds) {
    INFO(kind.name);
    for (const Index most : {kFewestSceneGaussians, Index{3000}, Index{40000}}) {
      INFO(most);
      const Gaussians scene = synthetic_scene(kind.value, most, plan_with(true, true), 3);
      CHECK_NOTHROW(check_sizes(scene));
      CHECK(scene.count() <= most);
      if (most > 1000) CHECK(double(scene.count()) > 0.85 * double(most));
      CHECK(fault_of(scene) == "");
      for (const std::size_t channel : {0U, 1U, 2U}) {  // neither dark nor glaring
        CHECK(mean_color(scene, channel) > 0.15);
        CHECK(mean_color(scene, channel) < 0.85);
      }
    }
    CHECK(std::string(scene_summary(kind.value)).size() > 20);
  }
}

TEST_CASE("rooms are boxes that are open to the front") {
  for (const SyntheticSceneKind kind :
       {SyntheticSceneKind::kLivingRoom, SyntheticSceneKind::kKitchen, SyntheticSceneKind::kBedroom}) {
    const Gaussians room = synthetic_scene(kind, 6000, plan_with(false, false), 1);
    for (std::size_t i = 0; i < room.means.size(); i += 3) {
      const bool inside = std::abs(room.means[i]) < 2.03F && std::abs(room.means[i + 1]) < 2.03F &&
                          room.means[i + 2] > -0.01F && room.means[i + 2] < 2.61F;
      if (!inside)
        FAIL("a Gaussian outside of the room, at " << room.means[i] << ' ' << room.means[i + 1] << ' '
                                                   << room.means[i + 2]);
    }
  }
}

TEST_CASE("nothing of a scene stands where the person acts") {
  for (const auto& kind : kSyntheticSceneKinds) {
    INFO(kind.name);
    const Gaussians scene = synthetic_scene(kind.value, 20000, plan_with(false, false), 5);
    int in_the_way = 0;
    for (std::size_t i = 0; i < scene.means.size(); i += 3) {
      const double x = double(scene.means[i]), y = double(scene.means[i + 1]), z = double(scene.means[i + 2]);
      in_the_way += std::hypot(x, y - 0.5) < 0.8 && z > 0.06 && z < 1.9 ? 1 : 0;
    }
    CHECK(in_the_way == 0);
  }
}

TEST_CASE("a scene is a function of its seed") {
  const ScenePlan plan;
  for (const auto& kind : kSyntheticSceneKinds) {
    INFO(kind.name);
    const Gaussians one = synthetic_scene(kind.value, 2000, plan, 1), same = synthetic_scene(kind.value, 2000, plan, 1);
    CHECK(one.means == same.means);
    CHECK(one.sh == same.sh);
    CHECK(one.sh != synthetic_scene(kind.value, 2000, plan, 2).sh);
  }
}

TEST_CASE("objects have about as many Gaussians as asked for around their centroid") {
  for (const auto& kind : kSyntheticObjectKinds) {
    if (kind.value == SyntheticObjectKind::kNone) continue;
    INFO(kind.name);
    CHECK(synthetic_object(kind.value, kFewestObjectGaussians, 0).gaussians.count() <= kFewestObjectGaussians);
    const SyntheticObject object = synthetic_object(kind.value, 1500, 0);
    CHECK(object.name == kind.name);
    CHECK(object.gaussians.count() > 1300);
    CHECK(object.gaussians.count() <= 1500);
    CHECK(fault_of(object.gaussians) == "");
    Vector3<double> sum = Vector3<double>::Zero();
    double lowest = 1;
    for (std::size_t i = 0; i < object.gaussians.means.size(); ++i) {
      sum[Eigen::Index(i % 3)] += double(object.gaussians.means[i]);
      if (i % 3 == 2) lowest = std::min(lowest, double(object.gaussians.means[i]));
    }
    CHECK(sum.norm() / double(object.gaussians.count()) < 1e-6);
    CHECK(lowest + object.above_ground > -0.01);  // it stands on the ground
    CHECK(lowest + object.above_ground < 0.02);
    CHECK(object.hands[1].has_value());
    for (const auto& hand : object.hands) {
      if (!hand) continue;
      CHECK(hand->thumb.norm() == Approx(1));
      CHECK(hand->fingers.norm() == Approx(1));
      CHECK(std::abs(dot(hand->thumb, hand->fingers)) < 1e-9);
      double nearest = 1;  // a hand holds something
      for (std::size_t i = 0; i < object.gaussians.means.size(); i += 3) {
        const Vector3<double> mean{double(object.gaussians.means[i]), double(object.gaussians.means[i + 1]),
                                   double(object.gaussians.means[i + 2])};
        nearest = std::min(nearest, (mean - hand->point).norm());
      }
      CHECK(nearest < 0.06);
    }
  }
  CHECK_FALSE(synthetic_object(SyntheticObjectKind::kNone, 1500, 0).exists());
}

TEST_CASE("a scene file stands in for the scene at its place") {
  const TemporaryFolder folder;
  Gaussians scene = synthetic_scene(SyntheticSceneKind::kLivingRoom, 1500, plan_with(false, false), 0);
  write_ply("scene.ply", scene);
  SyntheticSettings settings;
  settings.scene_file = "scene.ply";
  settings.scene_place = {0.5, -1, 0.25};
  settings.scene_scale = 0.5;
  settings.scene_turn_deg = 90;
  ScenePlan plan = plan_with(false, false);
  plan.middle = {0.1, 0.7};
  const Gaussians placed = synthetic_scene(settings, plan);
  REQUIRE(placed.count() == scene.count());
  for (const std::size_t i : {0U, 700U, 1200U}) {  // x_world = middle + R (s x − place)
    const double x = 0.5 * double(scene.means[3 * i]), y = 0.5 * double(scene.means[3 * i + 1]);
    CHECK(double(placed.means[3 * i]) == Approx(0.1 - (y + 1)).margin(1e-5));
    CHECK(double(placed.means[3 * i + 1]) == Approx(0.7 + (x - 0.5)).margin(1e-5));
    CHECK(double(placed.means[3 * i + 2]) == Approx(0.5 * double(scene.means[3 * i + 2]) - 0.25).margin(1e-5));
  }
  const Index with_table = synthetic_scene(settings, plan_with(true, false)).count();
  CHECK(with_table > scene.count() + 100);
  settings.scene_file = "missing.ply";
  CHECK_THROWS_AS(synthetic_scene(settings, plan), UserError);
}

TEST_CASE("an object file stands in for the object and is held where the settings say") {
  const TemporaryFolder folder;
  const SyntheticObject vase = synthetic_object(SyntheticObjectKind::kVase, 800, 0);
  write_ply("jug.ply", vase.gaussians);
  SyntheticSettings settings;
  settings.object = SyntheticObjectKind::kBox;
  settings.object_file = "jug.ply";
  settings.object_scale = 2;
  const SyntheticObject top = synthetic_object(settings);
  CHECK(top.name == "jug");
  CHECK(top.gaussians.count() == vase.gaussians.count());
  CHECK(top.above_ground == Approx(2 * vase.above_ground).margin(0.02));
  CHECK(top.grip.z() + top.above_ground == Approx(0.68).margin(0.03));  // the middle of its top
  CHECK(std::hypot(top.grip.x(), top.grip.y()) < 0.02);
  CHECK_FALSE(top.hands[0].has_value());
  settings.object_grip = {0, 0.05, 0.1};
  settings.object_turn_deg = 90;
  const SyntheticObject side = synthetic_object(settings);
  CHECK(side.grip.x() == Approx(-0.1).margin(0.02));
  CHECK(side.grip.z() == Approx(0.2).margin(0.02));
  CHECK((side.hands[1]->point - side.grip).norm() < 1e-12);
  write_ply("human.ply", vase.gaussians);
  settings.object_file = "human.ply";
  CHECK_THROWS_MATCHES(
      synthetic_object(settings), UserError,
      Catch::Matchers::Message("human.ply: an object is called by its file's name, and masks of \"human\" are those of "
                               "the person; rename the file"));
}

TEST_CASE("a motion is done at a place that the scene has") {
  using Scene = SyntheticSceneKind;
  using Motion = SyntheticMotionKind;
  CHECK(find_place(Scene::kBedroom, Motion::kSitOn, "")->name == std::string("bed"));
  CHECK(find_place(Scene::kBedroom, Motion::kSitOn, "windowsill")->height > 0.5);
  CHECK(find_place(Scene::kBedroom, Motion::kWave, "") == nullptr);
  CHECK(place_problem(Scene::kBedroom, Motion::kWave, "") == "");
  CHECK(place_problem(Scene::kBedroom, Motion::kWave, "bed") == "the motion wave is done at no place; leave it empty");
  CHECK(place_problem(Scene::kBar, Motion::kLeanOn, "ladder") ==
        "the scene bar has no \"ladder\" for the motion lean_on; there are bedroom/ladder, bar/bar");
  CHECK(place_problem(Scene::kKitchen, Motion::kSlide, "") ==
        "the scene kitchen has nothing for the motion slide; there are playground/slide");
  CHECK(place_names_of(Scene::kLivingRoom) == "sofa, sofa_back, table");
}

}  // namespace scene_test
