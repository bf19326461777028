// Writes pictures whose cameras are known, as read_posed_images reads them: transforms.json, images/, depths/.
#pragma once

#include <span>

#include "core/camera.h"
#include "core/folder_in_making.h"
#include "core/image.h"

namespace hsi4d {

/// Writes picture `number`: images/NNNN.png and depths/NNNN.exr. Several threads may write different ones at once.
///
/// @param picture  [3,H,W], or [4,H,W] with alpha, not multiplied in
/// @param depth    [1,H,W] camera z, metres, 0 where nothing is
/// Throws as write_image.
void write_photo(const FolderInMaking& out, Index number, const Image& picture, const Image& depth);

/// Writes transforms.json (OpenGL axes, as nerfstudio's) of pictures 0, 1, …, which have one size and one focal length.
void write_photo_cameras(const FolderInMaking& out, std::span<const Camera> cameras);

}  // namespace hsi4d
