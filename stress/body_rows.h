// The rows D that stand in body_robustness.cpp: wild steps, distances, priors, wraps.
#pragma once

#include "stress/stress.h"

namespace hsi4d::stress {

std::vector<StressFigure> bad_steps(Remedy);          ///< D4
std::vector<StressFigure> distances_at_zero(Remedy);  ///< D5
std::vector<StressFigure> near_neighbours(Remedy);    ///< D6
std::vector<StressFigure> joint_ranges(Remedy);       ///< D7
std::vector<StressFigure> unlikely_poses(Remedy);     ///< D8
std::vector<StressFigure> turns_beyond_half(Remedy);  ///< D9

}  // namespace hsi4d::stress
