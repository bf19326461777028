// The sections `skip` and `approx` of a config: what they change of a run's result, and what is told of them.
#include "bench/skips.h"

#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "body/motion_io.h"
#include "core/camera_file.h"
#include "core/check.h"
#include "core/image_io.h"
#include "pipelines/cli/check_command.h"
#include "pipelines/cli/run_command.h"
#include "pipelines/config/run_notes.h"
#include "pipelines/input/state.h"
#include "tests/support/tiny_run.h"

namespace skips_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

const std::vector<std::string> kAllOff = {"skip.static_tiles=false",   "skip.static_layer=false",
                                          "skip.zero_cotangent=false", "skip.unchanged_pixels=false",
                                          "skip.frozen_inputs=false",  "skip.unchanged_inputs=false",
                                          "skip.unread_pixels=false",  "skip.unseen_gaussians=false"};
// Those that leave the bits: layers are off, and sums are over all Gaussians.
const std::vector<std::string> kAllButLayers = {"skip.static_layer=false", "skip.unseen_gaussians=false"};
const std::vector<std::string> kTilesOnly = {"skip.static_layer=false", "skip.unseen_gaussians=false",
                                             "skip.zero_cotangent=false"};
const std::vector<std::string> kAllPixels = {"skip.static_layer=false", "skip.unseen_gaussians=false",
                                             "skip.unchanged_pixels=false"};

/// A run of the tiny clip in a folder; its result as bytes.
struct SkipRun {
  std::string folder, motion, objects;
  /// @param change  of what --set cannot say
  SkipRun(
      const std::string& name, const std::vector<std::string>& overrides,
      void (*change)(RunConfig&) = [](RunConfig&) {})
      : folder(name) {
    RunConfig config = tiny_config(overrides);
    change(config);
    execute_tiny(config, folder);
    motion = file_text(folder + "/motion.npz");
    objects = file_text(folder + "/objects.npz");
  }
  /// The sum of a counter over all lines of metrics.jsonl of a stage, that which draws what moves.
  double counted(const char* counter, const std::string& stage = "interaction") const {
    double sum = 0;
    for (const nlohmann::json& line : metrics_of(folder)) {
      if (line["stage"] == stage) sum += line.at(counter).get<double>();
    }
    return sum;
  }
};

/// Differences of two runs' results, ascending: places in metres and angles in radians.
std::vector<double> differences(const SkipRun& a, const SkipRun& b) {
  std::vector<double> all;
  const auto compare = [&all](const double* x, const double* y, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) all.push_back(std::abs(x[i] - y[i]));
  };
  const Motion m = read_motion(a.folder + "/motion.npz"), n = read_motion(b.folder + "/motion.npz");
  REQUIRE(m.poses.size() == n.poses.size());
  for (std::size_t t = 0; t < m.poses.size(); ++t) {
    compare(m.poses[t].transl.data(), n.poses[t].transl.data(), 3);
    compare(m.poses[t].axis_angle.data(), n.poses[t].axis_angle.data(), m.poses[t].axis_angle.size());
  }
  const auto tracks = read_object_tracks(a.folder + "/objects.npz", {kTinyObject});
  const auto others = read_object_tracks(b.folder + "/objects.npz", {kTinyObject});
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    compare(tracks[t][0].translation.data(), others[t][0].translation.data(), 3);
    compare(tracks[t][0].rotation.data(), others[t][0].rotation.data(), 3);
  }
  std::sort(all.begin(), all.end());
  return all;
}

std::vector<std::string> notes_of(const std::vector<std::string>& overrides) {
  std::vector<std::string> texts;
  for (const RunNote& note : run_notes(tiny_config(overrides)))
    texts.push_back(std::string(log_level_name(note.level)) + ": " + note.text);
  return texts;
}

}  // namespace

