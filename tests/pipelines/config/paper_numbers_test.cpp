// The numbers that the paper's supplementary text gives (C.2 to C.6, D.1), as the shipped configs resolve to them, and
// the choices that it leaves open (docs/numerics/measurements.md).
#include <algorithm>
#include <filesystem>
#include <string>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/check.h"
#include "core/file.h"
#include "optim/loss_term.h"
#include "optim/losses/list.h"
#include "optim/metrics.h"
#include "pipelines/config/run_config.h"
#include "tests/support/temporary_folder.h"

namespace paper_numbers_test {

using namespace hsi4d;
using Catch::Matchers::Message;
using hsi4d::test::TemporaryFolder;
namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace {

fs::path shipped(const std::string& name) { return fs::path(HSI4D_SOURCE_DIR) / "configs" / name; }

Json resolved(const std::string& name) {
  const std::vector<LossDescription> losses = descriptions_of(loss_terms());
  return Json::parse(resolved_config(load_run_config(shipped(name), {}, losses), losses));
}

/// A number of the text, where a config has it, and where the text has it.
struct PaperNumber {
  const char* pointer;
  double value;
  const char* from;
};

constexpr PaperNumber kNumbers[] = {
    {"/stages/camera/iterations", 30, "C.2"},
    {"/stages/camera/optimize/camera/lr", 0.001, "C.2"},
    {"/stages/interaction/iterations", 300, "C.2"},
    {"/stages/interaction/optimize/transl/lr", 0.01, "C.2"},
    {"/stages/interaction/optimize/transl/from", 0, "C.2"},
    {"/stages/interaction/optimize/global_orient/lr", 0.01, "C.2"},
    {"/stages/interaction/optimize/global_orient/from", 0, "C.2"},
    {"/stages/interaction/optimize/body_pose/lr", 0.01, "C.2"},
    {"/stages/interaction/optimize/body_pose/from", 30, "C.2: 30 of root alone"},
    {"/stages/interaction/optimize/left_hand_pose/lr", 0.01, "C.2"},
    {"/stages/interaction/optimize/left_hand_pose/from", 30, "C.2"},
    {"/stages/interaction/optimize/right_hand_pose/lr", 0.01, "C.2"},
    {"/stages/interaction/optimize/right_hand_pose/from", 30, "C.2"},
    {"/stages/interaction/optimize/object_orient/lr", 0.01, "C.2"},
    {"/stages/interaction/optimize/object_transl/lr", 0.01, "C.2"},
    {"/stages/interaction/optimize/color_net/lr", 1e-5, "C.2"},
    {"/stages/interaction/optimize/color_net/every", 5, "C.2"},
    {"/stages/interaction/losses/photometric/weight", 1, "C.2"},
    {"/stages/interaction/losses/photometric/ssim_share", 0.1, "C.2: λ"},
    {"/stages/interaction/losses/center/weight", 0.001, "C.2"},
    {"/stages/interaction/losses/depth/weight", 0.001, "C.2"},
    {"/camera_selection/above_pelvis_m", 0.1, "C.3"},
};

constexpr PaperNumber kRefinement[] = {
    {"/stages/refinement/iterations", 1000, "C.2"},
    {"/stages/refinement/optimize/transl/lr", 0.05, "C.2"},
    {"/stages/refinement/optimize/global_orient/lr", 0.05, "C.2"},
    {"/stages/refinement/optimize/pose_latents/lr", 0.05, "C.2"},
    {"/stages/refinement/losses/fit/weight", 1, "Eq. 15"},
    {"/stages/refinement/losses/contact/weight", 0.001 * 1, "C.2, C.4: λ_physics λ_contact"},
    {"/stages/refinement/losses/smooth/order", 1, "C.4"},
};

template <std::size_t N>
void check_numbers(const Json& config, const PaperNumber (&numbers)[N]) {
  for (const PaperNumber& number : numbers) {
    INFO(number.pointer << ", " << number.from);
    const Json::json_pointer at(number.pointer);
    REQUIRE(config.contains(at));
    CHECK(config[at].get<double>() == Approx(number.value).epsilon(1e-12));
  }
}

void check_names(const Json& stages, std::initializer_list<const char*> names) {
  CHECK(stages.size() == names.size());
  for (const char* name : names) CHECK(stages.contains(name));
}

}  // namespace

TEST_CASE("the paper's numbers are those of its configs") {
  const Json dynamic = resolved("paper.json"), still = resolved("paper_static.json");
  for (const Json& config : {dynamic, still}) {
    check_numbers(config, kNumbers);
    check_numbers(config, kRefinement);
    CHECK_FALSE(config["camera_selection"]["by_cover"].get<bool>());
    CHECK(config["stages"]["camera"]["weight"] == "unoccluded");  // D.1: of all frames so far
    CHECK(config["stages"]["camera"]["draw"] == "scene");
    CHECK(config["color_net"]["use"] == "on");
    for (const auto& [name, stage] : config["stages"].items()) CHECK(stage["optimizer"]["kind"] == "adam");
    CHECK(config["stages"]["refinement"]["losses"]["contact"]["points"] == "vertices");  // C.4: hand vertices
    CHECK(config["stages"]["refinement"]["losses"]["fit"]["joints"] == "mean");  // Alg. 1: the L2 of the camera's loss
    CHECK(config["stages"]["refinement"]["losses"]["smooth"]["frames"] == "sum");  // S4: no 1/T before L_smooth
    CHECK(config["camera"]["increment"] == "scene");
    for (const char* stage : {"camera", "interaction", "refinement"}) {
      for (const auto& [name, group] : config["stages"][stage]["optimize"].items()) {
        INFO(stage << ", " << name);
        // C.2 has one number a group. That of poses and objects falls to a tenth, which is inferred.
        const bool falls = stage == std::string("interaction") && name != "color_net";
        CHECK(group["lr_final_share"] == (falls ? 0.1 : 1));
        if (stage != std::string("interaction")) CHECK(group["from"] == 0);
      }
    }
    const Json& center = config["stages"]["interaction"]["losses"]["center"];
    CHECK(center["unit"] == "ndc");
    CHECK(center["norm"] == "squared");
    CHECK(center["moves"] == "object");
    check_names(config["stages"], {"camera", "interaction", "refinement"});
    check_names(config["stages"]["camera"]["losses"], {"masked_l2"});
    check_names(config["stages"]["interaction"]["losses"], {"photometric", "center", "depth"});
    check_names(config["stages"]["refinement"]["losses"], {"fit", "contact", "smooth"});
  }
  // C.4: λ_physics λ_smooth.
  CHECK(dynamic["stages"]["refinement"]["losses"]["smooth"]["weight"].get<double>() == Approx(0.001 * 0.1));
  CHECK(still["stages"]["refinement"]["losses"]["smooth"]["weight"].get<double>() == Approx(0.001 * 0.3));
  CHECK(kMetricJoints == 22);  // C.3
}

// Which frames those are: tests/pipelines/input/frame_source_test.cpp.
TEST_CASE("a video of 153 frames at 30 a second becomes a clip of 51 at 10") {
  const Json config = resolved("sources/kling.json");
  CHECK(config["sources"]["video"]["frames"] == 153);
  CHECK(config["data"]["video_rate"] == 30);
  CHECK(config["data"]["frame_rate"] == 10);
  CHECK(resolved("anyinteraction/base.json")["synthetic"]["frames"] == 51);
}

TEST_CASE("the paper's evaluation is 11 static and 9 dynamic instances of five seeds, without refinement") {
  const Json base = resolved("anyinteraction/base.json");
  check_numbers(base, kNumbers);
  check_names(base["stages"], {"camera", "interaction"});
  CHECK(base["synthetic"]["frame_rate"] == 10);
  for (const auto& [name, instances] : {std::pair{"anyinteraction_static", 11}, {"anyinteraction_dynamic", 9}}) {
    const Json sweep = Json::parse(read_text_file(shipped(std::string("sweeps/") + name + ".json").string()));
    CHECK(sweep["clips"].size() == static_cast<std::size_t>(instances));
    CHECK(sweep["seeds"] == 5);
  }
}

TEST_CASE("the paper's evaluation is paper.json without its refinement") {
  Json evaluated = resolved("anyinteraction/base.json"), paper = resolved("paper.json");
  CHECK(evaluated["stages"].size() == 2);
  CHECK(paper["stages"].erase("refinement") == 1);
  for (Json* const config : {&evaluated, &paper}) {
    for (const char* of_clips : {"name", "synthetic"}) config->erase(of_clips);
  }
  CHECK(evaluated["camera"] == paper["camera"]);
  CHECK(Json::diff(paper, evaluated).dump() == "[]");
}

TEST_CASE("a word that is none of a choice's is refused with its place and all that are") {
  struct Choice {
    const char* pointer;
    const char* words;
  };
  const TemporaryFolder here;
  for (const Choice& choice : {Choice{"/camera/increment", R"("camera", "world", "scene")"},
                               {"/stages/interaction/losses/center/unit", R"("pixels", "widths", "ndc")"},
                               {"/stages/interaction/losses/center/norm", R"("squared", "l1")"},
                               {"/stages/interaction/losses/center/moves", R"("all", "object")"},
                               {"/stages/refinement/losses/contact/points", R"("vertices", "gaussians")"},
                               {"/stages/refinement/losses/fit/joints", R"("sum", "mean")"},
                               {"/stages/refinement/losses/smooth/frames", R"("mean", "sum")"}}) {
    const std::string pointer = choice.pointer;
    nlohmann::ordered_json config = {{"extends", shipped("paper.json").string()}};
    config[nlohmann::ordered_json::json_pointer(pointer)] = "nowhere";
    here.write("a.json", config.dump(1));  // "extends" in line 2, then a line a key
    const auto line = 2 + std::count(pointer.begin(), pointer.end(), '/');
    CHECK_THROWS_MATCHES(load_run_config("a.json", {}, descriptions_of(loss_terms())), UserError,
                         Message("a.json:" + std::to_string(line) + ": " + pointer +
                                 ": \"nowhere\" is not one of the choices; allowed: " + choice.words));
  }
}

}  // namespace paper_numbers_test
