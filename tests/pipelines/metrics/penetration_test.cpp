#include "pipelines/metrics/penetration.h"

#include <cmath>

#include <catch2/catch.hpp>

#include "core/random.h"
#include "optim/solid/gaussian_surface.h"
#include "pipelines/synthetic/scene.h"
#include "tests/support/tiny_run.h"

namespace penetration_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Point = Vector3<double>;

/// A room of enough Gaussians, its solids, and the distance that its Gaussians show to a camera and a person.
struct Room {
  SyntheticSettings settings;
  ScenePlan plan;
  TriangleMesh solids;
  std::unique_ptr<MeshDistance> truth;
  std::unique_ptr<GaussianDistance> shown;

  Room() {
    settings.scene_gaussians = 20000;
    solids = synthetic_solids(settings, plan);
    truth = std::make_unique<MeshDistance>(cleaned(solids, "solids"), 0.1);
    const std::vector<Point> free = {{0.4, -1.6, 1.4}, {0, 0.6, 0.9}, {0.1, 0.6, 0.5}, {-0.1, 0.6, 0.1}, {0, 0.6, 1.4}};
    shown = std::make_unique<GaussianDistance>(facing(surface_discs(synthetic_scene(settings, plan)), free), 0.1);
  }
};

const Room& room() {
  static const Room made;
  return made;
}

}  // namespace

TEST_CASE("the solids of a generated scene are closed, the ground lies at 0, and its table is where the plan has it") {
  const Room& made = room();
  CHECK(count_edges(cleaned(made.solids, "solids")).open == 0);
  CHECK(made.truth->at({0.6, 0.4, 0.2}) == Approx(0.2).margin(1e-6));
  CHECK(made.truth->at({0.6, 0.4, -0.2}) == Approx(-0.2).margin(1e-6));
  const Point top = made.plan.support;
  CHECK(made.truth->at(top + Point(0, 0, 0.1)) == Approx(0.1).margin(1e-6));
  CHECK(made.truth->at(top - Point(0, 0, 0.005)) == Approx(-0.005).margin(1e-6));
  CHECK(made.truth->at(top - Point(0, 0, 0.2)) > 0.1);  // free below the top
  SyntheticSettings of_file;
  of_file.scene_file = "scene.ply";
  CHECK(synthetic_solids(of_file, made.plan).faces.empty());
}

TEST_CASE("what a room's Gaussians show is free and solid where the room is") {
  const Room& made = room();
  RandomSequence random(1);
  const Point top = made.plan.support;
  int near_floor = 0, on_table = 0, below_table = 0;
  for (int i = 0; i < 500; ++i) {
    const Point floor(random.uniform(0.3, 1), random.uniform(0, 1), random.uniform(-0.05, 0.1));
    const double d = made.shown->at(floor);
    near_floor += std::fabs(d - floor[2]) < 0.01 ? 1 : 0;  // the rug lies 8 mm high
    const Point over = top + Point(random.uniform(-0.3, 0.3), random.uniform(-0.2, 0.2), random.uniform(0.005, 0.1));
    on_table += std::fabs(made.shown->at(over) - (over[2] - top[2])) < 0.003 ? 1 : 0;
    const Point under =
        top + Point(random.uniform(-0.25, 0.25), random.uniform(-0.1, 0.1), random.uniform(-0.15, -0.06));
    const double below = made.shown->at(under);
    below_table += below > 0 || std::isnan(below) ? 1 : 0;
  }
  CHECK(near_floor > 490);
  CHECK(on_table > 490);
  CHECK(below_table > 450);
}

