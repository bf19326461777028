#include "pipelines/reconstruct.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>

#include "body/kinematics.h"
#include "body/motion_edit.h"
#include "body/pose_prior.h"
#include "core/camera_file.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/rotation.h"
#include "core/text.h"
#include "optim/metrics.h"
#include "optim/stage.h"
#include "pipelines/evaluate.h"
#include "pipelines/frame_graph.h"
#include "pipelines/frame_images.h"
#include "pipelines/gradient_table.h"
#include "pipelines/input_hashes.h"
#include "pipelines/penetration.h"
#include "pipelines/run_results.h"
#include "pipelines/run_state.h"
#include "pipelines/sequence_graph.h"

namespace hsi4d {

namespace {

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

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

std::string checkpoint_file(const RunPaths& paths) { return paths.checkpoint() + "/progress.npz"; }

/// The text that the checkpoints of a run belong to.
std::string checkpoint_identity(const RunConfig& config, const std::vector<LossTerm>& losses) {
  return to_json(sections_beside_data(config, descriptions_of(losses)));
}

std::optional<ColorNet> first_net(const RunConfig& config, const Clip& clip) {
  return first_color_net(config.color_net, clip.avatar, config.seed);
}

/// Stages that are run frame by frame; those over the sequence come after them.
std::size_t count_frame_stages(const RunConfig& config) {
  const auto is_of_frame = [](const auto& entry) { return entry.second.over == StageScope::kFrame; };
  return static_cast<std::size_t>(std::count_if(config.stages.begin(), config.stages.end(), is_of_frame));
}

/// What is in a checkpoint, if its inputs are still the same.
RunProgress read_checkpoint(const std::string& file, const std::string& identity, const RunConfig& config,
                            const Clip& clip) {
  RunProgress progress;
  try {
    progress = load_progress(file, identity, clip, count_frame_stages(config), first_net(config, clip));
  } catch (const DataError& damage) {
    throw DataError(std::string(damage.what()) + "; without this file the run begins anew");
  }
  std::vector<ClipFile> files = clip.files;
  for (Index t = 0; t < progress.frames_done(); ++t) {
    const std::vector<ClipFile> of_frame = frame_files(config.data, clip, t);
    files.insert(files.end(), of_frame.begin(), of_frame.end());
  }
  check_unchanged(progress.inputs, files, file);
  return progress;
}

/// What is told of a run that was stopped in frame `frame` of `frames`, or after the last of them: those before it are
/// kept, frame 0 being given.
std::string stop_message(Index frame, Index frames) {
  const std::string text =
      "interrupted " + (frame < frames ? "in frame " + std::to_string(frame) : "after the last frame") + "; ";
  if (frame == 1) return text + "no frame was finished";
  return text + (frame == 2 ? "frame 1 is" : "frames 1 to " + std::to_string(frame - 1) + " are") +
         " finished and kept";
}

/// Frames before the one at hand that terms over the motion see: three differences need as many.
constexpr std::ptrdiff_t kFramesBefore = 3;

class Reconstruction {
 public:
  Reconstruction(const RunConfig& config, const Clip& clip, const std::vector<LossTerm>& losses, RunFolder& folder,
                 const Observer& observer)
      : config_(config),
        losses_(losses),
        folder_(folder),
        observer_(observer),
        identity_(checkpoint_identity(config, losses)),
        clip_(clip),
        frame_stages_(count_frame_stages(config)),
        progress_(first_progress(clip_, frame_stages_, first_net(config, clip))),
        start_colors_(progress_.colors),
        bar_(config.name, total_steps(), observer.progress, observer.progress_interval) {}

  RunSummary run() {
    resume();
    while (progress_.frames_done() < clip_.frames()) run_frame(progress_.frames_done());
    if (frame_stages_ < config_.stages.size()) refine();
    bar_.finish();
    tell_left_out();
    write_results(folder_.paths(), config_, clip_, result(), progress_.colors);
    const RunSummary summary = summarize();
    folder_.write_summary(summary);
    write_body(folder_.paths(), config_, clip_, result());
    write_preview(folder_.paths(), clip_, result(), [this](Index frame, const SceneState& state) {
      stop_if_asked(clip_.frames());
      return rendered_image(state, colors_after(frame));
    });
    return summary;
  }

