// Which of several starts of a frame is the best.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "pipelines/config/run_config.h"
#include "pipelines/input/clip.h"
#include "pipelines/input/color_state.h"
#include "pipelines/input/state.h"
#include "pipelines/record/summary.h"

namespace hsi4d {

/// The parts of the state whose best start can be asked for, as config section `start` names them.
inline constexpr std::array<const char*, 3> kChosenParts = {"pose", "root", "objects"};
/// What is chosen from.
inline constexpr std::array<StartFrom, 3> kChosenStarts = {StartFrom::kPrevious, StartFrom::kEstimate,
                                                           StartFrom::kVelocity};

/// Whether a part of the state begins with the best of its starts (StartFrom::kBest).
bool chooses_start(const StartSettings& settings);

/// A start, and for each of kChosenParts which of the starts it is; none: the best was not asked for, or the clip does
/// not have the part.
struct ChosenStart {
  SceneState state;
  std::array<std::optional<StartFrom>, kChosenParts.size()> from;
};

/// The start of a frame: each part for which the settings ask for the best begins where the frame before ended, going
/// on as before, or as estimated, whichever gives the image that is nearest to the frame's (mean absolute difference;
/// of equals the first). Root and joints are chosen together, and for all people at once, then the objects. What does
/// not ask for it stays as in `state`.
/// @param done   the states of the frames before, frame 0 included
/// @param state  where frame_start begins, with the camera that the images are drawn from
ChosenStart choose_start(const RunConfig& config, const Clip& clip, const std::vector<SceneState>& done,
                         const ClipFrame& frame, const SceneState& state, const ColorState& colors);

/// The choices of the frames so far.
struct StartTotals {
  std::array<std::array<Index, kChosenStarts.size()>, kChosenParts.size()> frames{};  ///< [part][start]
  double seconds = 0;

  void add(const ChosenStart& chosen);
};

/// "root velocity, objects previous": what was chosen of the parts for which the best was asked.
std::string start_text(const ChosenStart& chosen);

/// As summary.json tells it; without parts where nothing was chosen.
StartSummary summarize_start(const StartTotals& totals);

}  // namespace hsi4d