TEST_CASE("penetration counts the human's Gaussians in the solid, and how deep they are") {
  const Clip clip = read_clip(tiny_config().data);
  REQUIRE(clip.surface != nullptr);
  CHECK(clip.surface_file == "surface.ply");
  SceneState lowered = clip.first;
  lowered.body.transl[2] -= 0.3;
  SceneState buried = clip.first;
  buried.body.transl[2] -= 3;
  const std::vector<Penetration> counts = penetration_by_frame(clip, {clip.first, lowered, buried});
  REQUIRE(counts.size() == 3);
  CHECK(counts[0].points == 500);
  CHECK(counts[0].inside <= 5);
  const MetricValues values = penetration_values(counts[1]);
  CHECK(values[0].first == "penetration_share");
  CHECK(values[0].second > 0.05);
  CHECK(values[0].second < 0.4);
  CHECK(values[1].second > 50);
  CHECK(values[1].second < 300);
  CHECK(penetration_values(counts[2])[0].second == 1);
  // Frame 0 is given, and the others count together.
  CHECK(mean_penetration(counts)[0].second == Approx(0.5 * (values[0].second + 1)));
  CHECK(penetration_values({.points = 7})[1].second == 0);
}

TEST_CASE("points that are followed from frame to frame count as each frame alone does") {
  const Clip clip = read_clip(tiny_config().data);
  std::vector<SceneState> states = {clip.first};
  RandomSequence random(7);
  for (int t = 0; t < 60; ++t) {  // steps of centimetres and of half a metre, also into the ground
    SceneState next = states.back();
    const double step = t % 10 == 9 ? 0.5 : 0.03;
    for (Index i = 0; i < 3; ++i) next.body.transl[i] += random.uniform(-step, step);
    next.body.transl[2] = clip.first.body.transl[2] - 0.3 + 0.35 * std::sin(0.5 * t);
    next.body.set_rotation(0, next.body.rotation_of(0) + Vector3<double>(0, 0.02, 0.05));
    states.push_back(next);
  }
  const SignedDistance distance = [&](const Vector3<double>& place) { return clip.surface->at(place); };
  const std::vector<Penetration> followed = penetration_by_frame(clip, states);
  Index inside = 0;
  for (std::size_t t = 0; t < states.size(); ++t) {
    const Penetration alone = penetration_of(distance, measured_points(clip.avatar, states[t].body));
    CAPTURE(t);
    CHECK(followed[t].points == alone.points);
    CHECK(followed[t].inside == alone.inside);
    CHECK(followed[t].depth == alone.depth);
    inside += alone.inside;
  }
  CHECK(inside > 1000);
}

TEST_CASE("a run with the loss penetration has the body less in the ground, and says so", "[release]") {
  const TemporaryFolder folder;
  const auto depth = [&](const char* name, const std::string& weight, std::vector<std::string> overrides) {
    const std::string mesh = (TinyDataset::folder() / "truth" / "surface.ply").string();
    overrides.push_back(R"(stages.interaction.losses={"fit": {}, "penetration": {"mesh": ")" + mesh +
                        R"(", "weight": )" + weight + "}}");
    overrides.push_back(R"(stages.interaction.optimize={"transl": {"lr": 0.01, "lr_final_share": 0.05}})");
    overrides.emplace_back("stages.interaction.iterations=40");
    execute_tiny(tiny_config(overrides), name);
    const nlohmann::json summary = json_of(std::string(name) + "/summary.json");
    CHECK(summary["surface"] == "surface.ply");
    CHECK_FALSE(summary["metrics"][0].contains("penetration_share"));
    CHECK(summary["baselines"]["start"].contains("penetration_share"));
    CHECK(summary["per_frame"][0].contains("penetration_depth_mm"));
    const nlohmann::json& stage = summary["metrics"][1];  // depth of all points, millimetres
    return stage["penetration_share"].get<double>() * stage["penetration_depth_mm"].get<double>();
  };
  const std::vector<std::string> estimate = {R"(start={"root": "estimate"})"};
  const double without = depth("without", "0", estimate), with = depth("with", "100000", estimate);
  CHECK(without > 0.1);
  CHECK(with < 0.3 * without);
}

}  // namespace penetration_test
