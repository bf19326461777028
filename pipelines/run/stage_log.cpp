#include "pipelines/run/stage_log.h"

#include <utility>

#include "core/log.h"
#include "core/text.h"
#include "optim/metrics.h"
#include "pipelines/config/run_notes.h"
#include "pipelines/draw/view_turn.h"
#include "pipelines/run/hidden_objects.h"

namespace hsi4d {

namespace {

constexpr double kLeastMoveMm = 0.1;  // of a stage over the sequence that does something

std::string left_out_line(const StageResult& result, const Clip& clip) {
  std::string text;
  for (const LeftOutObject& object : result.left_out) {
    const bool is_of_all = object.of_human && !object.reason.empty();
    const std::string name = is_of_all         ? "effect"
                             : object.of_human ? "the human"
                                               : clip.objects[static_cast<std::size_t>(object.object)].name;
    text += ", " + object.term + " without " + name + " in " + std::to_string(object.evaluations) + " of " +
            std::to_string(result.iterations + 1) + " evaluations";
  }
  return text;
}

/// Messages, each of several frames.
class FramesOfMessages {
 public:
  void add(const std::string& begin, Index frame, LogLevel level = LogLevel::kWarning) {
    std::vector<Index>& frames = frames_[begin];
    if (frames.empty()) order_.emplace_back(level, begin);
    if (frames.empty() || frames.back() != frame) frames.push_back(frame);
  }
  /// Each once, with its frames, in the order in which it was first added.
  void log() const {
    for (const auto& [level, begin] : order_) {
      const std::vector<Index>& frames = frames_.at(begin);
      log_message(level, begin + (frames.size() == 1 ? "frame " : "frames ") + frame_ranges(frames));
    }
  }

