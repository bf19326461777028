// Angles in radians.
#pragma once

#include <numbers>

namespace hsi4d {

inline constexpr double kPi = std::numbers::pi;

/// A degree: `30 * kDegree`.
inline constexpr double kDegree = kPi / 180;

}  // namespace hsi4d