 private:
  std::int64_t total_steps() const {
    std::int64_t steps = 0;
    for (std::size_t s = frame_stages_; s < config_.stages.size(); ++s) steps += config_.stages[s].second.iterations;
    return steps + steps_a_frame() * (clip_.frames() - 1);
  }
  std::int64_t steps_a_frame() const {
    std::int64_t steps = 0;
    for (std::size_t s = 0; s < frame_stages_; ++s) steps += config_.stages[s].second.iterations;
    return steps;
  }

  void resume() {
    const std::string file = checkpoint_file(folder_.paths());
    if (folder_.resumed_from() && std::filesystem::exists(file)) {
      progress_ = read_checkpoint(file, identity_, config_, clip_);
    } else {
      add_covered(read_frame(clip_, 0), config_.data, progress_.covered);
      progress_.inputs = input_hashes(clip_.files) + input_hashes(frame_files(config_.data, clip_, 0));
    }
    folder_.take_over_config();
    if (folder_.resumed_from())
      folder_.note("resumed with frame " + std::to_string(progress_.frames_done()) + " of " +
                   std::to_string(clip_.frames() - 1));
    folder_.truncate_metrics_after(static_cast<int>(progress_.frames_done()) - 1);
    bar_.skip(steps_a_frame() * (progress_.frames_done() - 1));
  }

  void run_frame(Index index) {
    const auto begin = std::chrono::steady_clock::now();
    const ClipFrame frame = read_frame(clip_, index);
    add_covered(frame, config_.data, progress_.covered);
    SceneState state = frame_start(config_.start, clip_, progress_.after_stage.back());
    ColorState colors = progress_.colors;
    std::vector<SceneState> after;
    for (std::size_t s = 0; s < frame_stages_; ++s) {
      if (config_.precision == RunPrecision::kFloat) {
        run_frame_stage<float>(index, s, frame, state, colors);
      } else {
        run_frame_stage<double>(index, s, frame, state, colors);
      }
      after.push_back(state);
    }
    progress_.colors = std::move(colors);
    write_images(index, frame, state, progress_.colors, progress_.image_errors);
    if (progress_.colors.net && moves_colors(config_))
      write_color_net(folder_.paths().frame_color_net(static_cast<int>(index)), *progress_.colors.net);
    write_start_image(index, frame);
    for (std::size_t s = 0; s < after.size(); ++s) progress_.after_stage[s].push_back(after[s]);
    progress_.inputs += input_hashes(frame_files(config_.data, clip_, index));
    progress_.seconds += seconds_since(begin);
    save_progress(checkpoint_file(folder_.paths()), identity_, progress_);
  }

  /// The stages over the whole sequence, each from where the one before ended.
  void refine() {
    const auto begin = std::chrono::steady_clock::now();
    for (std::size_t s = frame_stages_; s < config_.stages.size(); ++s) {
      std::vector<SceneState> states = result();
      StageTotals totals;
      if (config_.precision == RunPrecision::kFloat) {
        run_sequence_stage<float>(s, states, totals);
      } else {
        run_sequence_stage<double>(s, states, totals);
      }
      refined_.push_back({std::move(states), totals});
    }
    refined_errors_.resize(1);
    for (Index t = 1; t < clip_.frames(); ++t) {
      stop_if_asked(clip_.frames());
      const ClipFrame frame = read_frame(clip_, t);
      write_images(t, frame, result()[static_cast<std::size_t>(t)], colors_after(t), refined_errors_);
    }
    refined_seconds_ = seconds_since(begin);
  }

  template <class S>
  void run_sequence_stage(std::size_t s, std::vector<SceneState>& states, StageTotals& totals) {
    const auto& [name, stage] = config_.stages[s];
    Tape<S> tape;
    const bool moves_pose = find_entry(stage.optimize, "pose_latents") != nullptr;
    const PosePrior prior = stage.pose_prior ? *stage.pose_prior : read_pose_prior(stage.pose_weights.string());
    const SequenceGraph<S> graph(tape, clip_, states, moves_pose ? &prior : nullptr, config_.rotations);
    std::string begin;
    const auto note_iteration = [&](const IterationReport& report) {
      if (report.iteration == 0) begin = loss_text(report.loss, report.terms);
      note(std::nullopt, s, report, nullptr);
    };
    const StageResult result = run_stage<S>(tape, stage, losses_, graph.loss_inputs(), graph.groups(), note_iteration,
                                            {.name = name, .kept = nullptr});
    graph.read_states(stage.optimize, states);
    totals.iterations = result.iterations;
    totals.rollbacks = result.rollbacks;
    totals.seconds = result.seconds;
    tell_terms_off(name, stage, result.off);
    folder_.note("all frames, " + stage_line(name, result, begin));
  }

