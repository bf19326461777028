// What the camera has in view, and what a run tells where it has nothing of something.
#pragma once

#include <string>
#include <vector>

#include "core/image.h"
#include "pipelines/input/clip.h"
#include "pipelines/input/state.h"

namespace hsi4d {

/// What has a Gaussian whose centre is in the image, in front of the camera.
struct PartsInView {
  bool scene = false, human = false;
  std::vector<bool> objects = {};  ///< by object
  std::vector<bool> others = {};   ///< by person beside the first one

  bool operator==(const PartsInView&) const = default;
};

/// Of the clip in a state of it.
PartsInView parts_in_view(const Clip& clip, const SceneState& state);

/// Throws DataError naming the file of the camera when it has nothing at all in view in frame 0, which is given. Warns
/// when it has nothing of the scene.
void check_first_view(const Clip& clip, const std::string& camera_file);

/// Warns when frame 0 as it is drawn from what is given, [3,H,W], is farther from the video's frame 0 than the mean
/// colour of that is: a scene that is turned, scaled or of another place than the camera and the state.
void warn_of_other_first_frame(const Image& drawn, const Image& frame);

/// One warning for the scene, the human, and each object that is out of view in some of the frames, with these.
/// @param states  by frame, frame 0 included
void warn_of_what_is_out_of_view(const Clip& clip, const std::vector<SceneState>& states);

}  // namespace hsi4d
