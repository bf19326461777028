#include "pipelines/run/start_choice.h"

#include <cmath>
#include <limits>

#include "core/text.h"
#include "pipelines/run/frame_start.h"
#include "pipelines/run/reconstruct_stage.h"

namespace hsi4d {

namespace {

constexpr std::size_t kPose = 0, kRoot = 1, kObjects = 2;  // of kChosenParts

std::string start_name(StartFrom from) { return std::string(choice_name<StartFrom>(kStartsFrom, from)); }

double mean_absolute_difference(const Image& a, const Image& b) {
  double sum = 0;
  for (int c = 0; c < a.channels(); ++c) {
    for (int y = 0; y < a.height(); ++y) {
      for (int x = 0; x < a.width(); ++x)
        sum += std::fabs(static_cast<double>(a(c, y, x)) - static_cast<double>(b(c, y, x)));
    }
  }
  return sum / (static_cast<double>(a.channels()) * a.height() * a.width());
}

std::vector<StartFrom> starts_of(StartFrom asked, bool has_estimate) {
  if (asked != StartFrom::kBest) return {asked};
  if (!has_estimate) return {StartFrom::kPrevious, StartFrom::kVelocity};
  return {StartFrom::kPrevious, StartFrom::kVelocity, StartFrom::kEstimate};
}

}  // namespace

bool chooses_start(const StartSettings& settings) {
  return settings.pose == StartFrom::kBest || settings.root == StartFrom::kBest || settings.objects == StartFrom::kBest;
}

ChosenStart choose_start(const RunConfig& config, const Clip& clip, const std::vector<SceneState>& done,
                         const ClipFrame& frame, const SceneState& state, const ColorState& colors) {
  ChosenStart best{state, {}};
  double least = std::numeric_limits<double>::infinity();
  const auto consider = [&](const ChosenStart& candidate) {
    const double difference =
        mean_absolute_difference(render_state(config, clip, candidate.state, colors), frame.target);
    if (!(difference < least)) return;
    least = difference;
    best = candidate;
  };
  StartSettings settings = config.start;
  if (settings.root == StartFrom::kBest || settings.pose == StartFrom::kBest) {
    for (const StartFrom root : starts_of(config.start.root, !clip.estimate.empty())) {
      for (const StartFrom pose : starts_of(config.start.pose, !clip.estimate.empty())) {
        settings.root = root;
        settings.pose = pose;
        ChosenStart candidate = best;
        const SceneState start = frame_start(settings, clip, done);
        for (std::size_t p = 0; p < clip.people(); ++p) candidate.state.person(p) = start.person(p);
        if (config.start.pose == StartFrom::kBest) candidate.from[kPose] = pose;
        if (config.start.root == StartFrom::kBest) candidate.from[kRoot] = root;
        consider(candidate);
      }
    }
  }
  if (settings.objects == StartFrom::kBest && !clip.objects.empty()) {
    best.from[kObjects] = StartFrom::kPrevious;  // as in `state`; what is as near does not take its place
    for (const StartFrom objects : starts_of(settings.objects, !clip.object_estimate.empty())) {
      settings.objects = objects;
      ChosenStart candidate = best;
      candidate.state.objects = frame_start(settings, clip, done).objects;
      candidate.from[kObjects] = objects;
      consider(candidate);
    }
  }
  return best;
}

void StartTotals::add(const ChosenStart& chosen) {
  for (std::size_t part = 0; part < kChosenParts.size(); ++part) {
    for (std::size_t start = 0; start < kChosenStarts.size(); ++start)
      frames[part][start] += chosen.from[part] == kChosenStarts[start] ? 1 : 0;
  }
}

std::string start_text(const ChosenStart& chosen) {
  std::vector<std::string> parts;
  for (std::size_t part = 0; part < kChosenParts.size(); ++part) {
    if (chosen.from[part]) parts.push_back(std::string(kChosenParts[part]) + " " + start_name(*chosen.from[part]));
  }
  return joined(parts);
}

StartSummary summarize_start(const StartTotals& totals) {
  StartSummary summary;
  summary.seconds = totals.seconds;
  for (std::size_t part = 0; part < kChosenParts.size(); ++part) {
    StartCounts counts{kChosenParts[part], {}};
    Index frames = 0;
    for (std::size_t start = 0; start < kChosenStarts.size(); ++start) {
      counts.begun.emplace_back(start_name(kChosenStarts[start]), totals.frames[part][start]);
      frames += totals.frames[part][start];
    }
    if (frames > 0) summary.parts.push_back(std::move(counts));
  }
  return summary;
}

}  // namespace hsi4d
