#include "pipelines/run/reconstruct.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <limits>
#include <optional>

#include "body/avatar_shape.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/simd.h"
#include "core/stopwatch.h"
#include "core/text.h"
#include "optim/metrics.h"
#include "pipelines/config/parameter_groups.h"
#include "pipelines/config/run_problems.h"
#include "pipelines/draw/frame_images.h"
#include "pipelines/draw/view_turn.h"
#include "pipelines/draw/visibility.h"
#include "pipelines/input/body_files.h"
#include "pipelines/input/clip_unknowns.h"
#include "pipelines/input/input_hashes.h"
#include "pipelines/metrics/background_errors.h"
#include "pipelines/metrics/sequence_errors.h"
#include "pipelines/record/results.h"
#include "pipelines/record/run_events.h"
#include "pipelines/report/view3d.h"
#include "pipelines/run/checkpoint.h"
#include "pipelines/run/depth_bias.h"
#include "pipelines/run/frame_start.h"
#include "pipelines/run/heading_starts.h"
#include "pipelines/run/reconstruct_stage.h"
#include "pipelines/run/stage_log.h"
#include "pipelines/run/start_choice.h"
#include "pipelines/run/summarize.h"

namespace hsi4d {

namespace {

std::string checkpoint_file(const RunPaths& paths) { return paths.checkpoint() + "/progress.npz"; }

/// The text that the checkpoints of a run belong to.
std::string checkpoint_identity(const RunConfig& config, const std::vector<LossTerm>& losses) {
  return to_json(sections_beside_data(config, descriptions_of(losses)));
}

std::size_t count_stages(const RunConfig& config, StageScope over) {
  const auto is_over = [over](const auto& entry) { return entry.second.over == over; };
  return static_cast<std::size_t>(std::count_if(config.stages.begin(), config.stages.end(), is_over));
}

/// What is in a checkpoint, if its inputs are still the same.
RunProgress read_checkpoint(const std::string& file, const std::string& identity, const RunConfig& config,
                            const Clip& clip) {
  RunProgress progress;
  try {
    progress = load_progress(file, identity, clip, count_stages(config, StageScope::kFrame), first_net(config, clip),
                             count_stages(config, StageScope::kFirst));
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

/// The kernels of another instruction set round otherwise. (Another precision is another config, which is refused.)
void warn_of_other_isa(const std::string& before) {
  const std::string now = isa_name(best_isa());
  if (!before.empty() && before != now)
    log_warning("resumed with instruction set " + now + ", the frames so far were made with " + before +
                ": the bits will differ from those of a run that was never stopped");
}

/// What is told of a run that was stopped in frame `frame` of `frames`, or after the last of them: those before it are
/// kept.
/// @param first  the first frame that is worked on: 1, or 0 where frame 0 is not as given
std::string stop_message(Index frame, Index frames, Index first) {
  const std::string text =
      "interrupted " + (frame < frames ? "in frame " + std::to_string(frame) : "after the last frame") + "; ";
  if (frame == first) return text + "no frame was finished";
  const std::string from = std::to_string(first);
  return text +
         (frame == first + 1 ? "frame " + from + " is"
                             : "frames " + from + " to " + std::to_string(frame - 1) + " are") +
         " finished and kept";
}

class Reconstruction {
 public:
  Reconstruction(const RunConfig& config, Clip& clip, const std::vector<LossTerm>& losses, RunFolder& folder,
                 const Observer& observer)
      : config_(config),
        losses_(losses),
        folder_(folder),
        observer_(observer),
        identity_(checkpoint_identity(config, losses)),
        clip_(clip),
        first_stages_(count_stages(config, StageScope::kFirst)),
        frame_stages_(count_stages(config, StageScope::kFrame)),
        progress_(first_progress(clip_, frame_stages_, first_net(config, clip))),
        sigmas_(no_sigmas(clip.objects.size())),
        surest_stage_(config.uncertainty ? stage_of_sigmas(config) : std::nullopt),
        start_colors_(progress_.colors),
        bar_(config.name, total_steps(), observer.progress, observer.progress_interval) {}

  RunSummary run() {
    resume();
    if (progress_.frames_done() == 0) run_first_frame();
    while (progress_.frames_done() < clip_.frames()) run_frame(progress_.frames_done());
    if (config_.remove_depth_bias) remove_bias();
    if (sequence_stage() < config_.stages.size()) refine();
    bar_.finish();
    warn_of_left_out(progress_.left_out, config_, clip_);
    warn_of_still_groups(progress_.still, config_);
    warn_of_left_ranges(progress_.left_ranges, config_);
    warn_of_what_is_out_of_view(clip_, result());
    write_results(folder_.paths(), config_, clip_, result(), progress_.colors, progress_.sigmas);
    if (!progress_.unknowns.betas.empty()) write_found_avatar();
    RunSummary summary = summarize_run(config_, clip_, progress_, refinement_);
    add_gradient_shares(config_, folder_.paths().metrics(), summary);
    folder_.write_summary(summary);
    if (events_) events_->add_result(summary);
    const std::optional<BodyModel> body =
        write_body(folder_.paths(), found_body(), clip_.avatar, motion_of(clip_, result()));
    view3d_file(clip_, result(), body ? &*body : nullptr).write(folder_.paths().view3d());
    RunConfig other_side = config_;
    const auto render = [&](Index frame, const SceneState& state, const auto& background) {
      stop_if_asked(clip_.frames());
      if (background) other_side.background = *background;
      return render_state(background ? other_side : config_, clip_, state, colors_after(frame));
    };
    write_views(folder_.paths(), clip_, result(), render, config_.log.preview);
    return summary;
  }

 private:
  /// Stages over the first frame come first, then those over frames, and last those over the sequence.
  std::size_t sequence_stage() const { return first_stages_ + frame_stages_; }

  std::int64_t steps_of(StageScope over) const {
    std::int64_t steps = 0;
    for (const auto& [name, stage] : config_.stages) steps += stage.over == over ? stage.iterations : 0;
    return steps;
  }
  /// Steps of the frames before `frame`.
  std::int64_t steps_before(Index frame) const {
    if (frame == 0) return 0;
    return steps_of(StageScope::kFirst) + steps_of(StageScope::kFrame) * (frame - 1);
  }
  std::int64_t total_steps() const {
    return steps_before(clip_.frames()) + steps_of_bias() + steps_of(StageScope::kSequence);
  }
  /// Of a fit of frame 0.
  std::int64_t steps_of_bias() const {
    std::int64_t steps = 0;
    for (std::size_t s = first_stages_; config_.remove_depth_bias && s < sequence_stage(); ++s)
      steps += fits_what_moves(s) ? config_.stages[s].second.iterations : 0;
    return steps;
  }
  bool fits_what_moves(std::size_t s) const { return config_.stages[s].second.draw == Draw::kAll; }

  void resume() {
    const std::string file = checkpoint_file(folder_.paths());
    if (folder_.resumed_from() && std::filesystem::exists(file)) {
      progress_ = read_checkpoint(file, identity_, config_, clip_);
      apply_unknowns(progress_.unknowns, clip_);
      warn_of_other_isa(progress_.isa);
    } else {
      if (first_stages_ > 0) progress_.after_stage.assign(frame_stages_, {});  // frame 0 is yet to be found
      if (config_.uncertainty && first_stages_ == 0) progress_.sigmas = {sigmas_};
      const ClipFrame frame = read_frame(clip_, 0);
      warn_of_other_first_frame(render_state(config_, clip_, clip_.first, start_colors_), frame.target);
      add_covered(frame, config_.data, progress_.covered);
      progress_.inputs = input_hashes(clip_.files) + input_hashes(frame_files(config_.data, clip_, 0));
    }
    folder_.take_over_config();
    if (folder_.resumed_from())
      folder_.note("resumed with frame " + std::to_string(progress_.frames_done()) + " of " +
                   std::to_string(clip_.frames() - 1));
    folder_.truncate_metrics_after(static_cast<int>(progress_.frames_done()) - 1);
    begin_events();
    bar_.skip(steps_before(progress_.frames_done()));
  }

  /// Shows the frames that are done, and from then on what comes.
  void begin_events() {
    if (!config_.log.tensorboard) return remove_run_events(folder_.paths());
    const bool are_drawn_again = config_.remove_depth_bias || sequence_stage() < config_.stages.size();
    events_.emplace(folder_, ShownImages{config_.log.images_every, are_drawn_again}, first_worked_on(),
                    progress_.frames_done());
  }

  /// The stages over frame 0, from the given state on. What they find stands in its place from then on.
  void run_first_frame() {
    const auto begin = std::chrono::steady_clock::now();
    const ClipFrame frame = read_frame(clip_, 0);
    progress_.image_errors.clear();
    progress_.start_errors.clear();
    write_start_image(0, frame);
    SceneState state = clip_.first;
    for (std::size_t s = 0; s < first_stages_; ++s) {
      if (config_.stages[s].second.headings > 1) state = chosen_heading(s, frame, state);
      StageTotals totals;
      ClipUnknowns found;
      run_in_frame(s, {0, frame, progress_.covered, {}}, state, progress_.colors, totals, &found);
      take_unknowns(s, found, state);
      progress_.first_frame.push_back({state, totals});
    }
    end_frame(0, frame, std::vector(frame_stages_, state), begin);
  }

  void write_found_avatar() const {
    SafetensorsWriter file = avatar_file(clip_.avatar);
    add_avatar_shape({clip_.avatar.body, found_body().shape, clip_.gender}, file);
    file.write(folder_.paths().avatar());
  }

  /// The body in the shape that was found.
  BodySettings found_body() const {
    BodySettings body = body_of_avatar(config_.body, config_.data.avatar.string());
    const std::vector<double>& betas = progress_.unknowns.betas;
    body.shape.resize(std::max(body.shape.size(), betas.size()));
    for (std::size_t b = 0; b < betas.size(); ++b) body.shape[b] += betas[b];
    return body;
  }

  /// What a stage over the first frame has found of the clip is known from then on, which is told in the log.
  void take_unknowns(std::size_t s, const ClipUnknowns& found, SceneState& state) {
    if (unknown_groups_of(config_.stages[s].second).empty()) return;
    apply_unknowns(found, clip_);
    apply_unknowns(found, clip_, state);
    progress_.unknowns = compose(progress_.unknowns, found);
    folder_.note("found by stage " + config_.stages[s].first + ": " + unknowns_text(found, clip_));
    for (const std::string& doubtful : doubtful_unknowns(found, clip_))
      log_warning("stage " + config_.stages[s].first + " finds " + doubtful +
                  "; frame 0 hardly tells this; give a better start, or leave the group out");
  }

  /// Where a stage over the first frame begins that is tried from several headings, told in the log.
  SceneState chosen_heading(std::size_t s, const ClipFrame& frame, const SceneState& state) {
    const auto& [name, stage] = config_.stages[s];
    const HeadingStart chosen = best_heading(state, stage.headings, [&](const SceneState& start) {
      SceneState tried = start;
      ColorState colors = progress_.colors;
      try {
        return run_frame_stage({config_, clip_, losses_, s, nullptr}, {0, frame, progress_.covered, {}}, tried, colors,
                               [this](const IterationReport&, const RenderCounters&) { stop_if_asked(0); })
            .loss;
      } catch (const StageDivergedError&) {
        return std::numeric_limits<double>::infinity();
      }
    });
    folder_.note("frame 0, start of stage " + name + ": " + chosen.text);
    return chosen.state;
  }

  void run_frame(Index index) {
    const auto begin = std::chrono::steady_clock::now();
    const ClipFrame frame = read_frame(clip_, index);
    add_covered(frame, config_.data, progress_.covered);
    SceneState state = frame_start(config_.start, clip_, progress_.after_stage.back());
    ColorState colors = progress_.colors;
    std::vector<SceneState> after;
    bool has_start = !chooses_start(config_.start);
    for (std::size_t s = 0; s < frame_stages_; ++s) {
      if (!has_start && config_.stages[first_stages_ + s].second.draw == Draw::kAll) {
        state = chosen_start(index, frame, state, colors);
        has_start = true;
      }
      run_in_frame(first_stages_ + s, {index, frame, progress_.covered, progress_.after_stage.back()}, state, colors,
                   progress_.totals[s]);
      after.push_back(state);
    }
    progress_.colors = std::move(colors);
    write_start_image(index, frame);
    progress_.inputs += input_hashes(frame_files(config_.data, clip_, index));
    end_frame(index, frame, after, begin);
  }

  /// Where the stages that draw everything begin, told in the log.
  SceneState chosen_start(Index index, const ClipFrame& frame, const SceneState& state, const ColorState& colors) {
    const auto begin = std::chrono::steady_clock::now();
    const ChosenStart chosen = choose_start(config_, clip_, progress_.after_stage.back(), frame, state, colors);
    const double seconds = seconds_since(begin);
    progress_.start.add(chosen);
    progress_.start.seconds += seconds;
    const std::string text = start_text(chosen);
    if (!text.empty())
      folder_.note("frame " + std::to_string(index) + ", start: " + text + ", chosen in " + rounded(seconds, 3) + " s");
    return chosen.state;
  }

  /// Keeps what was found in a frame: in memory, as images, in the checkpoint.
  /// @param after  the state after each stage over frames
  void end_frame(Index index, const ClipFrame& frame, const std::vector<SceneState>& after,
                 std::chrono::steady_clock::time_point begin) {
    write_image(folder_.paths().frame_image(static_cast<int>(index), "target"), frame.target);
    write_result(index, frame, after.back(), progress_.colors, progress_.image_errors);
    if (progress_.colors.net && moves_colors(config_))
      write_color_net(folder_.paths().frame_color_net(static_cast<int>(index)), *progress_.colors.net);
    for (std::size_t s = 0; s < after.size(); ++s) progress_.after_stage[s].push_back(after[s]);
    if (config_.uncertainty) progress_.sigmas.push_back(sigmas_);
    progress_.seconds += seconds_since(begin);
    save_progress(checkpoint_file(folder_.paths()), identity_, progress_);
    if (events_) events_->end_frame(index);
  }

  /// Takes what a fit of frame 0 does to the given distances from all later frames. The checkpoint keeps these as they
  /// were: a run that is resumed finds the same.
  void remove_bias() {
    const ClipFrame frame = read_frame(clip_, 0);
    SceneState fitted = clip_.first;
    ColorState colors = progress_.colors;
    for (std::size_t s = first_stages_; s < sequence_stage(); ++s) {
      if (!fits_what_moves(s)) continue;
      const StageResult found =
          run_frame_stage({config_, clip_, losses_, s, nullptr}, {0, frame, progress_.covered, {}}, fitted, colors,
                          [this](const IterationReport& report, const RenderCounters&) {
                            show(report);
                            stop_if_asked(clip_.frames());
                          });
      drop_what_is_left(s, found);
    }
    const DepthBias bias = depth_bias(clip_, frame, config_.data.mask_threshold, clip_.first, fitted);
    folder_.note("frame 0, fitted too: distances times " + depth_bias_text(clip_, bias) +
                 "; taken from all later frames");
    std::vector<SceneState>& states = progress_.after_stage.back();
    for (Index t = 1; t < clip_.frames(); ++t)
      hsi4d::remove_depth_bias(clip_, bias, states[static_cast<std::size_t>(t)]);
    if (sequence_stage() < config_.stages.size()) return;  // these write the images
    progress_.image_errors.resize(1);
    write_results_of_frames(progress_.image_errors);
  }

  /// Images of all frames but the given one, and their errors.
  void write_results_of_frames(std::vector<MetricValues>& errors) {
    for (Index t = 1; t < clip_.frames(); ++t) {
      stop_if_asked(clip_.frames());
      const ClipFrame frame = read_frame(clip_, t);
      write_result(t, frame, result()[static_cast<std::size_t>(t)], colors_after(t), errors);
      if (events_) events_->add_images(t);
    }
  }

  /// The stages over the whole sequence, each from where the one before ended.
  void refine() {
    const auto begin = std::chrono::steady_clock::now();
    for (std::size_t s = sequence_stage(); s < config_.stages.size(); ++s) {
      std::vector<SceneState> states = result();
      const StageTotals totals = run_over_sequence(s, states);
      refinement_.stages.push_back({std::move(states), totals});
    }
    refinement_.image_errors.resize(1);
    write_results_of_frames(refinement_.image_errors);
    refinement_.seconds = seconds_since(begin);
  }

  StageTotals run_over_sequence(std::size_t s, std::vector<SceneState>& states) {
    const auto& [name, stage] = config_.stages[s];
    std::string begin;  // of the loss, for the log
    const auto note_iteration = [&](const IterationReport& report) {
      if (report.iteration == 0) begin = loss_text(report.loss, report.terms);
      note(std::nullopt, s, report, nullptr, nullptr);
    };
    const std::vector<SceneState> before = states;
    const StageResult result =
        run_sequence_stage({config_, clip_, losses_, s, observer_.stages}, states, note_iteration);
    drop_what_is_left(s, result);
    warn_of_terms_off(result.off, name, stage, !clip_.objects.empty());
    warn_of_idle_terms(result.notes, name);
    warn_of_still_joints(clip_, before, states, name);
    folder_.note("all frames, " + stage_text(name, result, begin, clip_));
    return {result.iterations, result.rollbacks, result.seconds};
  }

  /// The color net as it was after a frame, in the precision of its file, so that a resumed run has the same.
  ColorState colors_after(Index frame) const {
    ColorState colors = start_colors_;
    if (frame >= first_worked_on() && colors.net && moves_colors(config_))
      colors.net = read_color_net(folder_.paths().frame_color_net(static_cast<int>(frame)), clip_.avatar.count(),
                                  clip_.avatar.joint_count());
    return colors;
  }

  const std::vector<SceneState>& result() const { return result_of(progress_, refinement_); }

  Index first_worked_on() const { return first_stages_ > 0 ? 0 : 1; }

  /// @param totals  of the stage, to which this is added
  /// @param found   as StageTask has it
  void run_in_frame(std::size_t s, const FrameTask& frame, SceneState& state, ColorState& colors, StageTotals& totals,
                    ClipUnknowns* found = nullptr) {
    const auto& [name, stage] = config_.stages[s];
    std::string begin;  // of the loss, for the log
    GradientWatch gradients;
    const auto note_iteration = [&](const IterationReport& report, const RenderCounters& counters) {
      gradients.see(report.groups);
      if (report.iteration == 0) begin = loss_text(report.loss, report.terms);
      note(frame.index, s, report, &counters, &totals);
    };
    const SceneState before = state;
    const bool is_asked = s == surest_stage_ && frame.index > 0;
    const StageResult result =
        run_frame_stage({config_, clip_, losses_, s, observer_.stages, &tracks_, found, is_asked ? &sigmas_ : nullptr},
                        frame, state, colors, note_iteration);
    drop_what_is_left(s, result);
    if (stage.draw == Draw::kAll) note_left_ranges(s, frame.index, before, state);
    totals.iterations += result.iterations;
    totals.rollbacks += result.rollbacks;
    totals.seconds += result.seconds;
    // By then all frames before are there that terms over the motion want to see.
    if (frame.index == std::min<Index>(kFramesBefore, clip_.frames() - 1) || stage.over == StageScope::kFirst)
      warn_of_terms_off(result.off, name, stage, !clip_.objects.empty());
    for (const LeftOutObject& object : result.left_out) {
      if (!object.reason.empty() && object.of_human && frame.index <= 1)
        log_warning("stage " + name + ": the loss \"" + object.term + "\" has no effect in frame " +
                    std::to_string(frame.index) + ", in some iterations at least: " + object.reason);
      if (!object.reason.empty() && !object.of_human)
        progress_.left_out.push_back({s, frame.index, object.object, object.term, object.reason});
    }
    for (const std::string& group : gradients.still_groups()) progress_.still.push_back({s, frame.index, group});
    folder_.note("frame " + std::to_string(frame.index) + ", " + stage_text(name, result, begin, clip_));
  }

  /// What approximations took for small when the stage began.
  void note_left_ranges(std::size_t s, Index frame, const SceneState& before, const SceneState& after) {
    const ApproxSettings& approx = config_.approx;
    if (!approx.hold_colors && approx.seen_within_deg == 0) return;
    const double turn = view_turn_deg(clip_, before, after);
    if (approx.hold_colors && turn > kHeldColorsDeg) progress_.left_ranges.push_back({s, frame, "hold_colors"});
    if (approx.seen_within_deg > 0 && turn > approx.seen_within_deg)
      progress_.left_ranges.push_back({s, frame, "seen_within_deg"});
  }

  /// @param frame     none: all at once
  /// @param counters, totals  null: nothing was drawn
  void note(std::optional<Index> frame, std::size_t s, const IterationReport& report, const RenderCounters* counters,
            StageTotals* totals) {
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
    record.matrix = report.matrix;
    if (counters != nullptr) add_counters(*counters, *totals, record);
    for (const auto& [name, count] : {std::pair{"forward_nodes", report.tape.forward_nodes},
                                      {"backward_nodes", report.tape.backward_nodes},
                                      {"adjoint_numbers", report.tape.adjoint_numbers}})
      record.counters.emplace_back(name, static_cast<double>(count));
    folder_.append_metrics(record);
    if (events_) events_->add(record);
    show(report);
    stop_if_asked(frame.value_or(clip_.frames()));
  }

  void show(const IterationReport& report) {
    terms_.clear();
    for (const LossValue& term : report.terms) terms_.push_back({term.name, term.value});
    bar_.step_with("loss", report.loss, terms_);
  }

  /// A stage that ended before its last iteration leaves none to wait for.
  void drop_what_is_left(std::size_t s, const StageResult& result) {
    bar_.drop(config_.stages[s].second.iterations - result.iterations);
  }

  /// @param frame  the one at hand; that beyond the last: all are done
  void stop_if_asked(Index frame) const {
    if (observer_.wants_stop()) throw Interrupted(stop_message(frame, clip_.frames(), first_worked_on()));
  }

  static void add_counters(const RenderCounters& counters, StageTotals& totals, IterationRecord& record) {
    totals.tiles += counters.tiles;
    totals.pairs += counters.pairs;
    totals.fragments += counters.fragments;
    for (const auto& [name, count] : {std::pair{"channels", counters.channels},
                                      {"gaussians", counters.gaussians},
                                      {"tiles", counters.tiles},
                                      {"pairs", counters.pairs},
                                      {"groups", counters.groups},
                                      {"fragments", counters.fragments},
                                      {"layers", counters.layers},
                                      {"dirty_tiles", counters.dirty_tiles},
                                      {"adjoint_tiles", counters.adjoint_tiles}}) {
      record.counters.emplace_back(name, static_cast<double>(count));
    }
  }

  /// 1 where neither masks nor the drawn human are.
  static Image background_beside(const StatePicture& picture, const ClipFrame& frame) {
    constexpr float kHardlyHuman = 0.02F;
    Image background = background_of(frame);
    for (int y = 0; y < background.height(); ++y) {
      for (int x = 0; x < background.width(); ++x) {
        if (picture.silhouette(0, y, x) > kHardlyHuman) background(0, y, x) = 0;
      }
    }
    return background;
  }

  static MetricValues picture_errors(const StatePicture& picture, const ClipFrame& frame) {
    const Image foreground = foreground_of(frame);
    MetricValues errors = image_errors(picture.image, frame.target, &foreground);
    const MetricValues background = background_errors(picture.image, frame.target, background_beside(picture, frame));
    errors.insert(errors.end(), background.begin(), background.end());
    const std::optional<double> iou = mask_iou(picture.silhouette, frame.human_mask);
    if (iou) errors.emplace_back("silhouette_iou", *iou);
    return errors;
  }

  /// Writes images of a frame's result and notes how far it is from the video.
  void write_result(Index index, const ClipFrame& frame, const SceneState& state, const ColorState& colors,
                    std::vector<MetricValues>& errors) {
    const RunPaths& paths = folder_.paths();
    const auto number = static_cast<int>(index);
    StatePicture picture = picture_of_state(config_, clip_, state, colors);
    hide_unseen(frame, picture.image);
    write_image(paths.frame_image(number, "render"), picture.image);
    write_image(paths.frame_image(number, "difference"), difference_image(picture.image, frame.target));
    errors.push_back(picture_errors(picture, frame));
  }

  void write_start_image(Index index, const ClipFrame& frame) {
    StatePicture start = picture_of_state(config_, clip_, given_start(clip_, index), start_colors_);
    hide_unseen(frame, start.image);
    write_image(folder_.paths().frame_image(static_cast<int>(index), "start"), start.image);
    progress_.start_errors.push_back(picture_errors(start, frame));
  }

  const RunConfig& config_;
  const std::vector<LossTerm>& losses_;
  RunFolder& folder_;
  std::optional<RunEvents> events_;
  const Observer& observer_;
  std::string identity_;  // the text that a checkpoint of this run belongs to
  Clip& clip_;
  std::size_t first_stages_, frame_stages_;
  RunProgress progress_;
  RefinementProgress refinement_;
  TrackPoints tracks_;                       // of the frames that are done
  PlaceSigmas sigmas_;                       // of the frame at hand
  std::optional<std::size_t> surest_stage_;  // which tells them
  const ColorState start_colors_;
  Progress bar_;
  std::vector<ProgressPart> terms_;  // of the iteration at hand
};

}  // namespace

Index finished_frames(const std::string& folder, const RunConfig& config, const Clip& clip,
                      const std::vector<LossTerm>& losses) {
  const std::string file = checkpoint_file(RunPaths{folder});
  if (!std::filesystem::exists(file)) return 0;
  return read_checkpoint(file, checkpoint_identity(config, losses), config, clip).frames_done() - 1;
}

RunSummary reconstruct(const RunConfig& config, Clip& clip, const std::vector<LossTerm>& losses, RunFolder& folder,
                       const Observer& observer) {
  return Reconstruction(config, clip, losses, folder, observer).run();
}

}  // namespace hsi4d
