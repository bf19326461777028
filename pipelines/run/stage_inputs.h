// What one stage of a config reads where no run leads up to it: its clip, its frame, the states that it follows.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "optim/loss_term.h"
#include "pipelines/config/run_config.h"
#include "pipelines/input/clip.h"
#include "pipelines/input/color_state.h"
#include "pipelines/run/reconstruct_stage.h"

namespace hsi4d {

/// Which stage is meant, and how messages call what says so.
struct StageChoice {
  std::string stage;
  /// Of a stage over frames; none: the first that has all the frames before it that terms over the motion see.
  std::optional<Index> frame;
  std::string stage_option = "stage";  ///< begins messages about the stage
  std::string frame_option = "frame";  ///< likewise about the frame
};

/// A stage with its inputs. It stays where it was made: tasks name its members.
struct StageInputs {
  RunConfig config;  ///< prepared, what programs outside have made in the place of what they would make
  std::vector<LossTerm> losses;
  std::size_t stage = 0;
  Clip clip;
  std::optional<Index> frame;      ///< none: a stage over the sequence
  ClipFrame picture;               ///< of the frame
  Image covered;                   ///< as FrameTask has it
  std::vector<SceneState> before;  ///< as they are given: of the frames before, or of all of the sequence
  SceneState start;                ///< of the frame, where a run would begin with it if nothing was found before

  StageInputs(const RunConfig& asked, const std::vector<LossTerm>& terms, const StageChoice& choice);
  StageInputs(const StageInputs&) = delete;
  StageInputs& operator=(const StageInputs&) = delete;

  const std::string& name() const { return config.stages[stage].first; }
  const StageSettings& settings() const { return config.stages[stage].second; }
  StageTask task() const { return {config, clip, losses, stage}; }
  FrameTask frame_task() const { return {*frame, picture, covered, before}; }
  ColorState colors() const;
};

}  // namespace hsi4d
