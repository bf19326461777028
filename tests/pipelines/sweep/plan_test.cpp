#include "pipelines/sweep/plan.h"

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/check.h"
#include "core/json_text.h"
#include "core/log.h"
#include "tests/support/tiny_sweep.h"

namespace plan_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

namespace {

SweepPlan plan_of(const Json& more) { return plan_sweep(write_sweep(more), descriptions_of(loss_terms())); }

std::vector<std::string> labels_of(const SweepPlan& plan) {
  std::vector<std::string> labels;
  for (const SweepRun& run : plan.runs) labels.push_back(sweep_label(run));
  return labels;
}

/// What is said of a sweep's file that cannot be planned.
std::string refused(const Json& more) {
  try {
    plan_of(more);
  } catch (const UserError& error) {
    return error.what();
  }
  return "";
}

/// The value at a place of a run's config.
Json at(const SweepRun& run, const std::string& pointer) {
  return Json::parse(run.config).at(Json::json_pointer(pointer));
}

const std::vector<std::string> kNone;

}  // namespace

TEST_CASE("a sweep without axes is its base") {
  const TemporaryFolder here;
  write_tiny_base();
  const SweepPlan plan = plan_of(Json::object());
  REQUIRE(plan.runs.size() == 1);
  CHECK(plan.name == "tiny");
  CHECK(sweep_label(plan.runs[0]) == "the only run");
  CHECK(plan.compare.empty());
  CHECK(at(plan.runs[0], "/stages/camera/iterations") == 8);
  CHECK(at(plan.runs[0], "/name") == "tiny: the only run");
  CHECK(plan.runs[0].id.size() == 16);
  CHECK(plan.runs[0].dataset.size() == 16);
}

TEST_CASE("the base of a sweep may leave out by null what it inherits") {
  const TemporaryFolder here;
  write_tiny_base();
  here.write("mine.json", R"({"extends": "base.json", "stages": {"camera": null}})");
  const SweepPlan plan = plan_of({{"base", "mine.json"}, {"grid", {{"stages.interaction.iterations", {1, 2}}}}});
  REQUIRE(plan.runs.size() == 2);
  for (const SweepRun& run : plan.runs) CHECK_FALSE(at(run, "/stages").contains("camera"));
}

TEST_CASE("what a sweep sets of a dataset that is not made is told") {
  const TemporaryFolder here;
  write_tiny_base();
  std::vector<std::string> told;
  const LogSink sink =
      log_to([&told](LogLevel, std::string_view message) { told.emplace_back(message); }, LogLevel::kWarning);
  Json set = {{"synthetic.frames", 4}};
  plan_of({{"set", set}});
  CHECK(told == kNone);
  for (const char* name : {"scene", "avatar", "frames", "masks", "camera", "initial"}) {
    set[std::string("data.") + name] = std::string("there/") + name;
    fs::create_directories(fs::path("there") / name);  // a plan opens no data
  }
  plan_of({{"set", set}, {"seeds", 2}});
  CHECK(told ==
        std::vector<std::string>{"tiny: nothing reads synthetic.frames in 2 runs, whose config names its data"});
}

