#include "pipelines/run/stage_inputs.h"

#include <algorithm>

#include "core/check.h"
#include "core/suggest.h"
#include "core/text.h"
#include "pipelines/config/run_problems.h"
#include "pipelines/draw/frame_images.h"
#include "pipelines/run/frame_start.h"
#include "pipelines/run/run.h"
#include "pipelines/sources/sources.h"

namespace hsi4d {

namespace {

std::size_t stage_index(const RunConfig& config, const StageChoice& choice) {
  std::vector<std::string> names;
  for (const auto& [known, stage] : config.stages) names.push_back(known);
  const auto found = std::find(names.begin(), names.end(), choice.stage);
  if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  throw UserError(choice.stage_option + ": the config has no stage \"" + choice.stage + "\"; known: " + joined(names) +
                  did_you_mean(choice.stage, names));
}

/// What programs outside have made, in the place of what they would make.
void take_sources(RunConfig& config, const std::string& asker) {
  if (!has_sources(config.sources)) return;
  for (const SourceOutput& output : planned_sources(config)) {
    if (!output.is_there)
      throw UserError(asker + ": /sources/" + output.what + ": " +
                      (output.path.empty() ? "its output" : output.path.string()) +
                      " is not made yet; `hsi4d run` makes it");
    take_output(output, config.data);
  }
}

/// The frame of a stage; none of one over the sequence.
std::optional<Index> frame_of(StageScope over, const StageChoice& choice, const Clip& clip) {
  if (over == StageScope::kSequence) {
    if (choice.frame) throw UserError(choice.frame_option + ": the stage is over all frames at once");
    return {};
  }
  if (over == StageScope::kFirst) {
    if (choice.frame.value_or(0) != 0) throw UserError(choice.frame_option + ": the stage is over the first frame, 0");
    return 0;
  }
  const Index last = clip.frames() - 1;
  const Index frame = choice.frame.value_or(std::min<Index>(kFramesBefore, last));
  if (frame < 1 || frame > last)
    throw UserError(choice.frame_option + ": " + std::to_string(frame) + "; allowed: 1 to " + std::to_string(last));
  return frame;
}

std::vector<SceneState> given_states(const Clip& clip, Index frames) {
  std::vector<SceneState> states;
  if (frames > 0) states.push_back(clip.first);
  for (Index t = 1; t < frames; ++t) states.push_back(given_start(clip, t));
  return states;
}

}  // namespace

StageInputs::StageInputs(const RunConfig& asked, const std::vector<LossTerm>& terms, const StageChoice& choice)
    : config(asked), losses(terms) {
  if (!config.chain.empty())
    throw UserError(choice.stage_option + ": the config is a chain; allowed: that of one clip");
  prepare_run(config);
  config = with_passes(config);
  stage = stage_index(config, choice);
  take_sources(config, choice.stage_option);
  clip = read_run_clip(config, losses);
  check_run_clip(config, clip);
  frame = frame_of(settings().over, choice, clip);
  before = given_states(clip, frame.value_or(clip.frames()));
  start = clip.first;
  if (!frame) return;
  covered = Image(1, clip.camera.height, clip.camera.width);
  for (Index t = 0; t <= *frame; ++t) {
    picture = read_frame(clip, t);
    add_covered(picture, config.data, covered);
  }
  if (*frame > 0) start = frame_start(config.start, clip, before);
}

ColorState StageInputs::colors() const { return first_color_state(first_nets(config, clip)); }

}  // namespace hsi4d
