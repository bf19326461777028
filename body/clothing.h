// Colours of a dressed body, by place in the rest pose.
#pragma once

#include <span>

#include "body/body_model.h"

namespace hsi4d::detail {

/// Places per area about eyes and mouth over those of the head.
inline constexpr double kFaceDetail = 5;

/// Colours of a body in the SMPL-X layout: short-sleeved striped shirt, checked trousers, belt, shoes, hair, skin, and
/// a face: eyes with lids, iris and pupil, brows, lips.
class Clothing {
 public:
  /// @param texture  contrast of the patterns, 0 to 1
  /// Throws InternalError for a body of another layout.
  Clothing(const BodyModel& body, double texture);

  /// RGB at a point of the surface, without light.
  /// @param point  metres, rest pose
  /// @param joint  the one that moves the point most
  Vector3<double> color(const Vector3<double>& point, int joint) const;

  /// How much finer than the head what is painted there is: 1, and up to kFaceDetail about eyes and mouth.
  double detail(const Vector3<double>& point) const;

 private:
  Vector3<double> head(const Vector3<double>& point) const;
  Vector3<double> eye(double outward, double up) const;
  Vector3<double> mouth(double across, double up) const;
  Vector3<double> on_face(const Vector3<double>& point, const Vector3<double>& centre) const;
  Vector3<double> shirt(const Vector3<double>& point, bool sleeve) const;
  Vector3<double> trousers(const Vector3<double>& point) const;
  /// Below the middle of the eyes by as much as they are apart, and a little behind them.
  Vector3<double> mouth_centre() const;
  Vector3<double> joint(int j) const { return Vector3<double>(joints_.data() + 3 * j); }

  std::vector<double> joints_;
  double texture_;
  double head_size_;  // from the head's joint to its top, over that of the procedural body
};

}  // namespace hsi4d::detail
