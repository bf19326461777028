// Which Gaussian of the objects is nearest to a place.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/rigid.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// A hand nearer to the centre of an object's Gaussian than this touches the object, metres.   [method, stage 3: δ]
inline constexpr double kContactDistance = 0.05;

/// A Gaussian of one of several objects, and how far its centre is, metres.
struct NearestGaussian {
  Index object = 0, row = 0;
  double distance = 0;
};

/// The centres of the Gaussians of objects, to be searched by place.
class ObjectCentres {
 public:
  /// @param objects  relative to their centroids; must outlive this
  explicit ObjectCentres(const std::vector<const Gaussians*>& objects);
  ObjectCentres(ObjectCentres&&) noexcept;
  ObjectCentres& operator=(ObjectCentres&&) noexcept;
  ~ObjectCentres();

  /// The Gaussian nearest to a place among all objects; of equally near ones the first object's, and of an object the
  /// first (row D6). Nothing where none is nearer than `within`. May be called by several threads at once.
  ///
  /// @param place              metres, world
  /// @param world_from_object  of each object
  std::optional<NearestGaussian> nearest(const Vector3<double>& place, std::span<const Rigid<double>> world_from_object,
                                         double within) const;

 private:
  struct Object;
  std::vector<std::unique_ptr<Object>> objects_;
};

}  // namespace hsi4d
