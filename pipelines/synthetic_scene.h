// The synthetic room and the object that is carried in it, as Gaussians. Everything is a function of the settings and
// the seed.
#pragma once

#include <cstdint>
#include <string>

#include "pipelines/synthetic_settings.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// What the room is arranged around, so that the action fits into it. World coordinates, metres.
struct RoomPlan {
  Vector3<double> table_top{-0.25, 0.35, 0.75};  ///< middle of the table's upper side
  double table_turn = 0;                         ///< about z, radians
  Vector2<double> rug{0, 0.6};                   ///< middle of the rug
};

/// A room of 4 × 4 × 2.6 m around (0, 0), floor at z = 0, open towards -y: plank floor, rug, wallpaper over a panelled
/// wainscot, window with curtains, pictures, a bookcase, a potted plant and a table. The light is baked into the
/// colours; the floor and the table shine a little (spherical harmonics of degree 1).
///
/// @param most  Gaussians, at least kFewestRoomGaussians; as near to it as whole cells of the surfaces allow
Gaussians synthetic_room(Index most, const RoomPlan& plan, std::uint64_t seed);

/// An object with its own origin at the mean of its Gaussian centres, z up as it stands.
struct SyntheticObject {
  std::string name;         ///< the word of its kind
  Gaussians gaussians;      ///< relative to the mean of its centres
  Vector3<double> grip;     ///< where a hand holds it: the middle of its handle, which runs along x, metres
  double above_ground = 0;  ///< height of the origin over the ground that it stands on, metres
};

/// @param most  Gaussians, at least kFewestObjectGaussians
SyntheticObject synthetic_object(SyntheticObjectKind kind, Index most, std::uint64_t seed);

}  // namespace hsi4d
