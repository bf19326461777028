#include "bench/scaling.h"

#include <cmath>
#include <sstream>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/check.h"
#include "tests/bench/rows.h"

namespace scaling_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

const std::string kConfig = std::string(HSI4D_SOURCE_DIR) + "/configs/bench/paper_scale.json";

/// The shipped benchmark with little of everything.
RunConfig small_config(std::vector<std::string> more) {
  std::vector<std::string> overrides = {"synthetic.size_px=48", "synthetic.scene_gaussians=2000",
                                        "synthetic.avatar_gaussians=300", "synthetic.object_gaussians=100"};
  overrides.insert(overrides.end(), more.begin(), more.end());
  return load_run_config(kConfig, overrides, descriptions_of(loss_terms()), ConfigUse::kStages);
}

/// A point whose camera stage takes `ms`.
ScalingPoint made_up(Index value, double ms, Index pairs, Index fragments) {
  ScalingPoint point;
  point.value = value;
  ScalingCost cost;
  cost.stage = "camera";
  cost.moves_camera = true;
  cost.ms = 2 * ms;
  cost.min_ms = ms;
  cost.processor_ms = std::sqrt(ms);
  cost.pairs = pairs;
  cost.fragments = fragments;
  point.stages.push_back(cost);
  return point;
}

}  // namespace

TEST_CASE("a power law is found again, and what was expected stands beside it") {
  const ScalingAxis axis = chosen_axes({"scene"}).front();
  std::vector<ScalingPoint> points;
  for (const Index n : {100, 400, 1600}) points.push_back(made_up(n, 3 * std::pow(n, 0.5), 7 * n, n == 400 ? 0 : n));
  const std::vector<ScalingFit> fits = scaling_fits(axis, points);
  REQUIRE(fits.size() == 4);
  CHECK(fits[0].quantity == "least ms");
  CHECK(fits[0].fitted.value() == Approx(0.5));
  CHECK(fits[0].scale == Approx(3));
  CHECK(fits[0].expected.value() == 0.7);
  CHECK_FALSE(fits[0].reason.empty());
  CHECK(fits[1].quantity == "processor ms");
  CHECK(fits[1].fitted.value() == Approx(0.25));
  CHECK(fits[2].quantity == "pairs");
  CHECK(fits[2].fitted.value() == Approx(1));
  CHECK(fits[3].quantity == "fragments");
  CHECK_FALSE(fits[3].fitted);  // a zero has no logarithm

  points.resize(1);
  CHECK_FALSE(scaling_fits(axis, points)[0].fitted);
  points.front().stages.front().draws_all = true;  // and the camera moves: nothing was expected of that
  CHECK_FALSE(scaling_fits(axis, points)[0].expected);
}

TEST_CASE("axes of scaling are named with values or without") {
  CHECK(chosen_axes({}).size() == 4);
  const std::vector<ScalingAxis> axes = chosen_axes({"image=512,64,512", "threads"});
  REQUIRE(axes.size() == 2);
  CHECK(axes[0].setting == "synthetic.size_px");
  CHECK(axes[0].values == std::vector<Index>{64, 512});
  CHECK(axes[1].values == std::vector<Index>{1, 2});
  CHECK_THROWS_WITH(chosen_axes({"scenes"}),
                    "hsi4d bench scaling: --axis scenes: there is no axis \"scenes\"; known: scene, avatar, image, "
                    "threads; did you mean \"scene\"?");
  CHECK_THROWS_WITH(
      chosen_axes({"scene=1000,"}),
      "hsi4d bench scaling: --axis scene=1000,: \"\" is no number of 1 or more; write whole numbers apart "
      "by commas: scene=100000,500000");
  CHECK_THROWS_WITH(chosen_axes({"image=0"}),
                    "hsi4d bench scaling: --axis image=0: \"0\" is no number of 1 or more; write whole numbers apart "
                    "by commas: scene=100000,500000");
  CHECK_THROWS_WITH(chosen_axes({"image", "image=64"}),
                    "hsi4d bench scaling: --axis image=64: the axis was named before");
}

