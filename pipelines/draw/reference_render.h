// One image of Gaussians and its adjoint by the brute-force renderer in double (splat/reference/reference.h).
#pragma once

#include <functional>

#include "pipelines/draw/image_of_scene.h"

namespace hsi4d {

/// As render_scene, whatever view.precision.
SceneImage render_reference(const PosedGaussians& posed, const SceneView& view,
                            std::span<const PixelPlace> traced = {});

/// The derivatives [H,W,3] of a loss by the image `rendered` of its argument; may set its loss.
using CotangentOf = std::function<std::vector<double>(SceneGradients&)>;

/// The image, and the derivatives of the loss whose derivatives by the image are known. Throws InternalError for
/// another count of these.
SceneGradients adjoint_reference(const Gaussians& gaussians, const SceneView& view, const CotangentOf& cotangent_of);

}  // namespace hsi4d
