// The room of the benchmark: a grey sofa on parquet before a wide window, a piano, a floor lamp, shelves, a round rug.
// 5 × 4.7 × 2.6 m.
#include <array>
#include <cmath>
#include <numbers>

#include "pipelines/synthetic/furniture.h"

namespace hsi4d::detail {
namespace {

constexpr RoomSize kRoomSize{2.4, 2.7, 2.6};

const ScenePlace& sofa_place() { return places_of(SyntheticSceneKind::kRoom)[0]; }

void add_wide_window(SceneKit& kit) {
  const double y = kRoomSize.back - 0.03, left = -1.5, width = 2.1, low = 0.95, high = 2.15;
  kit.model.add_rectangle(
      Point(left, y, low), Point(width, 0, 0), Point(0, 0, high - low),
      [&kit](double u, double v) {  // a lawn, trees and the sky
        const double tree = 0.45 + 0.2 * kit.noise(Point(u * 6, 1, 2)) + 0.08 * kit.noise(Point(u * 20, 4, 2));
        if (v < 0.18) return Rgb(0.5, 0.66, 0.34);
        if (v < tree) return Rgb(Rgb(0.28, 0.45, 0.22) * (1 + 0.4 * kit.noise(Point(u * 25, v * 20, 3))));
        return mixed(Rgb(0.93, 0.96, 0.98), Rgb(0.62, 0.8, 0.95), v);
      },
      1.3);
  const Rgb white(0.96, 0.96, 0.95);
  for (int i = 0; i <= 3; ++i)
    kit.box(Point(left + width * i / 3, y - 0.03, (low + high) / 2), Point(0.03, 0.03, (high - low) / 2 + 0.04),
            plain(white), 1);
  for (const double z : {low, high})
    kit.box(Point(left + width / 2, y - 0.03, z), Point(width / 2 + 0.03, 0.04, 0.035), plain(white), 1);
  for (int i = 0; i < 5; ++i)  // blinds half drawn
    kit.box(Point(left + width / 2, y - 0.07, high - 0.05 - 0.06 * i), Point(width / 2, 0.008, 0.022),
            plain(Rgb(0.85, 0.8, 0.7)), 1);
}

void add_piano(SceneKit& kit) {
  const Piece piece(kit, {{1.55, 2.0}, -14});
  const Rgb black(0.1, 0.09, 0.09);
  piece.box({0, -0.3, 0.6}, {0.62, 0.2, 0.6}, black, 1.2);
  piece.painted(
      {0, 0.0, 0.7}, {0.6, 0.13, 0.04},
      [&](int face) {
        return face != 5 ? plain(black) : Paint([](double u, double v) {
          const double key = u * 42 - std::floor(u * 42);
          const int which = static_cast<int>(u * 42) % 7;
          const bool is_black = v > 0.4 && key < 0.3 && which != 0 && which != 3;
          return is_black || key < 0.08 ? Rgb(0.1, 0.1, 0.1) : Rgb(0.96, 0.95, 0.92);
        });
      },
      3);
  piece.panel({-0.25, -0.09, 0.86}, {0.5, 0, 0}, {0, -0.05, 0.28}, plain(Rgb(0.94, 0.93, 0.88)), 2);
  piece.box({0, 0.5, 0.44}, {0.3, 0.15, 0.03}, Rgb(0.3, 0.15, 0.1), 1.5);
  for (const double x : {-0.26, 0.26})
    for (const double y : {0.38, 0.62}) piece.bar({x, y, 0}, {x, y, 0.42}, 0.02, black, 1.5);
  for (const double x : {-0.57, 0.57}) piece.box({x, 0.08, 0.33}, {0.035, 0.035, 0.33}, black, 1);
}

}  // namespace

void make_room(SceneKit& kit) {
  add_room(kit, kRoomSize, Rgb(0.88, 0.87, 0.83), Rgb(0.95, 0.95, 0.94));
  add_floor(kit, kRoomSize.half_width, kRoomSize.back, [&kit](const Point& p) {
    const double r = std::hypot(p.x() - kit.plan.middle[0], p.y() - kit.plan.middle[1]);
    if (r < 0.95) {
      const double band = r / 0.95 * 6 + 0.06 * kit.noise(p * 30);
      return static_cast<int>(band) % 2 == 0 ? Rgb(0.24, 0.36, 0.48) : Rgb(0.86, 0.83, 0.75);
    }
    // herringbone
    const double a = (p.x() + p.y()) / 0.5, b = (p.x() - p.y()) / 0.12;
    const double tone = kit.noise(Point(std::floor(b) * 3.3, std::floor(a + 0.5 * std::floor(b)) * 1.7, 2));
    const double seam = std::abs(std::remainder(b, 1.0)) > 0.46 ? 0.8 : 1;
    return Rgb(mixed(Rgb(0.6, 0.41, 0.25), Rgb(0.75, 0.56, 0.37), 0.5 + 0.7 * tone) * seam);
  });
  add_wide_window(kit);
  const ScenePlace& place = sofa_place();
  add_sofa(kit, place.ground, {place.width, place.height, place.reach, 0.84}, Rgb(0.46, 0.49, 0.53));
  const Piece sofa(kit, place.ground);
  sofa.cushion({0.55, -0.42, place.height + 0.16}, {0.17, 0.07, 0.17}, plain(Rgb(0.86, 0.62, 0.2)), 2);
  add_piano(kit);
  const Point lamp(-1.75, 2.1, 0);
  kit.tube(lamp, lamp + Point(0, 0, 1.5), 0.014, Rgb(0.2, 0.2, 0.2), 1.5);
  kit.model.add_revolution(
      lamp, [](double v) { return Vector2<double>(0.15 * (1 - 0.9 * v), 0.03 * v); }, plain(Rgb(0.2, 0.2, 0.2)), 1.2);
  kit.model.add_revolution(
      lamp + Point(0, 0, 1.42), [](double v) { return Vector2<double>(0.22 - 0.07 * v, 0.3 * v); },
      plain(Rgb(0.99, 0.94, 0.8)), 1.3);
  kit.add_framed(
      1.0, 1.65, 1.45, 2.0, 0.03, Rgb(0.2, 0.18, 0.16),
      [](double u, double v) {
        const double r = std::hypot(u - 0.4, v - 0.55);
        if (r < 0.22) return Rgb(0.85, 0.4, 0.25);
        return v < 0.35 + 0.1 * std::sin(5 * u) ? Rgb(0.25, 0.38, 0.45) : Rgb(0.92, 0.87, 0.75);
      },
      2, kWall - kRoomSize.back + 0.03);
  kit.add_plant(Point(-2.0, 1.35, 0), 0.9);
}

double room_light(const ScenePlan& plan, const Point& p, const Point& normal) {
  static const std::array<FloorShade, 2> shades = {
      {{{-0.15, 1.95}, {0.95, 0.42}, 0, 0.45}, {{1.55, 2.2}, {0.65, 0.4}, -14, 0.4}}};
  return faced_light(normal) * room_corner_light(kRoomSize, p) * support_shadow(plan, p) * floor_shades(shades, p);
}

}  // namespace hsi4d::detail
