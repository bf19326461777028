#include "pipelines/scan/exposure.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "splat/sh_basis.h"

namespace hsi4d {

namespace {

using Numbers = std::array<double, kExposureNumbers>;

Numbers mean_exposure(const std::vector<bool>& held, const ScanState& state) {
  Numbers mean{};
  const auto learnt = static_cast<double>(std::max<Index>(1, std::count(held.begin(), held.end(), false)));
  for (std::size_t photo = 0; photo < held.size(); ++photo) {
    if (held[photo]) continue;
    for (std::size_t i = 0; i < mean.size(); ++i) mean[i] += static_cast<double>(exposure_of(state, photo)[i]) / learnt;
  }
  return mean;
}

/// c becomes c e^g + o, c = 1/2 + C0 dc + …
void expose(const Numbers& numbers, Gaussians& g) {
  const std::size_t coefficients = static_cast<std::size_t>(g.sh_coefficients());
  for (std::size_t at = 0; at < g.sh.size(); ++at) {
    const std::size_t channel = at % 3;
    const double gain = std::exp(numbers[channel]);
    double number = gain * static_cast<double>(g.sh[at]);
    if (at / 3 % coefficients == 0) number += (0.5 * gain + numbers[3 + channel] - 0.5) / kShC0;
    g.sh[at] = static_cast<float>(number);
  }
}

}  // namespace

std::span<const float> exposure_of(const ScanState& state, std::size_t photo) {
  return std::span(state.exposures).subspan(photo * kExposureNumbers, kExposureNumbers);
}
std::span<float> exposure_of(ScanState& state, std::size_t photo) {
  return std::span(state.exposures).subspan(photo * kExposureNumbers, kExposureNumbers);
}

void give_mean_exposure(const std::vector<bool>& held, ScanState& state) {
  if (state.exposures.empty()) return;
  const Numbers mean = mean_exposure(held, state);
  expose(mean, state.gaussians);
  for (std::size_t photo = 0; photo < held.size(); ++photo) {
    const std::span<float> own = exposure_of(state, photo);
    if (held[photo]) std::fill(own.begin(), own.end(), 0.0F);
    for (std::size_t channel = 0; channel < 3 && !held[photo]; ++channel) {
      const double gain = static_cast<double>(own[channel]) - mean[channel];
      own[3 + channel] = static_cast<float>(static_cast<double>(own[3 + channel]) - mean[3 + channel] * std::exp(gain));
      own[channel] = static_cast<float>(gain);
    }
  }
}

}  // namespace hsi4d
