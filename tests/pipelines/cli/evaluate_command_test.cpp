#include <cmath>
#include <filesystem>
#include <fstream>

#include <catch2/catch.hpp>

#include "body/motion_edit.h"
#include "body/motion_io.h"
#include "core/npz.h"
#include "core/rotation.h"
#include "tests/optim/solid/meshes.h"
#include "tests/support/procedural_file.h"
#include "tests/support/program.h"
#include "tests/support/tiny_run.h"
#include "tests/support/tiny_sweep.h"

namespace evaluate_command_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::StartsWith;
namespace fs = std::filesystem;

namespace {

std::string data(const char* name) { return (TinyDataset::folder() / name).string(); }

/// The message of a command that is refused.
std::string refused(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "evaluate");
  const ProgramResult result = run_hsi4d(arguments);
  CHECK(result.status == 2);
  CHECK(result.out.empty());
  return result.err;
}

nlohmann::json evaluated(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "evaluate");
  arguments.insert(arguments.end(), {"--json", "e.json"});
  const ProgramResult result = run_hsi4d(arguments);
  INFO(result.err);
  REQUIRE(result.status == 0);
  return json_of("e.json");
}

}  // namespace

TEST_CASE("evaluate finds what the summary of a run has", "[run]") {
  const TemporaryFolder here;
  execute_tiny(tiny_config({"name=one"}), "one");
  execute_tiny(tiny_config({"name=two", "stages.interaction.iterations=3"}), "two");
  execute_tiny(tiny_config({"name=three", "seed=5", "stages.interaction.iterations=3"}), "three");
  // As if by the config of "one" with another seed: a result that differs.
  write_changed("one/config.resolved.json", "one/config.resolved.json", [](auto&) {});
  write_changed("one/config.resolved.json", "three/config.resolved.json", [](auto& tree) { tree["seed"] = 5; });
  const nlohmann::json summary = json_of("one/summary.json"), both = evaluated({"one", "three"});
  const nlohmann::json& one = both["results"][0];
  CHECK(one["name"] == "one");
  CHECK(one["frames"] == kTinyFrames);
  CHECK(one["frame_rate"] == 10);
  int count = 0;
  for (const auto& [name, value] : summary["metrics"].back().items()) {
    if (!one.contains(name)) continue;
    INFO(name);
    CHECK(one[name].get<double>() == Approx(value.get<double>()).margin(1e-9));
    ++count;
  }
  for (const char* name :
       {"contact_share", "foot_sliding_mm", "penetration_share", "penetration_depth_mm", "object_penetration_share",
        "object_add_cm", "object_add_s_cm", "acceleration_error", "psnr_db", "psnr_foreground_db", "psnr_background_db",
        "silhouette_iou", "floor_drift_mm", "ssim"})
    CHECK(one.contains(name));
  for (const auto& [name, value] : summary["metrics"].back().items()) {
    INFO(name);
    CHECK((find_metric_facts(name) == nullptr || one.contains(name)));
  }
  CHECK(count == 28 + (one.contains("contact_distance_mm") ? 1 : 0));
  CHECK(one["per_frame"].size() == kTinyFrames - 1);
  CHECK(one["per_frame"][0]["frame"] == 1);
  CHECK(one["per_frame"][2]["mpjpe_mm"].get<double>() ==
        Approx(summary["per_frame"][2]["mpjpe_mm"].get<double>()).margin(1e-9));
  const double a = one["mpjpe_mm"], b = both["results"][1]["mpjpe_mm"];
  CHECK(a != b);
  CHECK(both["mean"]["mpjpe_mm"].get<double>() == Approx((a + b) / 2));
  CHECK(both["std"]["mpjpe_mm"].get<double>() == Approx(std::fabs(a - b) / std::sqrt(2)));

  // Each seed of a sweep has a dataset in a folder of its own.
  fs::copy(TinyDataset::folder(), "seed_7", fs::copy_options::recursive);
  fs::copy("three", "seven", fs::copy_options::recursive);
  write_changed("three/config.resolved.json", "seven/config.resolved.json", [](auto& tree) {
    std::string text = tree["data"].dump();
    const std::string folder = TinyDataset::folder().string(), other = fs::absolute("seed_7").string();
    for (std::size_t at = 0; (at = text.find(folder + "/", at)) != std::string::npos; at += other.size())
      text.replace(at, folder.size(), other);
    tree["data"] = std::decay_t<decltype(tree)>::parse(text);  // keys stay in their order
  });
  CHECK(evaluated({"one", "seven"})["mean"]["diversity_mm"] == both["mean"]["diversity_mm"]);
  fs::remove("seed_7/synthetic.json");  // some other data
  CHECK_FALSE(evaluated({"one", "seven"}).contains("mean"));

  const nlohmann::json apart = evaluated({"one", "two"});  // other iterations: a mean says nothing
  CHECK(apart["results"].size() == 2);
  CHECK_FALSE((apart.contains("mean") || apart.contains("std")));
  CHECK_THAT(run_hsi4d({"evaluate", "one", "two"}).out, !Contains("mean"));
  CHECK_THAT(run_hsi4d({"evaluate", "one", "three/motion.npz", "--truth", TinyDataset::folder().string()}).out,
             !Contains("mean"));

  const ProgramResult table = run_hsi4d({"evaluate", "one", "three"});
  CHECK(table.err.empty());
  CHECK_THAT(
      table.out,
      StartsWith("                         one") && Contains("mean ± std\nMPJPE [mm] ") &&
          Contains("\n\none: frames 1 to 3 at 10 a second, against " + data("truth") + "\n") &&
          Contains("one: penetration by the mesh " + data("truth/surface.ply") + ", of 500 points of the body\n") &&
          Contains("\ndiversity [mm] ") && Contains("  0.835  ") && Contains("  CHOIS 0.687, LINGO 0.699\n"));
  // Two repetitions: one pair.
  CHECK(both["mean"]["diversity_mm"].get<double>() > 0);
  CHECK_FALSE(one.contains("diversity_mm"));
  CHECK(both["published"]["figures"][0]["published"]["TRUMANS"] == 0.046);
  const nlohmann::json alike = evaluated({"one", "one"});
  CHECK(alike["mean"]["diversity_mm"] == 0);
  CHECK_THAT(run_hsi4d({"evaluate", "one"}).out, !Contains("mean"));

  SECTION("a motion has what is known of its body, on the dataset's avatar") {
    const nlohmann::json motion = evaluated({"one/motion.npz", "--truth", TinyDataset::folder().string()});
    for (const char* name : {"mpjpe_mm", "pa_mpjpe_mm", "world_mpjpe_depth_mm", "root_translation_mm", "jitter"})
      CHECK(motion["results"][0][name] == one[name]);
    for (const char* name : {"object_translation_cm", "camera_rotation_deg"})
      CHECK_FALSE(motion["results"][0].contains(name));
    CHECK(motion["results"][0]["penetration_share"] == one["penetration_share"]);
    // Its clip has an object, though nothing of it is measured.
    CHECK(motion["results"][0]["clip"] == "dynamic");
    CHECK_THAT(run_hsi4d({"evaluate", "one/motion.npz", "--truth", TinyDataset::folder().string()}).out,
               !Contains("0.019"));
    // With the poses of its object beside it, that too.
    const nlohmann::json with_object =
        evaluated({"one/motion.npz", "--objects", "one/objects.npz", "--truth", TinyDataset::folder().string()});
    for (const char* name : {"object_translation_cm", "object_add_s_cm", "contact_share", "object_penetration_share"})
      CHECK(with_object["results"][0][name].get<double>() == Approx(one[name].get<double>()).margin(1e-9));
    CHECK(motion["std"].empty());
    // Thirty frames a second have the same places at the moments of the truth.
    const nlohmann::json fast = evaluated({"one/motion_30fps.npz", "--truth", data("truth")});
    CHECK(fast["results"][0]["mpjpe_mm"].get<double>() == Approx(a).epsilon(1e-6));
    CHECK(fast["results"][0]["frame_rate"] == 10);
  }
  SECTION("a motion against another motion needs a body") {
    CHECK(refused({"one/motion.npz", "--truth", data("initial_motion.npz")}) ==
          "hsi4d evaluate: one/motion.npz, " + data("initial_motion.npz") +
              ": neither says of what body it is, and errors are those of its joints; --body-model M.npz or --avatar "
              "F.safetensors says it\n");
    const nlohmann::json known =
        evaluated({"one/motion.npz", "--truth", data("truth/motion.npz"), "--avatar", data("avatar.safetensors")});
    CHECK(known["results"][0]["mpjpe_mm"].get<double>() == Approx(a).margin(1e-9));
    CHECK_FALSE(known["results"][0].contains("world_mpjpe_depth_mm"));  // no camera
    CHECK(known["results"][0]["clip"] == "static");
    procedural_file().write("body.npz");
    const nlohmann::json model =
        evaluated({"one/motion.npz", "--truth", data("truth/motion.npz"), "--body-model", "body.npz"});
    CHECK(model["results"][0]["mpjpe_mm"].get<double>() == Approx(a).epsilon(0.01));
    CHECK_THAT(refused({"one/motion.npz", "--truth", data("truth/motion.npz"), "--body-model", "body.npz", "--avatar",
                        data("avatar.safetensors")}),
               Contains("--body-model and --avatar both say"));
  }
  SECTION("a run that has not ended, or does not know its truth") {
    fs::remove("one/motion.npz");
    CHECK(refused({"one"}) == "one: the run has no motion.npz; it has not come to its end\n");
    write_changed("two/config.resolved.json", "two/config.resolved.json",
                  [](auto& tree) { tree["data"]["truth"] = ""; });
    const nlohmann::json alone = evaluated({"two"})["results"][0];  // what needs no truth
    CHECK_FALSE((alone.contains("truth") || alone.contains("mpjpe_mm")));
    for (const char* name : {"jitter", "foot_sliding_mm", "contact_share", "penetration_share", "psnr_db"})
      CHECK(alone.contains(name));
    CHECK_THAT(run_hsi4d({"evaluate", "two"}).out,
               Contains("two: there is no truth: errors are not measured (--truth names one)\n"));
    CHECK(evaluated({"two", "--truth", data("truth")})["results"][0]["mpjpe_mm"] == b);
  }
}

