// Furniture and other things that people act at, built where the places of the scenes say.
#pragma once

#include "pipelines/config/synthetic_places.h"
#include "pipelines/synthetic/kit.h"

namespace hsi4d::detail {

/// Builds a thing where it stands. Coordinates are (left, forward, up) of one who sits on it or looks where its front
/// looks, metres; with heading 0 its front looks at the camera.
class Piece {
 public:
  Piece(SceneKit& kit_, const Ground& ground) : kit(kit_), ground_(ground) {}

  SceneKit& kit;

  Point at(const Point& p) const { return ground_.point(p); }
  const Ground& ground() const { return ground_; }
  /// A box of one paint; solid.
  void box(const Point& center, const Point& half, const Rgb& color, double detail = 1) const;
  void painted(const Point& center, const Point& half, const std::function<Paint(int face)>& paint,
               double detail = 1) const;
  /// A box of wood; solid.
  void board(const Point& center, const Point& half, const Rgb& color, double detail = 1) const;
  void bar(const Point& from, const Point& to, double radius, const Rgb& color, double detail = 1) const;
  /// A bent tube through three points.
  void bow(const Point& from, const Point& over, const Point& to, double radius, const Rgb& color) const;
  /// A rectangle; seen from the side of u × v, which for u to the left and v upwards is the front.
  void panel(const Point& corner, const Point& edge_u, const Point& edge_v, const Paint& paint,
             double detail = 1) const;
  /// A box with round edges; not solid.
  void cushion(const Point& center, const Point& half, const Paint& paint, double detail = 1) const;
  /// A wheel or ring in the plane of forward and up.
  void ring(const Point& center, double radius, double thick, const Rgb& color, double detail = 1) const;
  /// A disc in that plane, seen from the left (side 1) or the right (−1).
  void disc(const Point& center, double radius, double side, const Paint& paint, double detail = 1) const;

 private:
  Ground ground_;
};

struct SofaSize {
  double width, seat, depth, back;  ///< of the seat, its height, its depth, height of the back; metres
};

/// The front edge of its seat is at `ground`.
void add_sofa(SceneKit& kit, const Ground& ground, const SofaSize& size, const Rgb& cloth);
/// One whose back is at `ground`, which looks away.
void add_sofa_from_behind(SceneKit& kit, const Ground& ground, const SofaSize& size, const Rgb& cloth);
/// A wooden chair; the front edge of its seat is at `ground`.
void add_chair(SceneKit& kit, const Ground& ground, double seat, const Rgb& color);
/// A park bench.
void add_park_bench(SceneKit& kit, const ScenePlace& place, const Rgb& color);
/// A table; the middle of its front edge is at `ground`.
void add_dining_table(SceneKit& kit, const Ground& ground, const Point& size, const Rgb& color);
void add_round_table(SceneKit& kit, const Point& foot, double radius, double height, const Rgb& top);
/// A step ladder whose nearer side is where the hands rest.
void add_step_ladder(SceneKit& kit, const ScenePlace& place);
/// A counter of a bar, along which one stands.
void add_counter(SceneKit& kit, const Ground& ground, const Point& size, const Rgb& front, const Rgb& top);
void add_stool(SceneKit& kit, const Point& foot, double height, const Rgb& seat);
void add_treadmill(SceneKit& kit, const ScenePlace& place);
void add_slide(SceneKit& kit, const ScenePlace& place);

/// Shelves full of packages, or of bottles; the middle of its front edge is at `ground`.
struct ShelfSize {
  double width, height, depth;
  int rows;
  bool has_bottles = false;
};
void add_shelves(SceneKit& kit, const Ground& ground, const ShelfSize& size, const Rgb& frame);

/// A pickup truck; the middle of its long side is at `ground`, its hood to the left of one who looks at that side.
void add_pickup(SceneKit& kit, const Ground& ground, const Rgb& paint);
/// A bicycle along left, its front wheel first; between its wheels is `ground`.
void add_bicycle(SceneKit& kit, const Ground& ground, const Rgb& frame);

/// A room of any size, open to the front.
struct RoomSize {
  double half_width, back, height;  ///< metres; its sides are at ±half_width, its far wall at `back`
};

/// Ceiling and side walls plain, the back wall in `wall`.
void add_room(SceneKit& kit, const RoomSize& room, const Rgb& wall, const Rgb& ceiling);
/// A floor in two parts: coarse where no camera of the clip looks. @param paint  by place on the floor, metres
void add_floor(SceneKit& kit, double half_width, double back, const std::function<Rgb(const Point&)>& paint,
               double detail = 1);
/// Darker near the edges where the planes of a room meet.
double room_corner_light(const RoomSize& room, const Point& p);

/// A thing that stands on the floor, for its soft shadow there.
struct FloorShade {
  Vector2<double> center, half;
  double turn_deg = 0, strength = 0.4;
};
double floor_shades(std::span<const FloorShade> shades, const Point& p);

}  // namespace hsi4d::detail