TEST_CASE("axes are crossed, seeds fastest") {
  const TemporaryFolder here;
  write_tiny_base();
  const SweepPlan plan = plan_of({{"seeds", 2},
                                  {"ablations", {{"plain", Json::object()}, {"dark", {{"background", {0.5, 0, 0}}}}}},
                                  {"grid", {{"stages.camera.iterations", {3, 4}}}},
                                  {"zip", {{"render.blur", {0.1, 0.2}}, {"/stages/interaction/iterations", {5, 6}}}}});
  REQUIRE(plan.runs.size() == 16);
  CHECK(labels_of(plan)[0] == "plain, camera.iterations 3, blur 0.1, interaction.iterations 5, seed 0");
  CHECK(labels_of(plan)[1] == "plain, camera.iterations 3, blur 0.1, interaction.iterations 5, seed 1");
  CHECK(labels_of(plan)[2] == "plain, camera.iterations 3, blur 0.2, interaction.iterations 6, seed 0");
  CHECK(labels_of(plan)[4] == "plain, camera.iterations 4, blur 0.1, interaction.iterations 5, seed 0");
  CHECK(labels_of(plan)[15] == "dark, camera.iterations 4, blur 0.2, interaction.iterations 6, seed 1");
  const SweepRun& last = plan.runs[15];
  CHECK(at(last, "/seed") == 1);
  CHECK(at(last, "/synthetic/seed") == 1);
  CHECK(at(last, "/background") == Json({0.5, 0.0, 0.0}));
  CHECK(at(last, "/stages/camera/iterations") == 4);
  CHECK(at(last, "/stages/interaction/iterations") == 6);
  CHECK(at(last, "/render/blur") == 0.2);
  CHECK(at(last, "/stages/interaction/losses/center/weight") == 0.001);  // the base's
  CHECK(plan.compare == std::vector<std::pair<std::string, std::string>>{{"ablation", "plain"}});
  CHECK(distinct_runs(plan).size() == 16);
  CHECK(plan.runs[0].dataset == plan.runs[2].dataset);
  CHECK(plan.runs[0].dataset != plan.runs[1].dataset);
}

TEST_CASE("a run is told by what changes its result") {
  const TemporaryFolder here;
  write_tiny_base();
  const auto id = [](const Json& set) { return plan_of({{"set", set}}).runs[0].id; };
  const std::string plain = id(Json::object());
  CHECK(id({{"threads", 3}}) == plain);
  CHECK(id({{"log.tensorboard", true}}) == plain);
  CHECK(id({{"name", "other"}}) == plain);
  CHECK(id({{"stages.camera.iterations", 8}}) == plain);
  CHECK(id({{"stages.camera.iterations", 9}}) != plain);
  CHECK(id({{"synthetic.seed", 1}}) != plain);
  CHECK(plan_of({{"ablations", {{"a", Json::object()}, {"b", {{"render.blur", 0.13}}}}}}).runs[1].id == plain);
  const SweepPlan twice = plan_of({{"ablations", {{"a", Json::object()}, {"b", {{"render.blur", 0.13}}}}}});
  CHECK(distinct_runs(twice) == std::vector<std::size_t>{0});
}

TEST_CASE("objects merge and null takes out") {
  const TemporaryFolder here;
  write_tiny_base();
  const SweepPlan plan = plan_of({{"ablations",
                                   {{"more", {{"stages.interaction.losses.penetration", {{"weight", 3}}}}},
                                    {"less", {{"stages.interaction.losses.depth", nullptr}}},
                                    {"no_camera", {{"stages.camera", nullptr}}},
                                    {"loss", {{"stages.interaction.losses", {{"center", {{"weight", 2}}}}}}}}}});
  CHECK(at(plan.runs[0], "/stages/interaction/losses/penetration/weight") == 3);
  CHECK(at(plan.runs[0], "/stages/interaction/losses/depth/weight") == 0.1);
  CHECK_FALSE(at(plan.runs[1], "/stages/interaction/losses").contains("depth"));
  CHECK(at(plan.runs[2], "/stages").size() == 1);
  CHECK(at(plan.runs[3], "/stages/interaction/losses/center/weight") == 2);
  CHECK(at(plan.runs[3], "/stages/interaction/losses/depth/weight") == 0.1);
}

