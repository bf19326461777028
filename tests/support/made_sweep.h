// A sweep whose runs nobody has computed: made-up results, and programs that stand in for hsi4d.
#pragma once

#include <algorithm>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "pipelines/sweep/local.h"
#include "pipelines/sweep/results.h"
#include "tests/support/temporary_folder.h"

namespace hsi4d::test {

/// A sweep whose runs have made-up results: ablations plain and other, clips a and b, seeds 0 to 2.
class MadeSweep {
 public:
  /// @param change  what is other than that
  explicit MadeSweep(const std::function<void(SweepPlan&)>& change = {}) {
    plan_.name = "made";
    plan_.compare = {{"ablation", "plain"}};
    for (const char* ablation : {"plain", "other"}) {
      for (const char* clip : {"a", "b"}) {
        for (const char* seed : {"0", "1", "2"}) {
          SweepRun run;
          run.id =
              std::string(15 - std::to_string(plan_.runs.size()).size(), '0') + "f" + std::to_string(plan_.runs.size());
          run.ablation = ablation;
          run.clip = clip;
          run.seed = seed;
          run.config = "{}";
          plan_.runs.push_back(run);
        }
      }
    }
    if (change) change(plan_);
    write_sweep_plan(paths_, plan_, false);
  }

  /// A run that is done with this error.
  void finish(std::size_t index, double mpjpe) { finish_with(index, std::to_string(mpjpe)); }
  /// Likewise with the error as its summary has it: null, or no JSON at all.
  void finish_with(std::size_t index, const std::string& mpjpe) {
    const RunPaths run{paths_.run(plan_.runs[index].id)};
    here_.write(run.status(), R"({"state": "done"})");
    here_.write(run.summary(), R"({"name": "x", "frames": 4, "seconds": 2, "truth": true, "metrics": [
      {"stage": "interaction", "seconds": 1, "iterations": 5, "mpjpe_mm": 99},
      {"stage": "refinement", "seconds": 1, "iterations": 5, "mpjpe_mm": )" +
                                   mpjpe + R"(}],
      "baselines": {}, "per_frame": [], "baselines_per_frame": {}})");
  }

  void finish_all() {
    // plain: seeds 0, 1, 2 of clip a, then of b; other: 1, 2, 6 more in clip a, 3 more in b.
    const double errors[] = {10, 20, 30, 40, 50, 60, 11, 22, 36, 43, 53, 63};
    for (std::size_t i = 0; i < std::min<std::size_t>(12, plan_.runs.size()); ++i) finish(i, errors[i]);
  }

  SweepResults read() const { return read_sweep_results(paths_); }
  const SweepPaths& paths() const { return paths_; }
  const SweepPlan& plan() const { return plan_; }
  const std::string& id(std::size_t index) const { return plan_.runs[index].id; }
  const TemporaryFolder& here() const { return here_; }

 private:
  TemporaryFolder here_;
  SweepPaths paths_{"made"};
  SweepPlan plan_;
};

}  // namespace hsi4d::test
