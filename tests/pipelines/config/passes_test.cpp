#include "pipelines/config/passes.h"

#include <algorithm>

#include <catch2/catch.hpp>

#include "optim/loss_term.h"
#include "pipelines/config/parameter_groups.h"
#include "pipelines/config/run_config.h"
#include "pipelines/config/run_notes.h"
#include "tests/support/temporary_folder.h"

namespace passes_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

constexpr const char* kStages = R"({
  "passes": {"count": 3, "iterations_share": 0.5, "lr_share": 0.1, "smooth_share": 0.2},
  "stages": {
    "first": {"over": "first_frame", "iterations": 9, "optimize": {"transl": {"lr": 1}}, "losses": {"photometric": {}}},
    "camera": {"iterations": 20, "draw": "scene", "optimize": {"camera": {"lr": 1}}, "losses": {"photometric": {}}},
    "interaction": {
      "iterations": 9,
      "optimize": {
        "transl": {"lr": 1}, "body_pose": {"lr": 2, "from": 8}, "global_orient": {"lr": 2, "from": 2, "until": 3},
        "color_net": {"lr": 3}
      },
      "losses": {"photometric": {"weight": 2}}
    },
    "refinement": {
      "over": "sequence", "iterations": 5, "optimize": {"transl": {"lr": 4}}, "losses": {"fit": {}, "smooth": {"weight": 0.5}}
    }
  }
})";

RunConfig config_of(const std::vector<std::string>& overrides = {}) {
  const TemporaryFolder here;
  here.write("config.json", kStages);
  return load_run_config("config.json", overrides, descriptions_of(loss_terms()));
}

double rate(const StageSettings& stage, const char* group) { return find_entry(stage.optimize, group)->lr; }

}  // namespace

TEST_CASE("passes are copies of the stages that draw everything and of those over the sequence") {
  const RunConfig asked = config_of(), config = with_passes(asked);
  std::vector<std::string> names;
  for (const auto& [name, stage] : config.stages) names.push_back(name);
  CHECK(names == std::vector<std::string>{"first", "camera", "interaction", "refinement", "interaction_2",
                                          "refinement_2", "interaction_3", "refinement_3"});
  CHECK(config.passes.count == 1);
  for (const std::size_t copy : {4u, 6u}) {
    const StageSettings& stage = config.stages[copy].second;
    CHECK(stage.iterations == 5);
    CHECK(rate(stage, kTranslGroup) == Approx(0.1));
    CHECK(rate(stage, kColorNetGroup) == 3);  // goes on learning
    CHECK(find_entry(stage.optimize, "body_pose")->from == 4);
    CHECK(find_entry(stage.optimize, kOrientGroup)->from == 1);
    CHECK(find_entry(stage.optimize, kOrientGroup)->until == 2);  // it moves in one iteration at least
    CHECK(find_entry(stage.losses, "photometric")->weight == 2);
    CHECK(config.stages[copy + 1].second.iterations == 5);
    CHECK(rate(config.stages[copy + 1].second, kTranslGroup) == 4);
    CHECK(find_entry(config.stages[copy + 1].second.losses, "fit")->weight == 1);
    CHECK(find_entry(config.stages[copy + 1].second.losses, "smooth")->weight == Approx(0.1));
  }
  const std::vector<LossDescription> losses = descriptions_of(loss_terms());
  CHECK(resolved_config(with_passes(config), losses) == resolved_config(config, losses));
  CHECK(resolved_config(with_passes(config_of({"passes.count=1"})), losses) ==
        resolved_config(
            config_of({"passes={\"count\": 1, \"iterations_share\": 0.67, \"lr_share\": 0.5, \"smooth_share\": 1}"}),
            losses));
}

TEST_CASE("without a stage over the sequence there is one pass, and a run warns of it") {
  const RunConfig config = config_of({"stages.refinement=null"});
  CHECK(are_passes_idle(config));
  CHECK(with_passes(config).stages.size() == config.stages.size());
  const auto warns = [](const RunConfig& of) {
    const std::vector<RunNote> notes = run_notes(of);
    return std::any_of(notes.begin(), notes.end(), [](const RunNote& note) {
      return note.level == LogLevel::kWarning && note.text.find("passes.count does nothing") != std::string::npos;
    });
  };
  CHECK(warns(config));
  CHECK_FALSE(warns(config_of()));
}

TEST_CASE("a stage that has the name of a further pass is refused") {
  const TemporaryFolder here;
  here.write("config.json", R"({
    "passes": {"count": 2},
    "stages": {
      "a": {"iterations": 1, "optimize": {"transl": {"lr": 1}}, "losses": {"photometric": {}}},
      "a_2": {"iterations": 1, "optimize": {"transl": {"lr": 1}}, "losses": {"photometric": {}}},
      "r": {"over": "sequence", "iterations": 1, "optimize": {"transl": {"lr": 1}}, "losses": {"fit": {}}}
    }})");
  CHECK_THROWS_WITH(load_run_config("config.json", {}, descriptions_of(loss_terms()), ConfigUse::kStages),
                    Contains("/passes/count: further passes need the names of the stages a_2; allowed: 1, or other "
                             "names of these stages"));
  CHECK_THROWS_WITH(config_of({"passes.count=0"}), Contains("/passes/count"));
  CHECK_THROWS_WITH(config_of({"passes.iterations_share=0"}), Contains("/passes/iterations_share"));
}

}  // namespace passes_test
