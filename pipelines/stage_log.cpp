#include "pipelines/stage_log.h"

#include <map>

#include "core/log.h"
#include "core/text.h"

namespace hsi4d {

namespace {

std::string left_out_text(const StageResult& result, const Clip& clip) {
  std::string text;
  for (const LeftOutObject& object : result.left_out) {
    text += ", " + object.term + " without " + clip.objects[static_cast<std::size_t>(object.object)].name + " in " +
            std::to_string(object.evaluations) + " of " + std::to_string(result.iterations + 1) + " evaluations";
  }
  return text;
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
  return text + left_out_text(result, clip);
}

void warn_of_left_out(const std::vector<LeftOutInFrame>& left_out, const RunConfig& config, const Clip& clip) {
  std::map<std::string, std::vector<Index>> frames;  // by message
  std::vector<std::string> messages;                 // in the order in which it first happened
  for (const LeftOutInFrame& entry : left_out) {
    const std::string begin = "stage " + config.stages[entry.stage].first + ": the loss \"" + entry.term +
                              "\" was off for the object \"" +
                              clip.objects[static_cast<std::size_t>(entry.object)].name + "\" (" + entry.reason +
                              "), in some iterations at least, in ";
    if (frames[begin].empty()) messages.push_back(begin);
    if (frames[begin].empty() || frames[begin].back() != entry.frame) frames[begin].push_back(entry.frame);
  }
  for (const std::string& begin : messages) {
    const std::vector<Index>& of_object = frames[begin];
    log_warning(begin + (of_object.size() == 1 ? "frame " : "frames ") + frame_ranges(of_object));
  }
}

void warn_of_terms_off(const std::vector<std::string>& off, const std::string& stage, const StageSettings& settings) {
  for (const std::string& term : off) {
    const LossSettings* const term_settings = find_entry(settings.losses, term);
    log_warning("stage " + stage + ": the loss \"" + term + "\" is off: " +
                (term_settings != nullptr && term_settings->weight == 0 ? "its weight is 0" : "it lacks an input"));
  }
}

}  // namespace hsi4d
