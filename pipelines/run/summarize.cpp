#include "pipelines/run/summarize.h"

#include <algorithm>

#include "body/kinematics.h"
#include "core/file.h"
#include "core/rotation.h"
#include "pipelines/draw/plate_mark.h"
#include "pipelines/metrics/contact_metrics.h"
#include "pipelines/metrics/keypoint_errors.h"
#include "pipelines/metrics/penetration.h"
#include "pipelines/metrics/sigma_metrics.h"
#include "pipelines/record/gradient_table.h"
#include "pipelines/run/frame_start.h"

namespace hsi4d {

namespace {

constexpr const char* kCopyFrame0 = "copy_frame_0";

std::vector<FrameState> placed(const Clip& clip, const std::vector<SceneState>& states, Draw draw) {
  std::vector<FrameState> frames;
  for (const SceneState& state : states) frames.push_back(placed(clip.avatar, state, draw));
  return frames;
}

std::vector<const Gaussians*> objects_of(const Clip& clip) {
  std::vector<const Gaussians*> objects;
  for (const ClipObject& object : clip.objects) objects.push_back(&object.gaussians);
  return objects;
}

MetricValues errors_of(const Clip& clip, const std::vector<SceneState>& states, Draw draw, const ObjectPoints& points) {
  return sequence_summary(placed(clip, states, draw), placed(clip, *clip.truth, draw), clip.frame_rate, &points);
}

/// Time and work of a stage beside its errors.
StageSummary summarize_stage(const std::string& name, MetricValues errors, const StageTotals& totals) {
  StageSummary summary{name, totals.seconds, totals.iterations, std::move(errors)};
  for (const auto& [counter, count] : {std::pair{"rollbacks", totals.rollbacks},
                                       {"tiles", totals.tiles},
                                       {"pairs", totals.pairs},
                                       {"fragments", totals.fragments}}) {
    summary.values.emplace_back(counter, static_cast<double>(count));
  }
  return summary;
}

/// Errors of the first frame.
MetricValues first_frame_errors(const Clip& clip, const SceneState& state, Draw draw) {
  if (!clip.truth) return {};
  const ObjectPoints points(objects_of(clip));
  return frame_errors(placed(clip.avatar, state, draw), placed(clip.avatar, clip.truth->front(), draw), &points);
}

void append_values(const MetricValues& more, MetricValues& values) {
  values.insert(values.end(), more.begin(), more.end());
}

/// The stages over the first frame, and frame 0 as it was given.
void add_first_frame(const RunConfig& config, const Clip& clip, const RunProgress& progress, RunSummary& summary) {
  if (progress.first_frame.empty()) return;
  Baseline given{"given_frame_0", first_frame_errors(clip, clip.first, Draw::kAll), {}, true};
  append_values(progress.start_errors[0], given.values);
  summary.baselines.push_back(std::move(given));
  for (std::size_t s = 0; s < progress.first_frame.size(); ++s) {
    const auto& [name, stage] = config.stages[s];
    const FirstFrameState& found = progress.first_frame[s];
    summary.metrics.push_back(summarize_stage(name, first_frame_errors(clip, found.state, stage.draw), found.totals));
    summary.metrics.back().of_frame_0 = true;
  }
  append_values(progress.image_errors[0], summary.metrics.back().values);
}

/// Baselines and errors by frame, against the clip's truth.
void add_errors(const Clip& clip, const RunProgress& progress, const ObjectPoints& points, RunSummary& summary) {
  const std::vector<FrameState> truth = placed(clip, *clip.truth, Draw::kAll);
  std::vector<SceneState> start, copy;
  for (Index t = 0; t < clip.frames(); ++t) {
    start.push_back(given_start(clip, t));
    copy.push_back(clip.first);
  }
  for (const auto& [name, states] : {std::pair{"start", &start}, std::pair{kCopyFrame0, &copy}}) {
    summary.baselines.push_back({name, errors_of(clip, *states, Draw::kAll, points),
                                 sequence_errors(placed(clip, *states, Draw::kAll), truth, clip.frame_rate, &points)});
  }
  const auto by_frame = [&](const std::vector<SceneState>& states) {
    return sequence_errors(placed(clip, states, Draw::kAll), truth, clip.frame_rate, &points);
  };
  summary.per_frame = by_frame(result_of(progress));
  if (!progress.later.empty()) summary.first_pass = by_frame(progress.after_stage.back());
}

/// Adds errors of images, which need no truth, to means and frames.
void add_image_errors(const std::vector<MetricValues>& errors, MetricValues& means,
                      std::vector<FrameMetrics>& per_frame) {
  std::vector<FrameMetrics> images;
  for (std::size_t t = 1; t < errors.size(); ++t) images.push_back({static_cast<int>(t), errors[t]});
  for (std::size_t t = 0; t < images.size(); ++t) {
    if (per_frame.size() <= t) per_frame.push_back({images[t].frame, {}});
    append_values(images[t].values, per_frame[t].values);
  }
  append_values(mean_errors(images), means);
}

std::vector<SceneState> start_of(const Clip& clip) {
  std::vector<SceneState> start;
  for (Index t = 0; t < clip.frames(); ++t) start.push_back(given_start(clip, t));
  return start;
}

/// Calls add(state, values) for frame 0 as it was given, and as every stage over it that moves the body left it.
template <class F>
void for_first_frames(const RunConfig& config, const Clip& clip, const RunProgress& progress, RunSummary& summary,
                      const F& add) {
  for (Baseline& baseline : summary.baselines) {
    if (baseline.of_frame_0) add(clip.first, baseline.values);
  }
  for (std::size_t s = 0; s < progress.first_frame.size(); ++s) {
    if (config.stages[s].second.draw == Draw::kAll) add(progress.first_frame[s].state, summary.metrics[s].values);
  }
}

/// Calls add_all(states, means, per_frame) for what every stage that moves the body in all frames left; per_frame is
/// empty but for the last.
template <class F>
void for_stages(const RunConfig& config, const RunProgress& progress, RunSummary& summary, const F& add_all) {
  std::vector<FrameMetrics> none;
  const std::size_t first = progress.first_frame.size(), later = first + progress.after_stage.size();
  for (std::size_t s = first; s < config.stages.size(); ++s) {
    if (config.stages[s].second.draw == Draw::kScene) continue;
    const std::vector<SceneState>& states =
        s < later ? progress.after_stage[s - first] : progress.later[s - later].states;
    const bool is_last = s + 1 == config.stages.size();
    add_all(states, summary.metrics[s].values, is_last ? summary.per_frame : none);
  }
}

/// Of the start, of what every stage that moves the body left, and of the result's frames.
void add_penetration(const RunConfig& config, const Clip& clip, const RunProgress& progress, RunSummary& summary) {
  summary.surface = clip.surface_file;
  for_first_frames(config, clip, progress, summary, [&clip](const SceneState& state, MetricValues& values) {
    append_values(penetration_values(penetration_by_frame(clip, {state}).front()), values);
  });
  const auto add_all = [&](const std::vector<SceneState>& states, MetricValues& means,
                           std::vector<FrameMetrics>& per_frame) {
    const std::vector<Penetration> counts = penetration_by_frame(clip, states);
    append_values(mean_penetration(counts), means);
    for (FrameMetrics& frame : per_frame)
      append_values(penetration_values(counts[static_cast<std::size_t>(frame.frame)]), frame.values);
  };
  add_all(start_of(clip), summary.baselines[0].values, summary.baselines[0].per_frame);
  for_stages(config, progress, summary, add_all);
}

/// How much of the body is inside of the objects, by what their Gaussians show.
class ObjectPenetration {
 public:
  explicit ObjectPenetration(const Clip& clip) : clip_(clip) {
    for (const ClipObject& object : clip.objects)
      distances_.push_back(object_solid(object.gaussians, object.name).distance);
    is_known_ = std::any_of(distances_.begin(), distances_.end(), [](const auto& distance) { return !!distance; });
  }

