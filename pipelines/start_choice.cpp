#include "pipelines/start_choice.h"

#include <cmath>
#include <limits>

#include "pipelines/frame_start.h"
#include "pipelines/reconstruct_stage.h"

namespace hsi4d {

namespace {

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

SceneState choose_start(const RunConfig& config, const Clip& clip, const std::vector<SceneState>& done,
                        const ClipFrame& frame, const SceneState& state, const ColorState& colors) {
  SceneState best = state;
  double least = std::numeric_limits<double>::infinity();
  const auto consider = [&](const SceneState& candidate) {
    const double difference = mean_absolute_difference(render_state(config, clip, candidate, colors), frame.target);
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
        SceneState candidate = best;
        candidate.body = frame_start(settings, clip, done).body;
        consider(candidate);
      }
    }
  }
  if (settings.objects == StartFrom::kBest && !clip.objects.empty()) {
    for (const StartFrom objects : starts_of(settings.objects, !clip.object_estimate.empty())) {
      settings.objects = objects;
      SceneState candidate = best;
      candidate.objects = frame_start(settings, clip, done).objects;
      consider(candidate);
    }
  }
  return best;
}

}  // namespace hsi4d