  /// The color net as it was after a frame, in the precision of its file, so that a resumed run has the same.
  ColorState colors_after(Index frame) const {
    ColorState colors = start_colors_;
    if (frame > 0 && colors.net && moves_colors(config_))
      colors.net = read_color_net(folder_.paths().frame_color_net(static_cast<int>(frame)), clip_.avatar.count(),
                                  clip_.avatar.joint_count());
    return colors;
  }

  /// All frames after the last stage so far.
  const std::vector<SceneState>& result() const {
    return refined_.empty() ? progress_.after_stage.back() : refined_.back().states;
  }

  FrameGraphSettings graph_settings(Draw draw, const ColorState& colors) const {
    return {config_.render,
            config_.skip,
            config_.approx,
            config_.rotations,
            config_.camera.increment,
            draw,
            Vector3<double>(config_.background.data()),
            colors.net ? &*colors.net : nullptr,
            config_.color_net.pose_gradient,
            config_.color_net.camera_gradient,
            false};
  }

  /// Whether a term that is on reads the human's opacity.
  bool reads_human_opacity(const StageSettings& stage) const {
    return std::any_of(losses_.begin(), losses_.end(), [&stage](const LossTerm& term) {
      const LossSettings* const chosen = find_entry(stage.losses, term.description.name);
      const std::vector<std::string>& reads = term.description.reads;
      return chosen != nullptr && chosen->weight != 0 &&
             std::find(reads.begin(), reads.end(), kReadsHumanOpacity) != reads.end();
    });
  }

  /// The frames that terms over the motion see: up to kFramesBefore that are done, and the one at hand.
  std::vector<SceneState> seen_frames(const SceneState& state) const {
    const std::vector<SceneState>& done = progress_.after_stage.back();
    std::vector<SceneState> frames(done.end() - std::min(kFramesBefore, std::ssize(done)), done.end());
    frames.push_back(state);
    return frames;
  }

  template <class S>
  void run_frame_stage(Index index, std::size_t s, const ClipFrame& frame, SceneState& state, ColorState& colors) {
    const auto& [name, stage] = config_.stages[s];
    Tape<S> tape;
    FrameGraphSettings settings = graph_settings(stage.draw, colors);
    settings.human_opacity = stage.draw == Draw::kAll && reads_human_opacity(stage);
    FrameGraph<S> graph(tape, clip_, state.camera_from_world, settings);
    graph.set_state(state);
    if (stage.draw == Draw::kAll) graph.give_motion(seen_frames(state));
    const Image weight = pixel_weights(stage.weight, frame);
    graph.set_targets(targets_of(frame, stage, weight));
    std::string begin;  // of the loss, for the log
    const auto note_iteration = [&](const IterationReport& report) {
      if (report.iteration == 0) begin = loss_text(report.loss, report.terms);
      note(index, s, report, graph.rendered().counters.get());
    };
    const StageResult result =
        run_stage<S>(tape, stage, losses_, graph.loss_inputs(), graph.groups(), note_iteration,
                     {.name = name + ", frame " + std::to_string(index), .kept = &colors.moments});
    graph.read_state(stage.optimize, state);
    if (colors.net) graph.read_color_net(stage.optimize, *colors.net);
    StageTotals& totals = progress_.totals[s];
    totals.iterations += result.iterations;
    totals.rollbacks += result.rollbacks;
    totals.seconds += result.seconds;
    // By then all frames before are there that terms over the motion want to see.
    if (index == std::min<Index>(kFramesBefore, clip_.frames() - 1)) tell_terms_off(name, stage, result.off);
    for (const LeftOutObject& object : result.left_out) {
      progress_.left_out.push_back({s, index, object.object, object.term, object.reason});
    }
    folder_.note("frame " + std::to_string(index) + ", " + stage_line(name, result, begin) + left_out_text(result));
  }

  static std::string loss_text(double loss, std::span<const LossValue> terms) {
    std::vector<std::string> parts;
    for (const LossValue& term : terms) parts.push_back(term.name + " " + rounded(term.value, 4));
    return rounded(loss, 4) + " (" + joined(parts) + ")";
  }

  /// What a stage did, for the log.
  static std::string stage_line(const std::string& stage, const StageResult& result, const std::string& begin) {
    std::string text = "stage " + stage + ": " + std::to_string(result.iterations) + " iterations in " +
                       rounded(result.seconds, 3) + " s, loss " + begin + " -> " + loss_text(result.loss, result.terms);
    if (result.rollbacks > 0) text += ", " + std::to_string(result.rollbacks) + " steps not taken";
    return text;
  }

