#include <cmath>
#include <filesystem>
#include <fstream>

#include <catch2/catch.hpp>

#include "body/motion_io.h"
#include "tests/pipelines/tiny_run.h"
#include "tests/support/procedural_file.h"
#include "tests/support/program.h"

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
  carry_out_tiny(tiny_config({"name=one"}), "one");
  carry_out_tiny(tiny_config({"name=two", "stages.interaction.iterations=3"}), "two");
  carry_out_tiny(tiny_config({"name=three", "seed=5", "stages.interaction.iterations=3"}), "three");
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
  for (const char* name : {"contact_share", "foot_sliding_mm"}) CHECK(one.contains(name));
  CHECK(count == 13 + (one.contains("contact_distance_mm") ? 1 : 0));
  CHECK(one["per_frame"].size() == kTinyFrames - 1);
  CHECK(one["per_frame"][0]["frame"] == 1);
  CHECK(one["per_frame"][2]["mpjpe_mm"].get<double>() ==
        Approx(summary["per_frame"][2]["mpjpe_mm"].get<double>()).margin(1e-9));
  const double a = one["mpjpe_mm"], b = both["results"][1]["mpjpe_mm"];
  CHECK(a != b);
  CHECK(both["mean"]["mpjpe_mm"].get<double>() == Approx((a + b) / 2));
  CHECK(both["std"]["mpjpe_mm"].get<double>() == Approx(std::fabs(a - b) / std::sqrt(2)));

  const nlohmann::json apart = evaluated({"one", "two"});  // other iterations: a mean says nothing
  CHECK(apart["results"].size() == 2);
  CHECK_FALSE((apart.contains("mean") || apart.contains("std")));
  CHECK_THAT(run_hsi4d({"evaluate", "one", "two"}).out, !Contains("mean"));
  CHECK_THAT(run_hsi4d({"evaluate", "one", "three/motion.npz", "--truth", TinyDataset::folder().string()}).out,
             !Contains("mean"));

  const ProgramResult table = run_hsi4d({"evaluate", "one", "three"});
  CHECK(table.err.empty());
  CHECK_THAT(table.out, StartsWith("                         one") && Contains("mean ± std\nMPJPE [mm] ") &&
                            Contains("\n\none: frames 1 to 3 at 10 a second, against " + data("truth") + "\n"));
  CHECK_THAT(run_hsi4d({"evaluate", "one"}).out, !Contains("mean"));

  SECTION("a motion has what is known of its body, on the dataset's avatar") {
    const nlohmann::json motion = evaluated({"one/motion.npz", "--truth", TinyDataset::folder().string()});
    for (const char* name : {"mpjpe_mm", "pa_mpjpe_mm", "world_mpjpe_depth_mm", "root_translation_mm", "jitter"})
      CHECK(motion["results"][0][name] == one[name]);
    for (const char* name : {"object_translation_cm", "camera_rotation_deg"})
      CHECK_FALSE(motion["results"][0].contains(name));
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
    CHECK(refused({"two"}) ==
          "hsi4d evaluate: two: the run's config names no truth that is there (of a chain: of each clip); --truth says "
          "what it is compared with\n");
    CHECK(evaluated({"two", "--truth", data("truth")})["results"][0]["mpjpe_mm"] == b);
  }
}

TEST_CASE("what evaluate cannot compare is told") {
  const TemporaryFolder here;
  const std::string motion = data("initial_motion.npz"), truth = TinyDataset::folder().string();
  CHECK(refused({motion}) == "hsi4d evaluate: " + motion +
                                 ": --truth says what it is compared with: a dataset of hsi4d synth, or a motion\n");
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
             Contains("objects.npz: holds 4 frames, the motion beside it has 5 frames"));
  CHECK(refused({}).find("RUN") != std::string::npos);
}
