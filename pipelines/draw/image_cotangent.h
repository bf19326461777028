// Gradients of an image of Gaussians for derivatives by its pixels that are given.
#pragma once

#include <array>
#include <span>

#include "pipelines/draw/image_of_scene.h"

namespace hsi4d {

/// Derivatives by everything that the image is made of.
struct ImageAdjoint {
  SceneGradients numbers;              ///< its loss is Σ cotangent · image
  std::array<double, 3> background{};  ///< Σ over the pixels of T · cotangent, T = 1 − alpha
};

/// Renders, and carries a cotangent back.
/// @param cotangent  [H,W,3] derivatives of a loss by the image
/// Throws InternalError as check_sizes, and for another count of numbers.
ImageAdjoint image_adjoint(const Gaussians& gaussians, const SceneView& view, std::span<const double> cotangent);

}  // namespace hsi4d