  /// Nothing where no object has a surface.
  std::vector<Penetration> by_frame(const std::vector<SceneState>& states) const {
    std::vector<Penetration> counts;
    for (std::size_t t = 0; is_known_ && t < states.size(); ++t) {
      counts.push_back(
          penetration_of(distances_, rigids_of(states[t].objects), measured_points(clip_.avatar, states[t].body)));
    }
    return counts;
  }

 private:
  const Clip& clip_;
  std::vector<SignedDistance> distances_;
  bool is_known_ = false;
};

/// Contact of the hands, height and sliding of the feet and distances from keypoints, which need no truth.
/// @param states  by frame, of a person alone
std::vector<MetricValues> body_values(const Clip& clip, const std::vector<const Gaussians*>& objects,
                                      const std::vector<SceneState>& states, std::size_t person = 0) {
  const Avatar& avatar = clip.person(person).avatar;
  std::vector<MetricValues> all = contact_by_frame(avatar, objects, states);
  std::vector<std::vector<double>> joints;
  for (const SceneState& state : states) joints.push_back(pose_joints(avatar, state.body));
  const std::vector<MetricValues> sliding = sliding_by_frame(joints, clip.frame_rate);
  const std::vector<MetricValues> drift = floor_drift_by_frame(joints);
  const std::vector<MetricValues> seen = keypoint_errors_by_frame(clip, states, person);
  for (std::size_t t = 0; t < all.size(); ++t) {
    append_values(drift[t], all[t]);
    append_values(sliding[t], all[t]);
    append_values(seen[t], all[t]);
  }
  return all;
}

/// Where a person is, and the camera where that is known exactly.
std::vector<FrameState> bodies_at(const Clip& clip, std::size_t person, const std::vector<SceneState>& states,
                                  bool is_truth) {
  std::vector<FrameState> frames;
  for (const SceneState& state : with_person(states, person)) {
    frames.emplace_back().joints = pose_joints(clip.person(person).avatar, state.body);
    if (is_truth) frames.back().camera_from_world = state.camera_from_world;
  }
  return frames;
}

/// The people beside the first one.
void add_people(const Clip& clip, const std::vector<SceneState>& result, RunSummary& summary) {
  const std::vector<const Gaussians*> objects = objects_of(clip);
  for (std::size_t p = 1; p < clip.people(); ++p) {
    PersonSummary& person = summary.people.emplace_back(PersonSummary{clip.person(p).name, {}, {}});
    std::vector<FrameState> truth;
    if (clip.truth) truth = bodies_at(clip, p, *clip.truth, true);
    const auto values_of = [&](const std::vector<SceneState>& states) {
      const std::vector<FrameState> bodies = bodies_at(clip, p, states, false);
      MetricValues values =
          clip.truth ? sequence_summary(bodies, truth, clip.frame_rate) : motion_jitter(bodies, clip.frame_rate);
      append_values(mean_after_first(body_values(clip, objects, with_person(states, p), p)), values);
      return values;
    };
    person.start = values_of(start_of(clip));
    person.result = values_of(result);
    if (clip.truth) person.per_frame = sequence_errors(bodies_at(clip, p, result, false), truth, clip.frame_rate);
  }
}

/// Contact of the hands, what is inside of objects, height and sliding of the feet and distances from keypoints, which
/// need no truth: of the baselines, of what every stage that moves the body left, and of the result's frames.
void add_contact(const RunConfig& config, const Clip& clip, const RunProgress& progress, RunSummary& summary) {
  const std::vector<const Gaussians*> objects = objects_of(clip);
  const ObjectPenetration inside(clip);
  const auto by_frame = [&](const std::vector<SceneState>& states) { return body_values(clip, objects, states); };
  const auto add_all = [&](const std::vector<SceneState>& states, MetricValues& means,
                           std::vector<FrameMetrics>& per_frame) {
    const std::vector<MetricValues> values = by_frame(states);
    append_values(mean_after_first(values), means);
    const std::vector<Penetration> counts = inside.by_frame(states);
    if (!counts.empty()) append_values(object_penetration_values(sum_after_first(counts)), means);
    for (FrameMetrics& frame : per_frame) {
      const auto t = static_cast<std::size_t>(frame.frame);
      append_values(values[t], frame.values);
      if (!counts.empty()) append_values(object_penetration_values(counts[t]), frame.values);
    }
  };
  for_first_frames(config, clip, progress, summary, [&](const SceneState& state, MetricValues& values) {
    append_values(by_frame({state}).front(), values);
    const std::vector<Penetration> counts = inside.by_frame({state});
    if (!counts.empty()) append_values(object_penetration_values(counts.front()), values);
  });
  for (Baseline& baseline : summary.baselines) {
    if (baseline.of_frame_0) continue;
    const bool is_copy = baseline.name == kCopyFrame0;
    add_all(is_copy ? std::vector(static_cast<std::size_t>(clip.frames()), clip.first) : start_of(clip),
            baseline.values, baseline.per_frame);
  }
  for_stages(config, progress, summary, add_all);
}

/// How sure the result's places are.
void add_sigmas(const Clip& clip, const std::vector<SceneState>& result, const std::vector<PlaceSigmas>& sigmas,
                RunSummary& summary) {
  std::vector<FrameMetrics> all;
  for (FrameMetrics& frame : summary.per_frame) {
    const auto t = static_cast<std::size_t>(frame.frame);
    if (t >= sigmas.size()) continue;
    std::optional<FrameState> truth;
    if (clip.truth) truth = placed(clip.avatar, (*clip.truth)[t], Draw::kAll);
    all.push_back(
        {frame.frame, sigma_values(sigmas[t], placed(clip.avatar, result[t], Draw::kAll), truth ? &*truth : nullptr)});
    append_values(all.back().values, frame.values);
  }
  append_values(mean_errors(all), summary.metrics.back().values);
}

/// How much of the objects the frames show, and whether they are where these show them; means over the objects.
void add_seen_objects(const RunProgress& progress, RunSummary& summary) {
  std::vector<FrameMetrics> all;
  for (FrameMetrics& frame : summary.per_frame) {
    const auto t = static_cast<std::size_t>(frame.frame);
    FrameMetrics& of_objects = all.emplace_back(FrameMetrics{frame.frame, {}});
    if (t < progress.object_ious.size()) {
      std::vector<FrameMetrics> ious;
      for (const std::optional<double>& iou : progress.object_ious[t]) {
        if (iou) ious.push_back({frame.frame, {{"object_iou", *iou}}});
      }
      append_values(mean_errors(ious), of_objects.values);
    }
    if (t < progress.seen.size()) {
      std::vector<FrameMetrics> shares;
      for (const double share : progress.seen[t]) shares.push_back({frame.frame, {{"object_seen_share", share}}});
      append_values(mean_errors(shares), of_objects.values);
    }
    append_values(of_objects.values, frame.values);
  }
  append_values(mean_errors(all), summary.metrics.back().values);
}

}  // namespace

FrameState placed(const Avatar& avatar, const SceneState& state, Draw draw) {
  FrameState frame;
  frame.camera_from_world = state.camera_from_world;
  if (draw == Draw::kScene) return frame;
  frame.joints = pose_joints(avatar, state.body);
  frame.world_from_object = rigids_of(state.objects);
  return frame;
}

RunSummary summarize_run(const RunConfig& config, const Clip& clip, const RunProgress& progress) {
  RunSummary summary;
  summary.name = config.name;
  summary.frames = static_cast<int>(clip.frames());
  summary.seconds = progress.seconds;
  summary.has_truth = clip.truth.has_value();
  summary.is_on_plate = is_plate_file(config.data.scene);
  summary.found = unknowns_by_name(progress.unknowns, clip);
  summary.start = summarize_start(progress.start);
  const ObjectPoints points(objects_of(clip));
  const auto add_stage = [&](const std::vector<SceneState>& states, const StageTotals& totals) {
    const auto& [name, stage] = config.stages[summary.metrics.size()];
    summary.metrics.push_back(summarize_stage(name,
                                              clip.truth
                                                  ? errors_of(clip, states, stage.draw, points)
                                                  : motion_jitter(placed(clip, states, stage.draw), clip.frame_rate),
                                              totals));
  };
  if (clip.truth) {
    add_errors(clip, progress, points, summary);
  } else {
    summary.baselines = {{"start", motion_jitter(placed(clip, start_of(clip), Draw::kAll), clip.frame_rate), {}}};
  }
  add_first_frame(config, clip, progress, summary);
  for (std::size_t s = 0; s < progress.after_stage.size(); ++s) add_stage(progress.after_stage[s], progress.totals[s]);
  const std::size_t last_of_pass = summary.metrics.size() - 1;
  for (const LaterStage& stage : progress.later) add_stage(stage.states, stage.totals);
  const bool has_later = !progress.later.empty();
  if (has_later) {
    std::vector<FrameMetrics> before;
    add_image_errors(progress.image_errors, summary.metrics[last_of_pass].values, before);
  }
  add_image_errors(has_later ? progress.result_errors : progress.image_errors, summary.metrics.back().values,
                   summary.per_frame);
  add_image_errors(progress.start_errors, summary.baselines[0].values, summary.baselines[0].per_frame);
  add_contact(config, clip, progress, summary);
  if (clip.surface) add_penetration(config, clip, progress, summary);
  if (config.uncertainty) add_sigmas(clip, result_of(progress), progress.sigmas, summary);
  add_seen_objects(progress, summary);
  add_people(clip, result_of(progress), summary);
  summary.quality = quality_of(summary.metrics.back().values, clip.frame_rate);
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
