#include "pipelines/sweep/halving.h"

#include <algorithm>

#include "core/file.h"
#include "pipelines/record/summary.h"
#include "pipelines/sweep/statistics.h"

namespace hsi4d {
namespace {

bool has(const std::vector<std::string>& keys, const std::string& key) {
  return std::find(keys.begin(), keys.end(), key) != keys.end();
}

/// A run's values as text that equal values have in common.
/// @param takes  which keys
template <class Takes>
std::string values_text(const SweepRun& run, const Takes& takes) {
  std::string text;
  for (const auto& [key, value] : run.values) {
    if (takes(key)) text += key + " " + value + "\n";
  }
  return text;
}

}  // namespace

std::vector<std::size_t> best_points(const std::vector<std::optional<double>>& scores, int better, std::size_t count) {
  std::vector<std::size_t> order(scores.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    if (!scores[a] || !scores[b]) return scores[a].has_value() && !scores[b].has_value();
    return *scores[a] * better > *scores[b] * better;
  });
  order.resize(std::min(count, order.size()));
  std::sort(order.begin(), order.end());
  return order;
}

SweepTurns::SweepTurns(const SweepPlan& plan, DoneMetrics metrics)
    : plan_(plan), metrics_(std::move(metrics)), places_(plan.runs.size()) {
  for (std::size_t i = 0; i < plan.runs.size(); ++i) {
    const SweepRun& run = plan.runs[i];
    const PlannedSearch* const search = search_of(plan, run);
    if (search == nullptr || search->rung_keys.empty()) continue;
    const auto is_searched = [search](const std::string& key) {
      return std::any_of(search->over.begin(), search->over.end(),
                         [&](const SearchedKey& own) { return own.key == key; });
    };
    Place& place = places_[i];
    place.point = values_text(run, is_searched);
    place.bracket = run.block + "\n" + run.ablation + "\n" + values_text(run, [&](const std::string& key) {
                      return !is_searched(key) && !has(search->rung_keys, key);
                    });
    std::vector<Rung>& rungs = brackets_[place.bracket];
    if (rungs.size() <= run.rung) rungs.resize(run.rung + 1);
    auto& points = rungs[run.rung].points;
    const auto is_its = [&place](const auto& point) { return point.first == place.point; };
    auto point = std::find_if(points.rbegin(), points.rend(), is_its);  // its runs follow one another
    if (point == points.rend()) {
      points.emplace_back(place.point, std::vector<std::size_t>());
      point = points.rbegin();
    }
    point->second.push_back(i);
  }
}

SweepTurn SweepTurns::turn(std::size_t run, const std::function<bool(std::size_t)>& may_end) {
  const std::size_t rung = plan_.runs[run].rung;
  if (rung == 0 || places_[run].point.empty()) return SweepTurn::kNow;
  const std::set<std::string>* const computed = computed_points(places_[run].bracket, rung, may_end);
  if (computed == nullptr) return SweepTurn::kLater;
  return computed->contains(places_[run].point) ? SweepTurn::kNow : SweepTurn::kNever;
}

/// The points that are computed in a rung; null where that is not settled.
const std::set<std::string>* SweepTurns::computed_points(const std::string& bracket, std::size_t rung,
                                                         const std::function<bool(std::size_t)>& may_end) {
  std::vector<Rung>& rungs = brackets_[bracket];
  std::optional<std::set<std::string>>& computed = rungs[rung].computed;
  if (computed) return &*computed;
  std::set<std::string> all;
  for (const auto& [point, runs] : rungs[rung].points) all.insert(point);
  if (rung == 0 || rungs[rung - 1].points.empty()) return &computed.emplace(std::move(all));  // `only` may leave none
  const std::set<std::string>* const below = computed_points(bracket, rung - 1, may_end);
  if (below == nullptr) return nullptr;
  std::vector<std::string> points;
  std::vector<std::optional<double>> scores;
  const PlannedSearch& search = *search_of(plan_, plan_.runs[rungs[rung - 1].points.front().second.front()]);
  for (const auto& [point, runs] : rungs[rung - 1].points) {
    if (!below->contains(point)) continue;
    if (std::any_of(runs.begin(), runs.end(), may_end)) return nullptr;
    points.push_back(point);
    scores.push_back(score(runs, search.metric));
  }
  const std::size_t count = std::max<std::size_t>(1, points.size() / static_cast<std::size_t>(search.factor));
  computed.emplace();
  for (const std::size_t i : best_points(scores, find_metric_facts(search.metric)->better, count))
    computed->insert(points[i]);
  return &*computed;
}

std::optional<double> SweepTurns::score(const std::vector<std::size_t>& runs, const std::string& metric) const {
  std::vector<double> values;
  for (const std::size_t run : runs) {
    const std::optional<MetricValues> metrics = metrics_(run);
    const double* const value = metrics ? find_metric(*metrics, metric) : nullptr;
    if (value == nullptr) return std::nullopt;
    values.push_back(*value);
  }
  std::sort(values.begin(), values.end());
  return quantile(values, 0.5);
}

DoneMetrics done_metrics(const SweepPaths& paths, const SweepPlan& plan) {
  return [&paths, &plan](std::size_t run) -> std::optional<MetricValues> {
    const std::string& id = plan.runs[run].id;
    if (sweep_run_state(paths, id) != SweepRunState::kDone) return std::nullopt;
    const std::string file = RunPaths{paths.run(id)}.summary();
    return parse_summary(read_text_file(file), file).metrics.back().values;
  };
}

std::vector<SweepRunState> sweep_run_states(const SweepPaths& paths, const SweepPlan& plan) {
  std::vector<SweepRunState> states;
  for (const SweepRun& run : plan.runs) states.push_back(sweep_run_state(paths, run.id));
  SweepTurns turns(plan, done_metrics(paths, plan));
  const std::vector<SweepRunState> found = states;
  const auto may_end = [&found](std::size_t run) {
    return found[run] == SweepRunState::kNew || found[run] == SweepRunState::kStarted;
  };
  for (std::size_t i = 0; i < states.size(); ++i) {
    if (states[i] == SweepRunState::kNew && turns.turn(i, may_end) == SweepTurn::kNever)
      states[i] = SweepRunState::kLeftOut;
  }
  return states;
}

std::size_t left_out_by_halving(const SweepPlan& plan) {
  SweepTurns turns(plan, [](std::size_t) { return std::nullopt; });  // which points go on does not matter
  const std::vector<std::size_t> runs = distinct_runs(plan);
  return static_cast<std::size_t>(std::count_if(runs.begin(), runs.end(), [&turns](std::size_t run) {
    return turns.turn(run, [](std::size_t) { return false; }) == SweepTurn::kNever;
  }));
}

double spent_hours(const SweepPaths& paths, const SweepPlan& plan) {
  double seconds = 0;
  for (const std::size_t run : distinct_runs(plan)) {
    for (const SweepAttempt& attempt : read_attempts(paths, plan.runs[run].id)) seconds += attempt.seconds;
  }
  return seconds / 3600;
}

bool is_over_budget(const SweepPaths& paths, const SweepPlan& plan) {
  return plan.hours > 0 && spent_hours(paths, plan) >= plan.hours;
}

}  // namespace hsi4d
