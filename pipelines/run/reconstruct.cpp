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
#include "pipelines/metrics/sequence_errors.h"
#include "pipelines/record/results.h"
#include "pipelines/record/run_events.h"
#include "pipelines/report/view3d.h"
#include "pipelines/run/checkpoint.h"
#include "pipelines/run/depth_bias.h"
#include "pipelines/run/frame_start.h"
#include "pipelines/run/heading_starts.h"
#include "pipelines/run/hidden_objects.h"
#include "pipelines/run/hidden_tracker.h"
#include "pipelines/run/picture_errors.h"
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

/// What the stages are over, in the order in which they run.
struct StageOrder {
  std::size_t first = 0, frames = 0;  ///< how many there are over the first frame, and of the first pass
  std::vector<StageScope> later;      ///< of those after them
};

StageOrder order_of_stages(const RunConfig& config) {
  StageOrder order;
  for (const auto& [name, stage] : config.stages) {
    if (stage.over == StageScope::kFirst) ++order.first;
    const bool is_later = stage.over == StageScope::kSequence || !order.later.empty();
    if (is_later) order.later.push_back(stage.over);
    if (!is_later && stage.over == StageScope::kFrame) ++order.frames;
  }
  return order;
}

/// What is in a checkpoint, if its inputs are still the same.
RunProgress read_checkpoint(const std::string& file, const std::string& identity, const RunConfig& config,
                            const Clip& clip) {
  RunProgress progress;
  const StageOrder order = order_of_stages(config);
  try {
    progress = load_progress(file, identity, clip, order.frames, first_nets(config, clip), order.first, order.later);
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

/// Those stages that tell how sure places are for somebody who asks: for a loss of a stage that follows, before the
/// next one that tells it, and the last one where a run is asked to tell it.
std::vector<std::size_t> stages_whose_sigmas_are_read(const RunConfig& config) {
  const std::vector<std::size_t> telling = stages_of_sigmas(config);
  std::vector<std::size_t> needed;
  for (std::size_t i = 0; i < telling.size(); ++i) {
    const bool is_last = i + 1 == telling.size();
    const std::size_t end = is_last ? config.stages.size() : telling[i + 1];
    bool is_read = is_last && config.uncertainty;
    for (std::size_t s = telling[i]; s < end; ++s) is_read = is_read || weighs_by_sigma(config.stages[s].second);
    if (is_read) needed.push_back(telling[i]);
  }
  return needed;
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
        order_(order_of_stages(config)),
        first_stages_(order_.first),
        frame_stages_(order_.frames),
        progress_(first_progress(clip_, frame_stages_, first_nets(config, clip))),
        sigmas_(no_sigmas(clip.objects.size(), clip.others.size())),
        sigma_stages_(stages_whose_sigmas_are_read(config)),
        hidden_(config, clip, progress_.seen, [&folder](const std::string& text) { folder.note(text); }),
        start_colors_(progress_.colors),
        bar_(config.name, total_steps(), observer.progress, observer.progress_interval) {}

  RunSummary run() {
    resume();
    if (progress_.frames_done() == 0) run_first_frame();
    while (progress_.frames_done() < clip_.frames()) run_frame(progress_.frames_done());
    if (progress_.later.empty()) lay_hidden(progress_.after_stage.back());
    if (config_.remove_depth_bias && !progress_.bias) remove_bias();
    if (has_later()) {
      run_later_stages();
    } else if (are_drawn_again()) {
      progress_.image_errors.resize(1);
      write_results_of_frames(progress_.image_errors);
    }
    bar_.finish();
    warn_of_left_out(progress_.left_out, config_, clip_);
    warn_of_still_groups(progress_.still, config_);
    warn_of_left_ranges(progress_.left_ranges, config_);
    warn_of_lost(progress_.object_ious, clip_);
    warn_of_what_is_out_of_view(clip_, result());
    write_results(folder_.paths(), config_, clip_, result(), progress_.colors,
                  config_.uncertainty ? progress_.sigmas : std::vector<PlaceSigmas>{});
    if (!progress_.unknowns.betas.empty()) write_found_avatar();
    RunSummary summary = summarize_run(config_, clip_, progress_);
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
  /// Stages over the first frame come first, then those over frames; from the first one over the sequence on, those
  /// over frames go through them again.
  std::size_t later_stage() const { return first_stages_ + frame_stages_; }
  bool has_later() const { return !order_.later.empty(); }

  /// Whether frames change after the last one is done.
  bool are_drawn_again() const { return config_.remove_depth_bias || hidden_.is_on() || has_later(); }

  /// Steps of the stages [begin, end), each once.
  std::int64_t steps_of(std::size_t begin, std::size_t end) const {
    std::int64_t steps = 0;
    for (std::size_t s = begin; s < end; ++s) steps += config_.stages[s].second.iterations;
    return steps;
  }
  /// Steps of the first pass in the frames before `frame`.
  std::int64_t steps_before(Index frame) const {
    if (frame == 0) return 0;
    return steps_of(0, first_stages_) + steps_of(first_stages_, later_stage()) * (frame - 1);
  }
  /// Steps of the later stages that have begun, in the frames that are done; of all of them in all frames.
  std::int64_t steps_of_later(bool is_done) const {
    std::int64_t steps = 0;
    for (std::size_t l = 0; l < (is_done ? progress_.later.size() : order_.later.size()); ++l) {
      const Index frames = is_done ? std::ssize(progress_.later[l].states) : clip_.frames();
      steps += steps_of(later_stage() + l, later_stage() + l + 1) *
               (order_.later[l] == StageScope::kSequence ? 1 : frames - 1);
    }
    return steps;
  }
  std::int64_t total_steps() const { return steps_before(clip_.frames()) + steps_of_bias() + steps_of_later(false); }
  /// Of a fit of frame 0.
  std::int64_t steps_of_bias() const {
    std::int64_t steps = 0;
    for (std::size_t s = first_stages_; config_.remove_depth_bias && s < later_stage(); ++s)
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
      if (!sigma_stages_.empty() && first_stages_ == 0) progress_.sigmas = {sigmas_};
      if (hidden_.is_on() && first_stages_ == 0) progress_.seen = {hidden_.all_seen()};
      const ClipFrame frame = read_frame(clip_, 0);
      warn_of_other_first_frame(render_state(config_, clip_, clip_.first, start_colors_), frame.target);
      add_covered(frame, config_.data, progress_.covered);
      progress_.inputs = input_hashes(clip_.files) + input_hashes(frame_files(config_.data, clip_, 0));
    }
    folder_.take_over_config();
    if (folder_.resumed_from()) folder_.note(resumed_text());
    folder_.keep_metrics([this](const std::string& stage, std::optional<int> frame) { return is_done(stage, frame); });
    begin_events();
    bar_.skip(steps_before(progress_.frames_done()) + (progress_.bias ? steps_of_bias() : 0) + steps_of_later(true));
  }

  std::string resumed_text() const {
    const std::string all = " of " + std::to_string(clip_.frames() - 1);
    if (progress_.later.empty()) return "resumed with frame " + std::to_string(progress_.frames_done()) + all;
    const std::size_t last = progress_.later.size() - 1;
    return "resumed with frame " + std::to_string(progress_.later[last].states.size()) + all + " of stage " +
           config_.stages[later_stage() + last].first;
  }

  /// Whether the checkpoint has what a stage found in a frame.
  /// @param frame  none: in all at once
  bool is_done(const std::string& stage, std::optional<int> frame) const {
    for (std::size_t l = 0; l < order_.later.size(); ++l) {
      if (config_.stages[later_stage() + l].first != stage) continue;
      if (l >= progress_.later.size()) return false;
      return !frame || *frame < std::ssize(progress_.later[l].states);
    }
    return frame && *frame < progress_.frames_done();
  }

  /// Shows the frames that are done, and from then on what comes.
  void begin_events() {
    if (!config_.log.tensorboard) return remove_run_events(folder_.paths());
    events_.emplace(folder_, ShownImages{config_.log.images_every, are_drawn_again()}, first_worked_on(),
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
    if (hidden_.is_on()) progress_.seen = {hidden_.all_seen()};
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
    const std::vector<SceneState>& done = progress_.after_stage.back();
    SceneState state = frame_start(config_.start, clip_, done);
    ColorState colors = progress_.colors;
    std::vector<SceneState> after;
    bool has_start = false;
    for (std::size_t s = 0; s < frame_stages_; ++s) {
      if (!has_start && config_.stages[first_stages_ + s].second.draw == Draw::kAll) {
        if (chooses_start(config_.start)) state = chosen_start(index, frame, state, colors);
        if (hidden_.is_on()) hidden_.start_hidden(index, frame, done, colors, state);
        has_start = true;
      }
      run_in_frame(first_stages_ + s, {index, frame, progress_.covered, done}, state, colors, progress_.totals[s]);
      if (has_start) hidden_.carry_hidden(index, done, state);
      after.push_back(state);
    }
    if (hidden_.is_on() && !has_start) progress_.seen.push_back(hidden_.all_seen());
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
    if (hsi4d::moves_colors(config_)) write_color_nets(index, 1);
    for (std::size_t s = 0; s < after.size(); ++s) progress_.after_stage[s].push_back(after[s]);
    if (!sigma_stages_.empty()) progress_.sigmas.push_back(sigmas_);
    progress_.seconds += seconds_since(begin);
    save_progress(checkpoint_file(folder_.paths()), identity_, progress_);
    if (events_) events_->end_frame(index);
  }

  /// Takes what a fit of frame 0 does to the given distances from all later frames. The checkpoint keeps these as they
  /// were until a later pass writes it, with the bias: a run that is resumed finds the same.
  void remove_bias() {
    const ClipFrame frame = read_frame(clip_, 0);
    SceneState fitted = clip_.first;
    // With no light at first the fit would take some of the light for depth.
    if (clip_.frames() > 1) fitted.lights = progress_.after_stage.back()[1].lights;
    ColorState colors = progress_.colors;
    for (std::size_t s = first_stages_; s < later_stage(); ++s) {
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
    progress_.bias = bias;
    take_bias(progress_.after_stage.back());
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

  /// The stages after the first pass, each from where the one before ended, and the images of what they leave.
  void run_later_stages() {
    const std::size_t count = order_.later.size();
    for (std::size_t l = 0, end = 0; l < count; l = end) {
      end = l + 1;
      if (order_.later[l] == StageScope::kSequence) {
        if (progress_.later.size() == l) refine(l);
        continue;
      }
      while (end < count && order_.later[end] == StageScope::kFrame) ++end;
      go_through_again(l, end);
    }
    const auto begin = std::chrono::steady_clock::now();
    progress_.result_errors.resize(1);
    write_results_of_frames(progress_.result_errors);
    progress_.seconds += seconds_since(begin);
  }

  /// @param l  of the later stages, one over the sequence
  void refine(std::size_t l) {
    const auto begin = std::chrono::steady_clock::now();
    std::vector<SceneState> states = result();
    const StageTotals totals = run_over_sequence(later_stage() + l, states);
    lay_hidden_without_bias(states);
    progress_.later.push_back({std::move(states), totals});
    progress_.seconds += seconds_since(begin);
  }

  /// A pass through the frames after the first: each begins where the stages before left it.
  /// @param l, end  of the later stages
  void go_through_again(std::size_t l, std::size_t end) {
    ++pass_;
    tracks_ = {};
    if (progress_.later.size() == l) progress_.later.resize(end, {{states_before(l).front()}, {}});
    for (Index t = std::ssize(progress_.later[l].states); t < clip_.frames(); ++t) run_frame_again(t, l, end);
    if (moves_colors(l, end)) colors_pass_ = pass_;
  }

  void run_frame_again(Index index, std::size_t l, std::size_t end) {
    const auto begin = std::chrono::steady_clock::now();
    const ClipFrame frame = read_frame(clip_, index);
    std::vector<SceneState> done = progress_.later[end - 1].states;
    give_bias(done);
    std::vector<SceneState> biased = states_before(l);
    give_bias(biased);
    const std::span<const SceneState> after = std::span(biased).subspan(static_cast<std::size_t>(index) + 1);
    SceneState state = biased[static_cast<std::size_t>(index)];
    progress_.colors.nets = colors_after(index).nets;
    if (hidden_.is_on()) hidden_.look_for_lost({index, pass_}, frame, biased, done.back(), progress_.colors, state);
    for (std::size_t i = l; i < end; ++i) {
      run_in_frame(later_stage() + i, {index, frame, progress_.covered, done, after}, state, progress_.colors,
                   progress_.later[i].totals);
      hidden_.carry_hidden(index, biased, state);
      progress_.later[i].states.push_back(state);
    }
    if (progress_.bias) hsi4d::remove_depth_bias(clip_, *progress_.bias, progress_.later[end - 1].states.back());
    if (moves_colors(l, end)) write_color_nets(index, pass_);
    const auto is_of_pass = [&](std::size_t s) { return later_stage() + l <= s && s < later_stage() + end; };
    if (std::any_of(sigma_stages_.begin(), sigma_stages_.end(), is_of_pass))
      progress_.sigmas[static_cast<std::size_t>(index)] = sigmas_;
    progress_.seconds += seconds_since(begin);
    save_progress(checkpoint_file(folder_.paths()), identity_, progress_);
    if (events_) events_->end_frame(index);
  }

  /// What images pull states of frames after the first to, before the bias was taken from them.
  void give_bias(std::vector<SceneState>& states) const {
    if (!progress_.bias) return;
    DepthBias inverse = *progress_.bias;
    inverse.human = 1 / inverse.human;
    for (auto* factors : {&inverse.objects, &inverse.others}) {
      for (double& factor : *factors) factor = 1 / factor;
    }
    for (std::size_t t = 1; t < states.size(); ++t) hsi4d::remove_depth_bias(clip_, inverse, states[t]);
  }

  void take_bias(std::vector<SceneState>& states) const {
    for (std::size_t t = 1; progress_.bias && t < states.size(); ++t)
      hsi4d::remove_depth_bias(clip_, *progress_.bias, states[t]);
  }

  /// Of states from which the bias was taken: to their last bits nothing but what is laid changes.
  void lay_hidden_without_bias(std::vector<SceneState>& states) const {
    if (!hidden_.is_on()) return;
    std::vector<SceneState> before = states;
    give_bias(before);
    std::vector<SceneState> laid = before;
    lay_hidden(laid);
    std::vector<SceneState> result = laid;
    take_bias(result);
    for (std::size_t t = 1; t < states.size(); ++t) {
      for (std::size_t o = 0; o < states[t].objects.size(); ++o) {
        const ObjectPose &was = before[t].objects[o], &is = laid[t].objects[o];
        if (was.translation != is.translation || was.rotation != is.rotation)
          states[t].objects[o] = result[t].objects[o];
      }
    }
  }

  /// @param states  of all frames, as images pull them
  void lay_hidden(std::vector<SceneState>& states) const {
    const bool is_asked = std::any_of(config_.stages.begin(), config_.stages.end(),
                                      [](const auto& stage) { return weighs_by_sigma(stage.second); });
    hidden_.lay_hidden(progress_.colors, is_asked ? progress_.sigmas : std::vector<PlaceSigmas>{}, states);
  }

  /// Where a later stage begins, by frame.
  const std::vector<SceneState>& states_before(std::size_t l) const {
    return l == 0 ? progress_.after_stage.back() : progress_.later[l - 1].states;
  }

  /// Whether one of some later stages moves the color net or what it reads.
  bool moves_colors(std::size_t l, std::size_t end) const {
    if (progress_.colors.nets.empty()) return false;
    for (std::size_t s = later_stage() + l; s < later_stage() + end; ++s) {
      const auto& moved = config_.stages[s].second.optimize;
      if (find_entry(moved, "color_net") != nullptr || find_entry(moved, kFeaturesGroup) != nullptr) return true;
    }
    return false;
  }

  StageTotals run_over_sequence(std::size_t s, std::vector<SceneState>& states) {
    const auto& [name, stage] = config_.stages[s];
    std::string begin;  // of the loss, for the log
    const auto note_iteration = [&](const IterationReport& report) {
      if (report.iteration == 0) begin = loss_text(report.loss, report.terms);
      note(std::nullopt, s, report, nullptr, nullptr);
    };
    const std::vector<SceneState> before = states;
    const StageResult result = run_sequence_stage(
        {config_, clip_, losses_, s, observer_.stages, nullptr, nullptr, &progress_.sigmas}, states, note_iteration);
    drop_what_is_left(s, result);
    warn_of_terms_off(result.off, name, stage, !clip_.objects.empty());
    warn_of_idle_terms(result.notes, name, false);
    warn_of_still_joints(clip_, before, states, name);
    folder_.note("all frames, " + stage_text(name, result, begin, clip_));
    return {result.iterations, result.rollbacks, result.seconds};
  }

  /// The color nets as the last whole pass left them in a frame, in the precision of its file, so that a resumed run
  /// has the same.
  ColorState colors_after(Index frame) const {
    ColorState colors = start_colors_;
    if (frame < first_worked_on() || !hsi4d::moves_colors(config_)) return colors;
    for (std::size_t p = 0; p < colors.nets.size(); ++p) {
      const Avatar& avatar = clip_.person(p).avatar;
      colors.nets[p] =
          read_color_net(net_file(frame, frame == 0 ? 1 : colors_pass_, p), avatar.count(), avatar.joint_count());
    }
    return colors;
  }

  void write_color_nets(Index frame, int pass) const {
    for (std::size_t p = 0; p < progress_.colors.nets.size(); ++p)
      write_color_net(net_file(frame, pass, p), progress_.colors.nets[p]);
  }

  /// Where a pass keeps the color net of a person in a frame.
  std::string net_file(Index frame, int pass, std::size_t person) const {
    const std::filesystem::path file = folder_.paths().frame_color_net(static_cast<int>(frame));
    std::string name = file.stem().string();
    if (pass > 1) name += "_pass" + std::to_string(pass);
    if (person > 0) name += "_of_" + clip_.person(person).name;
    return (file.parent_path() / (name + file.extension().string())).string();
  }

  const std::vector<SceneState>& result() const { return result_of(progress_); }

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
    const bool is_asked =
        frame.index > 0 && std::find(sigma_stages_.begin(), sigma_stages_.end(), s) != sigma_stages_.end();
    const StageResult result = run_frame_stage(
        {config_, clip_, losses_, s, observer_.stages, &tracks_, found, nullptr, is_asked ? &sigmas_ : nullptr}, frame,
        state, colors, note_iteration);
    drop_what_is_left(s, result);
    if (stage.draw == Draw::kAll) note_left_ranges(s, frame.index, before, state);
    totals.iterations += result.iterations;
    totals.rollbacks += result.rollbacks;
    totals.seconds += result.seconds;
    // By then all frames before are there that terms over the motion want to see.
    if (frame.index == std::min<Index>(kFramesBefore, clip_.frames() - 1) || stage.over == StageScope::kFirst) {
      warn_of_terms_off(result.off, name, stage, !clip_.objects.empty());
      warn_of_idle_terms(result.notes, name, true);
    }
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
    if (counters != nullptr) add_work(*counters, *totals);
    const IterationRecord record = iteration_record(frame, stage, report, counters);
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
    if (!observer_.wants_stop()) return;
    if (pass_ > 1 && frame < clip_.frames())
      throw Interrupted("interrupted in frame " + std::to_string(frame) + " of pass " + std::to_string(pass_) +
                        "; the frames before it and pass " + std::to_string(pass_ - 1) + " are finished and kept");
    throw Interrupted(stop_message(frame, clip_.frames(), first_worked_on()));
  }

  static void add_work(const RenderCounters& counters, StageTotals& totals) {
    totals.tiles += counters.tiles;
    totals.pairs += counters.pairs;
    totals.fragments += counters.fragments;
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
    if (hidden_.is_on()) note_object_ious(picture, frame, errors.size());
  }

  /// @param frames  that are written, this one included
  void note_object_ious(const StatePicture& picture, const ClipFrame& frame, std::size_t frames) {
    progress_.object_ious.resize(frames);
    progress_.object_ious.back().clear();
    for (std::size_t o = 0; o < clip_.objects.size(); ++o)
      progress_.object_ious.back().push_back(object_iou(picture, frame, o));
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
  StageOrder order_;
  std::size_t first_stages_, frame_stages_;
  int pass_ = 1;         // through the frames, the one at hand
  int colors_pass_ = 1;  // the last whole one that moved the color net
  RunProgress progress_;
  TrackPoints tracks_;                     // of the frames that are done, in this pass
  PlaceSigmas sigmas_;                     // of the frame at hand
  std::vector<std::size_t> sigma_stages_;  // which tell them
  HiddenTracker hidden_;
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
