// The mask of an object in the first frame, of what a user says of it.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "core/image.h"

namespace hsi4d {

/// Where an object is in the first frame; one of the three.
struct ObjectHint {
  std::filesystem::path mask;                 ///< a picture, as data.masks has them
  std::vector<double> box;                    ///< x0, y0, x1, y1 around it, pixels of the frame
  std::vector<std::array<double, 2>> clicks;  ///< x, y on it

  bool empty() const { return mask.empty() && box.empty() && clicks.empty(); }
};

/// The mask.
///
///   mask    read from the file
///   box     what differs from around the box.   [Rother et al. 2004]
///   clicks  the part around each that is bordered by strong changes of colour (nearest pixels first, along ways on
///   which
///           colours change little; Dijkstra), then as a box. An object of several colours needs a click on each.
///
/// What the human's mask covers is none of it, unless it is clicked on.
///
/// @param frame  [3,H,W], the first
/// @param human  [1,H,W] mask of the human; empty: not known
/// @param longest_side_px  of the picture that is looked at
/// @param name   what messages call the hint: "--object can=12,40"
/// @return       [1,H,W] share of each pixel
/// Throws UserError naming the hint: a click or box outside the picture, a box without an inside; nothing found in it;
/// DataError for a mask of another size, or without a pixel above ½.
Image first_mask(const ObjectHint& hint, const Image& frame, const Image& human, int longest_side_px,
                 const std::string& name);

}  // namespace hsi4d
