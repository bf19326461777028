// The light on objects in a run: what it finds, and that it goes on from frame to frame.
#include <cmath>

#include <catch2/catch.hpp>

#include "core/npz.h"
#include "splat/files/io_ply.h"
#include "splat/files/splat_file.h"
#include "splat/sh_basis.h"
#include "tests/support/tiny_run.h"

namespace object_light_run_test {

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("a run finds the light on an object, and has the same bits after an interruption", "[run]") {
  const TemporaryFolder here;
  nlohmann::ordered_json content = nlohmann::ordered_json::parse(R"({
    "stages": {"interaction": {"iterations": 30, "optimize": {"object_light": {"lr": 0.02}}}}})");
  content["extends"] = tiny_config_file();
  here.write("lit.json", content.dump());
  RunConfig config = load_run_config("lit.json", {}, descriptions_of(loss_terms()));

  // The object's file is brighter than the video by a factor.
  Gaussians object = read_splats(config.data.objects.front().second.gaussians).gaussians;
  constexpr double kBrighter = 1.25;
  const auto numbers = static_cast<std::size_t>(3 * object.sh_coefficients());
  for (std::size_t i = 0; i < object.sh.size(); ++i) {
    const double middle = i % numbers < 3 ? 0.5 / kShC0 : 0;
    object.sh[i] = static_cast<float>(kBrighter * (object.sh[i] + middle) - middle);
  }
  write_ply("bright.ply", object);
  config.data.objects.front().second.gaussians = (here.path() / "bright.ply").string();

  execute_tiny(config, "run");
  const std::vector<double> light = Npz::read("run/objects.npz").array(kTinyObject + "/light").as<double>();
  REQUIRE(light.size() == 6 * kTinyFrames);
  CHECK(std::all_of(light.begin(), light.begin() + 6, [](double x) { return x == 0; }));  // frame 0 is given
  const std::vector<double> last(light.end() - 6, light.end());
  const double factor = std::exp((last[0] + last[1] + last[2]) / 3);
  CAPTURE(last, factor);
  CHECK(factor == Approx(1 / kBrighter).margin(0.1));

  int count = 0;
  CHECK_THROWS_AS(execute_tiny(config, "stopped", 1, false, [&] { return ++count == 2 * 30 + 20; }), Interrupted);
  execute_tiny(config, "stopped", 2, true);
  CHECK(differences("run", "stopped") == std::vector<std::string>{});
}

TEST_CASE("lights of a second pass survive an interruption, with colours held and what is unseen left out",
          "[run][passes]") {
  const TemporaryFolder here;
  nlohmann::ordered_json content = nlohmann::ordered_json::parse(R"({
    "remove_depth_bias": true,
    "approx": {"hold_colors": true, "seen_within_deg": 10},
    "stages": {
      "interaction": {"optimize": {"object_light": {"lr": 0.02}}, "losses": {"depth": null}},
      "refinement": {
        "over": "sequence", "iterations": 2, "optimize": {"transl": {"lr": 0.0001}}, "losses": {"fit": {}}
      },
      "again": {
        "iterations": 5, "losses": {"photometric": {}},
        "optimize": {"object_transl": {"lr": 0.002}, "object_light": {"lr": 0.01}}
      }
    }})");
  content["extends"] = tiny_config_file();
  here.write("lit.json", content.dump());
  const RunConfig config = load_run_config("lit.json", {}, descriptions_of(loss_terms()));
  execute_tiny(config, "run");
  const std::vector<double> light = Npz::read("run/objects.npz").array(kTinyObject + "/light").as<double>();
  CHECK(std::any_of(light.begin(), light.end(), [](double x) { return x != 0; }));
  constexpr int kFirstPass = (kTinyFrames - 1) * kPerFrame;
  for (const int last : {kFirstPass - 5, kFirstPass + 10 + 2 + 8}) {  // the second in the pass after the refinement
    CAPTURE(last);
    int count = 0;
    const std::string run = "stopped" + std::to_string(last);
    CHECK_THROWS_AS(execute_tiny(config, run, 1, false, [&] { return ++count == last; }), Interrupted);
    execute_tiny(config, run, 2, true);
    CHECK(differences("run", run) == std::vector<std::string>{});
  }
}

TEST_CASE("a run that looks for no light writes none", "[run]") {
  const TemporaryFolder here;
  execute_tiny(tiny_config(), "run");
  CHECK_FALSE(Npz::read("run/objects.npz").has(kTinyObject + "/light"));
}

}  // namespace object_light_run_test
