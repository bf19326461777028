// What of a clip is found because its files do not know it: the lens, sizes, the person's shape.
#pragma once

#include <string>
#include <vector>

#include "pipelines/input/clip.h"

namespace hsi4d {

/// What is found, beside what the files say. As it stands: nothing.
struct ClipUnknowns {
  double focal_length = 1;            ///< factor of fx and fy
  double scene_scale = 1;             ///< factor of the scene with its cameras, about the world's origin,
  double scene_height = 0;            ///< and metres by which they then rise
  std::vector<double> object_scales;  ///< factors by object, about the centroids; empty: 1
  std::vector<double> betas;          ///< to be added to the avatar's; empty: none

  bool operator==(const ClipUnknowns&) const = default;
};

/// Both, one after the other.
ClipUnknowns compose(const ClipUnknowns& first, const ClipUnknowns& second);

/// The clip as it is with what was found; with betas it needs a shape. The pelvis of first state, estimates and truth
/// stays where it is in the world. The truth's camera stays.
void apply_unknowns(const ClipUnknowns& unknowns, Clip& clip);

/// A state that was found together with them: its camera is that of a scene of another scale and height, its body is at
/// the same place with another shape.
/// @param clip  before or after apply_unknowns
void apply_unknowns(const ClipUnknowns& unknowns, const Clip& clip, SceneState& state);

/// By name, as summaries have it: focal_length_px, scene_scale, scene_height_m, object_scale_NAME, beta_0, …; those
/// that are as the files say are left out.
/// @param clip  with what was found
std::vector<std::pair<std::string, double>> unknowns_by_name(const ClipUnknowns& unknowns, const Clip& clip);

/// "focal length 612.4 px (1.043 of what was given), scene times 0.93, …"
std::string unknowns_text(const ClipUnknowns& unknowns, const Clip& clip);

/// A factor beyond this, or below its inverse, is hardly one that a frame tells.
inline constexpr double kLargestUnknownFactor = 1.5;

/// Names of what is further than that from what was given.
std::vector<std::string> doubtful_unknowns(const ClipUnknowns& unknowns, const Clip& clip);

}  // namespace hsi4d
