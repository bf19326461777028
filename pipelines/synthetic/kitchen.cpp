// The kitchen: chequered tiles, a row of cupboards with sink and stove under a window, wall cupboards, a refrigerator.
// 4 × 4 × 2.6 m.
#include <algorithm>
#include <array>
#include <cmath>

#include "core/angles.h"
#include "pipelines/synthetic/kit.h"

namespace hsi4d::detail {
namespace {

constexpr double kCounterFront = 1.5, kCounterTop = 0.9;  // of the cupboards, metres
const Rgb kSage(0.5, 0.63, 0.55), kCream(0.93, 0.89, 0.78), kBrass(0.8, 0.62, 0.28), kSinkSteel(0.72, 0.74, 0.76);

void add_tiles(SceneKit& kit) {
  constexpr int kRows = 10;
  constexpr double kTile = 2 * kWall / kRows;
  for (int row = 0; row < kRows; ++row) {
    const double y = -kWall + row * kTile;
    const Paint paint = [&kit, row](double u, double v) {
      const double x = u * kRows;
      const int column = static_cast<int>(x);
      const double edge = std::min({x - column, column + 1 - x, v, 1 - v});
      const Rgb color = (row + column) % 2 == 0 ? Rgb(0.86, 0.82, 0.74) : Rgb(0.36, 0.43, 0.46);
      const double veins = kit.rough(Point(x * 2.2, row + v * 2.2, 7));
      return Rgb(color * (1 + 0.1 * veins) * (edge < 0.035 ? 0.72 : 1));
    };
    const double detail = y + kTile < kit.plan.seen_from_y ? 0.25 : 1.6;
    kit.model.add_rectangle(Point(-kWall, y, 0), Point(2 * kWall, 0, 0), Point(0, kTile, 0), paint, detail, 0.06);
  }
}

void add_kitchen_walls(SceneKit& kit) {
  const double side = 2 * kWall;
  const Paint plaster = kit.mottled(Rgb(0.93, 0.82, 0.6), 0.05, 0.3, side, kCeiling);
  const auto wall = [&](const Point& corner, const Point& along, double detail) {
    kit.model.add_rectangle(corner, along * side, Point(0, 0, kCeiling), plaster, detail);
  };
  wall(Point(-kWall, kWall, 0), Point(1, 0, 0), 0.5);
  wall(Point(-kWall, -kWall, 0), Point(0, 1, 0), 0.1);
  wall(Point(kWall, kWall, 0), Point(0, -1, 0), 0.1);
  kit.model.add_rectangle(Point(-kWall, kWall, kCeiling), Point(side, 0, 0), Point(0, -side, 0),
                          plain(Rgb(0.95, 0.94, 0.9)), 0.03);
  constexpr int kCourses = 5;  // glazed tiles over the worktop
  for (int i = 0; i < kCourses; ++i) {
    const Paint glaze = [&kit, i](double u, double v) {
      const double x = u * 32 + 0.5 * (i % 2);
      const int column = static_cast<int>(x);
      const double edge = std::min({x - column, column + 1 - x, v, 1 - v});
      const bool is_blue = (column * 7 + i * 5) % 11 == 0;
      const Rgb tile = is_blue ? Rgb(0.3, 0.5, 0.68) : Rgb(0.95, 0.95, 0.93);
      return Rgb(tile * (edge < 0.07 ? 0.82 : 1 + 0.04 * kit.noise(Point(column * 3.7, i * 2.3, 0.5))));
    };
    kit.model.add_rectangle(Point(-1.95, kWall - 0.008, kCounterTop + 0.1 * i), Point(3.2, 0, 0), Point(0, 0, 0.1),
                            glaze, 1.4, 0.08);
  }
}

/// A door with a panel and a knob, seen from −y.
void add_door(SceneKit& kit, double left, double right, double low, double high, double y, const Rgb& color) {
  const double width = right - left, height = high - low;
  const Paint paint = [=](double u, double v) {
    const double frame = std::min(std::min(u, 1 - u) * width, std::min(v, 1 - v) * height);
    const double groove = std::exp(-std::pow((frame - 0.06) / 0.012, 2));
    return Rgb(color * ((frame < 0.008 ? 0.6 : 1) - 0.22 * groove + (frame > 0.06 ? 0.05 : 0)));
  };
  kit.model.add_rectangle(Point(left, y, low), Point(width, 0, 0), Point(0, 0, height), paint, 1.6);
  const double knob = high > 1.2 ? low + 0.06 : high - 0.08;
  kit.box(Point(right - 0.05, y - 0.015, knob), Point(0.012, 0.012, 0.012), plain(kBrass), 2);
}

void add_cupboards(SceneKit& kit) {
  const double left = -1.95;
  kit.box(Point(-0.36, (kCounterFront + kWall) / 2 + 0.02, 0.05), Point(1.58, 0.22, 0.05), plain(Rgb(0.2, 0.2, 0.2)),
          0.4);
  for (int i = 0; i < 5; ++i) {
    if (i == 4) continue;  // the stove
    const double x = left + 0.6 * i;
    add_door(kit, x, x + 0.6, 0.1, 0.68, kCounterFront, kSage);
    add_door(kit, x, x + 0.6, 0.68, kCounterTop - 0.04, kCounterFront, kSage * 1.04);
  }
  kit.model.add_rectangle(Point(1.25, kCounterFront, 0), Point(0, 0.5, 0), Point(0, 0, kCounterTop), plain(kSage * 0.9),
                          0.5);
  kit.board(Point(-0.65, (kCounterFront + kWall) / 2 - 0.01, kCounterTop - 0.02), Point(1.31, 0.26, 0.02),
            Rgb(0.72, 0.5, 0.3), 1.5);
  for (int i = 0; i < 3; ++i) {
    if (i == 1) continue;  // the window is between them
    const double x = i == 0 ? -1.95 : 0.45, bottom = 1.42, top = 2.12;
    kit.box(Point(x + 0.4, kWall - 0.15, (bottom + top) / 2), Point(0.4, 0.15, (top - bottom) / 2),
            plain(kCream * 0.92), 0.8);
    add_door(kit, x, x + 0.4, bottom, top, kWall - 0.302, kCream);
    add_door(kit, x + 0.4, x + 0.8, bottom, top, kWall - 0.302, kCream);
    kit.model.add_rectangle(Point(x, kWall, bottom), Point(0.8, 0, 0), Point(0, -0.3, 0), plain(kCream * 0.7), 0.3);
  }
}

void add_stove(SceneKit& kit) {
  const double left = 0.65, right = 1.25, y = kCounterFront - 0.005;
  const Paint front = [](double u, double v) {
    if (v > 0.86) {  // knobs
      const bool is_knob = std::abs(std::remainder(u * 5, 1.0)) < 0.2 && std::abs(v - 0.93) < 0.035;
      return is_knob ? Rgb(0.15, 0.15, 0.16) : Rgb(0.86, 0.86, 0.85);
    }
    if (std::abs(v - 0.78) < 0.02 && std::abs(u - 0.5) < 0.4) return Rgb(0.6, 0.61, 0.63);
    const bool is_glass = std::abs(u - 0.5) < 0.36 && v > 0.22 && v < 0.68;
    return is_glass ? Rgb(Rgb(0.1, 0.1, 0.12) * (1 + 2 * std::max(0.0, 0.5 - std::abs(u + v - 0.9) * 3)))
                    : Rgb(0.9, 0.9, 0.88);
  };
  kit.model.add_rectangle(Point(left, y, 0.04), Point(right - left, 0, 0), Point(0, 0, kCounterTop - 0.04), front, 3,
                          0.05);
  kit.box(Point((left + right) / 2, 1.75, kCounterTop - 0.01), Point(0.3, 0.25, 0.012), plain(Rgb(0.12, 0.12, 0.13)),
          1);
  const Point pot((left + right) / 2 - 0.1, 1.72, kCounterTop + 0.002);
  kit.model.add_revolution(
      pot, [](double v) { return Vector2<double>(0.115 + 0.004 * v, 0.15 * v); },
      [](double, double v) { return v > 0.9 ? Rgb(0.95, 0.9, 0.8) : Rgb(0.78, 0.2, 0.14); }, 2, 0.1);
  kit.model.add_revolution(
      pot + Point(0, 0, 0.15), [](double v) { return Vector2<double>(0.12 * (1 - v), 0.035 * std::sin(1.57 * v)); },
      plain(Rgb(0.7, 0.17, 0.12)), 1.4, 0.1);
  kit.box(pot + Point(0, 0, 0.195), Point(0.02, 0.012, 0.012), plain(Rgb(0.1, 0.1, 0.1)), 2);
}

void add_sink(SceneKit& kit) {
  const double x = -0.3;
  kit.model.add_rectangle(
      Point(x - 0.24, 1.58, kCounterTop + 0.003), Point(0.48, 0, 0), Point(0, 0.3, 0),
      [](double u, double v) {
        const double rim = std::min(std::min(u, 1 - u) * 0.48, std::min(v, 1 - v) * 0.3);
        return rim < 0.025 ? kSinkSteel : Rgb(kSinkSteel * (0.62 + 0.2 * v));
      },
      2.5, 0.1);
  kit.model.add_tube(
      [=](double v) {
        const double angle = 3.6 * v - 0.4;
        return v < 0.4
                   ? Point(x, 1.93, kCounterTop + 0.26 * v / 0.4)
                   : Point(x, 1.86 + 0.07 * std::cos(angle - 1.04), kCounterTop + 0.26 + 0.07 * std::sin(angle - 1.04));
      },
      [](double) { return 0.012; }, plain(kSinkSteel), 2, 0.1);
}

void add_things(SceneKit& kit) {
  const std::array<Rgb, 4> lids = {Rgb(0.75, 0.25, 0.2), Rgb(0.25, 0.42, 0.62), Rgb(0.85, 0.65, 0.2),
                                   Rgb(0.3, 0.5, 0.3)};
  for (int i = 0; i < 4; ++i) {  // jars
    const Point foot(-1.78 + 0.14 * i, 1.86, kCounterTop);
    const double height = 0.2 - 0.025 * i;
    const Rgb lid = lids[static_cast<std::size_t>(i)];
    kit.model.add_revolution(
        foot, [=](double v) { return Vector2<double>(0.052, height * v); },
        [=](double, double v) {
          return v > 0.84 ? lid : v > 0.3 && v < 0.6 ? Rgb(0.96, 0.93, 0.85) : Rgb(0.72, 0.56, 0.38);
        },
        2, 0.05);
    kit.model.add_revolution(
        foot + Point(0, 0, height), [](double v) { return Vector2<double>(0.052 * (1 - v), 0.004 * v); }, plain(lid),
        1);
  }
  const Point bowl(-1.0, 1.72, kCounterTop);
  kit.model.add_revolution(
      bowl, [](double v) { return Vector2<double>(0.06 + 0.09 * std::sqrt(v), 0.08 * v); },
      [](double u, double v) {
        return std::abs(v - 0.6) < 0.14 && std::abs(std::remainder(u * 14, 1.0)) < 0.3 ? Rgb(0.2, 0.35, 0.6)
                                                                                       : Rgb(0.93, 0.92, 0.88);
      },
      2);
  const std::array<Rgb, 5> fruits = {Rgb(0.93, 0.55, 0.12), Rgb(0.82, 0.16, 0.12), Rgb(0.95, 0.6, 0.15),
                                     Rgb(0.62, 0.75, 0.2), Rgb(0.85, 0.22, 0.16)};
  for (int i = 0; i < 5; ++i) {
    const double angle = 1.257 * i;
    const Point at = bowl + Point(0.065 * std::cos(angle), 0.065 * std::sin(angle), 0.045 + 0.02 * (i % 2));
    kit.model.add_revolution(
        at, [](double v) { return Vector2<double>(0.042 * std::sin(kPi * v) + 1e-4, 0.042 * (1 - std::cos(kPi * v))); },
        plain(fruits[static_cast<std::size_t>(i)]), 1.5, 0.05);
  }
}

void add_refrigerator(SceneKit& kit) {
  const Rgb mint(0.62, 0.8, 0.76);
  const Point center(1.62, 1.68, 0.9), half(0.31, 0.3, 0.88);
  kit.box(center, half, plain(mint * 0.93), 0.6, 0, 0.08);
  const Paint front = [mint](double u, double v) {
    if (std::abs(v - 0.68) < 0.006) return Rgb(mint * 0.5);
    if (u < 0.16 && u > 0.1 && ((v > 0.45 && v < 0.64) || (v > 0.72 && v < 0.86))) return Rgb(0.88, 0.89, 0.9);
    const double x = u - 0.62, y = (v - 0.55) * 2.8;  // notes under magnets
    if (std::abs(x) < 0.1 && std::abs(y) < 0.12)
      return std::abs(std::remainder(y * 22, 1.0)) < 0.2 ? Rgb(0.4, 0.4, 0.5) : Rgb(0.97, 0.95, 0.8);
    if (std::abs(x - 0.2) < 0.08 && std::abs(y + 0.06) < 0.1) return Rgb(0.95, 0.6, 0.55);
    return mint;
  };
  kit.model.add_rectangle(center + Point(-half.x(), -half.y() - 0.004, -half.z()), Point(2 * half.x(), 0, 0),
                          Point(0, 0, 2 * half.z()), front, 1.6, 0.08);
}

}  // namespace

void make_kitchen(SceneKit& kit) {
  add_tiles(kit);
  add_kitchen_walls(kit);
  kit.add_window(-0.85, 0.15, 1.12, 2.05);
  add_cupboards(kit);
  add_stove(kit);
  add_sink(kit);
  add_things(kit);
  add_refrigerator(kit);
}

double kitchen_light(const ScenePlan& plan, const Point& p, const Point& normal) {
  double light = faced_light(normal) * corner_light(p) * support_shadow(plan, p);
  if (p.z() < 0.02) light *= shadow(p, {-0.3, 1.8}, {1.9, 0.24}, 0, 0.4);
  if (p.y() > 1.96 && p.z() > 1.2) light *= 1 - 0.2 * ramp(1.2, 1.4, p.z()) * (1 - ramp(2.12, 2.3, p.z()));
  return light;
}

}  // namespace hsi4d::detail
