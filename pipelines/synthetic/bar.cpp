// The bar: dark panelling, shelves of bottles before a lit wall, a counter with stools, lamps over it, a checked floor.
// 5 × 5 × 2.8 m.
#include <array>
#include <cmath>

#include "pipelines/synthetic/furniture.h"

namespace hsi4d::detail {
namespace {

constexpr RoomSize kBarRoom{2.5, 3.4, 2.8};
constexpr double kCounterDepth = 0.62, kCounterLength = 1.5;

const ScenePlace& bar_place() { return places_of(SyntheticSceneKind::kBar)[0]; }

/// The front of the counter is what one leans on.
Ground counter_front() {
  const ScenePlace& place = bar_place();
  Ground ground;
  ground.heading_deg = place.ground.heading_deg + 180;
  ground.place = place.ground.point({0.45, place.reach - 0.06, 0}).head<2>();
  return ground;
}

void add_lamp_over(SceneKit& kit, const Point& at) {
  kit.tube(at + Point(0, 0, 0.2), Point(at.x(), at.y(), kBarRoom.height), 0.006, Rgb(0.1, 0.1, 0.1), 1);
  kit.model.add_revolution(
      at, [](double v) { return Vector2<double>(0.15 * (1 - 0.85 * v), 0.2 * v); }, plain(Rgb(0.8, 0.5, 0.2)), 2);
  kit.model.add_revolution(
      at, [](double v) { return Vector2<double>(0.12 * v, -0.01); }, plain(Rgb(1, 0.95, 0.75)), 1.5);
}

}  // namespace

void make_bar(SceneKit& kit) {
  add_room(kit, kBarRoom, Rgb(0.55, 0.34, 0.3), Rgb(0.62, 0.57, 0.52));
  add_floor(kit, kBarRoom.half_width, kBarRoom.back, [&kit](const Point& p) {
    const bool is_dark =
        (static_cast<int>(std::floor(p.x() / 0.32)) + static_cast<int>(std::floor(p.y() / 0.32))) % 2 != 0;
    return Rgb((is_dark ? Rgb(0.36, 0.3, 0.27) : Rgb(0.72, 0.63, 0.5)) * (1 + 0.1 * kit.rough(p * 6)));
  });
  const Rgb wood(0.4, 0.22, 0.12);
  for (int i = 0; i < 12; ++i)  // panelling
    kit.board(Point(-2.3 + 0.42 * i, kBarRoom.back - 0.02, 0.5), Point(0.19, 0.015, 0.42), kit.varied(wood, 0.08), 0.8);
  kit.board(Point(0, kBarRoom.back - 0.03, 0.95), Point(kBarRoom.half_width, 0.03, 0.03), wood * 1.2, 0.8);
  add_shelves(kit, {{-0.95, kBarRoom.back - 0.33}, 0}, {1.8, 2.2, 0.3, 5, true}, wood * 0.9);
  add_shelves(kit, {{1.15, kBarRoom.back - 0.33}, 0}, {1.8, 2.2, 0.3, 5, true}, wood * 0.9);
  add_counter(kit, counter_front(), {kCounterLength, kCounterDepth, bar_place().height}, wood * 1.05,
              Rgb(0.55, 0.3, 0.15));
  const Piece counter(kit, counter_front());
  for (int i = 0; i < 3; ++i) {  // glasses and a bottle
    const Point foot = counter.at({-0.4 + 0.13 * i, -0.42, bar_place().height});
    kit.model.add_revolution(
        foot, [](double v) { return Vector2<double>(0.03 + 0.006 * v, 0.12 * v); },
        [](double, double v) { return v < 0.75 ? Rgb(0.9, 0.62, 0.16) : Rgb(0.96, 0.94, 0.88); }, 3);
  }
  for (const double x : {-2.0, -1.35, -0.75})
    add_stool(kit, Point(x, 1.95 + 0.1 * std::sin(5 * x), 0), 0.74, Rgb(0.62, 0.12, 0.12));
  for (const double x : {-1.6, 0.55, 1.5}) add_lamp_over(kit, Point(x, 1.75, 1.95));
}

double bar_light(const ScenePlan& plan, const Point& p, const Point& normal) {
  static const std::array<FloorShade, 1> shades = {
      {{{0.5, 2.2}, {0.75, 0.33}, bar_place().ground.heading_deg + 180, 0.45}}};
  double glow = 0;
  for (const double x : {-1.6, 0.55, 1.5}) glow += 0.3 * std::exp(-(p - Point(x, 1.75, 1.6)).squaredNorm() / 0.9);
  return (0.98 * faced_light(normal) + glow) * room_corner_light(kBarRoom, p) * support_shadow(plan, p) *
         floor_shades(shades, p);
}

}  // namespace hsi4d::detail
