// Renders the frames and masks of a synthetic clip.
#pragma once

#include <vector>

#include "body/avatar.h"
#include "core/camera.h"
#include "core/image.h"
#include "core/rigid.h"
#include "splat/gaussians.h"
#include "splat/render_settings.h"

namespace hsi4d {

/// One frame as a camera would have seen it.
struct SyntheticFrame {
  Image color;                       ///< [3,H,W] in [0, 1]
  Image human_mask;                  ///< [1,H,W] share of each pixel that shows the human, what hides it included
  Image object_mask;                 ///< [1,H,W] as human_mask; empty without an object
  std::vector<Image> other_masks{};  ///< [1,H,W] likewise, of people beside the first one
};

/// A person beside the first one.
struct DrawnPerson {
  const Avatar& avatar;
  const BodyPose& pose;
};

/// Draws a room, one object and people in single precision.
class SyntheticRenderer {
 public:
  /// All four arguments are kept by reference and must outlive the renderer.
  SyntheticRenderer(const Gaussians& room, const Gaussians& object, const Avatar& avatar,
                    const RenderSettings& settings)
      : room_(room), object_(object), avatar_(avatar), settings_(settings) {}

  /// @param supersample  rendered at this multiple of the camera's size and reduced by area
  SyntheticFrame frame(const BodyPose& pose, const Rigid<double>& world_from_object, const Camera& camera,
                       int supersample, const std::vector<DrawnPerson>& others = {}) const;

 private:
  const Gaussians& room_;
  const Gaussians& object_;
  const Avatar& avatar_;
  const RenderSettings& settings_;
};

}  // namespace hsi4d
