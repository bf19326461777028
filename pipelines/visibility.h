// What the camera has in view, and what a run tells where it has nothing of something.
#pragma once

#include <string>
#include <vector>

#include "pipelines/clip.h"
#include "pipelines/state.h"

namespace hsi4d {

/// How many Gaussians have their centre in the image, in front of the camera.
struct GaussiansInView {
  Index scene = 0, human = 0;
  std::vector<Index> objects = {};  ///< by object

  bool operator==(const GaussiansInView&) const = default;
};

/// Of the clip's Gaussians in a state of it.
GaussiansInView gaussians_in_view(const Clip& clip, const SceneState& state);

/// Throws DataError naming the file of the camera when it has nothing at all in view in frame 0, which is given. Warns
/// when it has nothing of the scene.
void check_first_view(const Clip& clip, const std::string& camera_file);

/// One warning for the scene, the human, and each object that is out of view in some of the frames, with these.
/// @param states  by frame, frame 0 included
void warn_of_what_is_out_of_view(const Clip& clip, const std::vector<SceneState>& states);

}  // namespace hsi4d
