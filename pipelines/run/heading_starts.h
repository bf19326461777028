// Starts of a stage over the first frame: the human turned to other headings. A person seen from the front is like one
// seen from behind, and a fit of joints ends in the nearest of both.
#pragma once

#include <functional>
#include <string>

#include "pipelines/input/state.h"

namespace hsi4d {

/// The state with the human turned by an angle about the vertical through its pelvis, radians; z is up.
SceneState with_turned_human(const SceneState& state, double radians);

/// The start that was chosen.
struct HeadingStart {
  SceneState state;
  std::string text;  ///< what the log tells: "headings +0 deg: 12.5, +90 deg: 3.25 (kept), ..."
};

/// Tries `headings` starts, evenly around from the state's own, and keeps the one with the least loss; of equals, and
/// where no loss is finite, the first.
/// @param loss_from  what a stage that begins there ends with; infinite where it comes to no end
HeadingStart best_heading(const SceneState& state, int headings,
                          const std::function<double(const SceneState& start)>& loss_from);

}  // namespace hsi4d
