// The Gaussians that a reconstruction begins with.
#pragma once

#include <vector>

#include "pipelines/scan/settings.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// Half the size of what the cameras are spread over: the largest distance of one from their mean, times 1.1, and at
/// least a tenth of the mean distance to the point that they look at. Rates of places are shares of it.
double extent_of(const std::vector<Camera>& cameras);

/// The point nearest to all lines of sight, in least squares; where they are all parallel, the mean of the centres.
Vector3<double> looked_at(const std::vector<Camera>& cameras);

/// Points of a PLY: x, y, z, and colours red, green, blue of 0 to 255 where it has them. Throws DataError naming the
/// file.
std::vector<ColoredPoint> read_point_cloud(const std::filesystem::path& file);

/// Points from the depths of pictures: one a voxel that some pixel of alpha above ½ falls in, its mean place and
/// colour. Voxels are twice as large for each doubling of the depth beyond the median. Where there would be more than
/// settings.count, all are larger; the log says so.
std::vector<ColoredPoint> points_of_depths(const ScanStart& settings, const std::vector<Photo>& photos);

/// Round Gaussians at points: as large as the mean distance to the three nearest, times settings.size.
/// @param sh_degree  of the result; harmonics above degree 0 are zero
/// @param origin     of the result
Gaussians gaussians_at(const std::vector<ColoredPoint>& points, const ScanStart& settings, int sh_degree,
                       const Vector3<double>& origin);

/// By the settings; the log tells which start it was. Throws UserError: more than settings.density.most, points are
/// asked for and there are none, depths and a picture has none; DataError as read_point_cloud.
/// @param photos  in memory, those of `set`
Gaussians first_gaussians(const ScanSettings& settings, const PosedImages& set, const std::vector<Photo>& photos);

}  // namespace hsi4d
