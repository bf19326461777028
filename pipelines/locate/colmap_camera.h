// The camera of a picture that COLMAP has registered, in the world of a scene that `hsi4d align` has moved.
#pragma once

#include <filesystem>
#include <string>

#include "pipelines/photos/alignment.h"

namespace hsi4d {

/// The camera of a picture of a model.
///
/// @param folder     of the model, as read_posed_images has it: itself, sparse/0 or sparse in it
/// @param picture    as the model calls it, or without the folders before its name
/// @param alignment  from the model's world to the scene's
/// Throws UserError naming the folder: no model, no such picture or several, a lens that bends; DataError as
/// read_colmap.
Camera colmap_camera(const std::filesystem::path& folder, const std::string& picture, const Similarity& alignment);

}  // namespace hsi4d