TEST_CASE("what evaluate cannot compare is told") {
  const TemporaryFolder here;
  const std::string motion = data("initial_motion.npz"), truth = TinyDataset::folder().string();
  CHECK(refused({motion}) == "hsi4d evaluate: " + motion +
                                 ": does not say of what body it is, and errors are those of its joints; --body-model "
                                 "M.npz or --avatar F.safetensors says it\n");
  CHECK(refused({"none.npz", "--truth", truth}) == "none.npz: there is no such file or folder\n");
  CHECK(refused({motion, "--truth", "none"}) == "none: there is no such file or folder\n");
  here.write("note.txt", "text");
  CHECK(refused({"none"}) == "none: there is no such file or folder\n");
  CHECK(refused({"."}) == ".: holds no run, dataset or motion\n");
  here.write("demo/run/status.json", "{}");
  here.write("demo/dataset/truth/motion.npz", "");
  CHECK(refused({"demo"}) == "demo: holds no run, dataset or motion; did you mean demo/run?\n");
  CHECK(refused({motion, "--truth", "demo"}) == "demo: holds no run, dataset or motion; did you mean demo/dataset?\n");
  CHECK(refused({"note.txt", "--truth", truth}) ==
        "note.txt: is neither a folder of a run or dataset nor a motion (.npz)\n");
  here.write("bad.npz", "text");
  CHECK_THAT(refused({"bad.npz", "--truth", truth}), StartsWith("bad.npz: "));
  CHECK_THAT(refused({motion, "--truth", truth, "--from-rate", "-1"}),
             StartsWith("hsi4d evaluate: --from-rate: -1 is out of range; allowed: 0.01 to "));
  CHECK_THAT(refused({motion, "--truth", truth, "--json", "note.txt/e.json"}),
             Contains("note.txt/e.json: cannot be written"));
  CHECK_THAT(refused({motion, "--truth", motion, "--json", motion}), Contains("--json"));
  CHECK_THAT(refused({motion, "--truth", truth, "--avatar", "none.safetensors"}), Contains("none.safetensors"));
  const CopiedDataset dataset;
  fs::remove_all(dataset.path / "truth");
  CHECK(refused({motion, "--truth", dataset.path.string()}) ==
        dataset.path.string() + ": is a dataset without truth/motion.npz, which errors are measured against\n");
  fs::copy(TinyDataset::folder() / "truth", dataset.path / "truth");
  fs::copy_file(dataset.path / "truth/motion.npz", "long.npz");
  Motion longer = read_motion("long.npz");
  longer.poses.push_back(longer.poses.back());
  write_motion((dataset.path / "truth/motion.npz").string(), longer);
  CHECK_THAT(refused({motion, "--truth", dataset.path.string()}),
             Contains("objects.npz: holds 4 frames of objects, the motion beside it has 5 frames"));
  CHECK(refused({}).find("RUN") != std::string::npos);
  CHECK(refused({motion, "--truth", truth, "--up", "x"}) ==
        "hsi4d evaluate: --up: \"x\" is not known; allowed: y, z\n");
  CHECK(refused({motion, "--truth", truth, "--align", "all"}) ==
        "hsi4d evaluate: --align: \"all\" is not known; allowed: heading, rotation, none\n");
  CHECK(refused({motion, "--truth", truth, "--object-surface", "can"}) ==
        "hsi4d evaluate: --object-surface: \"can\"; allowed: NAME=FILE\n");
  CHECK(refused({motion, "--truth", truth, "--surface", "a.ply", "--occupancy", "b.npz"}) ==
        "hsi4d evaluate: --surface, --occupancy and --scene each say what is solid; give one\n");
  CHECK(refused({motion, "--truth", truth, "--clip", "a.npz", "--clip", "b.npz"}) ==
        "hsi4d evaluate: --clip: 2 files for 1 input; allowed: one for each, in their order\n");
  CHECK(refused({truth, "--truth", truth, "--frame-rate", "25"}) ==
        "--frame-rate: 25 is above the 10 frames a second of " + truth + " or " + truth +
            ", and what is between frames is not known; allowed: up to 10\n");
  CHECK(refused({truth, "--truth", truth, "--object-surface", "vase=a.ply"}) ==
        "hsi4d evaluate: --object-surface: " + truth + " has no object \"vase\"; there is watering_can\n");
}