  std::string left_out_text(const StageResult& result) const {
    std::string text;
    for (const LeftOutObject& object : result.left_out) {
      text += ", " + object.term + " without " + clip_.objects[static_cast<std::size_t>(object.object)].name + " in " +
              std::to_string(object.evaluations) + " of " + std::to_string(result.iterations + 1) + " evaluations";
    }
    return text;
  }

  /// Every object that a term of a stage left out: one warning, with its frames.
  void tell_left_out() const {
    std::map<std::string, std::vector<Index>> frames;  // by message
    std::vector<std::string> messages;                 // in the order in which it first happened
    for (const LeftOutInFrame& entry : progress_.left_out) {
      const std::string begin = "stage " + config_.stages[entry.stage].first + ": the loss \"" + entry.term +
                                "\" was off for the object \"" +
                                clip_.objects[static_cast<std::size_t>(entry.object)].name + "\" (" + entry.reason +
                                "), in some iterations at least, in ";
      if (frames[begin].empty()) messages.push_back(begin);
      if (frames[begin].empty() || frames[begin].back() != entry.frame) frames[begin].push_back(entry.frame);
    }
    for (const std::string& begin : messages) {
      const std::vector<Index>& of_object = frames[begin];
      log_warning(begin + (of_object.size() == 1 ? "frame " : "frames ") + frame_ranges(of_object));
    }
  }

  static void tell_terms_off(const std::string& name, const StageSettings& stage, const std::vector<std::string>& off) {
    for (const std::string& term : off) {
      const LossSettings* const settings = find_entry(stage.losses, term);
      log_warning("stage " + name + ": the loss \"" + term + "\" is off: " +
                  (settings != nullptr && settings->weight == 0 ? "its weight is 0" : "it lacks an input"));
    }
  }

  /// Empty where every pixel counts.
  Image pixel_weights(PixelWeight weight, const ClipFrame& frame) const {
    if (weight == PixelWeight::kUnoccluded) return complement(progress_.covered);
    if (weight == PixelWeight::kAll) return {};
    Image covered(1, clip_.camera.height, clip_.camera.width);
    add_covered(frame, config_.data, covered);
    return covered;
  }

  FrameTargets targets_of(const ClipFrame& frame, const StageSettings& stage, const Image& weight) const {
    FrameTargets targets;
    targets.image = &frame.target;
    targets.weight = stage.weight == PixelWeight::kAll ? nullptr : &weight;
    targets.human_mask = &frame.human_mask;
    for (const Image& mask : frame.object_masks) {
      targets.object_masks.push_back(&mask);
      targets.centers.push_back(mask_center(mask, config_.data.mask_threshold));
    }
    for (std::size_t o = 0; o < clip_.objects.size(); ++o) {
      targets.depths.push_back(
          mean_depth(clip_.objects[o].gaussians, clip_.first.objects[o], clip_.first.camera_from_world));
    }
    return targets;
  }

  /// @param frame     none: all at once
  /// @param counters  null: nothing was drawn
  void note(std::optional<Index> frame, std::size_t s, const IterationReport& report, const RenderCounters* counters) {
    const std::string& stage = config_.stages[s].first;
    if (report.rolled_back) {
      log_warning((frame ? "frame " + std::to_string(*frame) : "all frames") + ", stage " + stage + ", iteration " +
                  std::to_string(report.iteration) + ": no step, " + std::string(report.offender));
    }
    IterationRecord record;
    if (frame) record.frame = static_cast<int>(*frame);
    record.stage = stage;
    record.iteration = report.iteration;
    record.loss = report.loss;
    for (const LossValue& term : report.terms) record.losses.emplace_back(term.name, term.value);
    record.seconds = report.seconds;
    record.rolled_back = report.rolled_back;
    record.gradient_shares = report.gradient_shares;
    if (counters != nullptr) add_counters(*counters, progress_.totals[s], record);
    folder_.append_metrics(record);
    bar_.step_with("loss", report.loss);
    stop_if_asked(frame.value_or(clip_.frames()));
  }

  /// @param frame  the one at hand; that beyond the last: all are done
  void stop_if_asked(Index frame) const {
    if (observer_.wants_stop()) throw Interrupted(stop_message(frame, clip_.frames()));
  }