 private:
  std::map<std::string, std::vector<Index>> frames_;
  std::vector<std::pair<LogLevel, std::string>> order_;
};

/// Hands, jaw and eyes: the body or an object may be in front of them. Of an object its place tells that.
bool is_often_hidden(const std::string& group) {
  return (group.ends_with("_pose") && group != "body_pose") || group == kObjectLightGroup;
}

}  // namespace

std::string loss_text(double loss, std::span<const LossValue> terms) {
  std::vector<std::string> parts;
  for (const LossValue& term : terms) parts.push_back(term.name + " " + rounded(term.value, 4));
  return rounded(loss, 4) + " (" + joined(parts) + ")";
}

std::string stage_text(const std::string& stage, const StageResult& result, const std::string& begin,
                       const Clip& clip) {
  std::string text = "stage " + stage + ": " + std::to_string(result.iterations) + " iterations in " +
                     rounded(result.seconds, 3) + " s, loss " + begin + " -> " + loss_text(result.loss, result.terms);
  if (result.rollbacks > 0) text += ", " + std::to_string(result.rollbacks) + " steps not taken";
  text += left_out_line(result, clip);
  for (const LossNote& note : result.notes) text += ", " + note.term + ": " + note.text;
  return text;
}

IterationRecord iteration_record(std::optional<Index> frame, const std::string& stage, const IterationReport& report,
                                 const RenderCounters* counters) {
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
  const auto add = [&record](const char* name, auto count) {
    record.counters.emplace_back(name, static_cast<double>(count));
  };
  if (counters != nullptr) {
    add("channels", counters->channels);
    add("gaussians", counters->gaussians);
    add("tiles", counters->tiles);
    add("pairs", counters->pairs);
    add("groups", counters->groups);
    add("fragments", counters->fragments);
    add("layers", counters->layers);
    add("dirty_tiles", counters->dirty_tiles);
    add("adjoint_tiles", counters->adjoint_tiles);
  }
  add("forward_nodes", report.tape.forward_nodes);
  add("backward_nodes", report.tape.backward_nodes);
  add("adjoint_numbers", report.tape.adjoint_numbers);
  return record;
}

void warn_of_left_out(const std::vector<LeftOutInFrame>& left_out, const RunConfig& config, const Clip& clip) {
  FramesOfMessages messages;
  for (const LeftOutInFrame& entry : left_out) {
    const std::string begin = "stage " + config.stages[entry.stage].first + ": the loss \"" + entry.term +
                              "\" was off for the object \"" +
                              clip.objects[static_cast<std::size_t>(entry.object)].name + "\" (" + entry.reason +
                              "), in some iterations at least, in ";
    messages.add(begin, entry.frame);
  }
  messages.log();
}

void warn_of_left_ranges(const std::vector<LeftRange>& left_ranges, const RunConfig& config) {
  FramesOfMessages messages;
  for (const LeftRange& entry : left_ranges) {
    const bool is_of_colors = entry.setting == "hold_colors";
    messages.add("stage " + config.stages[entry.stage].first + ": the view of a part turned by more than " +
                     rounded(is_of_colors ? kHeldColorsDeg : config.approx.seen_within_deg, 3) + " degrees, so that " +
                     (is_of_colors ? "colours held by approx.hold_colors are out of date"
                                   : "Gaussians left out by approx.seen_within_deg may be seen") +
                     ", in ",
                 entry.frame);
  }
  messages.log();
}

void warn_of_lost(const std::vector<std::vector<std::optional<double>>>& ious, const Clip& clip) {
  FramesOfMessages messages;
  for (std::size_t t = 0; t < ious.size(); ++t) {
    for (std::size_t o = 0; o < ious[t].size(); ++o) {
      if (ious[t][o] && *ious[t][o] < kLostIou)
        messages.add("the object \"" + clip.objects[o].name +
                         "\" is lost: what is drawn has less than a fifth in common with its mask, in ",
                     static_cast<Index>(t));
    }
  }
  messages.log();
}

void warn_of_still_groups(const std::vector<StillGroup>& still, const RunConfig& config) {
  FramesOfMessages messages;
  for (const StillGroup& entry : still)
    messages.add("stage " + config.stages[entry.stage].first + ": what the losses see did not depend on the group \"" +
                     entry.group + "\" (its gradient was 0 in every iteration) in ",
                 entry.frame, is_often_hidden(entry.group) ? LogLevel::kInfo : LogLevel::kWarning);
  messages.log();
}

void GradientWatch::see(std::span<const GroupStep> groups) {
  for (const GroupStep& group : groups) {
    if (!group.moved) continue;
    const auto known = has_gradient_.try_emplace(std::string(group.name), false).first;
    known->second = known->second || group.gradient_norm > 0;
  }
}

std::vector<std::string> GradientWatch::still_groups() const {
  std::vector<std::string> names;
  for (const auto& [name, has_gradient] : has_gradient_) {
    if (!has_gradient) names.push_back(name);
  }
  return names;
}

void warn_of_idle_terms(const std::vector<LossNote>& notes, const std::string& stage, bool of_clip) {
  for (const LossNote& note : notes) {
    if (note.is_idle && (note.is_of_clip || !of_clip))
      log_warning("stage " + stage + ": the loss \"" + note.term + "\" moves nothing: " + note.text);
  }
}

void warn_of_still_joints(const Clip& clip, const std::vector<SceneState>& before, const std::vector<SceneState>& after,
                          const std::string& stage) {
  double sum = 0;
  Index count = 0;
  for (std::size_t i = 0; i < after.size() * clip.people(); ++i) {
    const std::size_t t = i % after.size(), p = i / after.size();
    if (t == 0) continue;  // is given
    const std::vector<double> from = pose_joints(clip.person(p).avatar, before[t].person(p)),
                              to = pose_joints(clip.person(p).avatar, after[t].person(p));
    for (std::size_t j = 0; j < static_cast<std::size_t>(3 * kMetricJoints); j += 3)
      sum += (Vector3<double>(to.data() + j) - Vector3<double>(from.data() + j)).norm();
    count += kMetricJoints;
  }
  if (count == 0) return;
  const double moved_mm = 1000 * sum / static_cast<double>(count);
  if (moved_mm >= kLeastMoveMm) return;
  log_warning("stage " + stage + ": the joints have moved by " + rounded(moved_mm, 2) +
              " mm on average, next to nothing: the weights or the learning rates leave the body where it was");
}

void warn_of_terms_off(const std::vector<std::string>& off, const std::string& stage, const StageSettings& settings,
                       bool has_objects) {
  for (const std::string& term : off) {
    const LossSettings* const term_settings = find_entry(settings.losses, term);
    if (!has_objects && term_settings != nullptr && is_of_objects(*term_settings)) continue;
    log_warning("stage " + stage + ": the loss \"" + term + "\" is off: " +
                (term_settings != nullptr && term_settings->weight == 0 ? "its weight is 0" : "it lacks an input"));
  }
}

}  // namespace hsi4d
