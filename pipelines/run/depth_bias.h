// A constant error of depths, as frame 0 tells it.
//
// The avatar is never quite the person who was filmed, nor the pixel filter quite the camera's. What is drawn too fat
// seems to be too near, and a fit puts it further away, in every frame by nearly the same factor. Frame 0 is given: a
// fit of it as if it were any other frame shows that factor.   [docs/numerics/accuracy.md]
#pragma once

#include <string>
#include <vector>

#include "pipelines/input/clip.h"
#include "pipelines/input/state.h"

namespace hsi4d {

/// How much further from the camera a fit puts what moves than it is: factors of the distance along the line of sight.
struct DepthBias {
  double human = 1;              ///< of the pelvis
  std::vector<double> objects;   ///< of the centroids, in the clip's order
  std::vector<double> others{};  ///< of the other people's pelvises, likewise

  double& person(std::size_t p) { return p == 0 ? human : others.at(p - 1); }
  double person(std::size_t p) const { return p == 0 ? human : others.at(p - 1); }
};

/// A fit that is further off than this has lost what it followed, and tells nothing: its factor is 1.
inline constexpr double kMostDepthBias = 0.05;

/// @param frame          frame 0, whose masks say what it shows: of anything else the factor is 1
/// @param given, fitted  its state, and what stages make of that; of one camera
DepthBias depth_bias(const Clip& clip, const ClipFrame& frame, double mask_threshold, const SceneState& given,
                     const SceneState& fitted);

/// Moves people and objects along their lines of sight to where they are without it. Objects on joints stay on these.
void remove_depth_bias(const Clip& clip, const DepthBias& bias, SceneState& state);

/// "human 1.0027, vase 1.0012"
std::string depth_bias_text(const Clip& clip, const DepthBias& bias);

}  // namespace hsi4d
