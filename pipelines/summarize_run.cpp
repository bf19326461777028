#include "pipelines/summarize_run.h"

#include <algorithm>

#include "body/kinematics.h"
#include "core/file.h"
#include "core/rotation.h"
#include "pipelines/evaluate.h"
#include "pipelines/frame_start.h"
#include "pipelines/gradient_table.h"
#include "pipelines/penetration.h"

namespace hsi4d {

namespace {

/// Where a state puts everything, for the metrics. A stage that draws the scene alone is judged by its camera alone.
FrameState placed(const Clip& clip, const SceneState& state, Draw draw) {
  FrameState frame;
  frame.camera_from_world = state.camera_from_world;
  if (draw == Draw::kScene) return frame;
  frame.joints = pose_joints(clip.avatar, state.body);
  for (const ObjectPose& pose : state.objects) {
    frame.world_from_object.push_back({so3_exp(pose.rotation), pose.translation});
  }
  return frame;
}

std::vector<FrameState> placed(const Clip& clip, const std::vector<SceneState>& states, Draw draw) {
  std::vector<FrameState> frames;
  for (const SceneState& state : states) frames.push_back(placed(clip, state, draw));
  return frames;
}

MetricValues errors_of(const Clip& clip, const std::vector<SceneState>& states, Draw draw) {
  return sequence_summary(placed(clip, states, draw), placed(clip, *clip.truth, draw), clip.frame_rate);
}

StageSummary summarize_stage(const std::string& name, const Clip& clip, const std::vector<SceneState>& states,
                             Draw draw, const StageTotals& totals) {
  StageSummary summary{name, totals.seconds, totals.iterations, {}};
  if (clip.truth) summary.values = errors_of(clip, states, draw);
  for (const auto& [counter, count] : {std::pair{"rollbacks", totals.rollbacks},
                                       {"tiles", totals.tiles},
                                       {"pairs", totals.pairs},
                                       {"fragments", totals.fragments}}) {
    summary.values.emplace_back(counter, static_cast<double>(count));
  }
  return summary;
}

/// Baselines and errors by frame, against the clip's truth.
void add_errors(const Clip& clip, const std::vector<SceneState>& result, RunSummary& summary) {
  const std::vector<FrameState> truth = placed(clip, *clip.truth, Draw::kAll);
  std::vector<SceneState> start, copy;
  for (Index t = 0; t < clip.frames(); ++t) {
    start.push_back(given_start(clip, t));
    copy.push_back(clip.first);
  }
  summary.baselines.clear();
  for (const auto& [name, states] : {std::pair{"start", &start}, std::pair{"copy_frame_0", &copy}}) {
    summary.baselines.push_back(
        {name, errors_of(clip, *states, Draw::kAll), sequence_errors(placed(clip, *states, Draw::kAll), truth)});
  }
  summary.per_frame = sequence_errors(placed(clip, result, Draw::kAll), truth);
}

/// Adds errors of images, which need no truth, to means and frames.
void add_image_errors(const std::vector<MetricValues>& errors, MetricValues& means,
                      std::vector<FrameMetrics>& per_frame) {
  std::vector<FrameMetrics> images;
  for (std::size_t t = 1; t < errors.size(); ++t) images.push_back({static_cast<int>(t), errors[t]});
  for (std::size_t t = 0; t < images.size(); ++t) {
    if (per_frame.size() <= t) per_frame.push_back({images[t].frame, {}});
    MetricValues& values = per_frame[t].values;
    values.insert(values.end(), images[t].values.begin(), images[t].values.end());
  }
  const MetricValues added = mean_errors(images);
  means.insert(means.end(), added.begin(), added.end());
}

/// Of the start, of what every stage that moves the body left, and of the result's frames.
void add_penetration(const RunConfig& config, const Clip& clip, const RunProgress& progress,
                     const RefinementProgress& refinement, RunSummary& summary) {
  summary.surface = clip.surface_file;
  const auto add = [](const MetricValues& more, MetricValues& values) {
    values.insert(values.end(), more.begin(), more.end());
  };
  const auto add_all = [&](const std::vector<SceneState>& states, MetricValues& means,
                           std::vector<FrameMetrics>& per_frame) {
    const std::vector<Penetration> counts = penetration_by_frame(clip, states);
    add(mean_penetration(counts), means);
    for (FrameMetrics& frame : per_frame)
      add(penetration_values(counts[static_cast<std::size_t>(frame.frame)]), frame.values);
  };
  std::vector<SceneState> start;
  for (Index t = 0; t < clip.frames(); ++t) start.push_back(given_start(clip, t));
  add_all(start, summary.baselines[0].values, summary.baselines[0].per_frame);
  std::vector<FrameMetrics> none;
  const std::size_t frame_stages = progress.after_stage.size();
  for (std::size_t s = 0; s < config.stages.size(); ++s) {
    if (s < frame_stages && config.stages[s].second.draw == Draw::kScene) continue;
    const std::vector<SceneState>& states =
        s < frame_stages ? progress.after_stage[s] : refinement.stages[s - frame_stages].states;
    const bool is_last = s + 1 == config.stages.size();
    add_all(states, summary.metrics[s].values, is_last ? summary.per_frame : none);
  }
}

}  // namespace

RunSummary summarize_run(const RunConfig& config, const Clip& clip, const RunProgress& progress,
                         const RefinementProgress& refinement) {
  RunSummary summary;
  summary.name = config.name;
  summary.frames = static_cast<int>(clip.frames());
  summary.seconds = progress.seconds + refinement.seconds;
  const std::size_t frame_stages = progress.after_stage.size();
  for (std::size_t s = 0; s < config.stages.size(); ++s) {
    const auto& [name, stage] = config.stages[s];
    if (s < frame_stages) {
      summary.metrics.push_back(summarize_stage(name, clip, progress.after_stage[s], stage.draw, progress.totals[s]));
    } else {
      const RefinedStates& refined = refinement.stages[s - frame_stages];
      summary.metrics.push_back(summarize_stage(name, clip, refined.states, Draw::kAll, refined.totals));
    }
  }
  summary.has_truth = clip.truth.has_value();
  summary.baselines = {{"start", {}, {}}};
  if (clip.truth) add_errors(clip, result_of(progress, refinement), summary);
  const bool is_refined = !refinement.stages.empty();
  if (is_refined) {
    std::vector<FrameMetrics> before_refinement;
    add_image_errors(progress.image_errors, summary.metrics[frame_stages - 1].values, before_refinement);
  }
  add_image_errors(is_refined ? refinement.image_errors : progress.image_errors, summary.metrics.back().values,
                   summary.per_frame);
  add_image_errors(progress.start_errors, summary.baselines[0].values, summary.baselines[0].per_frame);
  if (clip.surface) add_penetration(config, clip, progress, refinement, summary);
  return summary;
}

void add_gradient_shares(const RunConfig& config, const std::string& metrics_file, RunSummary& summary) {
  const auto measures = [](const auto& entry) { return entry.second.gradient_shares > 0; };
  if (std::none_of(config.stages.begin(), config.stages.end(), measures)) return;
  const std::string lines = read_text_file(metrics_file);
  for (std::size_t s = 0; s < config.stages.size(); ++s) {
    if (measures(config.stages[s]))
      summary.metrics[s].gradient_shares = mean_gradient_shares(lines, config.stages[s].first, metrics_file);
  }
}

}  // namespace hsi4d
