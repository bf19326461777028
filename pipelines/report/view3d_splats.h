// Gaussians for a viewer: a sample of them, in few bytes each.
#pragma once

#include <cstdint>
#include <vector>

#include "splat/gaussians.h"

namespace hsi4d {

/// Which of many things stand for all, and how likely each was to be taken.
struct Sample {
  std::vector<Index> rows;            ///< ascending
  std::vector<double> probabilities;  ///< of each row taken, 0 to 1
};

/// At most `count` rows, row i with the probability p_i = min(1, c w_i), Σ p_i = count: systematic sampling, without
/// chance. Rows of weight 0 are never taken; where no more than `count` have weight, all of them are.
///
/// @param weights  ≥ 0
Sample weighted_sample(const std::vector<double>& weights, Index count);

/// Parts of Gaussians: the scene, then each object, one after the other. What a number stands for is
///
///   position = box_min + u/65535 (box_max − box_min),   log scale = lo + u/255 (hi − lo),   quaternion = i/127
struct QuantisedSplats {
  std::vector<std::int32_t> counts;      ///< [P] Gaussians of each part
  std::vector<float> boxes;              ///< [P,2,3] metres; the scene's in the world, an object's about its centroid
  std::vector<std::uint16_t> positions;  ///< [N,3]
  std::vector<std::uint8_t> log_scales;  ///< [N,3]
  std::vector<std::int8_t> rotations;    ///< [N,4] wxyz, unit
  std::vector<std::uint8_t> colors;      ///< [N,4] RGB of the harmonics' constant part, and opacity, of 255
};

/// Log of metres that 0 and 255 stand for in QuantisedSplats::log_scales.
inline constexpr double kLeastLogScale = -8, kLargestLogScale = 2;

/// Gaussians farther from a viewer's subject, or fainter, are not shown.
struct SplatSelection {
  Index count = 0;                                         ///< at most
  Vector3<double> center_world = Vector3<double>::Zero();  ///< metres
  double radius = 0;                                       ///< metres
  double least_opacity = 0.02;
};

/// Appends a part: a sample of the Gaussians that the selection allows, weighted by opacity and size. Those that stand
/// for several are larger by p^-1/2, at most three times, so that they cover what all did.
///
/// Throws InternalError as check_sizes.
void add_part(const Gaussians& gaussians, const SplatSelection& selection, QuantisedSplats& splats);

}  // namespace hsi4d