TEST_CASE("blocks follow one another and take over what they do not have") {
  const TemporaryFolder here;
  write_tiny_base();
  const SweepPlan plan =
      plan_of({{"seeds", {7}},
               {"set", {{"render.blur", 0.3}}},
               {"ablations", {{"plain", Json::object()}, {"off", {{"color_net.use", "off"}}}}},
               {"blocks",
                {Json::object(),
                 {{"name", "steps"}, {"ablations", Json::object()}, {"grid", {{"stages.camera.iterations", {2, 3}}}}},
                 {{"name", "sharp"}, {"seeds", 2}, {"set", {{"render.blur", 0.1}}}}}}});
  CHECK(labels_of(plan) == std::vector<std::string>{"plain, seed 7", "off, seed 7", "steps, iterations 2, seed 7",
                                                    "steps, iterations 3, seed 7", "sharp, plain, seed 0",
                                                    "sharp, plain, seed 1", "sharp, off, seed 0",
                                                    "sharp, off, seed 1"});
  CHECK(at(plan.runs[0], "/render/blur") == 0.3);
  CHECK(at(plan.runs[2], "/render/blur") == 0.3);
  CHECK(at(plan.runs[4], "/render/blur") == 0.1);
}

TEST_CASE("skip and only choose runs") {
  const TemporaryFolder here;
  write_tiny_base();
  const Json axes = {{"seeds", 3}, {"grid", {{"stages.camera.iterations", {2, 3}}}}};
  const auto left = [&axes](const Json& rules) {
    Json sweep = axes;
    sweep.update(rules);
    return labels_of(plan_of(sweep));
  };
  CHECK(left({{"skip", {{{"seed", 1}}, {{"seed", 2}, {"stages.camera.iterations", 2.0}}}}}) ==
        std::vector<std::string>{"iterations 2, seed 0", "iterations 3, seed 0", "iterations 3, seed 2"});
  CHECK(left({{"only", {{{"seed", {0, "2"}}}}}, {"skip", {{{"/stages/camera/iterations", 2}}}}}) ==
        std::vector<std::string>{"iterations 3, seed 0", "iterations 3, seed 2"});
}

TEST_CASE("of a clip's config its data is taken") {
  const TemporaryFolder here;
  write_tiny_base();
  here.write("clips/a.json", R"({"synthetic": {"seed": 5, "frames": 3}, "render": {"blur": 1}, "stages": {}})");
  here.write("clips/b.json", R"({"data": {"scene": ")" + (TinyDataset::folder() / "scene.ply").string() + R"("}})");
  const SweepPlan plan = plan_of({{"clips", {"clips/a.json"}}});
  CHECK(sweep_label(plan.runs[0]) == "a");
  CHECK(at(plan.runs[0], "/render/blur") == 0.13);
  CHECK(at(plan.runs[0], "/synthetic/seed") == 5);
  CHECK(at(plan.runs[0], "/synthetic/size_px") == 256);  // not the base's
  CHECK(at(plan.runs[0], "/stages/camera/iterations") == 8);
  const SweepPlan real = plan_of(
      {{"seeds", 2},
       {"clips",
        {{"x", tiny_config_file()}, {"y", {{"config", tiny_config_file()}, {"set", {{"data.mask_margin_px", 2}}}}}}}});
  CHECK(labels_of(real) == std::vector<std::string>{"x, seed 0", "x, seed 1", "y, seed 0", "y, seed 1"});
  CHECK(real.runs[0].dataset.empty());
  CHECK(at(real.runs[0], "/data/scene") == (TinyDataset::folder() / "scene.ply").string());
  CHECK(at(real.runs[2], "/data/mask_margin_px") == 2);
  CHECK_THAT(refused({{"clips", {"clips/b.json"}}}), Contains("/data/avatar: not given; a run needs an avatar"));
}

