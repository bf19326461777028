// What a failing image test leaves: both images and their difference, as files to look at.
#pragma once

#include <string>
#include <vector>

namespace hsi4d::test {

/// Writes `computed` and `expected` as NAME_computed.png and NAME_expected.png (clamped to [0, 1], numbers that are not
/// finite as 0) and their difference, as it is, as NAME_difference.exr, all beside each other in the folder
/// failed_images of the build. NAME is `name` with anything but letters, digits and - as _, and a number that no other
/// call of this process has had.
///
/// @param computed, expected  planar [C,H,W], C 1 or 3
/// @return                    lines that name the files, or why there are none: it never throws
std::string save_failed_images(const std::string& name, const std::vector<double>& computed,
                               const std::vector<double>& expected, int height, int width);

/// Checks that no number of an image differs from the expected one by more than `tolerance`; saves both otherwise.
/// @return  the largest difference
double check_image(const std::string& name, const std::vector<double>& computed, const std::vector<double>& expected,
                   int height, int width, double tolerance);

}  // namespace hsi4d::test