  static void add_counters(const RenderCounters& counters, StageTotals& totals, IterationRecord& record) {
    totals.tiles += counters.tiles;
    totals.pairs += counters.pairs;
    totals.fragments += counters.fragments;
    for (const auto& [name, count] : {std::pair{"tiles", counters.tiles},
                                      {"pairs", counters.pairs},
                                      {"groups", counters.groups},
                                      {"fragments", counters.fragments},
                                      {"layers", counters.layers},
                                      {"adjoint_tiles", counters.adjoint_tiles}}) {
      record.counters.emplace_back(name, static_cast<double>(count));
    }
  }

  template <class S>
  Image render_state(const SceneState& state, const ColorState& colors) const {
    Tape<S> tape;
    FrameGraph<S> graph(tape, clip_, state.camera_from_world, graph_settings(Draw::kAll, colors));
    graph.set_state(state);
    tape.forward(graph.rendered().image);
    return to_image(tape.value(graph.rendered().image));
  }
  Image rendered_image(const SceneState& state, const ColorState& colors) const {
    return config_.precision == RunPrecision::kFloat ? render_state<float>(state, colors)
                                                     : render_state<double>(state, colors);
  }

  /// Writes the images of a frame and notes how far the result's is from the video's.
  void write_images(Index index, const ClipFrame& frame, const SceneState& state, const ColorState& colors,
                    std::vector<MetricValues>& errors) {
    const RunPaths& paths = folder_.paths();
    const auto number = static_cast<int>(index);
    const Image image = rendered_image(state, colors), foreground = foreground_of(frame);
    write_image(paths.frame_image(number, "target"), frame.target);
    write_image(paths.frame_image(number, "render"), image);
    write_image(paths.frame_image(number, "difference"), difference_image(image, frame.target));
    errors.push_back(image_errors(image, frame.target, &foreground));
  }

  void write_start_image(Index index, const ClipFrame& frame) {
    const Image start = rendered_image(baseline_start(index), start_colors_), foreground = foreground_of(frame);
    write_image(folder_.paths().frame_image(static_cast<int>(index), "start"), start);
    progress_.start_errors.push_back(image_errors(start, frame.target, &foreground));
  }

  /// What the run is given for a frame before it does anything.
  SceneState baseline_start(Index index) const {
    SceneState state = clip_.first;
    if (!clip_.estimate.empty()) state.body = clip_.estimate[static_cast<std::size_t>(index)];
    if (!clip_.object_estimate.empty()) state.objects = clip_.object_estimate[static_cast<std::size_t>(index)];
    return state;
  }

  RunSummary summarize() const {
    RunSummary summary;
    summary.name = config_.name;
    summary.frames = static_cast<int>(clip_.frames());
    summary.seconds = progress_.seconds + refined_seconds_;
    for (std::size_t s = 0; s < config_.stages.size(); ++s) summary.metrics.push_back(summarize_stage(s));
    summary.baselines = {{"start", {}, {}}};
    if (clip_.truth) add_errors(summary);
    std::vector<FrameMetrics> before_refinement;
    if (!refined_.empty())
      add_image_errors(progress_.image_errors, summary.metrics[frame_stages_ - 1].values, before_refinement);
    add_image_errors(refined_.empty() ? progress_.image_errors : refined_errors_, summary.metrics.back().values,
                     summary.per_frame);
    add_image_errors(progress_.start_errors, summary.baselines[0].values, summary.baselines[0].per_frame);
    if (clip_.surface) add_penetration(summary);
    add_gradient_shares(summary);
    return summary;
  }

