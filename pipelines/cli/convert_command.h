// `hsi4d convert IN OUT`: Gaussians from one file format into another, moved and thinned out on the way.
#pragma once

#include <optional>
#include <string>

namespace hsi4d::cli {

/// Options as they stand on the command line; empty or −1: not given.
struct ConvertOptions {
  std::string in = {}, out = {};
  double scale = 1;            ///< --scale S
  std::string rotate = {};     ///< --rotate x,y,z: axis times angle, degrees
  std::string translate = {};  ///< --translate x,y,z: metres
  std::string matrix = {};     ///< --matrix: the 16 numbers of [sR, t; 0, 1], row by row; instead of the three above
  std::string crop = {};       ///< --crop x0,y0,z0,x1,y1,z1: box, in the coordinates of IN, in which means are kept
  double min_opacity = 0;      ///< --min-opacity O: fainter Gaussians are left out
  int sh_degree = -1;          ///< --sh-degree N
  std::optional<int> spz_version = {};  ///< --spz-version N
  std::string spz_sh_bits = {};         ///< --spz-sh-bits A,B: of harmonics of degree 1, and of those above
};

/// Reads, leaves out what --crop and --min-opacity ask for, transforms (scale, then rotation, then translation), and
/// writes in the format of OUT's ending. What the reader left out or put right goes to the log as a warning. Returns
/// what the command prints: how many Gaussians, and what OUT's format could not hold.
///
/// Throws UserError that names the option, its value and what is allowed, or both files when they are one; and what
/// readers and writers throw.
std::string convert_command(const ConvertOptions& options);

}  // namespace hsi4d::cli