TEST_CASE("scaling runs the stages that draw a frame and counts what they do") {
  int told = 0;
  std::vector<ScalingPoint> points = measure_scaling({small_config({"synthetic.scene_gaussians=1000", "threads=1"}),
                                                      small_config({"synthetic.scene_gaussians=3000", "threads=2"})},
                                                     loss_terms(), 3, [&told] { ++told; });
  CHECK(told == 2 * kScalingRounds);
  REQUIRE(points.size() == 2);
  points[0].value = 1000;
  points[1].value = 3000;
  const ScalingPoint &few = points[0], &many = points[1];
  CHECK(few.threads == 1);
  CHECK(many.threads == 2);
  CHECK(few.scene_gaussians <= 1000);
  CHECK(few.scene_gaussians > 700);
  CHECK(many.scene_gaussians > 2000);
  CHECK(few.avatar_gaussians == 300);
  CHECK(few.peak_memory_bytes > 0);
  for (const ScalingPoint* point : {&few, &many}) {
    REQUIRE(point->stages.size() == 2);  // the one over the sequence draws nothing
    const ScalingCost &camera = point->stages[0], &interaction = point->stages[1];
    CHECK((camera.stage == "camera" && camera.moves_camera && !camera.draws_all));
    CHECK((interaction.stage == "interaction" && !interaction.moves_camera && interaction.draws_all));
    CHECK(camera.tiles == 9);
    for (const ScalingCost& cost : point->stages) {
      CHECK(cost.fragments > cost.pairs);
      CHECK(cost.min_ms > 0);
      CHECK(cost.ms >= cost.min_ms);
      CHECK(cost.processor_ms > 0);
      CHECK(cost.first_ms > 0);
      CHECK(cost.prepare_ms + cost.forward_ms + cost.backward_ms > 0);
      CHECK(cost.prepare_ms + cost.forward_ms + cost.backward_ms <= 1.5 * cost.ms);  // medians do not add up
    }
  }
  CHECK(many.stages[0].pairs > few.stages[0].pairs);

  const std::vector<ScalingResult> results = {{chosen_axes({"scene=1000,3000"}).front(), {few, many}},
                                              {chosen_axes({"threads=1"}).front(), {few}}};
  const std::string table = scaling_table(results);
  CHECK_THAT(table, Contains("scene: Gaussians of the scene, human 300, objects "));
  CHECK_THAT(table, Contains("interaction  processor ms") && Contains("expected  fitted"));
  std::istringstream lines(scaling_json(results));
  int costs = 0, fitted = 0;
  for (std::string line; std::getline(lines, line);) {
    const nlohmann::json object = nlohmann::json::parse(line);
    costs += object.contains("median_ms") ? 1 : 0;
    fitted += object.contains("fitted") ? 1 : 0;
    if (!object.contains("median_ms")) continue;
    const double parts = object["prepare_ms"].get<double>() + object["forward_ms"].get<double>() +
                         object["backward_ms"].get<double>() + object["other_ms"].get<double>();
    CHECK(object["name"] == "scaling/" + object["axis"].get<std::string>() + " " + object["value"].dump() + "/" +
                                object["stage"].get<std::string>());
    check_bench_row(object);
    CHECK(object.contains("mfragments_per_s"));
    CHECK(object["repeats"] == kScalingRounds);
    CHECK(object["pixels"] == 48 * 48);
    CHECK(object["gaussians"].get<Index>() == few.object_gaussians + 300 + object["scene_gaussians"].get<Index>());
    CHECK(parts == Approx(object["median_ms"].get<double>()));
  }
  CHECK(costs == 2 * 2 + 2);
  CHECK(fitted == 8);  // of one value nothing follows
  const std::string svg = scaling_svg(results, "small & quick");
  CHECK_THAT(svg, Contains("<svg xmlns=") && Contains("small &amp; quick") && Contains("scene, processor ms") &&
                      Contains("threads, least ms") && Contains("expected 0.70"));
  std::size_t dots = 0;
  for (std::size_t at = svg.find("<circle cx"); at != std::string::npos; at = svg.find("<circle cx", at + 1)) ++dots;
  CHECK(dots == (2 * 2 + 2) + 2 * 2);  // measured, and in the legends
}

TEST_CASE("scaling needs a stage that draws a frame") {
  RunConfig config = small_config({});
  std::erase_if(config.stages, [](const auto& entry) { return entry.second.over != StageScope::kSequence; });
  CHECK_THROWS_WITH(measure_scaling({config}, loss_terms(), 1),
                    "hsi4d bench scaling: the config has no stage that draws a frame");
}

}  // namespace scaling_test
