// The garden: a mown lawn, a path of stepping stones, beds of flowers, a hedge, a tree and a fence under the sky.
// About 8 × 5 m, and hills beyond.
#include <algorithm>
#include <array>
#include <cmath>

#include "core/angles.h"
#include "pipelines/synthetic/kit.h"
#include "pipelines/synthetic/plants.h"

namespace hsi4d::detail {
namespace {

constexpr double kHedge = 2.35;  // y of its front, metres
const Point kTree(1.45, 2.0, 0);

/// The path runs from the camera's right to the left end of the hedge.
Vector2<double> path_at(double t) { return {1.25 - 2.6 * t - 0.25 * std::sin(5 * t), -1.2 + 3.4 * t}; }

void add_lawn(SceneKit& kit) {
  const auto strip = [&](double low, double high, double detail) {
    const double left = -4.2, right = 4.2;
    const Paint grass = [&kit, left, right, low, high](double u, double v) {
      const Point p(left + u * (right - left), low + v * (high - low), 0);
      const double stripe = ramp(-0.1, 0.1, std::sin(kPi * (p.x() + 0.35 * p.y()) / 0.55));
      const Rgb tone = mixed(Rgb(0.3, 0.49, 0.17), Rgb(0.42, 0.6, 0.24), stripe);
      const double blades = kit.noise(p * 40), patches = kit.rough(p * 1.7);
      Rgb color = tone * (1 + 0.2 * blades + 0.16 * patches);
      if (kit.noise(Point(p.x() * 17, p.y() * 17, 4)) > 0.72)
        color = mixed(color, Rgb(0.95, 0.95, 0.9), 0.8);  // daisies
      return color;
    };
    kit.model.add_rectangle(Point(left, low, 0), Point(right - left, 0, 0), Point(0, high - low, 0), grass, detail);
  };
  const double from = std::max(-2.0, kit.plan.seen_from_y - 0.2);
  if (from > -2) strip(-2, from, 0.2);
  strip(from, kHedge + 0.1, 1.1);
}

void add_path(SceneKit& kit) {
  constexpr int kStones = 11;
  for (int i = 0; i < kStones; ++i) {
    const Vector2<double> at = path_at((i + 0.5) / kStones);
    const double a = 0.17 + 0.05 * kit.random.uniform(), b = 0.13 + 0.04 * kit.random.uniform();
    const double turn = 3 * kit.random.uniform(), shift = 50 * kit.random.uniform();
    const Rgb tone = kit.varied(Rgb(0.66, 0.63, 0.57), 0.1);
    const SheetShape stone = [=](double u, double v) {
      const double angle = -2 * kPi * u, r = v * (1 + 0.12 * std::sin(3 * angle + shift));
      const double x = a * r * std::cos(angle), y = b * r * std::sin(angle);
      return Point(at[0] + std::cos(turn) * x - std::sin(turn) * y, at[1] + std::sin(turn) * x + std::cos(turn) * y,
                   0.012 + 0.012 * (1 - v * v * v));
    };
    const Paint paint = [=, &kit](double u, double v) {
      const double x = v * std::cos(2 * kPi * u), y = v * std::sin(2 * kPi * u);
      return Rgb(tone * (1 + 0.22 * kit.rough(Point(x * 4, y * 4, shift))) * (v > 0.9 ? 0.72 : 1));
    };
    kit.model.add({stone, paint, 1.6});
  }
}

void add_flower_bed(SceneKit& kit, double left, double right, double front, double back, int flowers) {
  const Rgb earth(0.3, 0.21, 0.14);
  kit.model.add({[=, &kit](double u, double v) {
                   const Point p(left + u * (right - left), front + v * (back - front), 0);
                   const double rim = std::min({u, 1 - u, v, 1 - v});
                   return Point(p.x(), p.y(), 0.015 + 0.05 * ramp(0, 0.3, rim) + 0.02 * kit.noise(p * 9));
                 },
                 kit.mottled(earth, 0.4, 0.06, right - left, back - front), 1});
  for (int i = 0; i < flowers; ++i) {
    const double x = left + (right - left) * (0.06 + 0.88 * kit.random.uniform());
    const double y = front + (back - front) * (0.1 + 0.8 * (i + kit.random.uniform()) / flowers);
    add_flower(kit, Point(x, y, 0.05), 0.24 + 0.22 * kit.random.uniform());
  }
}

void add_fence(SceneKit& kit) {
  for (int i = 0; i < 16; ++i) {
    const double x = -3.9 + 0.17 * i;
    if (x > -2.05) break;
    kit.board(Point(x, kHedge + 0.02, 0.62), Point(0.065, 0.012, 0.6 + 0.03 * (i % 2)),
              kit.varied(Rgb(0.6, 0.45, 0.31), 0.12), 1);
  }
  kit.board(Point(-3.0, kHedge + 0.04, 0.95), Point(1.0, 0.012, 0.04), Rgb(0.52, 0.38, 0.26), 1);
}

/// Two clay pots with bushes and flowers.
void add_pots(SceneKit& kit) {
  const Rgb clay(0.72, 0.4, 0.25);
  for (const auto& [x, y, size] : {std::array<double, 3>{-1.75, 1.35, 1.0}, std::array<double, 3>{-1.42, 1.62, 0.75}}) {
    const Point foot(x, y, 0);
    kit.model.add_revolution(
        foot,
        [s = size](double v) { return Vector2<double>(s * (0.11 + 0.05 * v + (v > 0.85 ? 0.018 : 0)), s * 0.27 * v); },
        kit.mottled(clay, 0.15, 0.05, 0.9, 0.3), 1.5);
    add_bush(kit, foot + Point(0, 0, 0.36 * size), Point(0.2, 0.2, 0.2) * size, Rgb(0.32, 0.5, 0.22), 0.25, 1.2);
    for (int i = 0; i < 5; ++i)
      add_flower(kit, foot + Point(0.1 * size * std::cos(1.3 * i), 0.1 * size * std::sin(1.3 * i), 0.3 * size),
                 0.26 * size);
  }
}

}  // namespace

void make_garden(SceneKit& kit) {
  add_sky(kit);
  add_lawn(kit);
  add_path(kit);
  add_fence(kit);
  add_hedge(kit, -2.1, 4.3, kHedge, 0.5, 1.25);
  add_tree(kit, kTree, 1);
  add_flower_bed(kit, -1.15, 0.85, 1.75, 2.28, 34);
  add_flower_bed(kit, -3.2, -1.95, 1.1, 1.9, 18);
  add_pots(kit);
}

double garden_light(const ScenePlan& plan, const Point& p, const Point& normal) {
  if (p.y() > 6) return 1;  // the sky and what is far
  double light = sun_light(normal) * support_shadow(plan, p);
  if (p.z() < 0.1) {
    light *= shadow(p, {1.0, kHedge + 0.2}, {3.2, 0.3}, 0, 0.35);
    const Point shade = kTree + Point(0.55, 0.35, 0);  // away from the sun
    light *= 1 - 0.3 * (1 - ramp(0.5, 1.1, (p - shade).norm()));
    light *= shadow(p, {-1.75, 1.35}, {0.12, 0.12}, 0, 0.3) * shadow(p, {-1.42, 1.62}, {0.1, 0.1}, 0, 0.3);
  }
  return light;
}

}  // namespace hsi4d::detail
