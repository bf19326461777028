// Depth maps of a clip's frames, as programs make them that estimate depth from a single picture: a file for each
// frame, of any scale and shift.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/camera.h"
#include "core/file.h"
#include "core/image.h"
#include "pipelines/config/data_settings.h"
#include "pipelines/input/frame_source.h"

namespace hsi4d {

/// Where the maps of a clip's frames are.
struct DepthMaps {
  std::vector<std::filesystem::path> files;        ///< by frame; empty: there is none
  std::vector<std::filesystem::path> confidences;  ///< how sure the map is, by frame; none at all: alike everywhere
};

/// The map of a frame.
struct DepthMap {
  Image values;   ///< [1,H,W] of mean 0 and standard deviation 1 where they are known, 0 elsewhere; empty: says nothing
  Image weights;  ///< [1,H,W] how sure the map is, at most 1; 0 where nothing is known
};

/// Looks for the files of data.depth_maps and data.depth_confidence: NAME.png, NAME.exr, NAME.npy or NAME.npz for the
/// frame NAME.png, or for frame 3 of a video 0003.exr. Frames without one are told in the log.
/// Throws UserError or DataError naming the folder: none of any frame, two of one, maps without their confidence.
DepthMaps find_depth_maps(const DataSettings& data, const FrameSource& frames);

/// The numbers of a file: [1,H,W]. A grey picture (one channel, or three alike); of OpenEXR the layer Z, else Y, else
/// the only one, else three alike; an array [H,W], alone or in an archive, where it is the only one or is named
/// "depth", "disparity" or "confidence". Axes of length 1 before or behind are left out.
/// @param name  what error messages call it
/// Throws DataError: anything else, damage.
Image decode_depth_map(Bytes file, const std::string& name, const ImageLimits& limits = {});

/// The map of a frame, each pixel of the camera's image by the nearest of the file. Not known is what is 0 or not
/// finite, or has a confidence that is.
/// @param camera  of whose size it is made; the file may have any size of that shape
/// @return        empty where there is no file, or it says nothing: all that is known is one number
/// Throws UserError, DataError: a file that cannot be read, of another shape, or with a confidence below 0.
DepthMap read_depth_map(const DepthMaps& maps, const Camera& camera, Index frame);

/// Reads the maps of all frames once. Those that say nothing are told in the log, with their frames. Throws as
/// read_depth_map; DataError where none says anything.
void check_depth_maps(const DepthMaps& maps, const Camera& camera);

}  // namespace hsi4d
