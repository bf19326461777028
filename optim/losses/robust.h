// Robust functions of squared distances that terms share.
#pragma once

#include <array>
#include <cmath>
#include <string>
#include <type_traits>

#include "autodiff/dual.h"
#include "core/config.h"

namespace hsi4d {

/// What a distance counts for that is far from 0.
enum class RobustKernel {
  kNone,         ///< as much as the term has it without a kernel
  kHuber,        ///< constant pull
  kGemanMcClure  ///< it no longer pulls
};

/// Of terms that are squares without one.
inline constexpr std::array<ConfigChoice<RobustKernel>, 3> kSquareKernels = {
    {{RobustKernel::kNone, "squared"},
     {RobustKernel::kHuber, "huber"},
     {RobustKernel::kGemanMcClure, "geman_mcclure"}}};

/// What is wrong with a scale that is not the default where no kernel reads it; else nothing.
/// @param none  the word for no kernel
inline std::string idle_scale_text(RobustKernel kernel, double scale, double default_scale, const std::string& none) {
  if (kernel != RobustKernel::kNone || scale == default_scale) return "";
  return "does nothing with kernel \"" + none + "\"; allowed: kernel \"huber\" or \"geman_mcclure\", or no scale";
}

/// r² up to the scale s, then 2 s |r| − s². [Huber 1964]
/// @param squared  r²
template <class T>
T huber(T squared, float scale) {
  const float limit = scale * scale;
  const T far = max(squared, limit);  // at least the limit: the root has a slope
  return select(value_of(squared) <= static_cast<std::decay_t<decltype(value_of(squared))>>(limit), squared,
                2.0F * scale * sqrt(far) - limit);
}

/// s² r² / (s² + r²): nearly r² where that is small, never more than s². [Geman and McClure 1987]
/// @param limit  s²
template <class T>
T geman_mcclure(T squared, float limit) {
  const T share = limit / (limit + squared);  // of r² that counts
  const bool is_near = value_of(squared) <= static_cast<std::decay_t<decltype(value_of(squared))>>(limit);
  // Equal forms: in float the first loses the slope far from 0, the second the value near it.
  return select(is_near, squared * share, limit * (1.0F - share));
}

/// The kernel of r², by the scale s; r² of none.
template <class T>
T robust(T squared, RobustKernel kernel, float scale) {
  if (kernel == RobustKernel::kHuber) return huber(squared, scale);
  return kernel == RobustKernel::kGemanMcClure ? geman_mcclure(squared, scale * scale) : squared;
}

}  // namespace hsi4d
