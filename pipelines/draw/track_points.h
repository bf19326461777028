// What tracks of a video follow: the points of the human and of the objects that are seen where the tracks begin.
#pragma once

#include <span>
#include <vector>

#include "pipelines/input/clip.h"
#include "splat/render_settings.h"

namespace hsi4d {

/// A point of the surface that a track follows: it lies beside a Gaussian and moves as that does.
struct TrackPoint {
  Index track = 0;
  Index object = 0;                                  ///< of the clip's; the number of objects: the human
  Index row = 0;                                     ///< the Gaussian
  Vector3<double> offset = Vector3<double>::Zero();  ///< from its centre, where both are at rest, metres
};

/// The points of all tracks that have begun, found once for each frame.
///
/// A track begins in the first frame that shows it, and is bound by the state of that frame, where that is known. Its
/// pixel is drawn, and of scene, human and objects the one that weighs most there has it. The point is where the line
/// of sight is as deep as that one's Gaussians are in the mean; it follows the Gaussian of these that weighs most.
/// Tracks on the scene, and those where less than half of the pixel is opaque, have no point; the log tells how many
/// they are.
class TrackPoints {
 public:
  /// Those of tracks that begin in the frames `done`.
  /// @param done  by frame; those of before must be the same as before
  const std::vector<TrackPoint>& of(const Clip& clip, const RenderSettings& render, std::span<const SceneState> done);

 private:
  std::vector<TrackPoint> points_;
  std::size_t frames_ = 0;
};

}  // namespace hsi4d
