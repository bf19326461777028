// The objects of synthetic clips, as Gaussians, with where hands hold them. Everything is a function of the settings
// and the seed.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "pipelines/config/synthetic_settings.h"
#include "splat/gaussians.h"

namespace hsi4d {

/// How a hand holds an object, in the object's frame.
struct HandGrip {
  Vector3<double> point;    ///< what lies in the palm, metres
  Vector3<double> thumb;    ///< the side of the fist that the thumb is on; unit
  Vector3<double> fingers;  ///< where stretched fingers would point; unit, across `thumb`
};

/// An object with its own origin at the mean of its Gaussian centres. It stands with z up; its front is +x, its left
/// side +y.
struct SyntheticObject {
  std::string name;                                   ///< the word of its kind, or the stem of its file
  Gaussians gaussians;                                ///< relative to the mean of its centres; none of kind none
  Vector3<double> grip{0, 0, 0};                      ///< the middle of where it is held, metres
  std::array<std::optional<HandGrip>, 2> hands = {};  ///< left, right: those that hold it
  double above_ground = 0;           ///< height of the origin over the ground that it stands on, metres
  Vector3<double> carried{0, 0, 0};  ///< where its grip is when it is carried: left, forward, up of the person, metres
  bool has_normals = true;           ///< the third axis of each Gaussian is its outward normal, as of made ones
  bool on_floor = false;             ///< it stands on the floor, not on a table
  bool is_long = false;              ///< it is pushed along a wider circle
  std::optional<Vector3<double>> hinge = {};  ///< a point of the vertical axis that it turns about, on the ground it
                                              ///< stands on; none: it moves freely
  bool is_heavy = false;                      ///< a weight, lifted with both hands from where it lies; needs no stand

  bool exists() const { return gaussians.count() > 0; }
};

/// @param most  Gaussians, at least kFewestObjectGaussians
SyntheticObject synthetic_object(SyntheticObjectKind kind, Index most, std::uint64_t seed);

/// The object of the settings: of object_file, where there is one.
/// Throws as read_splats; DataError when the file holds no Gaussians; UserError when it is called like the masks of the
/// person.
SyntheticObject synthetic_object(const SyntheticSettings& settings);

/// One line of what an object is.
const char* object_summary(SyntheticObjectKind kind);

/// Height of the office chair's seat, metres.
inline constexpr double kChairSeat = 0.47;
/// From the middle of its seat to its back, metres.
inline constexpr double kChairBack = 0.25;

}  // namespace hsi4d
