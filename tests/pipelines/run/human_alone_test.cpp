// A clip of a standing camera in which nothing moves but a human: what is of objects costs nothing.
#include <catch2/catch.hpp>

#include "core/camera_file.h"
#include "core/log.h"
#include "tests/support/tiny_run.h"

namespace human_alone_test {

using namespace hsi4d;
using namespace hsi4d::test;
namespace fs = std::filesystem;

namespace {

/// A waving human, without an object or with one in the other hand, and stages with groups and losses of objects.
void write_waving(SyntheticObjectKind object, const fs::path& folder) {
  SyntheticSettings settings = TinyDataset::settings();
  settings.motion = SyntheticMotionKind::kWave;
  settings.object = object;
  settings.camera_drift = 0;
  ConfigProblems problems;
  const ConfigValue stages = load_config_text(kTinyStages, "tiny.json", folder, {}, problems);
  problems.throw_if_any();
  write_dataset(settings, video_render_settings(), folder, {}, stages);
}

RunSummary run(const fs::path& config, const std::string& out, const std::vector<std::string>& overrides = {}) {
  return execute_tiny(load_run_config(config, overrides, descriptions_of(loss_terms())), out);
}

/// The sum of a counter over the iterations of the stage that draws everything.
double counted(const std::string& run, const char* counter) {
  double sum = 0;
  for (const nlohmann::json& line : metrics_of(run)) {
    if (line["stage"] == "interaction") sum += line.at(counter).get<double>();
  }
  return sum;
}

constexpr std::array kCounters = {"tiles",         "pairs",         "groups",         "fragments",      "layers",
                                  "adjoint_tiles", "forward_nodes", "backward_nodes", "adjoint_numbers"};

}  // namespace

TEST_CASE("groups and losses of objects cost a clip of a human alone nothing", "[run]") {
  const TemporaryFolder here;
  write_waving(SyntheticObjectKind::kNone, "alone");
  write_changed("alone/config.json", "alone/without.json", [](nlohmann::ordered_json& config) {
    nlohmann::ordered_json& stage = config["stages"]["interaction"];
    for (const char* group : {"object_orient", "object_transl"}) stage["optimize"].erase(group);
    for (const char* loss : {"center", "depth"}) stage["losses"].erase(loss);
  });
  std::vector<std::string> warnings;
  {
    const LogSink sink =
        log_to([&](LogLevel, std::string_view text) { warnings.emplace_back(text); }, LogLevel::kWarning);
    run("alone/config.json", "named");
  }
  CHECK(warnings.empty());
  run("alone/without.json", "without");
  CHECK(differences("named", "without") == std::vector<std::string>{"config.resolved.json"});  // counters too
  for (const nlohmann::json& line : metrics_of("named")) CHECK(line["losses"].size() == 1);
  CHECK_FALSE(fs::exists("named/objects.npz"));
}

TEST_CASE("a clip of a human alone counts less of everything than one with an object", "[run]") {
  const TemporaryFolder here;
  write_waving(SyntheticObjectKind::kNone, "alone");
  write_waving(SyntheticObjectKind::kWateringCan, "with_can");
  run("alone/config.json", "run_alone");
  run("with_can/config.json", "run_with_can");
  for (const char* counter : kCounters) {
    const double alone = counted("run_alone", counter), with_can = counted("run_with_can", counter);
    INFO(counter << ": " << alone << " alone, " << with_can << " with the can");
    CHECK(alone > 0);
    CHECK(alone < with_can);
  }
}

TEST_CASE("a camera that stands is left standing", "[run]") {
  const TemporaryFolder here;
  write_waving(SyntheticObjectKind::kNone, "alone");
  const std::vector<Camera> truth = read_cameras("alone/truth/cameras.json");
  REQUIRE(truth.size() == kTinyFrames);
  for (const Camera& camera : truth)
    CHECK(camera.camera_from_world.translation == truth[0].camera_from_world.translation);
  const RunSummary summary = run("alone/config.json", "run");
  CHECK(summary.metrics.front().stage == "camera");
  const double cm = number_in(summary.metrics.front().values, "camera_translation_cm"),
               deg = number_in(summary.metrics.front().values, "camera_rotation_deg");
  INFO("off by " << cm << " cm and " << deg << " degrees");
  CHECK(cm < 1);
  CHECK(deg < 0.3);
  CHECK(number_in(summary.metrics.back().values, "camera_translation_cm") == cm);  // no later stage moves it
}

}  // namespace human_alone_test
