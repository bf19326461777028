// The signed distance to a mesh: positive in free space, negative in the solid.
//
// The nearest place of the surface is exact (body/surface_index.h). On which side of it a point is says the normal of
// the feature on which that place lies: of the face, the sum of the two faces' at an edge, the sum of the faces' by
// their angles at a corner.   [Bærentzen and Aanæs 2005, "Signed distance computation using the angle weighted
// pseudonormal"]
//
// A mesh may have several pieces (triangles that share no corner). Each closed one is a solid of its own, and the union
// of all counts: the distance is the least of theirs, exact outside, and no deeper than the truth where pieces overlap.
// A closed piece turned inwards is a hollow of the smallest solid whose box holds it; what lies outside of all those
// without one is solid, as of the walls of rooms.
//
// An open piece bounds nothing. It then is a slab: behind it, where the nearest place does not lie on its border, is
// solid down to `thickness`; deeper is unknown.
#pragma once

#include <memory>
#include <string>

#include "optim/solid/mesh_file.h"

namespace hsi4d {

/// Behind open pieces of a mesh and behind Gaussians so much counts as solid where penetration is measured, metres.
inline constexpr double kMeasuredThickness = 0.1;

/// How many edges of a mesh are not between two triangles that agree on their side.
struct MeshEdges {
  Index edges = 0, open = 0;
};
MeshEdges count_edges(const TriangleMesh& mesh);

/// Where a point is, by the surface.
class MeshDistance {
 public:
  /// @param mesh       cleaned (optim/solid/mesh_file.h). Throws InternalError where it has no faces
  /// @param thickness  of open pieces, metres
  MeshDistance(const TriangleMesh& mesh, double thickness);
  ~MeshDistance();
  MeshDistance(const MeshDistance&) = delete;
  MeshDistance& operator=(const MeshDistance&) = delete;

  /// Metres; NaN where it is not known: behind an open piece, and in no solid. By several threads at once.
  /// Throws InternalError for a point that is not finite.
  double at(const Vector3<double>& point) const;

  /// No place nearer than this to one at that distance is in the solid; 0 or less: there may be one. Closed pieces end
  /// where their surface is; behind the border of an open one its slab begins, as deep as it is thick.
  double free_radius(double distance) const { return distance - thickest_slab_; }

 private:
  struct Piece;
  std::vector<std::unique_ptr<const Piece>> pieces_;
  double thickest_slab_ = 0;
};

/// Reads a mesh and its distance. An open mesh, and one whose pieces are all turned inwards, is told in the log.
/// Errors as read_mesh.
std::shared_ptr<const MeshDistance> read_mesh_distance(const std::string& path, double thickness);

}  // namespace hsi4d
