// The shape of the procedural body: where its joints are, and a function of space that is negative inside it.
//
// Here the frame has its origin on the floor between the feet: x to the body's left, y up, z forward. Numbers are
// metres of an adult of 1.72 m, from segment lengths and breadths as shares of the height [Drillis and Contini 1966;
// Winter 2009, Biomechanics and Motor Control of Human Movement, ch. 4] and drawn by hand from there.
#pragma once

#include <array>
#include <vector>

#include "core/linear.h"

namespace hsi4d::detail {

/// A finger of the left hand: three bones from its joints to its tip.
struct Finger {
  int first_joint;                        // of the left hand: left_…1
  std::array<Vector3<double>, 4> points;  // its joints and its tip
  std::array<double, 4> radii;            // at the points
};

/// index, middle, pinky, ring, thumb.
const std::array<Finger, 5>& left_fingers();

/// Rest joints [55,3].
std::vector<double> procedural_joints();

/// About the signed distance to the surface, negative inside; mirror images have the same bits.
double body_field(const Vector3<double>& point);

/// About the signed distance to finger `finger` alone; x ≥ 0.
double finger_field(const Finger& finger, const Vector3<double>& point);

/// 0 below `low`, 1 above `high`, smooth between.
inline double smoothstep(double low, double high, double x) {
  const double t = (x - low) / (high - low);
  if (t <= 0) return 0;
  if (t >= 1) return 1;
  return t * t * (3 - 2 * t);
}

}  // namespace hsi4d::detail
