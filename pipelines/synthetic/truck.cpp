// The truck: a pickup on a street before a wall of houses, with a kerb, a hydrant, a bucket of suds.
#include <algorithm>
#include <array>
#include <cmath>

#include "pipelines/synthetic/furniture.h"
#include "pipelines/synthetic/plants.h"

namespace hsi4d::detail {
namespace {

constexpr double kStreet = 5.4;  // y of the house fronts

const ScenePlace& car_place() { return places_of(SyntheticSceneKind::kTruck)[0]; }

/// The middle of the side that is cleaned; the person stands before the cab.
Ground truck_side() {
  const ScenePlace& place = car_place();
  Ground ground;
  ground.place = place.ground.point({0.1, place.reach - 0.06, 0}).head<2>();  // windows lie so much deeper
  ground.heading_deg = place.ground.heading_deg + 180;
  return ground;
}

void add_houses(SceneKit& kit) {
  const std::array<Rgb, 4> walls = {Rgb(0.72, 0.45, 0.36), Rgb(0.85, 0.78, 0.62), Rgb(0.6, 0.66, 0.7),
                                    Rgb(0.8, 0.6, 0.45)};
  for (int i = 0; i < 4; ++i) {
    const double left = -6 + 3 * i, high = 3.4 + 0.35 * ((i * 7) % 3);
    const Rgb wall = walls[static_cast<std::size_t>(i)];
    const Paint front = [&kit, wall, i](double u, double v) {
      const double x = u * 3, z = v * 3.6;
      const double wx = std::abs(std::remainder(x - 0.75, 1.5));
      const bool is_door = std::abs(x - 2.25) < 0.42 && z < 2.05 && i % 2 == 0;
      if (is_door) return std::abs(x - 2.25) > 0.37 ? Rgb(0.9, 0.9, 0.87) : Rgb(0.3, 0.2, 0.16);
      const double wz = z - 1.55;
      if (wx < 0.45 && std::abs(wz) < 0.62) {
        if (wx > 0.39 || std::abs(wz) > 0.56 || wx < 0.02) return Rgb(0.93, 0.92, 0.88);
        return mixed(Rgb(0.28, 0.32, 0.36), Rgb(0.7, 0.8, 0.88), 0.5 + 0.5 * std::sin(3 * x + 2 * z));
      }
      const double course = std::abs(std::remainder(z / 0.1, 1.0)) < 0.1 ? 0.88 : 1;
      return Rgb(wall * course * (1 + 0.1 * kit.rough(Point(x * 3, z * 3, 2 + i))));
    };
    kit.model.add_rectangle(Point(left, kStreet, 0.12), Point(3, 0, 0), Point(0, 0, high), front, 0.4);
    kit.model.add_rectangle(Point(left, kStreet - 0.05, high), Point(3, 0, 0), Point(0, 0.6, 0.45),
                            plain(Rgb(0.4, 0.25, 0.2)), 0.2);
  }
}

}  // namespace

void make_truck(SceneKit& kit) {
  add_sky(kit);
  add_floor(kit, 6, 4.3, [&kit](const Point& p) {
    const Rgb asphalt(0.33, 0.33, 0.35);
    if (std::abs(p.y() + 0.55) < 0.06 && std::abs(std::remainder(p.x(), 1.6)) < 0.5) return Rgb(0.88, 0.87, 0.82);
    const double wet = ramp(1.15, 0.6, std::hypot(p.x() + 0.3, (p.y() - 1.5) * 1.3) + 0.3 * kit.noise(p * 3));
    return Rgb(asphalt * (1 + 0.14 * kit.noise(p * 45) + 0.1 * kit.rough(p * 2)) * (1 - 0.3 * wet));
  });
  kit.box(Point(0, 4.85, 0.06), Point(6, 0.55, 0.06), kit.mottled(Rgb(0.66, 0.65, 0.62), 0.1, 0.2, 12, 1), 0.4);
  add_houses(kit);
  add_tree(kit, Point(-2.9, 4.8, 0.1), 1.3);
  add_pickup(kit, truck_side(), Rgb(0.16, 0.45, 0.52));
  const Piece near(kit, car_place().ground);
  const Point bucket = near.at({0.62, 0.05, 0});
  kit.model.add_revolution(
      bucket, [](double v) { return Vector2<double>(0.11 + 0.03 * v, 0.26 * v); }, plain(Rgb(0.85, 0.2, 0.2)), 2);
  kit.model.add_revolution(
      bucket + Point(0, 0, 0.24),
      [](double v) { return Vector2<double>(0.13 * (1 - v) + 1e-4, 0.07 * std::sin(1.57 * v)); },
      [&kit](double u, double v) {
        return Rgb(Rgb(0.95, 0.97, 0.98) * (1 + 0.1 * kit.noise(Point(u * 12, v * 6, 3))));
      },
      2);
  const Point hydrant(-2.0, 4.1, 0);
  kit.model.add_revolution(
      hydrant, [](double v) { return Vector2<double>(v < 0.75 ? 0.1 : 0.4 * (1 - v) + 1e-3, 0.65 * v); },
      plain(Rgb(0.85, 0.22, 0.16)), 1.5);
}

double truck_light(const ScenePlan& plan, const Point& p, const Point& normal) {
  if (p.y() > 7) return 1;
  const Ground side = truck_side();
  const Point middle = side.point({0, -0.84, 0});
  const std::array<FloorShade, 2> shades = {
      {{{middle.x(), middle.y()}, {2.25, 0.85}, side.heading_deg, 0.55}, {{-0.9, 1.2}, {0.1, 0.1}, 0, 0.3}}};
  return sun_light(normal) * support_shadow(plan, p) * floor_shades(shades, p);
}

}  // namespace hsi4d::detail
