#include "pipelines/cli/gradcheck_command.h"

#include <sstream>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "tests/support/program.h"
#include "tests/support/tiny_run.h"

namespace gradcheck_command_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

/// A config on the tiny dataset, with kTinyStages and a stage over the sequence.
std::string config_of_three_stages(const TemporaryFolder& here) {
  const nlohmann::ordered_json refinement = nlohmann::ordered_json::parse(R"({
    "over": "sequence", "iterations": 5,
    "optimize": {"transl": {"lr": 0.05}, "pose_latents": {"lr": 0.05}},
    "losses": {"fit": {}, "smooth": {"weight": 0.01}, "foot_sliding": {"weight": 0.3}}})");
  return here.write(
      "three.json",
      nlohmann::ordered_json{{"extends", tiny_config_file()}, {"stages", {{"refinement", refinement}}}}.dump());
}

/// y = x, whose adjoint is a hundredth too large.
template <class S>
struct SlipOp {
  static constexpr const char* kName = "slip";
  void forward(NodeIo<S>& io) { io.out().scalar() = io.in(0).scalar(); }
  void backward(NodeIo<S>& io) { io.d_in(0).scalar() += io.d_out().scalar() * S(1.01); }
};

template <class S>
Var<S> slip(Var<S> x) {
  return x.owner().record(SlipOp<S>{}, {x}, kScalarShape, Source::current());
}

std::vector<nlohmann::json> lines_of(const std::string& file) {
  std::vector<nlohmann::json> lines;
  std::istringstream text(file_text(file));
  for (std::string line; std::getline(text, line);) lines.push_back(nlohmann::json::parse(line));
  return lines;
}

}  // namespace

TEST_CASE("gradcheck finds the gradients of every stage of a config right, on its own data", "[release]") {
  const TemporaryFolder here;
  const std::string config = config_of_three_stages(here);
  const auto groups_of = [&](const std::string& stage) {
    const ProgramResult result =
        run_hsi4d({"gradcheck", config, "--stage", stage, "--entries", "3", "--json", "g.json"});
    INFO(result.out << result.err);
    CHECK(result.status == 0);
    CHECK(result.err.empty());
    CHECK_THAT(result.out, Contains("stage " + stage + ", ") && Contains("WORST ERROR") && Contains("allowed: 1e-04"));
    std::vector<std::string> groups;
    for (const nlohmann::json& line : lines_of("g.json")) {
      INFO(line.dump());
      groups.push_back(line.at("group"));
      CHECK(line.at("stage") == stage);
      CHECK(line.at("verdict") == "right");
      CHECK(line.at("worst_error") <= 1e-4);
      CHECK(line.at("tried") > line.at("at_kinks"));
      CHECK(line.contains("frame") == (stage != "refinement"));
      if (line.contains("frame")) CHECK(line.at("frame") == 3);
    }
    return groups;
  };
  CHECK(groups_of("camera") == std::vector<std::string>{"camera"});
  CHECK(groups_of("interaction") ==
        std::vector<std::string>{"transl", "global_orient", "body_pose", "object_orient", "object_transl"});
  CHECK(groups_of("refinement") == std::vector<std::string>{"transl", "pose_latents"});
}

TEST_CASE("gradcheck tells of a loss term that is wrong, with status 1") {
  std::vector<LossTerm> losses = loss_terms();
  losses.push_back(
      make_loss_term("slip", "Is wrong", [](const auto& in) { return slip(mean(square(in.rendered - in.target))); }));
  cli::GradcheckArguments arguments;
  arguments.config = tiny_config_file();
  arguments.overrides = {R"(stages.interaction.losses={"slip": {}})",
                         R"(stages.interaction.optimize={"transl": {"lr": 1}})"};
  arguments.check.stage = "interaction";
  int status = 0;
  const std::string text = cli::gradcheck_command(arguments, losses, status);
  INFO(text);
  CHECK(status == 1);
  CHECK_THAT(text, Contains("WRONG") && Contains("transl: ") && Contains("is wrong at "));
}

TEST_CASE("gradcheck says what it cannot look at") {
  const TemporaryFolder here;
  const std::string config = config_of_three_stages(here);
  const auto refused = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"gradcheck", config});
    const ProgramResult result = run_hsi4d(more);
    CHECK(result.status == 2);
    CHECK(result.out.empty());
    return result.err;
  };
  CHECK(refused({"--stage", "camra"}) ==
        "hsi4d gradcheck: --stage: the config has no stage \"camra\"; known: camera, interaction, refinement; did you "
        "mean \"camera\"?\n");
  CHECK_THAT(refused({}), Contains("hsi4d gradcheck: --stage is required"));
  CHECK(refused({"--stage", "camera", "--frame", "4"}) == "hsi4d gradcheck: --frame: 4; allowed: 1 to 3\n");
  CHECK(refused({"--stage", "refinement", "--frame", "1"}) ==
        "hsi4d gradcheck: --frame: the stage is over all frames at once\n");
}

}  // namespace gradcheck_command_test
