#include "bench/stages.h"

#include <algorithm>
#include <utility>

#include <nlohmann/json.hpp>

#include "bench/machine.h"
#include "bench/timing.h"
#include "core/simd.h"
#include "core/table.h"
#include "pipelines/report/figure.h"

namespace hsi4d {

namespace {

/// A part of an iteration, for tables and plots: an operator, or what is in none.
struct CostPart {
  std::string name;
  double forward_ms = 0, backward_ms = 0;  ///< an iteration
  Index forward_runs = 0, forward_skips = 0, backward_runs = 0;

  double ms() const { return forward_ms + backward_ms; }
};

double per_iteration(double seconds, const StageCost& cost) {
  return cost.sum.iterations > 0 ? 1e3 * seconds / static_cast<double>(cost.sum.iterations) : 0;
}

double per_iteration(Index count, const StageCost& cost) {
  return cost.sum.iterations > 0 ? static_cast<double>(count) / static_cast<double>(cost.sum.iterations) : 0;
}

/// Millions of fragments a second of whole iterations, by the median.
double mfragments_per_s(const StageCost& cost) {
  const double ms = cost.median_ms();
  return ms > 0 ? per_iteration(cost.sum.counters.fragments, cost) / ms / 1e3 : 0;
}

void add_operators(const std::vector<OperatorProfile>& more, std::vector<OperatorProfile>& operators) {
  for (const OperatorProfile& o : more) {
    const auto is_it = [&o](const OperatorProfile& known) { return known.name == o.name; };
    const auto place = std::find_if(operators.begin(), operators.end(), is_it);
    if (place == operators.end()) {
      operators.push_back(o);
      continue;
    }
    place->nodes = std::max(place->nodes, o.nodes);
    place->forward_runs += o.forward_runs;
    place->forward_skips += o.forward_skips;
    place->backward_runs += o.backward_runs;
    place->forward_seconds += o.forward_seconds;
    place->backward_seconds += o.backward_seconds;
  }
}

/// Operators, the largest first; then the tape's own time and the steps.
std::vector<CostPart> parts_of(const StageCost& cost) {
  std::vector<CostPart> parts;
  double forward = 0, backward = 0;
  for (const OperatorProfile& o : cost.sum.operators) {
    parts.push_back({o.name, per_iteration(o.forward_seconds, cost), per_iteration(o.backward_seconds, cost),
                     o.forward_runs, o.forward_skips, o.backward_runs});
    forward += o.forward_seconds;
    backward += o.backward_seconds;
  }
  std::stable_sort(parts.begin(), parts.end(), [](const CostPart& a, const CostPart& b) { return a.ms() > b.ms(); });
  const StageTimes& times = cost.sum.times;
  parts.push_back({"the tape itself", per_iteration(times.forward - forward, cost),
                   per_iteration(times.backward - backward, cost), 0, 0, 0});
  parts.push_back({"checks and steps", 0, per_iteration(times.step, cost), 0, 0, 0});
  return parts;
}

double allocations_each(const StageCost& cost) {
  return static_cast<double>(cost.sum.allocations) / static_cast<double>(cost.sum.counted);
}

void add_stage(const StageCost& cost, Table& table) {
  const RenderCounters& c = cost.sum.counters;
  const auto all = static_cast<double>(cost.sum.tiles_of_image);
  const auto number = [&](Index count) { return all > 0 ? Cell(per_iteration(count, cost), 0) : kNoCell; };
  const Cell tiles = all > 0 ? Cell(number(c.tiles).text + " of " + fixed_number(all, 0)) : kNoCell;
  table.rows.push_back({cost.stage, cost.sum.iterations, Cell(cost.ms_each(), 2), Cell(cost.median_ms(), 2),
                        Cell(cost.sum.seconds, 1), tiles, number(c.pairs), number(c.fragments),
                        cost.sum.counted > 0 ? Cell(allocations_each(cost), 2) : kNoCell,
                        Cell(1e-6 * static_cast<double>(cost.sum.tape_bytes), 1)});
}

std::string part_lines(const StageCost& cost) {
  const double whole = per_iteration(cost.sum.times.forward + cost.sum.times.backward + cost.sum.times.step, cost);
  Table table{.head = {cost.stage + ", ms an iteration", "forward", "back"}, .align = "lr"};
  for (const CostPart& part : parts_of(cost)) {
    if (part.ms() > 0)
      table.rows.push_back({"  " + part.name, Cell(part.forward_ms, 3), Cell(part.backward_ms, 3),
                            fixed_number(100 * part.ms() / whole, 1) + " %"});
  }
  return table_text(table);
}

/// Steps of the operator `composite`, by name; ms an iteration.
std::vector<std::pair<std::string, double>> composite_steps(const StageCost& cost) {
  const RenderTimes& t = cost.sum.counters.times;
  std::vector<std::pair<std::string, double>> steps;
  for (const auto& [name, seconds] : {std::pair{"still", t.still_s},
                                      {"records", t.records_s},
                                      {"sort", t.sort_s},
                                      {"bin", t.bin_s},
                                      {"forward", t.forward_s},
                                      {"backward", t.backward_s},
                                      {"reduce", t.reduce_s}})
    steps.emplace_back(name, per_iteration(seconds, cost));
  return steps;
}

std::string composite_line(const StageCost& cost) {
  if (cost.sum.tiles_of_image == 0) return "";
  std::string text = "  of composite:";
  for (const auto& [name, ms] : composite_steps(cost)) text += formatted(" %s %.2f", name.c_str(), ms);
  return text + "\n";
}

/// Steps of one curvature, by name; ms, medians over the frames.
std::vector<std::pair<std::string, double>> curvature_steps(const StageCost& cost) {
  std::vector<std::pair<std::string, double>> steps;
  for (const auto& [name, step] : {std::pair{"weights", &CurvatureTimes::weights},
                                   {"twists", &CurvatureTimes::twists},
                                   {"renders", &CurvatureTimes::renders},
                                   {"residuals", &CurvatureTimes::residuals},
                                   {"movers", &CurvatureTimes::movers}}) {
    std::vector<double> ms;
    for (const CurvatureCost& one : cost.curvatures) ms.push_back(1e3 * one.times.*step);
    steps.emplace_back(name, median_of(ms));
  }
  return steps;
}

double curvature_ms(const StageCost& cost) {
  std::vector<double> ms;
  for (const CurvatureCost& one : cost.curvatures) ms.push_back(1e3 * one.times.sum());
  return median_of(ms);
}

std::string curvature_line(const StageCost& cost) {
  if (cost.curvatures.empty()) return "";
  const CurvatureCost& last = cost.curvatures.back();
  std::string text = formatted("  one curvature of %lld numbers by %lld movers: %.2f ms, %.1f times forward and back:",
                               static_cast<long long>(last.numbers), static_cast<long long>(last.movers),
                               curvature_ms(cost), curvature_ms(cost) / cost.evaluation_ms());
  for (const auto& [name, ms] : curvature_steps(cost)) text += formatted(" %s %.2f", name.c_str(), ms);
  return text + "\n";
}

}  // namespace

double StageCost::ms_each() const { return per_iteration(sum.iteration_seconds, *this); }

double StageCost::ms_each_of(double iterations) const {
  const double runs = static_cast<double>(ms_an_iteration.size()), rest = static_cast<double>(sum.iterations) - runs;
  if (!(runs > 0)) return 0;
  const double first = sum.first_seconds / runs;
  const double later = rest > 0 ? (sum.iteration_seconds - sum.first_seconds) / rest : first;
  return 1e3 * (first + (iterations - 1) * later) / iterations;
}

double StageCost::median_ms() const { return ms_an_iteration.empty() ? 0 : median_of(ms_an_iteration); }

double StageCost::min_ms() const {
  return ms_an_iteration.empty() ? 0 : *std::min_element(ms_an_iteration.begin(), ms_an_iteration.end());
}

double StageCost::evaluation_ms() const { return per_iteration(sum.times.forward + sum.times.backward, *this); }

void add_profile(const StageProfile& profile, std::vector<StageCost>& stages) {
  const auto is_it = [&profile](const StageCost& known) { return known.stage == profile.stage; };
  auto place = std::find_if(stages.begin(), stages.end(), is_it);
  if (place == stages.end()) {
    stages.push_back({});
    place = stages.end() - 1;
    place->stage = place->sum.stage = profile.stage;
  }
  StageProfile& sum = place->sum;
  place->frames += profile.frame ? 1 : 0;
  if (profile.iterations > 0)
    place->ms_an_iteration.push_back(1e3 * profile.iteration_seconds / static_cast<double>(profile.iterations));
  if (profile.curvature) place->curvatures.push_back(*profile.curvature);
  sum.iterations += profile.iterations;
  sum.seconds += profile.seconds;
  sum.iteration_seconds += profile.iteration_seconds;
  sum.first_seconds += profile.first_seconds;
  sum.times.forward += profile.times.forward;
  sum.times.backward += profile.times.backward;
  sum.times.step += profile.times.step;
  sum.counters += profile.counters;
  sum.tape += profile.tape;
  sum.allocations += profile.allocations;
  sum.counted += profile.counted;
  sum.pixels_of_image = profile.pixels_of_image;
  sum.tiles_of_image = profile.tiles_of_image;
  sum.nodes = std::max(sum.nodes, profile.nodes);
  sum.tape_bytes = std::max(sum.tape_bytes, profile.tape_bytes);
  add_operators(profile.operators, sum.operators);
}

double optimisation_seconds(const RunCost& cost) {
  double seconds = 0;
  for (const StageCost& stage : cost.stages) seconds += stage.sum.iteration_seconds;
  return seconds;
}

std::string cost_table(const RunCost& cost) {
  Table table{
      .head = {"stage", "iterat.", "ms each", "median", "all, s", "tiles", "pairs", "fragments", "allocat.", "tape MB"},
      .align = "lr"};
  for (const StageCost& stage : cost.stages) add_stage(stage, table);
  std::string text = table_text(table);
  for (const StageCost& stage : cost.stages)
    text += "\n" + part_lines(stage) + composite_line(stage) + curvature_line(stage);
  return text + formatted("\noptimisation %.1f s of %.1f s on %d threads (%s), at most %.0f MB\n",
                          optimisation_seconds(cost), cost.seconds, cost.threads, isa_name(best_isa()),
                          1e-6 * static_cast<double>(cost.peak_memory_bytes));
}

std::string cost_json(const RunCost& cost) {
  std::string text;
  for (const StageCost& stage : cost.stages) {
    const StageProfile& sum = stage.sum;
    nlohmann::ordered_json entry = {{"name", "stages/" + stage.stage},
                                    {"stage", stage.stage},
                                    {"threads", cost.threads},
                                    {"ms", stage.ms_each()},
                                    {"median_ms", stage.median_ms()},
                                    {"min_ms", stage.min_ms()},
                                    {"repeats", stage.ms_an_iteration.size()},
                                    {"frames", stage.frames},
                                    {"iterations", sum.iterations},
                                    {"seconds", sum.seconds},
                                    {"nodes", sum.nodes},
                                    {"forward_nodes", per_iteration(sum.tape.forward_nodes, stage)},
                                    {"backward_nodes", per_iteration(sum.tape.backward_nodes, stage)},
                                    {"adjoint_numbers", per_iteration(sum.tape.adjoint_numbers, stage)},
                                    {"tape_bytes", sum.tape_bytes}};
    if (sum.tiles_of_image > 0)
      entry.update({{"pixels", sum.pixels_of_image},
                    {"tiles_of_image", sum.tiles_of_image},
                    {"gaussians", per_iteration(sum.counters.gaussians, stage)},
                    {"tiles", per_iteration(sum.counters.tiles, stage)},
                    {"pairs", per_iteration(sum.counters.pairs, stage)},
                    {"fragments", per_iteration(sum.counters.fragments, stage)},
                    {"mfragments_per_s", mfragments_per_s(stage)},
                    {"adjoint_tiles", per_iteration(sum.counters.adjoint_tiles, stage)},
                    {"layers", per_iteration(sum.counters.layers, stage)},
                    {"dirty_tiles", per_iteration(sum.counters.dirty_tiles, stage)},
                    {"composite_ms", composite_steps(stage)}});
    if (!stage.curvatures.empty())
      entry.update({{"curvature_numbers", stage.curvatures.back().numbers},
                    {"curvature_movers", stage.curvatures.back().movers},
                    {"curvature_ms", curvature_ms(stage)},
                    {"curvature_steps_ms", curvature_steps(stage)}});
    if (sum.counted > 0) entry["allocations"] = allocations_each(stage);
    text += bench_line(entry.dump());
    for (const CostPart& part : parts_of(stage)) {
      const nlohmann::ordered_json of_part = {{"stage", stage.stage},
                                              {"operator", part.name},
                                              {"forward_ms", part.forward_ms},
                                              {"backward_ms", part.backward_ms},
                                              {"forward_runs", part.forward_runs},
                                              {"forward_skips", part.forward_skips},
                                              {"backward_runs", part.backward_runs}};
      text += of_part.dump() + "\n";
    }
  }
  return text + bench_line(nlohmann::ordered_json{{"name", "stages"},
                                                  {"threads", cost.threads},
                                                  {"optimisation_s", optimisation_seconds(cost)},
                                                  {"seconds", cost.seconds},
                                                  {"peak_memory_bytes", cost.peak_memory_bytes}}
                               .dump());
}

namespace {

/// The operators that get a colour, the costliest of all stages first.
std::vector<std::string> costliest_parts(const RunCost& cost) {
  constexpr std::size_t kColors = 8;
  std::vector<CostPart> all;
  for (const StageCost& stage : cost.stages) {
    const std::vector<CostPart> parts = parts_of(stage);
    all.insert(all.end(), parts.begin(), parts.end());
  }
  std::stable_sort(all.begin(), all.end(), [](const CostPart& a, const CostPart& b) { return a.ms() > b.ms(); });
  std::vector<std::string> names;
  for (const CostPart& part : all) {
    if (names.size() < kColors && std::find(names.begin(), names.end(), part.name) == names.end())
      names.push_back(part.name);
  }
  return names;
}

std::string color_of(const std::string& name, const std::vector<std::string>& costliest) {
  const auto place = std::find(costliest.begin(), costliest.end(), name);
  return place == costliest.end() ? "#b5b5b5" : part_color(static_cast<std::size_t>(place - costliest.begin()));
}

}  // namespace

std::string cost_svg(const RunCost& cost, const std::string& title) {
  double longest = 0;
  for (const StageCost& stage : cost.stages) longest = std::max(longest, stage.ms_each());
  const std::vector<std::string> costliest = costliest_parts(cost);
  PictureSection section{.title = title, .columns = 1};
  for (const StageCost& stage : cost.stages) {
    std::vector<CostPart> parts = parts_of(stage);
    std::stable_sort(parts.begin(), parts.end(), [](const CostPart& a, const CostPart& b) { return a.ms() > b.ms(); });
    std::vector<BarPart> bar;
    for (const CostPart& part : parts)
      bar.push_back({part.name, std::max(0.0, part.ms()), color_of(part.name, costliest)});
    Plot plot = bar_plot(stage.stage + ": " + fixed_number(stage.ms_each(), 2) + " ms an iteration", "ms", bar, 0.02);
    plot.also = {longest};
    plot.width = 930;
    section.plots.push_back(std::move(plot));
  }
  return picture_svg({section});
}

}  // namespace hsi4d
