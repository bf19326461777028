#include "pipelines/run/stage_check.h"

#include <algorithm>

#include "core/check.h"
#include "core/parallel.h"
#include "core/suggest.h"
#include "core/text.h"
#include "pipelines/config/run_problems.h"
#include "pipelines/draw/frame_images.h"
#include "pipelines/input/color_state.h"
#include "pipelines/run/frame_start.h"
#include "pipelines/run/reconstruct_stage.h"
#include "pipelines/run/run.h"
#include "pipelines/sources/sources.h"

namespace hsi4d {

namespace {

std::size_t stage_index(const RunConfig& config, const std::string& name) {
  std::vector<std::string> names;
  for (const auto& [known, stage] : config.stages) names.push_back(known);
  const auto found = std::find(names.begin(), names.end(), name);
  if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  throw UserError("hsi4d gradcheck: --stage: the config has no stage \"" + name + "\"; known: " + joined(names) +
                  did_you_mean(name, names));
}

/// What programs outside have made, in the place of what they would make.
void take_sources(RunConfig& config) {
  if (!has_sources(config.sources)) return;
  for (const SourceOutput& output : planned_sources(config)) {
    if (!output.is_there)
      throw UserError("hsi4d gradcheck: /sources/" + output.what + ": " +
                      (output.path.empty() ? "its output" : output.path.string()) +
                      " is not made yet; `hsi4d run` makes it");
    take_output(output, config.data);
  }
}

/// The frame of a stage over frames.
Index frame_of(StageScope over, const std::optional<Index>& asked, const Clip& clip) {
  if (over == StageScope::kFirst) {
    if (asked.value_or(0) != 0) throw UserError("hsi4d gradcheck: --frame: the stage is over the first frame, 0");
    return 0;
  }
  const Index last = clip.frames() - 1;
  const Index frame = asked.value_or(std::min<Index>(kFramesBefore, last));
  if (frame < 1 || frame > last)
    throw UserError("hsi4d gradcheck: --frame: " + std::to_string(frame) + "; allowed: 1 to " + std::to_string(last));
  return frame;
}

std::vector<SceneState> given_states(const Clip& clip, Index frames) {
  std::vector<SceneState> states = {clip.first};
  for (Index t = 1; t < frames; ++t) states.push_back(given_start(clip, t));
  return states;
}

StageGradcheck check_in_frame(const StageTask& task, Index index, const StageGradcheckOptions& options) {
  const Clip& clip = task.clip;
  const RunConfig& config = task.config;
  Image covered(1, clip.camera.height, clip.camera.width);
  ClipFrame frame;
  for (Index t = 0; t <= index; ++t) {
    frame = read_frame(clip, t);
    add_covered(frame, config.data, covered);
  }
  const ColorState colors = first_color_state(first_color_net(config.color_net, clip.avatar, config.seed));
  if (index == 0) return check_frame_stage(task, {0, frame, covered, {}}, clip.first, colors, options);
  const std::vector<SceneState> done = given_states(clip, index);
  return check_frame_stage(task, {index, frame, covered, done}, frame_start(config.start, clip, done), colors, options);
}

}  // namespace

StageCheck check_stage(const RunConfig& asked, const std::vector<LossTerm>& losses, const StageCheckOptions& options) {
  RunConfig config = asked;
  const std::size_t index = stage_index(config, options.stage);
  if (!config.chain.empty()) throw UserError("hsi4d gradcheck: the config is a chain; allowed: that of one clip");
  config.color_net.camera_gradient = true;
  prepare_run(config);
  take_sources(config);
  const Clip clip = read_run_clip(config, losses);
  check_run_clip(config, clip);
  StageGradcheckOptions check;
  check.differences.entries = options.entries;
  check.differences.seed = options.seed;
  StageCheck result{options.stage, {}, check.differences.tolerance, {}};
  const StageTask task{config, clip, losses, index};
  const StageScope over = config.stages[index].second.over;
  const int threads = options.threads > 0 ? options.threads : config.threads;
  with_threads(threads > 0 ? threads : thread_count(), [&] {
    if (over == StageScope::kSequence) {
      if (options.frame) throw UserError("hsi4d gradcheck: --frame: the stage is over all frames at once");
      result.found = check_sequence_stage(task, given_states(clip, clip.frames()), check);
    } else {
      result.frame = frame_of(over, options.frame, clip);
      result.found = check_in_frame(task, *result.frame, check);
    }
  });
  return result;
}

}  // namespace hsi4d
