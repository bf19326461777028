// The terrace: flagstones before a brick house with a glass door and a window, planters, a bench, a lamp, and a low
// hedge under the sky at the side.
#include <algorithm>
#include <array>
#include <cmath>

#include "pipelines/synthetic/kit.h"
#include "pipelines/synthetic/plants.h"

namespace hsi4d::detail {
namespace {

constexpr double kHouse = 2.0;                         // y of the wall, metres
constexpr double kDeckLeft = -1.35, kDeckRight = 3.2;  // ends of the wall
constexpr double kDeckTop = 3.1;

void add_flags(SceneKit& kit) {
  constexpr double kRow = 0.5;
  for (int row = 0; row < 8; ++row) {
    double x = -4 - 0.4 * kit.random.uniform();
    const double y = -kWall + row * kRow;
    while (x < 3.6) {
      const double length = 0.45 + 0.4 * kit.random.uniform(), shift = 60 * kit.random.uniform();
      const Rgb tone = kit.varied(mixed(Rgb(0.7, 0.65, 0.57), Rgb(0.6, 0.6, 0.58), kit.random.uniform()), 0.08);
      const Paint stone = [=, &kit](double u, double v) {
        const double rim = std::min(std::min(u, 1 - u) * length, std::min(v, 1 - v) * kRow);
        if (rim < 0.014) return Rgb(0.42, 0.42, 0.34);
        return Rgb(tone * (1 + 0.16 * kit.rough(Point(u * length * 7, v * kRow * 7, shift))));
      };
      const double detail = y + kRow < kit.plan.seen_from_y ? 0.2 : 2.2;
      kit.model.add_rectangle(Point(x, y, 0), Point(length, 0, 0), Point(0, kRow, 0), stone, detail);
      x += length;
    }
  }
  kit.model.add_rectangle(Point(-6, kHouse, -0.02), Point(5, 0, 0), Point(0, 4, 0),
                          kit.mottled(Rgb(0.36, 0.53, 0.2), 0.3, 0.1, 5, 4), 0.2);
}

bool in_opening(const Point& p) {
  const bool door = p.x() > 0.95 && p.x() < 1.95 && p.z() < 2.15;
  const bool window = p.x() > -0.75 && p.x() < 0.35 && p.z() > 1.02 && p.z() < 2.1;
  return door || window;
}

void add_bricks(SceneKit& kit) {
  const double course = 0.085, length = kDeckRight - kDeckLeft;
  const int courses = static_cast<int>(kDeckTop / course);
  kit.model.add({[=](double u, double v) { return Point(kDeckLeft + u * length, kHouse + 0.02, kDeckTop * v); },
                 plain(Rgb(0.68, 0.63, 0.56)), 0.3, 0, [](const Point& p) { return !in_opening(p); }});
  for (int i = 0; i < courses; ++i) {
    const Paint bricks = [&kit, i, length](double u, double) {
      const double x = u * length / 0.235 + 0.5 * (i % 2);
      const double column = std::floor(x), edge = std::min(x - column, column + 1 - x);
      if (edge < 0.05) return Rgb(0.7, 0.65, 0.58);
      const double tone = kit.noise(Point(column * 3.3 + 0.5, i * 2.7 + 0.5, 0.5));
      return Rgb(mixed(Rgb(0.62, 0.3, 0.21), Rgb(0.78, 0.47, 0.33), 0.5 + 0.8 * tone) *
                 (1 + 0.08 * kit.noise(Point(x * 5, i, 2))));
    };
    const double z = i * course;
    kit.model.add(
        {[=](double u, double v) { return Point(kDeckLeft + u * length, kHouse, z + 0.008 + v * (course - 0.016)); },
         bricks, 1.6, 0, [](const Point& p) { return !in_opening(p); }});
  }
  kit.model.add_rectangle(Point(kDeckLeft, kHouse + 2, 0), Point(0, -2, 0), Point(0, 0, kDeckTop),
                          plain(Rgb(0.6, 0.34, 0.25)), 0.1);
}

/// What shows in a pane: the room behind it and a reflection of the sky.
Paint glass(const Rgb& room) {
  return [room](double u, double v) {
    const double shine = std::clamp(1.6 * (u + v) - 1.1, 0.0, 1.0);
    return mixed(room, Rgb(0.7, 0.82, 0.92), 0.15 + 0.5 * shine);
  };
}

void add_openings(SceneKit& kit) {
  const Rgb white(0.94, 0.93, 0.9), green(0.2, 0.36, 0.3);
  const auto pane = [&](double left, double right, double low, double high, const Rgb& room) {
    kit.model.add_rectangle(Point(left, kHouse + 0.03, low), Point(right - left, 0, 0), Point(0, 0, high - low),
                            glass(room), 1.2, 0.1);
  };
  const auto bar = [&](double x0, double x1, double z0, double z1, const Rgb& color) {
    kit.box(Point((x0 + x1) / 2, kHouse - 0.005, (z0 + z1) / 2), Point((x1 - x0) / 2, 0.025, (z1 - z0) / 2),
            plain(color), 1.5);
  };
  for (const double x : {-0.75, -0.2}) pane(x, x + 0.55, 1.02, 2.1, Rgb(0.3, 0.27, 0.25));
  for (const double x : {-0.75, -0.2, 0.35}) bar(x - 0.03, x + 0.03, 1.0, 2.12, white);
  for (const double z : {1.02, 1.6, 2.1}) bar(-0.78, 0.38, z - 0.025, z + 0.025, white);
  bar(-0.85, 0.45, 0.95, 1.0, Rgb(0.72, 0.7, 0.66));
  for (const double side : {-1.13, 0.73}) {  // shutters
    const Paint slats = [green](double, double v) {
      return Rgb(green * (0.8 + 0.5 * std::abs(std::remainder(v * 16, 1.0))));
    };
    kit.model.add_rectangle(Point(side - 0.2, kHouse - 0.03, 1.0), Point(0.34, 0, 0), Point(0, 0, 1.12), slats, 1.8);
  }
  pane(0.98, 1.92, 0.1, 2.1, Rgb(0.36, 0.3, 0.26));
  for (const double x : {0.97, 1.45, 1.93}) bar(x - 0.045, x + 0.045, 0, 2.15, green);
  for (const double z : {0.12, 0.8, 2.1}) bar(0.95, 1.95, z - 0.06, z + 0.06, green);
  kit.box(Point(1.45, kHouse - 0.1, 0.05), Point(0.65, 0.17, 0.05),
          kit.mottled(Rgb(0.62, 0.6, 0.56), 0.12, 0.1, 1.3, 0.3), 1);
  kit.box(Point(1.39, kHouse - 0.05, 1.05), Point(0.012, 0.02, 0.07), plain(Rgb(0.8, 0.65, 0.3)), 2);
  kit.box(Point(0.62, kHouse - 0.1, 2.35), Point(0.07, 0.07, 0.11), plain(Rgb(0.98, 0.9, 0.66)), 1.5);
  kit.box(Point(0.62, kHouse - 0.1, 2.49), Point(0.09, 0.09, 0.02), plain(Rgb(0.13, 0.13, 0.13)), 1.5);
}

void add_planter(SceneKit& kit, const Point& center, const Point& half, const Rgb& color, bool lavender) {
  const Paint slats = [color](double, double v) {
    return Rgb(color * (std::abs(std::remainder(v * 3, 1.0)) < 0.1 ? 0.6 : 1.0));
  };
  kit.box(center + Point(0, 0, half.z()), half, slats, 1.2);
  const double top = 2 * half.z();
  if (!lavender) {
    add_bush(kit, center + Point(0, 0, top + 0.24), Point(half.x() * 1.1, half.y() * 1.2, 0.3), Rgb(0.3, 0.46, 0.19),
             0.2, 1.2);
    return;
  }
  add_bush(kit, center + Point(0, 0, top + 0.06), Point(half.x(), half.y(), 0.12), Rgb(0.4, 0.5, 0.33), 0.25, 1);
  for (int i = 0; i < 26; ++i) {
    const double x = half.x() * (1.7 * kit.random.uniform() - 0.85), y = half.y() * (1.6 * kit.random.uniform() - 0.8);
    const double high = 0.2 + 0.14 * kit.random.uniform();
    const Point foot = center + Point(x, y, top + 0.08), tip = foot + Point(0.3 * x, 0.3 * y, high);
    kit.tube(foot, tip, 0.005, Rgb(0.42, 0.55, 0.36), 1);
    kit.tube(foot + 0.6 * (tip - foot), tip + 0.12 * (tip - foot), 0.013, kit.varied(Rgb(0.5, 0.4, 0.74), 0.12), 2);
  }
}

void add_bench(SceneKit& kit) {
  const Point at(-1.95, 1.2, 0);
  const double turn = 0.9;
  const Vector2<double> along(std::cos(turn), std::sin(turn)), back(-std::sin(turn), std::cos(turn));
  const auto place = [&](double a, double b, double z) {
    return Point(at.x() + a * along[0] + b * back[0], at.y() + a * along[1] + b * back[1], z);
  };
  const Rgb teak(0.66, 0.46, 0.29);
  for (int i = 0; i < 4; ++i) kit.board(place(0, -0.18 + 0.11 * i, 0.44), Point(0.62, 0.048, 0.014), teak, 1.3, turn);
  for (int i = 0; i < 3; ++i) kit.board(place(0, 0.22, 0.58 + 0.12 * i), Point(0.62, 0.014, 0.045), teak, 1.3, turn);
  for (const double a : {-0.55, 0.55}) {
    kit.board(place(a, -0.18, 0.22), Point(0.03, 0.03, 0.22), teak * 0.85, 1, turn);
    kit.board(place(a, 0.22, 0.44), Point(0.03, 0.03, 0.44), teak * 0.85, 1, turn);
  }
}

}  // namespace

void make_terrace(SceneKit& kit) {
  add_sky(kit);
  add_flags(kit);
  add_bricks(kit);
  add_openings(kit);
  add_hedge(kit, -5, -1.45, 2.3, 0.5, 1.0);
  add_planter(kit, Point(-0.2, 1.76, 0), Point(0.55, 0.16, 0.2), Rgb(0.5, 0.36, 0.25), true);
  add_planter(kit, Point(2.25, 1.7, 0), Point(0.2, 0.2, 0.24), Rgb(0.36, 0.4, 0.43), false);
  add_planter(kit, Point(0.68, 1.78, 0), Point(0.15, 0.15, 0.2), Rgb(0.36, 0.4, 0.43), false);
  add_bench(kit);
}

double terrace_light(const ScenePlan& plan, const Point& p, const Point& normal) {
  if (p.y() > 6) return 1;
  double light = sun_light(normal) * support_shadow(plan, p);
  if (p.z() < 0.05) {
    light *= shadow(p, {-0.2, 1.8}, {0.5, 0.14}, 0, 0.35) * shadow(p, {2.25, 1.75}, {0.2, 0.2}, 0, 0.35);
    light *= shadow(p, {0.68, 1.8}, {0.15, 0.15}, 0, 0.35) * shadow(p, {-1.95, 1.2}, {0.55, 0.15}, 0.9, 0.35);
    light *= 1 - 0.12 * ramp(1.5, 2.0, p.y());
  }
  if (p.z() < 0.95 && p.y() > 1.96) light *= shadow(p, {-0.2, 1.9}, {0.55, 0.2}, 0, 0.2);
  return light;
}

}  // namespace hsi4d::detail
