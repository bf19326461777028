// How far an object's points are from where they should be: ADD and ADD-S.
#pragma once

#include <memory>
#include <vector>

#include "core/rigid.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// Points of an object that are looked at, evenly chosen among the centres of its Gaussians; all where there are fewer.
inline constexpr Index kMeasuredObjectPoints = 500;

/// Errors of an object's pose as its surface sees them.
struct ObjectPointErrors {
  double add_cm = 0;    ///< average distance of the points
  double add_s_cm = 0;  ///< average distance to the nearest point: forgives a symmetry
};

/// The points of objects.
class ObjectPoints {
 public:
  /// @param objects  relative to their centroids; must outlive this
  explicit ObjectPoints(const std::vector<const Gaussians*>& objects);
  ObjectPoints(ObjectPoints&&) noexcept;
  ~ObjectPoints();

  Index objects() const;

  /// With M the chosen points and M* all centres of an object, x its frame:
  ///
  ///   ADD   = 100/|M| Σ_{x ∈ M} |T̂ x − T x|                        [Hinterstoisser et al. 2012]
  ///   ADD-S = 100/|M| Σ_{x ∈ M} min_{y ∈ M*} |T̂ y − T x|           [Xiang et al. 2018, PoseCNN, eq. 6]
  ///
  /// @param pose, truth  T̂ and T: world_from_object
  /// @return             centimetres; 0 of an object without Gaussians
  ObjectPointErrors errors(Index object, const Rigid<double>& pose, const Rigid<double>& truth) const;

 private:
  struct Object;
  std::vector<std::unique_ptr<const Object>> objects_;
};

}  // namespace hsi4d
