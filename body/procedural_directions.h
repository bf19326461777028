// How the procedural body differs from person to person, and how its hands close.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "body/body_model.h"
#include "body/procedural_body.h"

namespace hsi4d::detail {

/// What the shape directions change; a unit is about a standard deviation among adults.
inline constexpr std::array<const char*, kProceduralBetas> kProceduralShapes = {
    "height",         "weight",    "leg length", "arm length", "torso length",
    "shoulder width", "hip width", "belly",      "head size",  "size of hands and feet"};

/// Metres for each unit of the numbers of kProceduralShapes.
struct ShapeDirections {
  std::vector<double> vertices;  ///< [3V,10]
  std::vector<double> joints;    ///< [3J,10]
};

/// Bones stretch along the axes of the rest pose, and carry what hangs on them:
///
///   d_child = d_j + s_j ∘ (r_child − r_j),   d_x = Σ_j w_j (d_j + s_j ∘ (x − r_j))
///
/// with s_j [3] what a direction says of bone j. So surface and joints stay together, and shapes are smooth where
/// weights are.
ShapeDirections procedural_directions(const BodyModel& body);

/// How the fingers of a hand bend.
struct HandBend {
  double base, middle, tip;  ///< of the three joints of four fingers, radians
  double thumb;              ///< across the palm, 0 stretched to 1 over the fingers
  double spread;             ///< of neighbouring fingers at the base, radians
};

inline constexpr HandBend kRelaxedHand = {0.30, 0.40, 0.22, 0.25, 0.0};
inline constexpr HandBend kClosedHand = {1.40, 1.65, 1.00, 1.0, 0.0};

/// Axis-angle [45] of a hand's joints in the order of the body model, radians; the right hand mirrors the left.
///
/// @param side  0 left, 1 right
std::array<double, 45> hand_pose_of(const HandBend& bend, int side);

}  // namespace hsi4d::detail
