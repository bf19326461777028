// Files of keypoints as they are, before a clip says which of their frames and persons count.
#pragma once

#include <filesystem>
#include <vector>

#include "pipelines/input/keypoints.h"

namespace hsi4d {

/// Reads any of the formats of keypoints.h: a file, or a folder of OpenPose.
/// @param joints  as parse_keypoints has them
/// Throws as parse_keypoints and keypoint_files; UserError where it cannot be read.
FoundKeypoints read_found_keypoints(const std::filesystem::path& path, const std::vector<KeypointJoints>& joints = {});

}  // namespace hsi4d