TEST_CASE("mistakes of a sweep's file are told with their place") {
  const TemporaryFolder here;
  write_tiny_base();
  CHECK(refused({{"blocks", {{{"gird", {{"seed", {1}}}}}}}}) ==
        "sweep.json:6: /blocks/0/gird: unknown key; did you mean \"grid\"?");
  CHECK(refused({{"zip", {{"render.blur", {0.1, 0.2}}, {"threads", {1, 2, 3}}}}}) ==
        "sweep.json:4: /zip: lists that are zipped have one length, and these have 2 (render.blur), 3 (threads)");
  CHECK(refused({{"grid", {{"render.blur", Json::array()}}}}) ==
        "sweep.json:5: /grid/render.blur: has no values; give some, or leave it out");
  CHECK(refused({{"grid", Json::object()}}) == "sweep.json:4: /grid: is empty; name something, or leave it out");
  CHECK(refused({{"grid", {{"render.blur", {0.1, 0.10}}}}}) ==
        "sweep.json:7: /grid/render.blur: 0.1 is in the list twice");
  CHECK(refused({{"grid", {{"render.blur", 1}}}}) ==
        "sweep.json:5: /grid/render.blur: 1 is a number, not a list of values");
  CHECK(refused({{"blocks", {{{"name", "x"}}, {{"name", "x"}}}}}) ==
        "sweep.json:9: /blocks/1/name: \"x\" is the name of another block too");
  CHECK(refused({{"seeds", {1, 1}}}) == "sweep.json:6: /seeds/1: 1 is in the list twice");
  CHECK(refused({{"seeds", 0}}) == "sweep.json:4: /seeds: 0 is not a seed; allowed: 1 to 100000");
  CHECK(refused({{"seeds", 50001}, {"grid", {{"render.blur", {0.1, 0.2}}}}}) ==
        "sweep.json:1: the axes make more than 100000 runs, which is the most");
  CHECK(refused({{"seeds", 60000}, {"blocks", {{{"name", "x"}}, {{"name", "y"}}, {{"name", "z"}}}}}) ==
        "sweep.json:9: /blocks/1: the axes make more than 100000 runs, which is the most");
  CHECK(refused({{"ablations", {{"a b", Json::object()}}}}) ==
        "sweep.json:5: /ablations/a b: \"a b\" cannot be a name; allowed: letters, digits, '_' and '-'");
  CHECK(refused({{"skip", {{{"seed", 7}}}}, {"seeds", 3}}) == "sweep.json:5: /skip/0: no run has these values");
  CHECK(refused({{"skip", {{{"sed", 7}}}}, {"seeds", 3}}) ==
        "sweep.json:6: /skip/0/sed: is no axis of this sweep; did you mean \"seed\"?");
  CHECK(refused({{"skip", {{{"seed", {0, 1}}}}}, {"seeds", 2}}) == "sweep.json:5: /skip/0: no run is left");
  CHECK(refused({{"grid", {{"render.blur", {1, 2}}}}, {"ablations", {{"a", {{"/render/blur", 3}}}}}}) ==
        "sweep.json:12: render.blur is set by grid and by ablations; one of them would not count");
  CHECK(refused({{"grid", {{"stages.camera", {nullptr, Json::object()}}}},
                 {"ablations", {{"a", {{"stages.camera.iterations", 3}}}}}}) ==
        "sweep.json:12: stages.camera is set by grid and stages.camera.iterations by ablations; one is a part of the "
        "other, and would not count");
  CHECK(refused({{"grid", {{"render", {{{"blur", 1}}, {{"blur", 2}}}}, {"render.blur", {1, 2}}}}}) ==
        "sweep.json:14: render is set by grid and render.blur by grid; one is a part of the other, and would not "
        "count");
  CHECK(refused({{"seeds", 2}, {"grid", {{"synthetic.seed", {1, 2}}}}}) ==
        "sweep.json:7: synthetic.seed is set by grid and by seeds; one of them would not count");
  CHECK(refused({{"grid", {{"seed", {1, 2}}}}}) ==
        "sweep.json:5: /grid/seed: seeds are an axis of their own: write \"seeds\": [0, 1] beside the grid");
  CHECK(refused({{"grid", {{"render.blur", {1, 2}}}},
                 {"ablations", {{"a", Json::object()}, {"b", {{"seed", 1}}}}},
                 {"skip", {{{"ablation", "b"}, {"render.blur", 2}}}},
                 {"compare", {{"ablation", "b"}, {"render.blur", 2}}}}) ==
        "sweep.json:23: /compare: no run has all of these values");
  CHECK(
      refused({{"slurm", {{"time", "0-00:02"}}}}) ==
      "sweep.json:4: /slurm/grace_s: 120 s before the end of its time, or up to a minute earlier, Slurm tells a run to "
      "save its state; of 120 s (/slurm/time) none may be left to work in; allowed: 1 to 59, or a time of more than "
      "180 s");
  CHECK(
      refused({{"slurm", {{"time", "1"}, {"grace_s", 48}}}}) ==
      "sweep.json:6: /slurm/grace_s: 48 s before the end of its time, or up to a minute earlier, Slurm tells a run to "
      "save its state; of 60 s (/slurm/time) none may be left to work in; give it a time of more than 108 s");
  CHECK(refused({{"slurm", {{"time", "2:30"}, {"grace_s", 119}, {"options", {"--account", "hsi"}}}}}) ==
        "sweep.json:9: /slurm/options/1: \"hsi\" is no option of sbatch, which begin with '-'; a value belongs to its "
        "option: --account=hsi");
  for (const char* option :
       {"--time=1:00:00", "-t30", "--time-min=5", "--signal=USR2@30", "--array=0-3", "--no-requeue"}) {
    CHECK_THAT(refused({{"slurm", {{"options", {"--account=hsi", option}}}}}),
               Catch::StartsWith("sweep.json:7: /slurm/options/1: \"" + std::string(option) + "\" is not for here: "));
  }
  CHECK(refused({{"ablations", {{"a", Json::object()}}}, {"compare", {{"ablation", "b"}}}}) ==
        "sweep.json:8: /compare/ablation: no run has \"b\" there");
  CHECK(refused({{"base", "bsae.json"}}) == "sweep.json:3: /base: \"bsae.json\" does not exist (looked for bsae.json)");
  here.write("twice.json", "{\"base\": \"base.json\",\n\"ablations\": {\"a\": {},\n\"a\": {\"seed\": 1}}}");
  CHECK_THROWS_WITH(plan_sweep("twice.json", descriptions_of(loss_terms())),
                    "twice.json:3: /ablations/a: written twice, first in line 2; keep one of them");
  CHECK_THROWS_WITH(plan_sweep("base.json", descriptions_of(loss_terms())),
                    "base.json: is no sweep: it has no \"base\"; docs/sweeps.md tells what one looks like");
}

