#include "bench/skips.h"

#include <algorithm>
#include <utility>

#include <nlohmann/json.hpp>

#include "bench/machine.h"
#include "core/table.h"

namespace hsi4d {

namespace {

/// One stage with skips, and without.
struct StagePair {
  const StageCost& with;
  const StageCost& without;

  /// Without skips fewer iterations were run: what as many would have taken.
  double ms_without() const {
    return without.ms_each_of(static_cast<double>(with.sum.iterations) /
                              static_cast<double>(with.ms_an_iteration.size()));
  }
  double ratio() const { return ms_without() / with.ms_each(); }
};

/// Stages of both runs that draw, in order. In others all that is recorded moves, and what is recorded depends on where
/// they begin.
std::vector<StagePair> pairs_of(const RunCost& with, const RunCost& without) {
  std::vector<StagePair> pairs;
  for (const StageCost& stage : with.stages) {
    if (stage.sum.tiles_of_image == 0) continue;
    const auto other = std::find_if(without.stages.begin(), without.stages.end(),
                                    [&stage](const StageCost& known) { return known.stage == stage.stage; });
    if (other != without.stages.end()) pairs.push_back({stage, *other});
  }
  return pairs;
}

/// Seconds of the whole run without skips.
double seconds_without(const RunCost& with, const RunCost& without) {
  double seconds = with.seconds;
  for (const StagePair& pair : pairs_of(with, without))
    seconds += static_cast<double>(pair.with.sum.iterations) * 1e-3 * (pair.ms_without() - pair.with.ms_each());
  return seconds;
}

/// Counters that skips make smaller, an iteration.
std::vector<std::pair<const char*, double>> counters_of(const StageCost& cost) {
  const RenderCounters& render = cost.sum.counters;
  const TapeCounters& tape = cost.sum.tape;
  std::vector<std::pair<const char*, double>> counters;
  for (const auto& [name, count] : {std::pair{"forward_nodes", tape.forward_nodes},
                                    {"backward_nodes", tape.backward_nodes},
                                    {"adjoint_numbers", tape.adjoint_numbers},
                                    {"gaussians", render.gaussians},
                                    {"tiles", render.tiles},
                                    {"adjoint_tiles", render.adjoint_tiles},
                                    {"pairs", render.pairs},
                                    {"groups", render.groups},
                                    {"fragments", render.fragments}})
    counters.emplace_back(name,
                          static_cast<double>(count) / static_cast<double>(std::max<Index>(1, cost.sum.iterations)));
  return counters;
}

}  // namespace

RunConfig without_skips(RunConfig config, int iterations) {
  config.skip = no_skips();
  for (auto& [name, stage] : config.stages) {
    stage.iterations = std::min(stage.iterations, iterations);
    for (auto& [group, settings] : stage.optimize) settings.from = std::min(settings.from, stage.iterations - 1);
  }
  return config;
}

std::string comparison_table(const RunCost& with, const RunCost& without) {
  const auto with_unit = [](double value, int decimals, const char* unit) {
    return fixed_number(value, decimals) + unit;
  };
  Table table{.head = {"an iteration", "with skips", "without", "ratio"}, .align = "lr"};
  for (const StagePair& pair : pairs_of(with, without)) {
    table.rows.push_back({pair.with.stage, with_unit(pair.with.ms_each(), 2, " ms"),
                          with_unit(pair.ms_without(), 2, " ms"), Cell(pair.ratio(), 2)});
    const auto less = counters_of(pair.with), more = counters_of(pair.without);
    for (std::size_t i = 0; i < more.size(); ++i)
      if (more[i].second > 0)
        table.rows.push_back({std::string("  ") + more[i].first, Cell(less[i].second, 0), Cell(more[i].second, 0)});
  }
  const double seconds = seconds_without(with, without);
  table.rows.push_back(
      {"whole run", with_unit(with.seconds, 1, " s"), with_unit(seconds, 1, " s"), {seconds / with.seconds, 2}});
  return table_text(table);
}

std::string comparison_json(const RunCost& with, const RunCost& without) {
  std::string text;
  for (const StagePair& pair : pairs_of(with, without)) {
    nlohmann::ordered_json entry = {{"name", "stages/" + pair.with.stage + "/skips"},
                                    {"stage", pair.with.stage},
                                    {"threads", with.threads},
                                    {"ms", pair.with.ms_each()},
                                    {"ms_without_skips", pair.ms_without()},
                                    {"ratio", pair.ratio()},
                                    {"counters", nlohmann::ordered_json::object()},
                                    {"counters_without_skips", nlohmann::ordered_json::object()}};
    for (const auto& [name, count] : counters_of(pair.with)) entry["counters"][name] = count;
    for (const auto& [name, count] : counters_of(pair.without)) entry["counters_without_skips"][name] = count;
    text += bench_line(entry.dump());
  }
  const double seconds = seconds_without(with, without);
  return text + bench_line(nlohmann::ordered_json{{"name", "stages/skips"},
                                                  {"threads", with.threads},
                                                  {"seconds", with.seconds},
                                                  {"seconds_without_skips", seconds},
                                                  {"ratio", seconds / with.seconds}}
                               .dump());
}

}  // namespace hsi4d
