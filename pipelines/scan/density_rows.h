// Rows of a reconstruction that come, go and take others' shapes.
#pragma once

#include <cmath>
#include <vector>

#include "core/random.h"
#include "pipelines/scan/state.h"

namespace hsi4d {

inline double opacity_of_logit(float logit) { return 1 / (1 + std::exp(-static_cast<double>(logit))); }
inline float logit_of_opacity(double opacity) { return static_cast<float>(std::log(opacity / (1 - opacity))); }

/// Random numbers of one purpose in one iteration.
Random density_random(std::int64_t seed, const char* purpose, Index iteration);

/// Makes the number of rows `rows`; new ones are zero, with no moments.
void resize_rows(ScanState& state, Index rows);
/// Row `to` becomes what row `from` is; moments stay.
void copy_row(ScanState& state, Index from, Index to);
/// Forgets what the optimiser has accumulated of a row.
void forget_moments(ScanState& state, Index row);
/// Leaves the rows for which `keeps` is true, in their order, with their moments.
void keep_rows(ScanState& state, const std::vector<bool>& keeps);

}  // namespace hsi4d
