// What pictures must be before a reconstruction begins, and what of them is told.
#pragma once

#include <string>
#include <vector>

#include "pipelines/photos/photo.h"
#include "pipelines/scan/settings.h"

namespace hsi4d {

/// Before any picture is read: throws UserError where all pictures are held back, for pictures of several sizes (it
/// names two), for more than memory holds, and for cameras that are all at one place. Warns in the log where all look
/// from one side.
void check_photo_cameras(const ScanSettings& settings, const PosedImages& set);

/// Throws UserError where nothing of any picture counts or is wanted. Warns of single pictures of that kind, of
/// pictures of an object in which nothing says what is behind it, and of depths as a camera in a wall has them.
void check_what_counts(const ScanSettings& settings, const PosedImages& set, const std::vector<Photo>& photos);

/// What a checkpoint belongs to, beside its config: names, cameras and sizes of the files of all pictures.
std::string photo_identity(const PosedImages& set);

}  // namespace hsi4d