TEST_CASE("evaluate follows the protocols of public benchmarks") {
  const TemporaryFolder here;
  const std::string truth = TinyDataset::folder().string();
  const nlohmann::json world = evaluated({truth, "--truth", truth, "--protocol", "emdb2"})["results"][0];
  CHECK(world["protocol"] == "emdb2");
  for (const char* name : {"wa_mpjpe_100_mm", "w_mpjpe_100_mm", "rte_percent"})
    CHECK(world[name].get<double>() == Approx(0).margin(1e-6));
  CHECK(world["protocol_jitter"].get<double>() == Approx(world["jitter"].get<double>() / 10));
  CHECK_FALSE(world.contains("cd_both_cm"));
  const nlohmann::json objects =
      evaluated({truth, "--truth", truth, "--protocol", "behave", "--align-frames", "1"})["results"][0];
  for (const char* name : {"cd_human_cm", "cd_object_cm", "cd_both_cm"})  // of points as they are
    CHECK(objects[name].get<double>() == Approx(0).margin(1e-6));
  CHECK_FALSE(objects.contains("acceleration_human_cm"));
  CHECK_FALSE(objects.contains("wa_mpjpe_100_mm"));
  const std::string table = run_hsi4d({"evaluate", truth, "--truth", truth, "--protocol", "rich"}).out;
  CHECK_THAT(table,
             Contains("\nWA-MPJPE-100 [mm] ") && Contains("\nRTE [%] ") &&
                 Contains(": protocol rich: 4 frames in pieces of 100, 22 joints\n") &&
                 Contains(": protocol rich: the protocol is for 30 frames a second, this is at 10: its pieces and "
                          "steps are counted in frames") &&
                 Contains(": feet slide by points "));
  CHECK_FALSE(evaluated({truth, "--truth", truth})["results"][0].contains("protocol"));

  const auto told = [&truth](std::vector<std::string> options) {
    options.insert(options.begin(), {truth, "--truth", truth});
    return refused(std::move(options));
  };
  CHECK(told({"--protocol", "emdb"}) ==
        "hsi4d evaluate: --protocol: \"emdb\" is not known; allowed: emdb2, rich, behave, intercap\n");
  for (const char* text : {"1,2,3", "1,2,3,4,5", "1,2,3,", "1,2,3,4,", "a", "1,2,3,-4", "1,2,3,4.5", "1;2;3;4",
                           "1,2,3,99999999999999999999"}) {
    INFO(text);
    CHECK_THAT(
        told({"--protocol", "emdb2", "--foot-points", text}),
        StartsWith("hsi4d evaluate: --foot-points: \"" + std::string(text) + "\"; allowed: four numbers of points"));
  }
  CHECK_THAT(told({"--protocol", "emdb2", "--foot-points", "0,1,2,99999"}),
             StartsWith("hsi4d evaluate: --foot-points: there is no point 99999; the body has 0 to "));
  CHECK(told({"--protocol", "behave", "--foot-points", "0,1,2,3"}) ==
        "hsi4d evaluate: --foot-points: only --protocol emdb2 and rich measure feet by points\n");
  CHECK(told({"--align-frames", "2"}) ==
        "hsi4d evaluate: --align-frames: only --protocol behave and intercap lay frames on the truth by it\n");
  CHECK(told({"--protocol", "intercap", "--align-frames", "0"}) ==
        "hsi4d evaluate: --align-frames: 0 is out of range; allowed: 1 or more\n");
  CHECK_THAT(told({"--protocol", "intercap", "--align-frames", "-1"}), Contains("--align-frames"));
  CHECK(told({"--truth-body-model", "m.npz"}) ==
        "hsi4d evaluate: --truth-body-model is given without --body-model, the body of the other motions\n");
  procedural_file().write("body.npz");
  CHECK_THAT(told({"--body-model", "body.npz", "--truth-body-model", "none.npz"}), Contains("none.npz"));
  CHECK(refused({data("truth/motion.npz"), "--protocol", "rich", "--avatar", data("avatar.safetensors")}) ==
        "hsi4d evaluate: --protocol: " + data("truth/motion.npz") +
            ": there is no truth to compare with; --truth names one\n");
}

