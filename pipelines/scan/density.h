// Where Gaussians are, and how many: by the scheme of "3D Gaussian splatting as Markov chain Monte Carlo" [Kheradmand
// et al. 2024], in which nothing is cut away, and what has become faint goes to where something is seen and shares its
// place; or by adaptive density control (pipelines/scan/density_adc.h).
#pragma once

#include "pipelines/scan/settings.h"
#include "pipelines/scan/state.h"

namespace hsi4d {

/// What one change of the density did.
struct DensityChange {
  Index moved = 0;  ///< faint Gaussians that share another's place now
  Index added = 0;
  Index removed = 0;
};

/// With mcmc moves Gaussians of at most settings.least_opacity to others, and adds settings.growth − 1 of all, up to
/// settings.most. Whom they join is drawn by opacity; those at one place share its opacity and size (splat/density.h),
/// so that the image hardly changes. They begin with no moments. A function of the arguments alone.
///
/// @param seed    and state.iteration: of the draws
/// @param extent  of the scene, metres; with adc sizes are shares of it
DensityChange change_density(const DensitySettings& settings, std::int64_t seed, double extent, ScanState& state);

/// Whether the density changes after an iteration, counted from 0: not after the last one, for what is new is to be
/// fitted.
bool changes_density_after(const DensitySettings& settings, Index iteration, Index iterations);

/// How far places tremble: N(0, Σ²) · noise · rate · σ(100 (0.005 − o)), so that what is faint looks around and what is
/// seen stands still [the paper's noise, as its code has it].
///
/// @param means  [N,3] rows that are moved
/// @param rate   of the means in this iteration
void add_noise(const DensitySettings& settings, std::int64_t seed, Index iteration, double rate,
               const Gaussians& shapes, float* means);

}  // namespace hsi4d
