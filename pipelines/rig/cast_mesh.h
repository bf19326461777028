// Rays at a mesh, and what they meet.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "core/camera.h"
#include "pipelines/rig/ray_library.h"
#include "pipelines/rig/textured_mesh.h"

namespace hsi4d {

/// Where a ray meets a mesh.
struct MeshHit {
  std::int32_t face = -1;  ///< -1: nowhere
  double u = 0, v = 0;     ///< the place is (1 − u − v) a + u b + v c
  double distance = 0;     ///< along the ray, in lengths of its direction
  double cosine = 0;       ///< between ray and the face's normal: below 0 where its front is seen
};

/// A half-line of the world.
struct WorldRay {
  Vector3<double> origin, direction;
  float threshold = 0.5F;  ///< alphas from which it stops: as they are; those of a mask are at their own cut-off
};

/// A mesh that rays are cast at, from several threads at once.
class CastMesh {
 public:
  /// Throws InternalError where the library cannot be loaded; UserError where memory is short.
  explicit CastMesh(TexturedMesh mesh);
  CastMesh(const CastMesh&) = delete;
  CastMesh& operator=(const CastMesh&) = delete;

  const TexturedMesh& mesh() const { return mesh_; }

  /// The face that each ray meets first, -1: none. Rays that are side by side should be near each other.
  std::vector<std::int32_t> faces_met(std::span<const WorldRay> rays) const;

  /// What each ray meets first.
  std::vector<MeshHit> cast(std::span<const WorldRay> rays) const;

 private:
  TexturedMesh mesh_;
  std::unique_ptr<RayScene, void (*)(RayScene*)> scene_;
};

/// Where a ray meets the plane of a face, held within the face. In double; a face without an area: nowhere.
MeshHit hit_on(const TexturedMesh& mesh, std::int32_t face, const WorldRay& ray);

/// Rays through places in a picture; their distances are camera z.
class PictureRays {
 public:
  explicit PictureRays(const Camera& camera);

  WorldRay through(double x, double y, float threshold = 0.5F) const {
    return {center_, direction_ * Vector3<double>(x, y, 1), threshold};
  }

 private:
  Vector3<double> center_;
  Matrix3<double> direction_;  ///< of a place in pixels, (x, y, 1)
};

/// Alpha of a face at (u, v): of its material, its texture and its vertices.
float alpha_at(const TexturedMesh& mesh, std::int32_t face, double u, double v);

}  // namespace hsi4d
