// null in a config that extends another one leaves out what that has.
#include <catch2/catch.hpp>

#include "core/check.h"
#include "pipelines/config/run_config.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace taken_out_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

TEST_CASE("null leaves out an inherited stage, loss, group or section") {
  const TemporaryFolder here;
  here.write("base.json", kTinyStages);
  here.write("mine.json", R"({"extends": "base.json", "render": null,
    "stages": {"camera": null, "interaction": {"losses": {"depth": null}, "optimize": {"object_orient": null}}}})");
  const auto load = [](const char* file, const std::vector<std::string>& overrides = {}) {
    return load_run_config(file, overrides, descriptions_of(loss_terms()), ConfigUse::kStages);
  };
  const RunConfig config = load("mine.json");
  REQUIRE(config.stages.size() == 1);
  const StageSettings& stage = config.stages.front().second;
  CHECK(config.stages.front().first == "interaction");
  CHECK(find_entry(stage.losses, "depth") == nullptr);
  CHECK(find_entry(stage.losses, "center") != nullptr);
  CHECK(find_entry(stage.optimize, "object_orient") == nullptr);
  CHECK(config.render.blur == RunConfig().render.blur);  // as if nobody had said it
  CHECK(load("base.json", {"stages.camera=null"}).stages.size() == 1);

  here.write("mine.json", R"({"extends": "base.json", "stages": {"camra": null}})");
  CHECK_THROWS_WITH(load("mine.json"), Contains("/stages/camra: null is not an object, and takes none out"));
  here.write("mine.json", R"({"extends": "base.json", "stages": {"camera": null, "interaction": null}})");
  CHECK(load("mine.json").stages.empty());
}

}  // namespace taken_out_test
