// Colours of a dressed body, by place in the rest pose.
#pragma once

#include <span>

#include "body/body_model.h"

namespace hsi4d::detail {

/// Colours of a body in the SMPL-X layout: short-sleeved striped shirt, checked trousers, belt, shoes, hair, skin.
class Clothing {
 public:
  /// @param texture  contrast of the patterns, 0 to 1
  /// Throws InternalError for a body of another layout.
  Clothing(const BodyModel& body, double texture);

  /// RGB at a point of the surface.
  /// @param point   metres, rest pose
  /// @param normal  outward, of length 1
  /// @param joint   the one that moves the point most
  Vector3<double> color(const Vector3<double>& point, const Vector3<double>& normal, int joint) const;

 private:
  Vector3<double> fabric(const Vector3<double>& point, int joint) const;
  Vector3<double> head(const Vector3<double>& point) const;
  Vector3<double> shirt(const Vector3<double>& point, bool sleeve) const;
  Vector3<double> trousers(const Vector3<double>& point) const;
  Vector3<double> joint(int j) const { return Vector3<double>(joints_.data() + 3 * j); }

  std::vector<double> joints_;
  double texture_;
  double head_size_;  // from the head's joint to its top, over that of the procedural body
};

}  // namespace hsi4d::detail
