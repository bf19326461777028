// Pictures of a mesh: its own colours, softly shaded, with depths.
#pragma once

#include "pipelines/rig/cast_mesh.h"

namespace hsi4d {

struct MeshLight {
  int supersample = 4;  ///< rays along each side of a pixel
  double shade = 0.3;   ///< how much darker a side is that looks away from the sky; 0: colours as they are
};

/// What a camera sees.
struct MeshPicture {
  Image color;  ///< [3,H,W] mean of the rays that meet something, 0 where none does
  Image alpha;  ///< [1,H,W] share of rays that do
  Image depth;  ///< [1,H,W] camera z through the pixel's centre, metres; 0: nothing
};

/// Draws a mesh. Each ray asks what it meets; those of a quarter of a pixel that meet the same face are shaded as one,
/// through their middle, with the texture as sharp as that is wide. Both sides of its faces are seen. A material that
/// blends stops as large a share of a pixel's rays as its alpha says. Colours are averaged as the file has them. A
/// function of its arguments, for any number of threads.
MeshPicture mesh_picture(const CastMesh& mesh, const Camera& camera, const MeshLight& light);

/// The factor of a colour by the normal, turned to who looks: 1 towards a place high in the sky, 1 − shade away from
/// it.
///
///   1 − shade (1 − n·l)/2
double sky_shade(const Vector3<double>& normal, double shade);

}  // namespace hsi4d
