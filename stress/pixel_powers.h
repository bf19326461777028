// The exponentials of the kernels of pixels, by pixels whose alpha is nothing else.
#pragma once

#include <cmath>

#include "splat/limits.h"
#include "splat/render/block_kernel.h"
#include "splat/render/composite_kernel.h"

namespace hsi4d::stress {

/// A function of the kernels of pixels: what it is given for a wanted argument, and its value.
template <class S>
struct Pixel {
  S argument, value;
};

/// exp(−d²/2) of a row of pixels, for d = √(−2 x).
template <class S>
Pixel<S> row_exponential(S wanted) {
  const double distance = std::sqrt(-2 * static_cast<double>(wanted));
  detail::SplatRecord<S> record{};
  record.l22 = record.opacity = 1;
  record.y = 0.5 - distance;
  detail::TileJob<S> job{};
  job.width = job.height = 16;
  const auto mean = static_cast<S>(record.y);
  const S d = S(0.5) - mean;  // as the kernel has it
  const detail::CompositeRules<S> rules{S(1), S(0), S(0), false, false};
  return {S(-0.5) * (d * d), detail::pixel_alpha(record, rules, job, 0, 0).alpha};
}

/// 2ᵖ of a block of pixels: with L = 0 what is left of the exponent is log₂ o.
inline Pixel<float> block_exponential(float p) {
  detail::SplatRecord<float> record{};
  record.opacity = 1;
  record.log2_opacity = p;
  const detail::CompositeRules<float> rules{1, kExactBelowAlpha, 1e-4f, false, false, 0.3f};
  return {p, detail::block_pixel_alpha(16, record, rules, 0, 0, 0, 0).alpha};
}

/// Its better form, which settings without cuts have, as `reference`, and small blurs. There log₂ o is not in the
/// exponent, which is −w² here: of a mean so far away, and an l22 so small, that where in the tile the pixel lies is
/// lost beside it.
inline Pixel<float> exact_block_exponential(float p) {
  constexpr auto kScale = static_cast<float>(detail::kLog2Scale);
  detail::SplatRecord<float> record{};
  record.opacity = 1;
  record.l22 = 0x1p-60f;
  const double y = std::sqrt(-static_cast<double>(p)) / static_cast<double>(kScale);
  record.y = -0x1p60 * y;
  const auto w = static_cast<float>(static_cast<double>(kScale) * y);
  const detail::CompositeRules<float> rules{1, kLeastAlpha, 0, false, false, 0.3f};
  return {-(w * w), detail::block_pixel_alpha(16, record, rules, 0, 0, 0, 0).alpha};
}

}  // namespace hsi4d::stress