TEST_CASE("what is solid is told by a mesh, by voxels or by Gaussians", "[run]") {
  const TemporaryFolder here;
  const std::string truth = TinyDataset::folder().string();
  // Solid is all below 0.5 m, which the legs are in.
  write_mesh("half.ply", box_mesh({-20, -20, -20}, {20, 20, 0.5}));
  NpzWriter file;
  std::vector<std::uint8_t> voxels;
  for (int i = 0; i < 60 * 60; ++i) {
    for (int k = 0; k < 30; ++k) voxels.push_back(k < 15 ? 1 : 0);
  }
  file.add<std::uint8_t>("occupancy", {60, 60, 30}, voxels);  // of 10 cm, from 1 m below the ground
  file.add<double>("origin", {3}, {-3, -3, -1});
  file.add_scalar("voxel_size", 0.1);
  file.write("half.npz");
  const nlohmann::json mesh = evaluated({truth, "--surface", "half.ply"})["results"][0];
  const nlohmann::json grid = evaluated({truth, "--occupancy", "half.npz"})["results"][0];
  CHECK(mesh["surface"] == "the mesh half.ply");
  CHECK(grid["surface"] == "the occupancy grid half.npz");
  CHECK(mesh["penetration_share"].get<double>() > 0.1);
  CHECK(mesh["penetration_share"].get<double>() < 0.5);
  CHECK(grid["penetration_share"].get<double>() == Approx(mesh["penetration_share"].get<double>()).margin(1e-9));
  CHECK(grid["penetration_depth_mm"].get<double>() == Approx(mesh["penetration_depth_mm"].get<double>()).margin(1e-3));
  const ProgramResult shown = run_hsi4d({"evaluate", truth, "--scene", data("scene.ply")});
  CHECK_THAT(shown.out, Contains("penetration by the Gaussians of " + data("scene.ply")));
  // An object's mesh instead of its Gaussians: one that is all around the body.
  write_mesh("around.ply", box_mesh({-9, -9, -9}, {9, 9, 9}));
  const nlohmann::json inside = evaluated({truth, "--object-surface", "watering_can=around.ply"})["results"][0];
  CHECK(inside["object_penetration_share"] == 1);
  // A body by its vertices.
  procedural_file().write("body.npz");
  const nlohmann::json model = evaluated({truth, "--surface", "half.ply", "--body-model", "body.npz"})["results"][0];
  CHECK(model["penetration_share"].get<double>() == Approx(mesh["penetration_share"].get<double>()).margin(0.1));
  CHECK(model.contains("contact_share"));
}

