// The places of synthetic scenes: what a person can sit on, lean on, run on, slide down, reach into, wipe or water
// there. Scenes put furniture where the table says, and motions read from it where hands, feet and seat go.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "core/linear.h"
#include "pipelines/config/synthetic_settings.h"

namespace hsi4d {

/// The frame that motions are told in: a place on the floor and a direction. Vectors in it are (left, forward, up),
/// metres.
struct Ground {
  Vector2<double> place = Vector2<double>::Zero();  ///< world
  double heading_deg = 0;                           ///< about z; at 0 forward is −y, at 90 it is +x

  /// In the world: a point, a direction, and the rotation of the heading.
  Vector3<double> point(const Vector3<double>& left_forward_up) const;
  Vector3<double> direction(const Vector3<double>& left_forward_up) const;
  Matrix3<double> turn() const;
};

/// What a place is for.
enum class PlaceUse {
  kSeat,     ///< ground: the floor under the middle of the front edge, and where one looks who sits
  kRest,     ///< ground: where one stands; hands rest `reach` ahead
  kBelt,     ///< ground: the middle of a treadmill's belt; height: of the belt; its rail is `reach` ahead
  kSlide,    ///< ground: the end of a slide, and where it leads; it begins `reach` behind, at `height`
  kShelf,    ///< ground: where one stands; the shelf's edge is `reach` ahead
  kPanel,    ///< ground: where one stands; an upright surface `reach` ahead, its middle at `height`
  kFlowers,  ///< ground: where one stands; the flowers' middle is `reach` ahead
};

/// Where the camera stands, against that of other motions.
struct PlaceView {
  double turn_deg = 0;  ///< about the person
  double distance = 1;  ///< share of the usual one
  double left = 0;      ///< what it looks at is so far to the left in the image, metres
  double up = 0;        ///< and so much higher, metres
};

/// A place of a scene. Metres; degrees.
struct ScenePlace {
  const char* name;
  PlaceUse use;
  Ground ground;
  double height;    ///< of the seat, of what hands rest on, of the belt, of the top of the slide, of the shelf
  double reach;     ///< how far it is, or how deep
  double rise = 0;  ///< of kRest: how much higher the other hand is
  double width = 1;
  PlaceView view = {};
};

/// The places of a scene, in the order in which they are listed.
std::span<const ScenePlace> places_of(SyntheticSceneKind scene);

/// What a motion needs to be done at; none: it is done in the middle.
std::optional<PlaceUse> use_of(SyntheticMotionKind motion);

/// The place of that name that the motion can be done at; without a name the scene's first one. Null for a motion that
/// needs none. @return null, too, where there is none: place_problem tells why
const ScenePlace* find_place(SyntheticSceneKind scene, SyntheticMotionKind motion, const std::string& name);

/// What is wrong with a place for a motion in a scene, or nothing.
std::string place_problem(SyntheticSceneKind scene, SyntheticMotionKind motion, const std::string& name);

/// How far aside of its middle the place can be acted at, metres.
double room_of(const ScenePlace& place);

/// Height of a slide's chute so far behind its end, metres: level, then a slope up to the place's height at its reach.
double slide_height(const ScenePlace& slide, double behind);

/// Names of a scene's places, or of those that a motion can be done at, as "SCENE/PLACE".
std::string place_names_of(SyntheticSceneKind scene);
std::string place_names_of(SyntheticMotionKind motion);

}  // namespace hsi4d
