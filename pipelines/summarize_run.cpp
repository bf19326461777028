#include "pipelines/summarize_run.h"

#include "body/kinematics.h"
#include "core/rotation.h"
#include "pipelines/evaluate.h"
#include "pipelines/frame_start.h"

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
  return summary;
}

}  // namespace hsi4d
