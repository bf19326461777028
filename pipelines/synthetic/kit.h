// What synthetic scenes are built of: paints, light, and things that more than one scene has.
#pragma once

#include "core/random.h"
#include "pipelines/synthetic/scene.h"
#include "pipelines/synthetic/surface.h"

namespace hsi4d::detail {

using Point = Vector3<double>;

/// Half the width of the rooms, and their height, metres.
inline constexpr double kWall = 2, kCeiling = 2.6;

/// Towards the light of all scenes.
inline const Point kToLight = Point(-0.35, -0.55, 0.76).normalized();

inline const Vector2<double> kTableHalf{0.38, 0.27};  // metres

Rgb mixed(const Rgb& a, const Rgb& b, double part);

/// 0 below `low`, 1 above `high`, smooth between.
double ramp(double low, double high, double x);

Paint plain(const Rgb& color);

/// Light by the direction of a surface.
double faced_light(const Point& normal);

/// Darker near the edges where floor, walls and ceiling of a room meet.
double corner_light(const Point& p);

/// Share of light left under a thing that stands at `center` and is about `half` wide; 1 far from it.
double shadow(const Point& p, const Vector2<double>& center, const Vector2<double>& half, double turn, double strength);

/// Shadow of what the object stands on.
double support_shadow(const ScenePlan& plan, const Point& p);

/// Collects a scene.
class SceneKit {
 public:
  SceneKit(const ScenePlan& plan_, std::uint64_t seed)
      : plan(plan_), random(seed, random_stream("synthetic.room")), noise_(seed, "synthetic.texture") {}

  ScenePlan plan;
  RandomSequence random;
  SurfaceModel model;

  double noise(const Point& p) const { return noise_.at(p); }
  /// Noise of three sizes, each half as strong and half as large as the one before.
  double rough(const Point& p) const;
  Rgb varied(const Rgb& color, double amount) { return color * (1 + amount * (2 * random.uniform() - 1)); }

  /// Wood whose grain runs along u of a sheet that is `length` × `width` metres.
  Paint wood(const Rgb& color, double length, double width);
  /// A colour with noise; `size` of its features in metres, of a sheet that is `u_length` × `v_length`.
  Paint mottled(const Rgb& color, double amount, double size, double u_length, double v_length);

  /// A box of one paint.
  void box(const Point& center, const Point& half, const Paint& paint, double detail = 1, double turn = 0,
           double gloss = 0);
  /// A box of wood, whose grain runs along the ground.
  void board(const Point& center, const Point& half, const Rgb& color, double detail = 1, double turn = 0);
  void tube(const Point& from, const Point& to, double radius, const Rgb& color, double detail = 1);

  /// Planks across the room between two tones; none where `keep` says no.
  void add_planks(const Rgb& dark, const Rgb& light, const std::function<bool(const Point&)>& keep);
  /// A flat thing on the back wall with a frame around it. @param out  from the wall
  void add_framed(double left, double right, double low, double high, double frame, const Rgb& frame_color,
                  const Paint& paint, double detail, double out);
  /// A window to hills under a sky, with bars and a sill.
  void add_window(double left, double right, double low, double high);
  void add_curtain(double left, double right, double low, double high, const Rgb& bottom, const Rgb& top);
  void add_plant(const Point& foot, double size = 1);
  /// What the plan asks for: a table, a stand, posts, or nothing.
  void add_support();

 private:
  void add_table();
  void add_screen();
  void add_stand();
  void add_posts();

  SmoothNoise noise_;
};

using MakeScene = void(SceneKit& kit);
using SceneLight = double(const ScenePlan& plan, const Point& p, const Point& normal);

/// A scene's maker, its light and what it is.
struct SceneMaker {
  SyntheticSceneKind kind;
  const char* summary;
  MakeScene* make;
  SceneLight* light;
};

MakeScene make_living_room, make_kitchen, make_bedroom, make_garden, make_terrace, make_gym, make_bar, make_playground,
    make_greenhouse, make_cafe, make_store, make_bicycle, make_room, make_truck;
SceneLight living_room_light, kitchen_light, bedroom_light, garden_light, terrace_light, gym_light, bar_light,
    playground_light, greenhouse_light, cafe_light, store_light, bicycle_light, room_light, truck_light;

}  // namespace hsi4d::detail
