// The rows of blending_cases, by file.
#pragma once

#include <vector>

#include "stress/stress.h"

namespace hsi4d::stress {

// transmittance.cpp: stacks at one pixel
std::vector<StressFigure> kept_transmittance(Remedy);    // B1
std::vector<StressFigure> opaque_gradients(Remedy);      // B2
std::vector<StressFigure> stop_rule(Remedy);             // B4
std::vector<StressFigure> faint_layers(Remedy);          // B5
std::vector<StressFigure> million_on_one_pixel(Remedy);  // B12
std::vector<StressFigure> opaque_wall(Remedy);           // B16

// blending_gradients.cpp: branches that the gradient has to take as the forward pass did
std::vector<StressFigure> cap_gradient(Remedy);             // B3
std::vector<StressFigure> differences_across_cuts(Remedy);  // B6
std::vector<StressFigure> recomputed_alpha(Remedy);         // B13
std::vector<StressFigure> conic_gradient(Remedy);           // B21

// rendered_values.cpp: opacity, colour, depth
std::vector<StressFigure> normalized_depth(Remedy);   // B14
std::vector<StressFigure> saturated_sigmoid(Remedy);  // B15
std::vector<StressFigure> quick_exponential(Remedy);  // B17
std::vector<StressFigure> held_color(Remedy);         // B18
std::vector<StressFigure> color_direction(Remedy);    // B19

// footprints.cpp: which pixels
std::vector<StressFigure> footprint(Remedy);        // B7
std::vector<StressFigure> nothing_to_draw(Remedy);  // B11
std::vector<StressFigure> pixel_centres(Remedy);    // B20

// depth_order.cpp: sorting and counting
std::vector<StressFigure> depth_sort(Remedy);   // B8
std::vector<StressFigure> depth_keys(Remedy);   // B9
std::vector<StressFigure> pair_counts(Remedy);  // B10

}  // namespace hsi4d::stress
