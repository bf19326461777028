// Rows A of the catalogue, a function each; the failures and remedies are told in stress/projection.cpp. Those about a
// Gaussian's ellipse in the image are in projection_ellipse.cpp, those about camera and world in projection_world.cpp
// and projection_turns.cpp.
#pragma once

#include <vector>

#include "stress/stress.h"

namespace hsi4d::stress {

std::vector<StressFigure> needles(Remedy remedy);                 ///< A1
std::vector<StressFigure> held_ratios(Remedy remedy);             ///< A2
std::vector<StressFigure> beside_the_view(Remedy remedy);         ///< A3
std::vector<StressFigure> near_and_far(Remedy remedy);            ///< A4
std::vector<StressFigure> wild_log_scales(Remedy remedy);         ///< A5
std::vector<StressFigure> wild_places(Remedy remedy);             ///< A6
std::vector<StressFigure> antialias_factor(Remedy remedy);        ///< A7
std::vector<StressFigure> units_of_length(Remedy remedy);         ///< A8
std::vector<StressFigure> small_gaussians(Remedy remedy);         ///< A9
std::vector<StressFigure> far_from_the_origin(Remedy remedy);     ///< A10
std::vector<StressFigure> turning_camera(Remedy remedy);          ///< A11
std::vector<StressFigure> edge_on(Remedy remedy);                 ///< A12
std::vector<StressFigure> lengths_of_quaternions(Remedy remedy);  ///< A13

}  // namespace hsi4d::stress
