// The store: a bright floor, shelves full of packages, a fridge, a sign, and a shelf of snacks to pick from.
// 6 × 5 × 3 m.
#include <array>
#include <cmath>

#include "pipelines/synthetic/furniture.h"

namespace hsi4d::detail {
namespace {

constexpr RoomSize kStoreRoom{3, 3.4, 3};

const ScenePlace& shelf_place() { return places_of(SyntheticSceneKind::kStore)[0]; }

/// What looks back at who stands there.
Ground shelf_front() {
  const ScenePlace& place = shelf_place();
  Ground ground;
  ground.place = place.ground.point({0.05, place.reach, 0}).head<2>();
  ground.heading_deg = place.ground.heading_deg + 180;
  return ground;
}

void add_fridge(SceneKit& kit) {
  const Piece piece(kit, {{-2.2, 2.75}, 18});
  piece.painted(
      {0, -0.35, 1.0}, {0.55, 0.35, 1.0},
      [&](int face) {
        if (face != 2) return plain(Rgb(0.88, 0.89, 0.9));
        return Paint([&kit](double u, double v) {
          if (v > 0.88) return Rgb(0.15, 0.4, 0.7);
          if (v < 0.1 || std::min(u, 1 - u) < 0.04 || std::abs(u - 0.5) < 0.02) return Rgb(0.8, 0.81, 0.83);
          const double row = (v - 0.1) / 0.78 * 5, fy = row - std::floor(row), column = std::floor(u * 22);
          const double fx = u * 22 - column, tone = kit.noise(Point(column * 3.3, std::floor(row) * 5.1, 3));
          if (fy < 0.08) return Rgb(0.9, 0.92, 0.94);
          const bool is_bottle = std::abs(fx - 0.5) < (fy < 0.6 ? 0.36 : 0.14) && fy < 0.85;
          if (!is_bottle) return Rgb(0.72, 0.8, 0.86);
          return tone > 0.2 ? Rgb(0.85, 0.3, 0.15) : tone > -0.25 ? Rgb(0.2, 0.55, 0.35) : Rgb(0.25, 0.2, 0.2);
        });
      },
      2);
}

}  // namespace

void make_store(SceneKit& kit) {
  add_room(kit, kStoreRoom, Rgb(0.86, 0.87, 0.84), Rgb(0.95, 0.95, 0.95));
  add_floor(kit, kStoreRoom.half_width, kStoreRoom.back, [&kit](const Point& p) {
    const double rim = std::min(std::abs(std::remainder(p.x(), 0.5)), std::abs(std::remainder(p.y(), 0.5)));
    const Rgb tile(0.8, 0.79, 0.75);
    return Rgb(tile * (rim < 0.008 ? 0.8 : 1) * (1 + 0.05 * kit.rough(p * 6) + 0.05 * kit.noise(p * 33)));
  });
  const Rgb frame(0.72, 0.73, 0.75);
  add_shelves(kit, {{-0.4, kStoreRoom.back - 0.42}, 0}, {2.2, 1.95, 0.4, 5}, frame);
  add_shelves(kit, {{1.9, kStoreRoom.back - 0.42}, 0}, {2.1, 1.95, 0.4, 5}, frame);
  add_fridge(kit);
  kit.box(
      Point(0.7, kStoreRoom.back - 0.05, 2.45), Point(2.2, 0.04, 0.24),
      [](double u, double v) {
        const double x = std::abs(std::remainder(u * 6, 1.0));
        if (v < 0.12 || v > 0.88) return Rgb(0.97, 0.85, 0.25);
        return std::hypot(x * 2.2, (v - 0.5)) < 0.25 ? Rgb(0.97, 0.95, 0.9) : Rgb(0.16, 0.52, 0.34);
      },
      1.2);
  for (const double x : {-1.4, 1.2})
    kit.model.add_rectangle(Point(x - 0.6, 0.6, kStoreRoom.height - 0.02), Point(1.2, 0, 0), Point(0, 0.2, 0),
                            plain(Rgb(1, 1, 1)), 0.4);
  if (kit.plan.place != nullptr) {
    // boards at the height that hands reach to
    add_shelves(kit, shelf_front(), {shelf_place().width, 1.66, 0.38, 4}, Rgb(0.8, 0.3, 0.22));
    add_shelves(kit, {{-1.75, 1.75}, 62}, {1.0, 1.3, 0.36, 3}, frame);
  }
}

double store_light(const ScenePlan& plan, const Point& p, const Point& normal) {
  static const std::array<FloorShade, 2> shades = {
      {{{-0.4, kStoreRoom.back - 0.2}, {1.1, 0.2}, 0, 0.35}, {{1.9, kStoreRoom.back - 0.2}, {1.1, 0.2}, 0, 0.35}}};
  double light =
      faced_light(normal) * room_corner_light(kStoreRoom, p) * support_shadow(plan, p) * floor_shades(shades, p);
  if (plan.place != nullptr && p.z() < 0.03) {
    const Vector2<double> middle = shelf_front().point({0, -0.2, 0}).head<2>();
    light *= shadow(p, middle, {0.75, 0.2}, shelf_front().heading_deg * 3.14159265 / 180, 0.35);
  }
  return light;
}

}  // namespace hsi4d::detail
