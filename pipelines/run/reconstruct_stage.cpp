#include "pipelines/run/reconstruct_stage.h"

#include <algorithm>

#include "body/pose_prior.h"
#include "core/mask_image.h"
#include "optim/optimizer.h"
#include "pipelines/draw/frame_images.h"
#include "pipelines/draw/posed_avatar.h"
#include "pipelines/graph/frame_masks.h"
#include "pipelines/run/place_uncertainty.h"
#include "pipelines/run/recorded_stage.h"

namespace hsi4d {

namespace {

/// Whether a stage looks for the light on objects: then all are drawn with it.
bool lights_objects(const RunConfig& config) {
  return std::any_of(config.stages.begin(), config.stages.end(),
                     [](const auto& entry) { return find_entry(entry.second.optimize, kObjectLightGroup) != nullptr; });
}

FrameGraphSettings graph_settings(const RunConfig& config, Draw draw, const ColorState& colors) {
  return {config.render,
          config.skip.render,
          config.approx.hold_colors,
          config.rotations,
          config.camera.increment,
          draw,
          Vector3<double>(config.background.data()),
          colors.nets,
          config.color_net.camera_gradient,
          lights_objects(config)};
}

/// Whether a term that is on needs an input which is made on demand.
bool some_loss_needs(const StageSettings& stage, LossInput input) {
  return stage.draw == Draw::kAll && std::any_of(stage.losses.begin(), stage.losses.end(), [input](const auto& entry) {
           return needs_input(entry.second, input);
         });
}

/// The frames that terms over the motion see: up to kFramesBefore that are done, and the one at hand.
std::vector<SceneState> seen_frames(std::span<const SceneState> done, const SceneState& state) {
  std::vector<SceneState> frames(done.end() - std::min(kFramesBefore, std::ssize(done)), done.end());
  frames.push_back(state);
  return frames;
}

/// Empty where every pixel counts.
Image weights_of_setting(const StageSettings& stage, const FrameTask& task, const RunConfig& config) {
  if (stage.weight == PixelWeight::kAll) return {};
  Image covered(1, task.covered.height(), task.covered.width());
  if (stage.weight == PixelWeight::kUnoccluded) covered = task.covered;
  if (stage.weight == PixelWeight::kBackground || stage.weight == PixelWeight::kForeground)
    add_covered(task.frame, config.data, covered);
  return stage.weight == PixelWeight::kForeground ? std::move(covered) : complement(covered);
}

/// Those of the stage, where the frame is seen. Empty where every pixel counts.
Image pixel_weights(const StageSettings& stage, const FrameTask& task, const RunConfig& config) {
  Image weights = weights_of_setting(stage, task, config);
  if (task.frame.seen.empty()) return weights;
  if (weights.empty()) return task.frame.seen;
  hide_unseen(task.frame, weights);
  return weights;
}

/// Frame 0 as the stages of a frame see it: as it was found, or, while it is looked for, as it was given.
const SceneState& first_state(const StageTask& task, const FrameTask& frame) {
  return frame.done.empty() ? task.clip.first : frame.done.front();
}

/// What a stage draws of objects and human, where approx.seen_within_deg asks for less than all. What the stage needs
/// wholly is kept: objects for their mean depth, the human for features or a shape that move.
std::optional<SeenRows> rows_to_draw(const StageTask& task, const SceneState& state) {
  const auto& stage = task.config.stages[task.stage].second;
  const double within_deg = task.config.approx.seen_within_deg;
  if (within_deg == 0 || stage.draw == Draw::kScene) return {};
  const Clip& clip = task.clip;
  ViewRange view_range{clip.camera, task.config.render, within_deg};
  view_range.camera.camera_from_world = state.camera_from_world;
  const bool needs_objects = std::any_of(stage.losses.begin(), stage.losses.end(), [](const auto& entry) {
    const std::vector<LossInput> needs = needs_of(entry.second);
    return std::find(needs.begin(), needs.end(), LossInput::kObjectDepth) != needs.end();
  });
  const bool needs_human =
      find_entry(stage.optimize, kFeaturesGroup) != nullptr || find_entry(stage.optimize, kBetasGroup) != nullptr;
  SeenRows rows;
  for (std::size_t o = 0; o < clip.objects.size(); ++o) {
    const Gaussians& object = clip.objects[o].gaussians;
    rows.objects.push_back(needs_objects ? all_rows(object.count())
                                         : seen_rows(posed_object(object, state.objects[o]), view_range));
  }
  for (std::size_t p = 0; p < clip.people(); ++p) {
    const Avatar& avatar = clip.person(p).avatar;
    rows.people.push_back(
        needs_human ? all_rows(avatar.count())
                    : seen_rows({rest_gaussians(avatar), blended_transforms(avatar, state.person(p))}, view_range));
  }
  return rows;
}

/// As mask_center has it, the coverage as a share of what the object covers at its present pose with nothing before it.
Vector3<double> center_and_share(const Image& mask, const StageTask& task, std::size_t object,
                                 const SceneState& state) {
  Vector3<double> center = mask_center(mask, task.config.data.mask_threshold);
  if (center[2] == 0) return center;
  Camera camera = task.clip.camera;
  camera.camera_from_world = state.camera_from_world;
  const double area = covered_area(task.clip.objects[object].gaussians, state.objects[object], camera);
  center[2] = center[2] < area ? center[2] / area : 1;
  return center;
}

FrameTargets targets_of(const StageTask& task, const FrameTask& frame_task, const SceneState& state,
                        const Image& weight) {
  const Clip& clip = task.clip;
  const ClipFrame& frame = frame_task.frame;
  const SceneState& first = first_state(task, frame_task);
  const bool are_objects_read = some_loss_needs(task.config.stages[task.stage].second, LossInput::kObjectOpacity);
  FrameTargets targets;
  targets.image = &frame.target;
  targets.weight = weight.empty() ? nullptr : &weight;
  targets.human_mask = &frame.human_mask;
  targets.human_seen = mask_center(frame.human_mask, task.config.data.mask_threshold)[2] != 0;
  const auto t = static_cast<std::size_t>(frame_task.index);
  if (clip.keypoints) targets.keypoints = &clip.keypoints->frames.at(t);
  for (std::size_t p = 0; p < clip.others.size(); ++p) {
    const Image& mask = frame.other_masks[p];
    const std::optional<Keypoints>& keypoints = clip.others[p].keypoints;
    targets.others.push_back({&mask, mask_center(mask, task.config.data.mask_threshold)[2] != 0,
                              keypoints ? &keypoints->frames.at(t) : nullptr});
  }
  targets.depth_map = &frame.depth_map;
  for (std::size_t o = 0; o < clip.objects.size(); ++o) {
    if (are_objects_read) {
      targets.object_masks.push_back(&frame.object_masks[o]);
      targets.centers.push_back(center_and_share(frame.object_masks[o], task, o, state));
    }
    targets.depths.push_back(mean_depth(clip.objects[o].gaussians, first.objects[o], first.camera_from_world));
  }
  return targets;
}

/// Points of tracks that begin in frames before, where the stage asks for them.
template <class S>
void give_tracks(FrameGraph<S>& graph, const StageTask& task, const FrameTask& frame) {
  if (!task.clip.tracks || !some_loss_needs(task.config.stages[task.stage].second, LossInput::kTracks)) return;
  TrackPoints found;
  TrackPoints& known = task.tracks != nullptr ? *task.tracks : found;
  const std::vector<TrackPoint>& points = known.of(task.clip, task.config.render, frame.done);
  if (!points.empty()) graph.give_tracks(points, task.clip.tracks->frames[static_cast<std::size_t>(frame.index)]);
}

Index tiles_in_image(const Camera& camera, int tile) {
  return Index{(camera.width + tile - 1) / tile} * ((camera.height + tile - 1) / tile);
}

}  // namespace

template <class S>
RecordedFrame<S> record_frame(Tape<S>& tape, const StageTask& task, const FrameTask& frame, const SceneState& state,
                              const ColorState& colors, std::optional<double> camera_reach) {
  const StageSettings& stage = task.config.stages[task.stage].second;
  tape.set_skips(task.config.skip.tape);
  FrameGraphSettings settings = graph_settings(task.config, stage.draw, colors);
  settings.human_opacity = some_loss_needs(stage, LossInput::kHumanOpacity);
  settings.object_opacity = some_loss_needs(stage, LossInput::kObjectOpacity);
  settings.keypoints = some_loss_needs(stage, LossInput::kKeypoints);
  settings.bones = some_loss_needs(stage, LossInput::kBones);
  settings.depth_map = task.clip.depth_maps && some_loss_needs(stage, LossInput::kDepthMap);
  settings.unknowns = unknown_groups_of(stage);
  settings.camera_reach = camera_reach;
  settings.seen = rows_to_draw(task, state);
  auto recorded = std::make_unique<FrameGraph<S>>(tape, task.clip, state.camera_from_world, settings);
  FrameGraph<S>& graph = *recorded;
  graph.set_state(state);
  if (stage.draw == Draw::kAll) {
    const std::vector<SceneState> seen = seen_frames(frame.done, state);
    graph.give_motion(first_state(task, frame), seen, frame.index + 1 - std::ssize(seen));
    const std::size_t after = std::min<std::size_t>(kFramesBefore, frame.after.size());
    if (after > 0) graph.give_motion_after(frame.after.first(after));
  }
  give_tracks(graph, task, frame);
  const Image weight = pixel_weights(stage, frame, task.config);
  graph.set_targets(targets_of(task, frame, state, weight));
  LossInputs<S> inputs = graph.loss_inputs();
  if (weight.empty()) inputs.weight = {};
  return {std::move(recorded), inputs};
}

double camera_reach_of(const StageSettings& stage) {
  const ParameterGroupSettings* const camera = find_entry(stage.optimize, "camera");
  return camera != nullptr ? longest_way(*camera, stage.iterations, stage.optimizer) : 0;
}

std::string name_in_frame(const StageTask& task, const FrameTask& frame) {
  return task.config.stages[task.stage].first + ", frame " + std::to_string(frame.index);
}

namespace {

template <class S>
StageResult run_frame_stage_in(const StageTask& task, const FrameTask& frame, SceneState& state, ColorState& colors,
                               const FrameStageCallback& callback) {
  const std::string& name = task.config.stages[task.stage].first;
  const StageSettings& stage = task.config.stages[task.stage].second;
  StageProbe probe(task.watch);
  Tape<S> tape;
  const auto [graph, inputs] = record_frame<S>(tape, task, frame, state, colors, camera_reach_of(stage));
  const StageResult result =
      run_stage<S>(tape, stage, task.losses, inputs, graph->groups(),
                   [&probe, &callback, &counters = *graph->rendered().counters](const IterationReport& report) {
                     probe.iteration_ended(report, &counters);
                     callback(report, counters);
                     probe.iteration_begins();
                   },
                   {.name = name_in_frame(task, frame),
                    .kept = &colors.moments,
                    .curvature = stage.optimizer.keep_curvature ? &colors.curvature[name] : nullptr,
                    .profile = probe.is_on(),
                    .time_curvature = probe.times_curvature(),
                    .held = graph->held()});
  graph->read_state(stage.optimize, state);
  if (task.found != nullptr) *task.found = graph->unknowns();
  graph->read_color_nets(stage.optimize, colors.nets);
  if (task.sigmas != nullptr)
    *task.sigmas = place_sigmas<S>(tape, task, graph->groups(), inputs, graph->object_places(),
                                   foreground_of(frame.frame), state.camera_from_world.rotation);
  const Camera& drawn = task.clip.camera;
  probe.stage_ended(result, {.stage = name,
                             .frame = frame.index,
                             .pixels_of_image = static_cast<Index>(drawn.width) * drawn.height,
                             .tiles_of_image = tiles_in_image(drawn, task.config.render.tile),
                             .tape_bytes = tape.memory_bytes()});
  return result;
}

}  // namespace

template <class S>
SequenceGraph<S> record_sequence(Tape<S>& tape, const StageTask& task, const std::vector<SceneState>& states) {
  const StageSettings& stage = task.config.stages[task.stage].second;
  tape.set_skips(task.config.skip.tape);
  const bool moves_pose = find_entry(stage.optimize, kPoseLatents) != nullptr;
  const PosePrior prior = stage.pose_prior ? *stage.pose_prior : read_pose_prior(stage.pose_weights.string());
  SequenceGraph<S> graph(tape, task.clip, states, moves_pose ? &prior : nullptr, task.config.rotations);
  if (task.known != nullptr && !task.known->empty()) graph.give_sigmas(states, *task.known);
  return graph;
}

namespace {

template <class S>
StageResult run_sequence_stage_in(const StageTask& task, std::vector<SceneState>& states,
                                  const StageCallback& callback) {
  const auto& [name, stage] = task.config.stages[task.stage];
  StageProbe probe(task.watch);
  Tape<S> tape;
  const SequenceGraph<S> graph = record_sequence<S>(tape, task, states);
  const StageResult result = run_stage<S>(
      tape, stage, task.losses, graph.loss_inputs(), graph.groups(),
      [&](const IterationReport& report) {
        probe.iteration_ended(report, nullptr);
        callback(report);
        probe.iteration_begins();
      },
      {.name = name, .kept = nullptr, .profile = probe.is_on(), .time_curvature = probe.times_curvature()});
  graph.read_states(stage.optimize, states);
  probe.stage_ended(result, {.stage = name, .tape_bytes = tape.memory_bytes()});
  return result;
}

/// The planes of an image, each for itself.
std::vector<Image> planes_of(const Image& image) {
  std::vector<Image> planes;
  for (int c = 0; c < image.channels(); ++c) {
    Image& plane = planes.emplace_back(1, image.height(), image.width());
    for (int y = 0; y < image.height(); ++y) std::copy_n(image.row(c, y), image.width(), plane.row(0, y));
  }
  return planes;
}

template <class S>
StatePicture picture_in(const RunConfig& config, const Clip& clip, const SceneState& state, const ColorState& colors,
                        bool has_silhouette) {
  Tape<S> tape;
  FrameGraphSettings settings = graph_settings(config, Draw::kAll, colors);
  settings.camera_reach = 0;
  settings.human_opacity = has_silhouette;
  settings.object_opacity = has_silhouette && config.start.objects == StartFrom::kBest;
  FrameGraph<S> graph(tape, clip, state.camera_from_world, settings);
  graph.set_state(state);
  tape.forward(graph.rendered().image);
  StatePicture picture{to_image(tape.value(graph.rendered().image)), {}, {}, {}};
  if (!has_silhouette) return picture;
  tape.forward(graph.loss_inputs().human_opacity);
  picture.silhouette = to_image(tape.value(graph.loss_inputs().human_opacity));
  for (const LossInputs<S>& other : graph.loss_inputs().others) {
    tape.forward(other.human_opacity);
    picture.others.push_back(to_image(tape.value(other.human_opacity)));
  }
  if (!settings.object_opacity || clip.objects.empty()) return picture;
  tape.forward(graph.loss_inputs().object_opacity);
  picture.objects = planes_of(to_image(tape.value(graph.loss_inputs().object_opacity)));
  return picture;
}

StatePicture picture(const RunConfig& config, const Clip& clip, const SceneState& state, const ColorState& colors,
                     bool has_silhouette) {
  return config.precision == RunPrecision::kFloat ? picture_in<float>(config, clip, state, colors, has_silhouette)
                                                  : picture_in<double>(config, clip, state, colors, has_silhouette);
}

}  // namespace

StageResult run_frame_stage(const StageTask& task, const FrameTask& frame, SceneState& state, ColorState& colors,
                            const FrameStageCallback& callback) {
  return task.config.precision == RunPrecision::kFloat
             ? run_frame_stage_in<float>(task, frame, state, colors, callback)
             : run_frame_stage_in<double>(task, frame, state, colors, callback);
}

StageResult run_sequence_stage(const StageTask& task, std::vector<SceneState>& states, const StageCallback& callback) {
  return task.config.precision == RunPrecision::kFloat ? run_sequence_stage_in<float>(task, states, callback)
                                                       : run_sequence_stage_in<double>(task, states, callback);
}

StageGradcheck check_frame_stage(const StageTask& task, const FrameTask& frame, const SceneState& state,
                                 const ColorState& colors, const StageGradcheckOptions& options) {
  Tape<double> tape;
  const auto [graph, inputs] = record_frame<double>(tape, task, frame, state, colors, std::nullopt);
  return check_stage_gradient(tape, task.config.stages[task.stage].second, task.losses, inputs, graph->groups(),
                              name_in_frame(task, frame), options);
}

StageGradcheck check_sequence_stage(const StageTask& task, const std::vector<SceneState>& states,
                                    const StageGradcheckOptions& options) {
  const auto& [name, stage] = task.config.stages[task.stage];
  Tape<double> tape;
  const SequenceGraph<double> graph = record_sequence<double>(tape, task, states);
  return check_stage_gradient(tape, stage, task.losses, graph.loss_inputs(), graph.groups(), name, options);
}

template RecordedFrame<float> record_frame(Tape<float>&, const StageTask&, const FrameTask&, const SceneState&,
                                           const ColorState&, std::optional<double>);
template RecordedFrame<double> record_frame(Tape<double>&, const StageTask&, const FrameTask&, const SceneState&,
                                            const ColorState&, std::optional<double>);
template SequenceGraph<float> record_sequence(Tape<float>&, const StageTask&, const std::vector<SceneState>&);
template SequenceGraph<double> record_sequence(Tape<double>&, const StageTask&, const std::vector<SceneState>&);

std::vector<ColorNet> first_nets(const RunConfig& config, const Clip& clip) {
  std::vector<ColorNet> nets;
  for (std::size_t p = 0; p < clip.people(); ++p) {
    std::optional<ColorNet> net =
        first_color_net(config.color_net, clip.person(p).avatar, config.seed + static_cast<std::int64_t>(p));
    if (!net) return {};
    nets.push_back(std::move(*net));
  }
  return nets;
}

Image render_state(const RunConfig& config, const Clip& clip, const SceneState& state, const ColorState& colors) {
  return picture(config, clip, state, colors, false).image;
}

StatePicture picture_of_state(const RunConfig& config, const Clip& clip, const SceneState& state,
                              const ColorState& colors) {
  return picture(config, clip, state, colors, true);
}

}  // namespace hsi4d
