// Which camera of a file is that of which frame. Entries that name their pictures (nerfstudio's file_path) are matched
// by name, whatever their order; others are in the order of the frames.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/camera.h"
#include "pipelines/input/frame_source.h"

namespace hsi4d {

/// The camera of frame 0, of a file with one or with those of all frames. What is not used of it is told in the log.
///
/// Throws as read_cameras; DataError naming the file when frame 0 has no entry or several, when an entry among several
/// names no picture and others do, when cameras differ in size, focal length or principal point, or when cameras
/// without names are not as many as frames.
Camera first_camera(const std::filesystem::path& file, const FrameSource& frames);

/// The camera of every frame, each with a lens of its own. Throws otherwise as first_camera, naming all frames without
/// an entry.
std::vector<Camera> cameras_of_frames(const std::filesystem::path& file, const FrameSource& frames);

/// The camera of a file that has one, for when there are no frames yet. Throws DataError for another number of them.
Camera only_camera(const std::filesystem::path& file);

/// A camera for its size and focal lengths. Throws DataError for a file whose cameras differ in these.
Camera camera_for_size(const std::filesystem::path& file);

/// The same; none for an empty path.
std::optional<Camera> intrinsics_of(const std::filesystem::path& file);

}  // namespace hsi4d
