// The café, out of doors: cobbles before a shop front with an awning, round tables with chairs, a parasol, a board.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "pipelines/synthetic/furniture.h"
#include "pipelines/synthetic/plants.h"

namespace hsi4d::detail {
namespace {

constexpr double kBarFront = 3.0, kBarLeft = -2.6, kBarRight = 2.4, kBarTop = 3.3;  // of the house

const ScenePlace& chair_place() { return places_of(SyntheticSceneKind::kCafe)[0]; }

void add_front(SceneKit& kit) {
  const double length = kBarRight - kBarLeft;
  const auto in_opening = [](const Point& p) {
    return (p.x() > -2.2 && p.x() < 0.5 && p.z() > 0.55 && p.z() < 2.2) || (p.x() > 0.95 && p.x() < 1.9 && p.z() < 2.2);
  };
  kit.model.add({[=](double u, double v) { return Point(kBarLeft + u * length, kBarFront, kBarTop * v); },
                 [&kit](double u, double v) {
                   const Rgb plaster = v < 0.15 ? Rgb(0.45, 0.42, 0.4) : Rgb(0.9, 0.83, 0.68);
                   return Rgb(plaster * (1 + 0.07 * kit.rough(Point(u * 20, v * 14, 3))));
                 },
                 0.7, 0, [in_opening](const Point& p) { return !in_opening(p); }});
  const auto inside = [](double u, double v) {  // lamps and shelves behind the glass
    if (std::abs(std::remainder(u * 4, 1.0)) < 0.05 && v > 0.7) return Rgb(1, 0.9, 0.6);
    if (v < 0.3) return Rgb(0.32, 0.2, 0.14);
    const double shine = std::clamp(1.5 * (u + v) - 1.3, 0.0, 0.5);
    return mixed(Rgb(0.5, 0.36, 0.25), Rgb(0.75, 0.83, 0.88), shine);
  };
  kit.model.add_rectangle(Point(-2.2, kBarFront + 0.03, 0.55), Point(2.7, 0, 0), Point(0, 0, 1.65), inside, 1, 0.1);
  kit.model.add_rectangle(Point(0.95, kBarFront + 0.03, 0), Point(0.95, 0, 0), Point(0, 0, 2.2), inside, 1, 0.1);
  const Rgb green(0.13, 0.33, 0.27);
  const auto bar = [&](double x0, double x1, double z0, double z1) {
    kit.box(Point((x0 + x1) / 2, kBarFront - 0.01, (z0 + z1) / 2), Point((x1 - x0) / 2, 0.03, (z1 - z0) / 2),
            plain(green), 1.2);
  };
  for (const double x : {-2.22, -1.3, -0.4, 0.5, 0.95, 1.9}) bar(x - 0.035, x + 0.035, x > 0.6 ? 0.0 : 0.5, 2.24);
  bar(-2.25, 0.55, 0.45, 0.55);
  bar(-2.25, 1.95, 2.2, 2.28);
  bar(0.95, 1.9, 0.0, 0.5);
  kit.box(
      Point(-0.2, kBarFront - 0.04, 2.92), Point(1.5, 0.03, 0.17),
      [](double u, double v) {  // CAFE
        constexpr std::array<std::array<int, 7>, 4> kLetters = {{{14, 17, 16, 16, 16, 17, 14},
                                                                 {14, 17, 17, 31, 17, 17, 17},
                                                                 {31, 16, 16, 30, 16, 16, 16},
                                                                 {31, 16, 16, 30, 16, 16, 31}}};
        const double x = (u - 0.22) / 0.56 * 23, y = (1 - v) * 11 - 2;
        const int column = static_cast<int>(std::floor(x)), row = static_cast<int>(std::floor(y));
        if (column < 0 || column > 22 || row < 0 || row > 6 || column % 6 > 4) return Rgb(0.13, 0.33, 0.27);
        const int line = kLetters[static_cast<std::size_t>(column / 6)][static_cast<std::size_t>(row)];
        return (line >> (4 - column % 6) & 1) != 0 ? Rgb(0.97, 0.88, 0.6) : Rgb(0.13, 0.33, 0.27);
      },
      3);
  const Paint stripes = [](double u, double) {
    return std::abs(std::remainder(u * 9, 1.0)) < 0.25 ? Rgb(0.8, 0.22, 0.2) : Rgb(0.96, 0.94, 0.88);
  };
  kit.model.add_rectangle(Point(-2.35, kBarFront - 0.85, 2.3), Point(4.4, 0, 0), Point(0, 0.85, 0.4), stripes, 1.2);
  kit.model.add_rectangle(Point(-2.35, kBarFront - 0.85, 2.14), Point(4.4, 0, 0), Point(0, 0, 0.17), stripes, 1.2);
  kit.model.add_rectangle(Point(kBarLeft, kBarFront + 3, 0), Point(0, -3, 0), Point(0, 0, kBarTop),
                          plain(Rgb(0.78, 0.7, 0.56)), 0.1);
}

void add_parasol(SceneKit& kit, const Point& foot) {
  kit.tube(foot, foot + Point(0, 0, 2.3), 0.022, Rgb(0.8, 0.78, 0.74), 1.2);
  kit.model.add_revolution(
      foot + Point(0, 0, 1.95), [](double v) { return Vector2<double>(1.05 * (1 - v) + 1e-4, 0.38 * v); },
      [](double u, double) { return static_cast<int>(u * 8) % 2 == 0 ? Rgb(0.93, 0.88, 0.74) : Rgb(0.2, 0.42, 0.4); },
      1.2);
}

void add_menu(SceneKit& kit, const Ground& ground) {
  const Piece piece(kit, ground);
  piece.panel(
      {-0.25, 0, 0.05}, {0.5, 0, 0}, {0, -0.18, 0.85},
      [](double u, double v) {
        if (std::min({u, 1 - u, v, 1 - v}) < 0.06) return Rgb(0.6, 0.42, 0.25);
        const bool is_line =
            std::abs(std::remainder(v * 8, 1.0)) < 0.16 && u > 0.2 && u < 0.55 + 0.3 * std::sin(17 * v);
        return is_line ? Rgb(0.9, 0.9, 0.88) : Rgb(0.12, 0.14, 0.13);
      },
      3);
}

}  // namespace

void make_cafe(SceneKit& kit) {
  add_sky(kit);
  add_floor(kit, 5, kBarFront, [&kit](const Point& p) {
    const double row = std::floor(p.y() / 0.11),
                 x = p.x() / 0.13 + 0.5 * row + 0.2 * kit.noise(Point(p.x() * 2, row, 1));
    const double fx = x - std::floor(x), fy = p.y() / 0.11 - row, rim = std::min({fx, 1 - fx, fy, 1 - fy});
    const double tone = kit.noise(Point(std::floor(x) * 2.3, row * 3.1, 6));
    const Rgb stone = mixed(Rgb(0.52, 0.5, 0.48), Rgb(0.7, 0.66, 0.6), 0.5 + 0.6 * tone);
    return Rgb(stone * (0.7 + 0.3 * ramp(0, 0.16, rim)));
  });
  add_front(kit);
  const ScenePlace& place = chair_place();
  add_chair(kit, place.ground, place.height, Rgb(0.55, 0.3, 0.17));
  add_round_table(kit, place.ground.point({0.72, -0.1, 0}), 0.36, 0.72, Rgb(0.9, 0.88, 0.84));
  const Point cup = place.ground.point({0.62, 0.0, 0.72});
  kit.model.add_revolution(
      cup, [](double v) { return Vector2<double>(0.07, 0.008 * v); }, plain(Rgb(0.95, 0.95, 0.93)), 3);
  kit.model.add_revolution(
      cup, [](double v) { return Vector2<double>(0.028 + 0.015 * v, 0.075 * v); }, plain(Rgb(0.97, 0.97, 0.95)), 3);
  add_round_table(kit, Point(-1.75, 2.1, 0), 0.34, 0.72, Rgb(0.9, 0.88, 0.84));
  add_chair(kit, {{-2.0, 1.75}, 150}, 0.46, Rgb(0.5, 0.27, 0.16));
  add_chair(kit, {{-1.4, 2.2}, -60}, 0.46, Rgb(0.5, 0.27, 0.16));
  add_parasol(kit, Point(-1.9, 2.45, 0));
  add_menu(kit, {{1.75, 1.9}, -18});
  for (const double x : {0.72, 2.15}) {
    kit.model.add_revolution(
        Point(x, kBarFront - 0.3, 0), [](double v) { return Vector2<double>(0.16 + 0.05 * v, 0.4 * v); },
        plain(Rgb(0.28, 0.3, 0.3)), 1.2);
    add_bush(kit, Point(x, kBarFront - 0.3, 0.66), Point(0.26, 0.26, 0.3), Rgb(0.27, 0.46, 0.2), 0.15, 1);
  }
}

double cafe_light(const ScenePlan& plan, const Point& p, const Point& normal) {
  if (p.y() > 7) return 1;
  static const std::array<FloorShade, 4> shades = {{{{-0.28, 1.7}, {0.2, 0.2}, 22, 0.35},
                                                    {{0.3, 1.85}, {0.3, 0.3}, 0, 0.35},
                                                    {{-1.75, 2.2}, {0.6, 0.5}, 0, 0.3},
                                                    {{0, kBarFront - 0.3}, {2.3, 0.4}, 0, 0.3}}};
  return sun_light(normal) * support_shadow(plan, p) * floor_shades(shades, p);
}

}  // namespace hsi4d::detail
