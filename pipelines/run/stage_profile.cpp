#include "pipelines/run/stage_profile.h"

#include <algorithm>

#include "core/stopwatch.h"

namespace hsi4d {

namespace {

OperatorProfile& entry_of(std::vector<OperatorProfile>& operators, const std::string& name) {
  const auto is_it = [&name](const OperatorProfile& known) { return known.name == name; };
  const auto place = std::find_if(operators.begin(), operators.end(), is_it);
  if (place != operators.end()) return *place;
  operators.push_back({});
  operators.back().name = name;
  return operators.back();
}

/// In the order in which they are first met on the tape.
std::vector<OperatorProfile> by_operator(const std::vector<NodeStatistics>& nodes) {
  std::vector<OperatorProfile> operators;
  for (const NodeStatistics& node : nodes) {
    OperatorProfile& entry = entry_of(operators, node.name);
    ++entry.nodes;
    entry.forward_runs += node.forward_runs;
    entry.forward_skips += node.forward_skips;
    entry.backward_runs += node.backward_runs;
    entry.forward_seconds += 1e-9 * node.forward_ns;
    entry.backward_seconds += 1e-9 * node.backward_ns;
  }
  return operators;
}

}  // namespace

StageProbe::StageProbe(const StageWatch* watch) : watch_(watch), start_(std::chrono::steady_clock::now()) {
  if (is_on()) iteration_begins();
}

std::int64_t StageProbe::allocation_count() const { return watch_->allocation_count ? watch_->allocation_count() : 0; }

void StageProbe::iteration_ended(const IterationReport& report, const RenderCounters* counters) {
  if (!is_on()) return;
  if (watch_->allocation_count && report.iteration >= report.iterations / 2) {
    allocations_ += allocation_count() - before_;
    ++counted_;
  }
  iteration_seconds_ += report.seconds;
  if (report.iteration == 0) first_seconds_ = report.seconds;
  tape_ += report.tape;
  if (counters != nullptr) counters_ += *counters;
}

void StageProbe::iteration_begins() {
  if (is_on()) before_ = allocation_count();
}

void StageProbe::stage_ended(const StageResult& result, StageProfile profile) const {
  if (!is_on() || !watch_->done) return;
  profile.iterations = result.iterations;
  profile.seconds = seconds_since(start_);
  profile.iteration_seconds = iteration_seconds_;
  profile.first_seconds = first_seconds_;
  profile.times = result.times;
  profile.operators = by_operator(result.nodes);
  profile.nodes = static_cast<Index>(result.nodes.size());
  profile.counters = counters_;
  profile.tape = tape_;
  profile.allocations = allocations_;
  profile.counted = counted_;
  profile.curvature = result.curvature;
  watch_->done(profile);
}

}  // namespace hsi4d
