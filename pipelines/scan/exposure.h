// Gain and offset of each channel of each picture: y = c e^g + o of what the Gaussians show, c. Nothing but the mean
// over pictures says how bright the Gaussians themselves are.
#pragma once

#include <span>

#include "pipelines/scan/state.h"

namespace hsi4d {

/// The numbers of a picture: three gains g, three offsets o. With exposures alone.
std::span<const float> exposure_of(const ScanState& state, std::size_t photo);
std::span<float> exposure_of(ScanState& state, std::size_t photo);

/// Gives the Gaussians the mean exposure of the pictures that were learnt from, and takes it from all pictures, so that
/// each looks as it did (but for colours held at 0). Pictures that were held back have none then. Nothing without
/// exposures.
void give_mean_exposure(const std::vector<bool>& held, ScanState& state);

}  // namespace hsi4d
