#include "bench/pareto_tracking.h"

#include <sstream>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/check.h"
#include "tests/support/temporary_folder.h"

namespace pareto_tracking_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

/// The shipped config with little of everything.
RunConfig small_config() {
  return load_run_config(std::string(HSI4D_SOURCE_DIR) + "/configs/bench/pareto_tracking.json",
                         {"synthetic.size_px=48", "synthetic.scene_gaussians=1000", "synthetic.avatar_gaussians=300",
                          "synthetic.object_gaussians=100", "synthetic.frames=2", "stages.camera.iterations=2",
                          "stages.interaction.iterations=6"},
                         descriptions_of(loss_terms()), ConfigUse::kStages);
}

}  // namespace

TEST_CASE("a clip is reconstructed with as many steps and in as much time", "[run][release]") {
  const TemporaryFolder here;
  Tracking tracking{small_config(), {pareto_settings().front()}, 2, here.path() / "made"};
  for (const ParetoSetting& setting : pareto_settings())
    if (setting.name() == "quality accurate") tracking.settings.push_back(setting);
  Index told = 0;
  const std::vector<TrackedPoint> points = measure_tracking(tracking, loss_terms(), [&told] { ++told; });
  CHECK(told == tracking_run_count(tracking));
  CHECK(told == 8);
  CHECK_FALSE(std::filesystem::exists(tracking.folder));
  REQUIRE(points.size() == 4);
  CHECK((!points[0].is_fixed_time && points[1].is_fixed_time));
  CHECK(points[0].iterations == 8);
  CHECK(points[1].iterations == 8);
  CHECK(points[2].iterations == 8);
  CHECK(points[0].cost_ratio == 1);
  CHECK(points[2].cost_ratio > 0);
  for (const TrackedPoint& point : points) {
    CHECK(point.world_mm.mean > 0);
    CHECK(point.world_mm.deviation > 0);
    CHECK(point.camera_cm.mean > 0);
  }
  CHECK(points[0].world_mm.mean == points[1].world_mm.mean);  // the default in its own time

  std::istringstream lines(tracking_json(points));
  int objects = 0;
  for (std::string line; std::getline(lines, line); ++objects)
    CHECK(nlohmann::json::parse(line)["world_mpjpe_mm"]["mean"] > 0);
  CHECK(objects == 4);
  CHECK_THAT(tracking_table(points), Contains("as many steps\n") && Contains("quality accurate"));
}

TEST_CASE("a folder that is there is not overwritten by reconstructions") {
  const TemporaryFolder here;
  const Tracking tracking{small_config(), {pareto_settings().front()}, 1, here.path()};
  CHECK_THROWS_WITH(
      measure_tracking(tracking, loss_terms()),
      here.path().string() + ": is there; hsi4d bench pareto makes this folder and removes it again (--out)");
  CHECK(std::filesystem::exists(here.path()));
}

}  // namespace pareto_tracking_test