TEST_CASE("embeddings by CLIP are scored, given or in a run's folder") {
  const TemporaryFolder here;
  const std::string truth = TinyDataset::folder().string();
  NpzWriter file;
  file.add<double>("image_embeddings", {3, 2}, {2, 0, 3, 4, 0, 7});
  file.add<double>("text_embedding", {2}, {5, 0});
  file.add_text("model", "ViT-B/32");
  file.write("e.npz");
  const nlohmann::json given = evaluated({truth, "--clip", "e.npz"})["results"][0];
  CHECK(given["clip_score"].get<double>() == Approx(160.0 / 3));
  CHECK(given["clip_consistency"].get<double>() == Approx(70));
  const ProgramResult told = run_hsi4d({"evaluate", truth, "--clip", "e.npz"});
  CHECK_THAT(told.out,
             Contains("CLIP by e.npz, 3 frames, ViT-B/32\n") && Contains("\nCLIP score ") && Contains("24.01"));
  CHECK_FALSE(evaluated({truth})["results"][0].contains("clip_score"));
  fs::create_directory("run");
  for (const char* name : {"motion.npz", "objects.npz", "cameras.json"})
    fs::copy_file(TinyDataset::folder() / "truth" / name, fs::path("run") / name);
  here.write("run/status.json", "{}");
  fs::copy_file("e.npz", "run/clip.npz");
  const nlohmann::json found = evaluated({"run", "--data", truth})["results"][0];
  CHECK(found["clip_score"] == given["clip_score"]);
  CHECK_FALSE(found.contains("mpjpe_mm"));
}

