// What of a body or an object a camera sees: the rest of it is behind its own surface.
#pragma once

#include <vector>

#include "core/camera.h"
#include "pipelines/draw/image_of_scene.h"
#include "pipelines/input/state.h"

namespace hsi4d {

/// Rows of what moves that a frame graph draws.
struct SeenRows {
  std::vector<std::vector<Index>> objects;  ///< by object, ascending
  std::vector<std::vector<Index>> people;   ///< by person, ascending
};

/// A camera, and how far it may turn about what it looks at.
struct ViewRange {
  Camera camera;
  RenderSettings render;
  double within_deg = 0;  ///< about the middle of what it looks at
};

/// The Gaussians of a part that are seen of it when it is drawn alone, ascending: those that weigh more than
/// kLeastWeight pixels, summed over the image, from the camera or from one of four that are turned by `within_deg` to
/// the left, right, up and down about the mean of the part's centres. All of them where that is none: what is outside
/// of the image may come in.
std::vector<Index> seen_rows(const PosedGaussians& part, const ViewRange& view_range);

/// 0 to count − 1.
std::vector<Index> all_rows(Index count);

}  // namespace hsi4d
