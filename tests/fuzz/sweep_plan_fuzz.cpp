// Any bytes as the plan of a sweep's folder. What is taken is written and read back to the same text.
#include "core/check.h"
#include "pipelines/sweep/plan.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz::sweep_plan_fuzz {

namespace {

SweepPlan small_plan() {
  SweepPlan plan;
  plan.name = "a";
  plan.threads = 2;
  plan.memory_mb = 512.5;
  plan.slurm.time = "02:00:00";
  plan.slurm.options = {"--account=hsi"};
  plan.compare = {{"ablation", "plain"}, {"render.blur", "0.13"}};
  plan.runs.push_back(
      {"0123456789abcdef", "one", "walk", "plain", "0", {{"render.blur", "0.13"}}, "fedcba9876543210", ""});
  plan.runs.push_back({"0123456789abcdee", "", "", "", "", {}, "", "", 1});
  plan.hours = 1.5;
  plan.memory_retries = 1;
  plan.searches = {{"one", "mpjpe_mm", {{"stages.a.lr", true}, {"color_net.use", false}}, {"last_frame"}, 3},
                   {"", "ssim", {{"render.blur", false}}, {}, 2}};
  return plan;
}

}  // namespace

std::vector<Bytes> corpus() {
  const std::string text = sweep_plan_json(small_plan());
  return {Bytes(text.begin(), text.end())};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    const SweepPlan plan = parse_sweep_plan(std::string(file.begin(), file.end()), "sweep.json");
    HSI4D_CHECK(plan.threads >= 0 && plan.memory_mb >= 0, "a number that no plan has");
    const std::string once = sweep_plan_json(plan);
    HSI4D_CHECK_EQ(sweep_plan_json(parse_sweep_plan(once, "sweep.json")), once);
    HSI4D_CHECK(distinct_runs(plan).size() <= plan.runs.size(), "runs that the plan has not");
    for (const SweepRun& run : plan.runs) HSI4D_CHECK(!sweep_label(run).empty(), "a run without a name");
  });
}

const Target target("sweep_plan", corpus, accepts);

}  // namespace hsi4d::fuzz::sweep_plan_fuzz