TEST_CASE("a motion of another world is laid on frame 0") {
  const TemporaryFolder here;
  const std::string truth = TinyDataset::folder().string();
  Motion motion = read_motion(data("truth/motion.npz"));
  const Rigid<double> elsewhere{so3_exp(Vector3<double>(0, 0, 1)), {7, -5, 0.2}};
  write_motion("moved.npz", transformed(motion, elsewhere, motion.pelvis_rest.value_or(kSmplxPelvis)));
  const auto error = [&](std::vector<std::string> more) {
    more.insert(more.begin(), "moved.npz");
    return evaluated(more)["results"][0]["world_mpjpe_mm"].get<double>();
  };
  CHECK(error({"--truth", truth}) > 5000);
  CHECK(error({"--truth", truth, "--align", "heading"}) < 1e-6);
  CHECK(error({"--truth", truth, "--align", "rotation"}) < 1e-6);
  // Without a truth on the dataset's own first frame.
  const nlohmann::json alone = evaluated({"moved.npz", "--data", truth, "--align", "heading"})["results"][0];
  CHECK(alone["foot_sliding_mm"].get<double>() >= 0);
  CHECK(refused({"moved.npz", "--avatar", data("avatar.safetensors"), "--align", "heading"}) ==
        "hsi4d evaluate: --align: moved.npz: there is no frame 0 to lay it on; --truth or --data has one\n");
  // All of a run or dataset moves alike.
  const nlohmann::json same = evaluated({truth, "--truth", truth, "--align", "heading"})["results"][0];
  for (const char* name : {"world_mpjpe_mm", "object_add_cm", "camera_translation_cm"}) CHECK(same[name] < 1e-9);
}

