// The sweeps that come with the program.
#include <filesystem>

#include <catch2/catch.hpp>

#include "optim/loss_term.h"
#include "pipelines/sweep_plan.h"
#include "tests/support/program.h"
#include "tests/support/temporary_folder.h"

using namespace hsi4d;
using namespace hsi4d::test;
namespace fs = std::filesystem;

TEST_CASE("every shipped sweep can be planned") {
  const TemporaryFolder here;
  int count = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(HSI4D_SOURCE_DIR) / "configs" / "sweeps")) {
    if (entry.path().extension() != ".json") continue;
    INFO(entry.path());
    CHECK(plan_sweep(entry.path(), descriptions_of(loss_terms())).name == entry.path().stem().string());
    ++count;
  }
  CHECK(count >= 1);
}

TEST_CASE("the smoke sweep is computed", "[full]") {
  const TemporaryFolder here;
  const std::string file = (fs::path(HSI4D_SOURCE_DIR) / "configs" / "sweeps" / "smoke.json").string();
  CHECK(run_hsi4d({"check", file}).out == file + ": OK, a sweep of 4 runs\n");
  const ProgramResult sweep = run_hsi4d({"sweep", file});
  INFO(sweep.err);
  CHECK(sweep.status == 0);
  CHECK(sweep.out.find("\n4 runs: 4 done\n") != std::string::npos);
  CHECK(fs::exists("runs/smoke/report.html"));
}
