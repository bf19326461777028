// What a reconstruction is at one moment, and its checkpoint.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "optim/row_adam.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// Groups, in the order of scan_groups().
inline constexpr std::size_t kScanGroups = 5;

/// Of the exposure of one picture: logarithms of gains of three channels, and offsets.
inline constexpr Index kExposureNumbers = 6;

/// Iterations that make one point of the curve.
inline constexpr Index kCurveEvery = 20;

/// The numbers of each group.
std::array<std::vector<float>*, kScanGroups> arrays_of(Gaussians& g);

/// Gaussians on their way.
struct ScanState {
  Index iteration = 0;  ///< that comes next
  Gaussians gaussians;
  std::array<RowMoments<float>, kScanGroups> moments;  ///< by group; none yet of one that does not move
  std::vector<float> exposures;                        ///< of all pictures; empty where they are not learnt
  std::vector<RowMoments<float>> exposure_moments;     ///< by picture, kExposureNumbers rows each
  std::vector<float> gradient_sums;                    ///< density_adc.h, since the last change; empty: none yet
  std::vector<std::int32_t> gradient_counts;           ///< of pictures that they are of
  Index refused = 0;                                   ///< rows of gradients that were no numbers, so far
  std::vector<double> curve;                           ///< mean PSNR of each kCurveEvery iterations, dB
  double curve_sum = 0;                                ///< of the PSNRs since the last of them

  /// Numbers of a row of each group.
  std::array<Index, kScanGroups> columns() const;
};

/// Writes a state in one step. @param identity  text of what it belongs to
void save_scan_state(const std::string& file, const ScanState& state, const std::string& identity);

/// Reads it, the same bits. Throws as load_checkpoint: also where it belongs to something else.
ScanState load_scan_state(const std::string& file, const std::string& identity);

}  // namespace hsi4d
