#include "pipelines/config/run_config.h"

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/config_file.h"
#include "core/file.h"
#include "optim/loss_term.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_losses.h"

namespace run_config_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr const char* kRun = R"({
  "seed": 7,
  "threads": 2,
  "render": {"quality": "accurate", "blur": 0.1},
  "stages": {
    "camera": {"iterations": 30, "optimize": {"camera": {"lr": 1e-3}}, "losses": {"centre": {}}},
    "interaction": {
      "iterations": 300,
      "optimize": {"root": {"lr": 0.01, "lr_final_share": 0.1}, "body": {"lr": 0.01, "from": 30, "until": 250, "every": 5}},
      "losses": {"photo": {"weight": 0.5, "masked": true}, "centre": {"weight": 1e-3}},
      "optimizer": {"kind": "adam", "beta1": 0.8, "max_rollbacks": 3}
    }
  }
})";

}  // namespace

TEST_CASE("a run config is read into its structs") {
  const TemporaryFolder folder;
  const RunConfig run =
      load_run_config(folder.write("run.json", kRun), {"stages.camera.iterations=100"}, test_losses());
  CHECK(run.seed == 7);
  CHECK(run.threads == 2);
  CHECK(run.render.alpha_cap == 1);
  CHECK(run.render.blur == 0.1);
  REQUIRE(run.stages.size() == 2);
  CHECK(run.stages[0].first == "camera");
  CHECK(run.stages[0].second.iterations == 100);
  const StageSettings& stage = *find_entry(run.stages, "interaction");
  CHECK(stage.optimizer.beta1 == 0.8);
  CHECK(stage.optimizer.beta2 == 0.999);
  CHECK(stage.optimizer.max_rollbacks == 3);
  const ParameterGroupSettings& body = *find_entry(stage.optimize, "body");
  CHECK(body.from == 30);
  CHECK(body.until == 250);
  CHECK(body.every == 5);
  CHECK(body.lr_final_share == 1);
  CHECK(find_entry(stage.optimize, "root")->lr_final_share == 0.1);
  CHECK_FALSE(find_entry(stage.optimize, "root")->until.has_value());
  const LossSettings& photo = *find_entry(stage.losses, "photo");
  CHECK(photo.weight == 0.5);
  CHECK(photo.own_as<PhotoSettings>().masked);
  CHECK(photo.own_as<PhotoSettings>().ssim_share == 0.1);
}

TEST_CASE("files that stages name are inputs of the run, by their pointers") {
  const TemporaryFolder folder;
  folder.write("w.npz", "weights");
  const auto files_of = [&](const std::string& weights) {
    const std::string text = R"({"body": {"kind": "smplx", "path": "w.npz"}, "stages": {"refine": {"iterations": 1,
      "optimize": {}, "losses": {"pose_prior": {"weights": ")" +
                             weights + R"("}}}}})";
    const std::vector<LossDescription> losses = descriptions_of(loss_terms());
    return stage_files(load_run_config(folder.write("run.json", text), {}, losses), losses);
  };
  CHECK(files_of("").empty());
  CHECK(files_of(".").empty());  // a folder
  const std::vector<ConfigPath> files = files_of("w.npz");
  REQUIRE(files.size() == 1);
  CHECK(files[0].pointer == "/stages/refine/losses/pose_prior/weights");
  CHECK(read_text_file(files[0].path.string()) == "weights");
}

TEST_CASE("the resolved config holds every default and reads back to the same bytes") {
  const TemporaryFolder folder;
  const RunConfig run = load_run_config(folder.write("run.json", kRun), {}, test_losses());
  const std::string once = resolved_config(run, test_losses());
  for (const char* expected :
       {"\"eps\": 1e-08", "\"ssim_share\": 0.1", "\"until\": null", "\"tile\": 16", "\"beta1\": 0.8"})
    CHECK_THAT(once, Catch::Matchers::Contains(expected));
  const RunConfig again = load_run_config(folder.write("resolved.json", once), {}, test_losses());
  CHECK(resolved_config(again, test_losses()) == once);
}

TEST_CASE("an empty config is a config") {
  const TemporaryFolder folder;
  const RunConfig run = load_run_config(folder.write("run.json", "{}"), {}, {});
  CHECK(resolved_config(run, {}) == resolved_config(RunConfig{}, {}));
}

TEST_CASE("overrides alone make a config") {
  ConfigProblems problems;
  const ConfigValue tree = config_from_overrides({"render.blur=0.5", "seed=3"}, problems);
  const RunConfig run = read_run_config(tree, {}, problems);
  CHECK(run.render.blur == 0.5);
  CHECK(run.seed == 3);
}

TEST_CASE("settings are listed with those of every loss") {
  std::string pointers;
  for (const ConfigSetting& setting : run_config_settings(test_losses())) {
    pointers += setting.pointer + "\n";
    CHECK_FALSE(setting.summary.empty());
  }
  for (const char* expected :
       {"/render/alpha_min\n", "/stages/NAME/optimize/NAME/lr\n", "/stages/NAME/losses/photo/ssim_share\n"})
    CHECK_THAT(pointers, Catch::Matchers::Contains(expected));
}

}  // namespace run_config_test
