// Places on a body's surface, and the nearest one to a point.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "body/body_model.h"

namespace hsi4d {

/// A place on a triangle of a body.
struct SurfacePlace {
  std::int32_t face = 0;
  std::array<double, 3> shares = {1, 0, 0};         ///< barycentric, of the face's corners; they sum to 1
  Vector3<double> point = Vector3<double>::Zero();  ///< metres, rest pose
};

/// The place of a triangle that is nearest to a point. A triangle without area is its longest edge, or a point.
/// @param corners  metres
SurfacePlace nearest_on_triangle(const std::array<Vector3<double>, 3>& corners, const Vector3<double>& point);

/// Corners of a face, metres.
std::array<Vector3<double>, 3> face_corners(const BodyModel& body, std::int32_t face);

/// Normals of the vertices: the mean of the faces around each, by area.
/// @return  [V] of length 1; zero where the faces around have no area, or there are none
std::vector<Vector3<double>> vertex_normals(const BodyModel& body);

/// Finds the nearest place of a whole surface: exact, in about the logarithm of the number of faces.
///
/// A tree (nanoflann) of the centroids of the faces for each size of faces: one within d of a point has its centroid
/// within d + r, r its largest distance to a corner.
class SurfaceIndex {
 public:
  /// The body must outlive it. Throws InternalError when it has no faces.
  explicit SurfaceIndex(const BodyModel& body);
  ~SurfaceIndex();
  SurfaceIndex(const SurfaceIndex&) = delete;
  SurfaceIndex& operator=(const SurfaceIndex&) = delete;

  /// The nearest place; of equally near ones that of the lowest face. Throws InternalError for a point that is not
  /// finite. May be called by several threads.
  SurfacePlace nearest(const Vector3<double>& point) const;

 private:
  struct Trees;
  const BodyModel& body_;
  std::unique_ptr<const Trees> trees_;
};

/// Appends the skinning weights at a place: the `per_vertex` largest of those of the triangle's corners, interpolated,
/// the largest first (ties: the lower joint), divided by their sum. Unused places have weight 0.
void append_weights(const BodyModel& body, const SurfacePlace& place, SparseWeights& weights);

}  // namespace hsi4d
