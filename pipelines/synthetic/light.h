// Light of generated videos that the reconstruction knows nothing of: shading of what moves, and its shadow on the
// scene, anew in every frame.
#pragma once

#include <vector>

#include "body/avatar.h"
#include "core/rigid.h"
#include "pipelines/synthetic/object.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// A ball that keeps light away.
struct Occluder {
  Vector3<double> center;  ///< world, metres
  double radius;           ///< metres
};

/// Balls along the limbs, the trunk and the head of a posed body.
std::vector<Occluder> body_occluders(const BodyModel& body, const BodyPose& pose);

/// Balls over an object's Gaussians, in its own frame: at most `most`, centres far apart from each other.
std::vector<Occluder> object_occluders(const Gaussians& object, Index most = 24);

std::vector<Occluder> moved(const std::vector<Occluder>& occluders, const Rigid<double>& world_from_object);

/// Share of the light that is left at a point between occluders: a soft shadow away from the light, times what the
/// occluders leave of the sky.
///
///   sky_i = max(0, n·d_i) r_i²/|p − c_i|²     [the share of the hemisphere that a ball covers, Quilez 2006],
///   d_i the direction to it;  a ball between the point and the light darkens by how near the ray passes, with an edge
///   that softens, and a depth that falls, with its distance
///
/// @param normal    of the surface, of length 1
/// @param strength  0: none of it; 1: full
double light_left(const std::vector<Occluder>& occluders, const Vector3<double>& point, const Vector3<double>& normal,
                  double strength);

/// The scene with the shadow of the occluders on it; the shortest axis of a Gaussian is its normal, towards the eye.
Gaussians shadowed_scene(const Gaussians& scene, const std::vector<Occluder>& occluders, const Vector3<double>& eye,
                         double strength);

/// The avatar with colours as its surface faces the light in a pose; the third axis of a Gaussian is its normal, as
/// surface_avatar makes it.
Avatar shaded_avatar(const Avatar& avatar, const BodyPose& pose, double strength);

/// An object with colours as its surface faces the light in a pose, against how it stands in its own frame. One without
/// normals is lit as a ball around its centroid would be.
Gaussians shaded_object(const SyntheticObject& object, const Rigid<double>& world_from_object, double strength);

}  // namespace hsi4d
