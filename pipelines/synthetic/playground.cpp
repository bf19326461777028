// The playground: sand before a lawn, a slide, a swing, a seesaw, a sandpit, trees and a fence under the sky.
#include <array>
#include <cmath>
#include <numbers>

#include "pipelines/synthetic/furniture.h"
#include "pipelines/synthetic/plants.h"

namespace hsi4d::detail {
namespace {

constexpr double kFar = 5.2;

void add_swing(SceneKit& kit, const Ground& ground) {
  const Piece piece(kit, ground);
  const Rgb frame(0.25, 0.55, 0.35);
  constexpr double kHigh = 2.1, kHalf = 1.1;
  piece.bar({-kHalf, 0, kHigh}, {kHalf, 0, kHigh}, 0.045, frame, 1.5);
  for (const double x : {-kHalf, kHalf})
    for (const double y : {-0.6, 0.6}) piece.bar({x * 1.08, y, 0}, {x, 0, kHigh}, 0.04, frame, 1.5);
  for (const double middle : {-0.5, 0.5}) {
    for (const double side : {-0.2, 0.2})
      piece.bar({middle + side, 0, 0.5}, {middle + side, 0, kHigh}, 0.009, Rgb(0.5, 0.5, 0.52), 1.5);
    piece.box({middle, 0, 0.49}, {0.23, 0.09, 0.02}, Rgb(0.85, 0.25, 0.2), 2);
  }
}

void add_seesaw(SceneKit& kit, const Ground& ground) {
  const Piece piece(kit, ground);
  piece.board({0, 0, 0.2}, {0.12, 0.12, 0.2}, Rgb(0.5, 0.36, 0.25), 1.2);
  piece.bar({-1.2, 0, 0.2}, {1.2, 0, 0.7}, 0.05, Rgb(0.25, 0.45, 0.75), 1.5);
  for (const double side : {-1.0, 1.0}) {
    piece.box({side * 1.12, 0, 0.5 + side * 0.24}, {0.14, 0.12, 0.02}, Rgb(0.95, 0.75, 0.2), 1.5);
    piece.bar({side * 0.92, -0.12, 0.66 + side * 0.2}, {side * 0.92, 0.12, 0.66 + side * 0.2}, 0.015,
              Rgb(0.15, 0.15, 0.15), 1);
  }
}

}  // namespace

void make_playground(SceneKit& kit) {
  add_sky(kit);
  add_floor(kit, 5.5, kFar + 0.3, [&kit](const Point& p) {
    const double edge = std::hypot(p.x() - 0.2, (p.y() - 1.4) * 1.1) + 0.12 * kit.noise(p * 2);
    if (edge < 2.35) return Rgb(Rgb(0.8, 0.69, 0.48) * (1 + 0.12 * kit.rough(p * 9) + 0.06 * kit.noise(p * 50)));
    if (edge < 2.45) return Rgb(0.55, 0.43, 0.3);
    return Rgb(Rgb(0.36, 0.55, 0.2) * (1 + 0.2 * kit.noise(p * 40) + 0.14 * kit.rough(p * 2)));
  });
  add_slide(kit, places_of(SyntheticSceneKind::kPlayground)[0]);
  add_swing(kit, {{-2.0, 3.7}, 12});
  add_seesaw(kit, {{-1.55, 2.05}, -25});
  add_tree(kit, Point(2.9, 4.4, 0), 1.2);
  add_tree(kit, Point(-3.9, 4.7, 0), 1.1);
  add_hedge(kit, -5.2, 5.2, kFar, 0.4, 0.8);
  const std::array<Rgb, 4> colors = {Rgb(0.86, 0.26, 0.2), Rgb(0.95, 0.78, 0.2), Rgb(0.25, 0.5, 0.75),
                                     Rgb(0.3, 0.62, 0.35)};
  for (int i = 0; i < 26; ++i)  // a fence of many colours
    kit.board(Point(-4.2 + 0.33 * i, kFar - 0.1, 0.36), Point(0.05, 0.012, 0.36),
              colors[static_cast<std::size_t>(i % 4)], 0.8);
  kit.board(Point(0, kFar - 0.07, 0.5), Point(4.3, 0.012, 0.035), Rgb(0.8, 0.75, 0.65), 0.6);
  kit.model.add_revolution(
      Point(-1.15, 1.35, 0), [](double v) { return Vector2<double>(0.1 + 0.03 * v, 0.2 * v); },
      plain(Rgb(0.9, 0.3, 0.5)), 2);  // a bucket
  kit.model.add_revolution(
      Point(1.35, 1.4, 0.14),
      [](double v) {
        const double a = std::numbers::pi * (v - 0.5);
        return Vector2<double>(0.14 * std::cos(a) + 1e-4, 0.14 * std::sin(a));
      },
      [](double u, double) {
        return std::abs(std::remainder(u * 3, 1.0)) < 0.25 ? Rgb(0.9, 0.25, 0.2) : Rgb(0.95, 0.95, 0.9);
      },
      2.5);
}

double playground_light(const ScenePlan& plan, const Point& p, const Point& normal) {
  if (p.y() > 7) return 1;
  static const std::array<FloorShade, 3> shades = {
      {{{0.55, 2.35}, {0.3, 1.2}, -52, 0.35}, {{2.9, 4.6}, {0.7, 0.6}, 0, 0.35}, {{-2.0, 3.7}, {1.1, 0.5}, 12, 0.12}}};
  return sun_light(normal) * support_shadow(plan, p) * floor_shades(shades, p);
}

}  // namespace hsi4d::detail
