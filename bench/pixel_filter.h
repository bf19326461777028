// How well a renderer's pixel filter does at silhouettes: the image that an ideal sensor would have taken, and how far
// the figure in a render is from the figure in it.
//
// The renderer widens every Gaussian by `blur` and takes one sample at the centre of a pixel. A sensor adds up what
// falls on the pixel. The latter is made by rendering at several times the size without any blur and averaging the
// samples of each pixel: nothing is filtered but by the pixel's square.
#pragma once

#include "pipelines/draw/image_of_scene.h"

namespace hsi4d {

/// The scene rendered at `factor` times the view's size in both directions, the mean of factor × factor pixels in each.
/// Settings are taken as they are: `blur` is in pixels² of the large image. The large image is made in bands, so that
/// it need not fit into memory.
/// @return  image and alpha; depth is left empty
/// Throws InternalError unless factor ≥ 1; else as render_scene.
SceneImage supersampled(const PosedGaussians& scene, const SceneView& view, int factor);

/// The image as a soft lens would have made it: colours and alpha convolved with a Gaussian of that variance, pixels²,
/// nothing around the image. Unlike `blur` this acts on what is seen, not on each Gaussian.
SceneImage softened(const SceneImage& image, double variance);

/// How a silhouette differs from the true one. Widths are of a limb, that is of both of its edges: positive is fatter.
///
/// With α and t the opacities of render and truth, P = Σ |∇t| the length of the silhouette's contour in pixels (central
/// differences), a figure whose outline lies e outside of the true one everywhere has a width error of 2e, and
///
///   width       2 Σ (α − t) / P: what Σ α along a row across the limb has too much, mean over the contour
///   half_width  the same of the area within which α, interpolated along rows, is above ½ (to a tenth where the outline
///               is curved)
struct SilhouetteError {
  double width_px = 0;
  double half_width_px = 0;
  double brightness = 0;  ///< Σ image / Σ truth − 1
  double rms = 0;         ///< root of the mean squared difference of colours, over as many pixels as Σ t
};

/// Throws InternalError when the images differ in size or the truth is empty.
SilhouetteError silhouette_error(const SceneImage& render, const SceneImage& truth);

}  // namespace hsi4d