TEST_CASE("skips that are set in a config leave the result's bits, or nearly, and save what their counters say",
          "[run]") {
  const TemporaryFolder here;
  const SkipRun off("off", kAllOff), tiles("tiles", kTilesOnly), cotangent("cotangent", kAllButLayers), on("on", {}),
      pixels("pixels", kAllPixels);
  CHECK(tiles.motion == off.motion);
  CHECK(tiles.objects == off.objects);
  CHECK(cotangent.motion == off.motion);
  CHECK(cotangent.objects == off.objects);
  CHECK(pixels.motion == off.motion);
  CHECK(pixels.objects == off.objects);
  CHECK(pixels.counted("dirty_tiles") == 0);
  CHECK(cotangent.counted("dirty_tiles") > 0);
  CHECK(cotangent.counted("dirty_tiles") < off.counted("tiles"));
  // An image that is 1e-7 off turns the sign of an L1 difference here and there, and Adam's first steps are as long as
  // the rate however small the gradient: an angle that few pixels tell may part a little more.
  const std::vector<double> near = differences(on, off);
  INFO("with static layers " << near.back() << " m or rad off at most");
  CHECK(near[near.size() * 99 / 100] <= 1e-5);  // 3e-6
  CHECK(near.back() <= 1e-4);                   // 1.1e-5

  CHECK(tiles.counted("tiles") < off.counted("tiles"));
  CHECK(tiles.counted("fragments") < off.counted("fragments"));
  CHECK(cotangent.counted("adjoint_tiles") <= tiles.counted("adjoint_tiles"));
  CHECK(on.counted("groups") < tiles.counted("groups"));
  for (const SkipRun* run : {&off, &tiles, &cotangent}) CHECK(run->counted("layers") == 0);
  CHECK(on.counted("layers") > 0);
  CHECK(on.counted("layers") < on.counted("tiles"));  // they are kept from one iteration to the next
}

TEST_CASE("the backward pass leaves tiles out in which the loss sees nothing", "[run]") {
  const TemporaryFolder here;
  const auto run_with = [](const std::string& name, const std::string& skipped) {
    return SkipRun(name, {"skip.zero_cotangent=" + skipped, "skip.unread_pixels=false", "render.tile=8",
                          "stages.camera.weight=foreground"});
  };
  const SkipRun on = run_with("on", "true"), off = run_with("off", "false");
  CHECK(on.motion == off.motion);
  CHECK(on.objects == off.objects);
  CHECK(on.counted("adjoint_tiles", "camera") < off.counted("adjoint_tiles", "camera"));
}

TEST_CASE("Gaussians that the camera cannot see are left out, and the result is the same but for rounding", "[run]") {
  const TemporaryFolder here;
  const SkipRun on("on", {}), off("off", {"skip.unseen_gaussians=false"});
  const double near = differences(on, off).back();
  INFO("without those that cannot be seen " << near << " m or rad off");
  CHECK(near <= 1e-5);
  CHECK(on.counted("gaussians") < off.counted("gaussians"));
  CHECK(on.counted("pairs") == off.counted("pairs"));
}

TEST_CASE("skips of the tape that are set in a config leave the result's bits and save what their counters say",
          "[run]") {
  const TemporaryFolder here;
  // Static layers are off: without these skips there are none, and they leave nearly the same bits.
  // Masks grow until they cover whole squares of pixels.
  const auto run_with = [](const std::string& name, const std::string& setting) {
    return SkipRun(name, {"skip.static_layer=false", "data.mask_margin_px=8", "stages.camera.iterations=4",
                          "stages.interaction.iterations=5", setting});
  };
  const SkipRun on = run_with("on", "threads=1");
  const auto without = [&](const std::string& skip) { return run_with(skip, "skip." + skip + "=false"); };
  const SkipRun frozen = without("frozen_inputs"), unchanged = without("unchanged_inputs"),
                unread = without("unread_pixels");
  for (const SkipRun* run : {&frozen, &unchanged, &unread}) {
    INFO(run->folder);
    CHECK(run->motion == on.motion);
    CHECK(run->objects == on.objects);
    CHECK(file_text(run->folder + "/cameras.json") == file_text("on/cameras.json"));
  }
  for (const char* stage : {"camera", "interaction"}) {
    INFO(stage);
    CHECK(on.counted("adjoint_numbers", stage) < frozen.counted("adjoint_numbers", stage));
    CHECK(on.counted("backward_nodes", stage) < frozen.counted("backward_nodes", stage));
    CHECK(on.counted("forward_nodes", stage) < unchanged.counted("forward_nodes", stage));
  }
  CHECK(on.counted("tiles") < frozen.counted("tiles"));
  CHECK(on.counted("tiles") < unchanged.counted("tiles"));
  CHECK(on.counted("tiles", "camera") < unread.counted("tiles", "camera"));
  CHECK(on.counted("fragments", "camera") < unread.counted("fragments", "camera"));
  CHECK(on.counted("tiles") == unread.counted("tiles"));  // photometric reads every pixel
}

