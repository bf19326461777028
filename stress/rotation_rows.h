// The rows C that stand in rotation_forms.cpp: quaternions, pairs of columns, chains, views.
#pragma once

#include "stress/stress.h"

namespace hsi4d::stress {

std::vector<StressFigure> quaternion_signs(Remedy);    ///< C7
std::vector<StressFigure> quaternion_lengths(Remedy);  ///< C8
std::vector<StressFigure> parallel_columns(Remedy);    ///< C9
std::vector<StressFigure> pivots(Remedy);              ///< C10
std::vector<StressFigure> dead_branches(Remedy);       ///< C11
std::vector<StressFigure> chains(Remedy);              ///< C12
std::vector<StressFigure> views_along_up(Remedy);      ///< C13

}  // namespace hsi4d::stress