TEST_CASE("blocks whose runs would be taken for one another need names") {
  const TemporaryFolder here;
  write_tiny_base();
  const Json sharp = {{"set", {{"render.blur", 0.1}}}};
  CHECK(
      refused({{"seeds", 1}, {"blocks", {Json::object(), sharp}}}) ==
      "sweep.json:7: /blocks/1: run 1 (seed 0) would be taken for one of /blocks/0, which has other settings; give the "
      "blocks a \"name\"");
  Json other_seeds = sharp;
  other_seeds["seeds"] = {5};
  CHECK_THAT(refused({{"seeds", 1}, {"blocks", {Json::object(), other_seeds}}}),
             Contains("run 1 (seed 5) would be taken for one of /blocks/0"));
  other_seeds["name"] = "sharp";
  CHECK(plan_of({{"seeds", 1}, {"blocks", {Json::object(), other_seeds}}}).runs.size() == 2);
  CHECK(plan_of({{"blocks", {{{"seeds", 2}}, {{"seeds", {1, 2}}}}}}).runs.size() == 4);  // made in one way
}

TEST_CASE("runs are compared with the first ablation that changes nothing, or the first combination") {
  const TemporaryFolder here;
  write_tiny_base();
  using Pairs = std::vector<std::pair<std::string, std::string>>;
  const Json blur = {{"a", {{"color_net.use", "off"}}}, {"b", {{"stages.camera.iterations", 3}}}};
  CHECK(plan_of({{"ablations", blur}, {"grid", {{"render.blur", {0.3, 0.1}}}}}).compare ==
        Pairs{{"ablation", "a"}, {"render.blur", "0.3"}});
  Json with_whole = blur;
  with_whole["whole"] = Json::object();
  CHECK(plan_of({{"ablations", with_whole}}).compare == Pairs{{"ablation", "whole"}});
  CHECK(plan_of({{"ablations", with_whole}, {"skip", {{{"ablation", "whole"}}}}}).compare == Pairs{{"ablation", "a"}});
}