TEST_CASE("trajectories are exported beside the numbers") {
  const TemporaryFolder here;
  const std::string truth = TinyDataset::folder().string();
  const ProgramResult result = run_hsi4d({"evaluate", truth, "--data", truth, "--export", "out"});
  INFO(result.err);
  REQUIRE(result.status == 0);
  CHECK_THAT(result.out, Contains("\nout: 10 frames at 30 a second, for TRUMANS, LINGO and CHOIS; grids of "));
  CHECK(fs::exists("out/lingo/input.json"));
  CHECK(run_hsi4d({"evaluate", truth, truth, "--export", "two"}).status == 0);
  // Not over what somebody has made.
  const ProgramResult within = run_hsi4d({"evaluate", truth, "--data", truth, "--export", truth + "/exports"});
  CHECK(within.err ==
        "hsi4d evaluate: --export: " + truth + "/exports is in " + truth + ", which is read; choose another folder\n");
  here.write("mine/summary.json", "{}");
  CHECK(run_hsi4d({"evaluate", truth, "--data", truth, "--export", "mine"}).err ==
        "hsi4d evaluate: --export: mine holds something else, with a summary.json; choose another folder\n");
  CHECK(fs::exists("two/0/trajectory.npz"));
  CHECK(fs::exists("two/1/trajectory.npz"));
}

TEST_CASE("runs of a sweep are measured by their names, and together as its report has them", "[run]") {
  const TemporaryFolder here;
  write_tiny_base();
  const nlohmann::ordered_json ablations = {{"whole", nlohmann::ordered_json::object()},
                                            {"short", {{"stages.interaction.iterations", 3}}}};
  write_sweep({{"seeds", 2}, {"ablations", ablations}});
  const ProgramResult computed = run_hsi4d({"sweep", "sweep.json", "--out", "s", "--jobs", "2", "--threads", "2"});
  INFO(computed.err);
  REQUIRE(computed.status == 0);
  const nlohmann::json all = evaluated({"s"});
  const std::vector<std::string> ids = ids_of("s");
  REQUIRE(all["results"].size() == 4);
  const char* const names[] = {"whole, seed 0", "whole, seed 1", "short, seed 0", "short, seed 1"};
  double error[4];
  for (std::size_t i = 0; i < 4; ++i) {
    CHECK(all["results"][i]["name"] == names[i]);
    error[i] = all["results"][i]["mpjpe_mm"];
    const nlohmann::json summary = json_of(fs::path("s") / "runs" / ids[i] / "summary.json");
    CHECK(error[i] == Approx(summary["metrics"].back()["mpjpe_mm"].get<double>()).margin(1e-9));
  }
  CHECK_FALSE(all.contains("mean"));  // of different ablations it would say nothing
  const nlohmann::json &sweep = all["sweeps"][0], &whole = sweep["rows"][0], &cut = sweep["rows"][1];
  CHECK(sweep["compared_with"] == "whole");
  CHECK(whole["name"] == "whole");
  CHECK(whole["mean"]["mpjpe_mm"].get<double>() == Approx((error[0] + error[1]) / 2));
  CHECK(whole["std"]["mpjpe_mm"].get<double>() == Approx(std::fabs(error[0] - error[1]) / std::sqrt(2.0)));
  CHECK(whole["mean"]["diversity_mm"].get<double>() > 0);
  CHECK_FALSE(whole.contains("difference"));
  CHECK(cut["difference"]["mpjpe_mm"]["pairs"] == 2);
  CHECK(cut["difference"]["mpjpe_mm"]["mean"].get<double>() ==
        Approx((error[2] - error[0] + error[3] - error[1]) / 2).margin(1e-9));

  const std::string text = run_hsi4d({"evaluate", "s"}).out;
  CHECK_THAT(text, Contains("\nwhole, seed 1  ") && Contains("\n## Means\n") &&
                       Contains("\n## Differences to whole\n") && Contains("\n## Diversity over seeds\n") &&
                       Contains("\nall: frames 1 to 3 at 10 a second, against "
                                "its dataset/truth"));
  // Repetitions of one row are those of one config: they have a mean, as runs by their paths do.
  const nlohmann::json row = evaluated({"s/whole"});
  CHECK(row["results"].size() == 2);
  CHECK(row["mean"]["mpjpe_mm"].get<double>() == Approx((error[0] + error[1]) / 2));
  CHECK(row["mean"]["diversity_mm"].get<double>() == Approx(whole["mean"]["diversity_mm"].get<double>()));
  CHECK(evaluated({"s/short, seed 1", "s/runs/" + ids[0]})["results"][0]["name"] == "s/short, seed 1");
  CHECK_THAT(refused({"s/hole"}), Contains("did you mean \"whole\"?"));
}

}  // namespace evaluate_command_test