TEST_CASE("a config without skips has every one of the section off and few iterations") {
  const RunConfig config = without_skips(tiny_config({"stages.interaction.optimize.transl.from=7"}), 3);
  const nlohmann::json resolved = nlohmann::json::parse(resolved_config(config, descriptions_of(loss_terms())));
  CHECK(resolved["skip"].size() == kAllOff.size());
  for (const auto& [name, value] : resolved["skip"].items()) {
    INFO(name);
    CHECK(value == false);
  }
  for (const auto& [name, stage] : config.stages) CHECK(stage.iterations == 3);
  CHECK(find_entry(config.stages[1].second.optimize, "transl")->from == 2);
}

TEST_CASE("colours that are held cost fewer operators and change the result a little", "[run]") {
  const TemporaryFolder here;
  const auto move_net = [](RunConfig& config) {
    ParameterGroupSettings net;
    net.lr = 1e-3;
    net.every = 4;
    config.stages.back().second.optimize.emplace_back("color_net", net);
  };
  const auto run_with = [&](const std::string& name, const std::string& held) {
    return SkipRun(name, {"color_net.use=on", "approx.hold_colors=" + held}, move_net);
  };
  const SkipRun on = run_with("on", "true"), off = run_with("off", "false");
  const double near = differences(on, off).back();
  INFO("with held colours " << near << " m or rad off");
  CHECK(near > 0);
  CHECK(near <= 0.05);
  for (const char* stage : {"camera", "interaction"}) {
    INFO(stage);
    CHECK(on.counted("forward_nodes", stage) < off.counted("forward_nodes", stage));
    CHECK(on.counted("backward_nodes", stage) < off.counted("backward_nodes", stage));
  }
  CHECK_THAT(file_text("on/log.txt"), Contains(" info approx.hold_colors is on: "));
}

TEST_CASE("what human and objects hide of themselves is left out and the result is near", "[run]") {
  const TemporaryFolder here;
  const auto without_depth = [](RunConfig& config) {
    std::erase_if(config.stages.back().second.losses, [](const auto& loss) { return loss.first == "depth"; });
  };
  const SkipRun part("part", {"approx.seen_within_deg=10"}, without_depth), all("all", {}, without_depth);
  CHECK(part.counted("pairs") < all.counted("pairs"));
  CHECK(part.counted("pairs", "camera") == all.counted("pairs", "camera"));
  const double near = differences(part, all).back();
  INFO("without what is hidden " << near << " m or rad off");
  CHECK(near > 0);
  CHECK(near <= 0.05);
  CHECK_THAT(file_text("part/log.txt"), Contains(" info approx.seen_within_deg is on: "));
  // A stage that needs the mean depth of the objects' Gaussians draws all of them.
  const SkipRun depth("depth", {"approx.seen_within_deg=10"});
  CHECK(depth.counted("pairs") > part.counted("pairs"));
}

TEST_CASE("a stage that turns something further than approximations allow for is told with its frames", "[run]") {
  const TemporaryFolder here;
  const SkipRun narrow("narrow", {"approx.seen_within_deg=0.001", "approx.hold_colors=true"});
  const SkipRun wide("wide", {"approx.seen_within_deg=45"});
  const std::string warning =
      " warning stage interaction: the view of a part turned by more than 0.001 degrees, so that Gaussians left out by "
      "approx.seen_within_deg may be seen, in frames 1-3\n";
  CHECK_THAT(file_text("narrow/log.txt"),
             Contains(warning) && Contains("colours held by approx.hold_colors are out of date, in frame"));
  CHECK_THAT(file_text("wide/log.txt"), !Contains("the view of a part turned"));
}