TEST_CASE("mistakes of combinations are told with the runs that they are in") {
  const TemporaryFolder here;
  write_tiny_base();
  CHECK(refused({{"set", {{"rendr.blur", 1}}}, {"seeds", 2}}) ==
        "sweep.json:5: /rendr: unknown key; did you mean \"render\"?");
  CHECK(
      refused({{"set", {{"stages.camra.iterations", 1}}}}) ==
      "sweep.json:5: /stages/camra: no such entry in the config; an object in its place, {...}, adds one; did you mean "
      "\"camera\"?");
  CHECK(
      refused({{"seeds", 2}, {"grid", {{"render.blur", {0.1, -1, 0.2}}}}}) ==
      "sweep.json:8: /render/blur: -1 is out of range; allowed: 0 to 100\n  in 2 of 6 runs, the first of them 2 (blur "
      "-1, seed 0)");
  CHECK_THAT(refused({{"ablations", {{"none", {{"stages.camera", nullptr}, {"stages.interaction", nullptr}}}}}}),
             Contains("base.json: /stages: a run needs at least one stage"));
}

TEST_CASE("a plan is read as it was written") {
  const TemporaryFolder here;
  write_tiny_base();
  const SweepPlan plan = plan_of({{"seeds", 2},
                                  {"grid", {{"render.blur", {0.1, 0.25}}, {"data.frames", {"base.json", ""}}}},
                                  {"only", {{{"data.frames", ""}}}},
                                  {"threads", 2},
                                  {"memory_mb", 800.5},
                                  {"slurm", {{"time", "00:10:00"}, {"at_once", 3}, {"options", {"--nice"}}}}});
  const std::string text = sweep_plan_json(plan);
  const SweepPlan again = parse_sweep_plan(text, "sweep.json");
  CHECK(sweep_plan_json(again) == text);
  CHECK(labels_of(again) == labels_of(plan));
  CHECK(again.slurm.options == std::vector<std::string>{"--nice"});
  CHECK(again.memory_mb == 800.5);
  CHECK_THROWS_WITH(parse_sweep_plan("{\"sweep_plan\": 1}", "p.json"), "p.json:1: there is no \"name\"");
  std::string damaged = text;
  damaged.replace(damaged.find(plan.runs[0].id), 16, "../../etc/passwd");
  CHECK_THROWS_WITH(parse_sweep_plan(damaged, "p.json"), Contains("/runs/0/id: \"../../etc/passwd\" is not the name"));
}

TEST_CASE("a clip whose instance has its data in place is that data") {
  const TemporaryFolder here;
  write_tiny_base();
  here.write("clip.json",
             R"({"instance": {"folder": "there", "prompt": "A person walks."}, "synthetic": {"frames": 3}})");
  const Json sweep = {{"clips", {{"a", "clip.json"}}}};
  const SweepPlan made = plan_of(sweep);
  CHECK(made.runs[0].dataset.size() == 16);
  CHECK(at(made.runs[0], "/instance/prompt") == "A person walks.");
  fs::copy(TinyDataset::folder(), "there", fs::copy_options::recursive);
  const SweepPlan given = plan_of(sweep);
  CHECK(given.runs[0].dataset.empty());
  CHECK(given.runs[0].id != made.runs[0].id);
  CHECK_THAT(at(given.runs[0], "/data/scene").get<std::string>(), Contains("there/scene.ply"));
}

}  // namespace plan_test