  /// Adds errors of images, which need no truth, to means and frames.
  static void add_image_errors(const std::vector<MetricValues>& errors, MetricValues& means,
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

  /// The frames after a stage.
  const std::vector<SceneState>& states_after(std::size_t s) const {
    return s < frame_stages_ ? progress_.after_stage[s] : refined_[s - frame_stages_].states;
  }

  /// Of the start, of what every stage that moves the body left, and of the result's frames.
  void add_penetration(RunSummary& summary) const {
    summary.surface = clip_.surface_file;
    const auto add = [](const MetricValues& more, MetricValues& values) {
      values.insert(values.end(), more.begin(), more.end());
    };
    const auto add_all = [&](const std::vector<SceneState>& states, MetricValues& means,
                             std::vector<FrameMetrics>& per_frame) {
      const std::vector<Penetration> counts = penetration_by_frame(clip_, states);
      add(mean_penetration(counts), means);
      for (FrameMetrics& frame : per_frame)
        add(penetration_values(counts[static_cast<std::size_t>(frame.frame)]), frame.values);
    };
    std::vector<SceneState> start;
    for (Index t = 0; t < clip_.frames(); ++t) start.push_back(baseline_start(t));
    add_all(start, summary.baselines[0].values, summary.baselines[0].per_frame);
    std::vector<FrameMetrics> none;
    for (std::size_t s = 0; s < config_.stages.size(); ++s) {
      if (s < frame_stages_ && config_.stages[s].second.draw == Draw::kScene) continue;
      const bool is_last = s + 1 == config_.stages.size();
      add_all(states_after(s), summary.metrics[s].values, is_last ? summary.per_frame : none);
    }
  }

  /// From the lines of metrics.jsonl, which a run that was resumed has whole.
  void add_gradient_shares(RunSummary& summary) const {
    const auto measures = [](const auto& entry) { return entry.second.gradient_shares > 0; };
    if (std::none_of(config_.stages.begin(), config_.stages.end(), measures)) return;
    const std::string lines = read_text_file(folder_.paths().metrics());
    for (std::size_t s = 0; s < config_.stages.size(); ++s) {
      if (measures(config_.stages[s]))
        summary.metrics[s].gradient_shares =
            mean_gradient_shares(lines, config_.stages[s].first, folder_.paths().metrics());
    }
  }

  StageSummary summarize_stage(std::size_t s) const {
    const auto& [name, stage] = config_.stages[s];
    const bool is_of_frame = s < frame_stages_;
    const StageTotals& totals = is_of_frame ? progress_.totals[s] : refined_[s - frame_stages_].totals;
    StageSummary summary{name, totals.seconds, totals.iterations, {}};
    if (clip_.truth) summary.values = errors_of(states_after(s), is_of_frame ? stage.draw : Draw::kAll);
    for (const auto& [counter, count] : {std::pair{"rollbacks", totals.rollbacks},
                                         {"tiles", totals.tiles},
                                         {"pairs", totals.pairs},
                                         {"fragments", totals.fragments}}) {
      summary.values.emplace_back(counter, static_cast<double>(count));
    }
    return summary;
  }

  MetricValues errors_of(const std::vector<SceneState>& states, Draw draw) const {
    return sequence_summary(placed(clip_, states, draw), placed(clip_, *clip_.truth, draw), clip_.frame_rate);
  }

  void add_errors(RunSummary& summary) const {
    const std::vector<FrameState> truth = placed(clip_, *clip_.truth, Draw::kAll);
    std::vector<SceneState> start, copy;
    for (Index t = 0; t < clip_.frames(); ++t) {
      start.push_back(baseline_start(t));
      copy.push_back(clip_.first);
    }
    summary.baselines.clear();
    for (const auto& [name, states] : {std::pair{"start", &start}, std::pair{"copy_frame_0", &copy}}) {
      summary.baselines.push_back(
          {name, errors_of(*states, Draw::kAll), sequence_errors(placed(clip_, *states, Draw::kAll), truth)});
    }
    summary.per_frame = sequence_errors(placed(clip_, result(), Draw::kAll), truth);
  }

  const RunConfig& config_;
  const std::vector<LossTerm>& losses_;
  RunFolder& folder_;
  const Observer& observer_;
  std::string identity_;  // the text that a checkpoint of this run belongs to
  /// All frames after a stage over the sequence.
  struct Refined {
    std::vector<SceneState> states;
    StageTotals totals;
  };

  const Clip& clip_;
  std::size_t frame_stages_;
  RunProgress progress_;
  std::vector<Refined> refined_;
  double refined_seconds_ = 0;
  std::vector<MetricValues> refined_errors_;  // of the images of the last, as progress_.image_errors
  const ColorState start_colors_;
  Progress bar_;
};

}  // namespace

Index finished_frames(const std::string& folder, const RunConfig& config, const Clip& clip,
                      const std::vector<LossTerm>& losses) {
  const std::string file = checkpoint_file(RunPaths{folder});
  if (!std::filesystem::exists(file)) return 0;
  return read_checkpoint(file, checkpoint_identity(config, losses), config, clip).frames_done() - 1;
}

RunSummary reconstruct(const RunConfig& config, const Clip& clip, const std::vector<LossTerm>& losses,
                       RunFolder& folder, const Observer& observer) {
  return Reconstruction(config, clip, losses, folder, observer).run();
}

}  // namespace hsi4d