TEST_CASE("a run whose images are reduced writes smaller ones and finds nearly the same", "[run]") {
  const TemporaryFolder here;
  const std::string half = std::to_string(kTinyPixels / 2);
  const SkipRun small("small", {"approx.longest_side_px=" + half}), all("all", {});
  CHECK(read_image("small/frames/0002_render.png").width() == kTinyPixels / 2);
  CHECK(read_cameras("small/cameras.json").at(1).width == kTinyPixels / 2);
  CHECK(small.counted("fragments") < all.counted("fragments"));
  CHECK(differences(small, all).back() < 0.3);
}

TEST_CASE("what settings of skip and approx do to each other is told", "[run]") {
  using Notes = std::vector<std::string>;
  const std::string off_too = "info: skip.static_tiles=false switches skip.static_layer off too";
  CHECK(notes_of({}).empty());
  CHECK(notes_of({"skip.zero_cotangent=false"}).empty());
  CHECK(notes_of({"skip.static_layer=false"}).empty());
  CHECK(notes_of({"skip.static_tiles=false"}) == Notes{off_too});
  const std::string both_off =
      "info: skip.frozen_inputs=false switches skip.static_tiles and skip.static_layer off too";
  CHECK(notes_of({"skip.frozen_inputs=false"}) == Notes{both_off});
  CHECK(notes_of({"skip.unchanged_inputs=false"}) ==
        Notes{"info: skip.unchanged_inputs=false has made anew in every iteration what skip.static_tiles keeps"});
  CHECK(notes_of({"skip.unread_pixels=false"}).empty());
  CHECK(notes_of(kAllOff).empty());
}

TEST_CASE("check, a dry run and a run's log have what is to be known of skip and approx", "[run]") {
  const TemporaryFolder here;
  const std::vector<std::string> overrides = {"stages.camera.optimizer.keep_curvature=true",
                                              "stages.camera.optimizer.kind=adam"};
  const std::string text = "stages.camera.optimizer: keep_curvature does nothing with kind adam\n";
  const auto check = [](const std::vector<std::string>& set) {
    return cli::check_command(tiny_config_file(), set, false, descriptions_of(loss_terms()));
  };
  CHECK_THAT(check(overrides), Contains("  note: " + text));
  CHECK_THAT(check({}), !Contains("note:"));
  cli::RunArguments arguments;
  arguments.config = tiny_config_file();
  arguments.overrides = overrides;
  arguments.out = "run";
  arguments.dry_run = true;
  CHECK_THAT(cli::run_command(arguments, loss_terms()), Contains("  note: " + text));
  execute_tiny(tiny_config(overrides), "run");
  CHECK_THAT(file_text("run/log.txt"), Contains(" warning " + text));
}

TEST_CASE("settings of an optimiser that the stage does not have are told, and leave the kind free to be changed") {
  const auto told = [](const std::string& optimizer, std::vector<std::string> more = {}) {
    more.insert(more.begin(),
                {"stages.camera.optimize.camera.lr_final_share=1", "stages.camera.optimizer=" + optimizer});
    return notes_of(more);
  };
  using Notes = std::vector<std::string>;
  const std::string bfgs = R"({"kind": "bfgs", "keep_curvature": true})";
  CHECK(told(bfgs).empty());
  CHECK(told(bfgs, {"stages.camera.optimizer.kind=adam"}) ==
        Notes{"warning: stages.camera.optimizer: keep_curvature does nothing with kind adam"});
  CHECK(told(R"({"kind": "bfgs", "beta1": 0.8, "eps": 1e-9})") ==
        Notes{"warning: stages.camera.optimizer: beta1, eps do nothing with kind bfgs"});
  CHECK(told(R"({"beta1": 0.8, "eps": 1e-9})").empty());
}

}  // namespace skips_test
