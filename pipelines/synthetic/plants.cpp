#include "pipelines/synthetic/plants.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/angles.h"

namespace hsi4d::detail {
namespace {

/// Leaves of a green at a point: light and dark tufts, with depth between them.
Rgb foliage(const SceneKit& kit, const Rgb& green, const Point& p, double size) {
  const double tufts = kit.noise(p / size), leaves = kit.noise(p * 2.7 / size + Point(9, 0, 0));
  const Rgb color = mixed(Rgb(green * 0.5), Rgb(green * 1.3 + Rgb(0.06, 0.06, 0)), 0.5 + 0.5 * tufts + 0.25 * leaves);
  return color;
}

}  // namespace

double sun_light(const Point& normal) { return 0.68 + 0.42 * std::max(0.0, dot(normal, kToLight)); }

void add_sky(SceneKit& kit) {
  constexpr double kFar = 11;
  const SheetShape dome = [](double u, double v) {
    const double angle = (1 - u) * kPi;
    return Point(kFar * std::cos(angle), 1.5 + kFar * std::sin(angle), -1.2 + 10 * v);
  };
  const Paint paint = [&kit](double u, double v) {
    const double x = u * 16;
    const double hills = 0.245 + 0.022 * std::sin(x * 1.1 + 1) + 0.012 * std::sin(x * 2.9);
    const double woods = 0.215 + 0.02 * std::sin(x * 1.9 + 4) + 0.02 * kit.noise(Point(x * 6, 0, 3));
    if (v < woods)
      return Rgb(mixed(Rgb(0.24, 0.4, 0.2), Rgb(0.36, 0.5, 0.27), v / woods) *
                 (1 + 0.2 * kit.noise(Point(x * 8, v * 90, 1))));
    if (v < hills) return Rgb(0.5, 0.63, 0.6);
    const Rgb sky = mixed(Rgb(0.86, 0.92, 0.96), Rgb(0.36, 0.6, 0.9), (v - 0.22) * 1.5);
    const double cloud = ramp(0.08, 0.5, kit.rough(Point(x * 0.55, v * 7, 12)));
    return mixed(sky, Rgb(0.99, 0.99, 0.98), 0.85 * cloud * ramp(0.26, 0.36, v));
  };
  kit.model.add({dome, paint, 0.03});
  const SheetShape behind = [dome](double u, double v) {  // what shows between the Gaussians of the first
    const Point p = dome(u, v);
    return Point(1.04 * p.x(), 1.5 + 1.04 * (p.y() - 1.5), p.z());
  };
  kit.model.add({behind, paint, 0.01});
}

void add_bush(SceneKit& kit, const Point& center, const Point& half, const Rgb& green, double rough, double detail) {
  const double shift = 40 * kit.random.uniform();
  const auto place = [=, &kit](double u, double v) {
    const double around = 2 * kPi * u, up = -0.45 * kPi + 0.95 * kPi * v;
    const Point d(std::cos(up) * std::cos(around), std::cos(up) * std::sin(around), std::sin(up));
    const double r =
        1 + rough * kit.noise(d * 3.2 + Point(shift, 0, 0)) + 0.5 * rough * kit.noise(d * 8 + Point(0, shift, 0));
    return Point(center + d.cwiseProduct(half) * r);
  };
  const double size = 0.22 * std::cbrt(half.x() * half.y() * half.z()) + 0.02;
  const Paint paint = [=, &kit](double u, double v) {
    return Rgb(foliage(kit, green, place(u, v), size) * (0.72 + 0.34 * v));
  };
  kit.model.add({place, paint, detail});
}

void add_hedge(SceneKit& kit, double left, double right, double front, double depth, double height) {
  const Rgb green(0.26, 0.42, 0.16);
  const auto bumped = [&kit](const Point& p, const Point& out) {
    return Point(p + out * (0.05 * kit.noise(p * 5) + 0.03 * kit.noise(p * 13)));
  };
  const double length = right - left;
  const SheetShape side = [=](double u, double v) {
    const double round = 0.12 * std::pow(v, 6);
    return bumped(Point(left + u * length, front + round, height * v), Point(0, -1, 0));
  };
  kit.model.add(
      {side, [=, &kit](double u, double v) { return Rgb(foliage(kit, green, side(u, v), 0.085) * (0.62 + 0.45 * v)); },
       1.1});
  const SheetShape top = [=](double u, double v) {
    return bumped(Point(left + u * length, front + 0.1 + v * depth, height), Point(0, 0, 1));
  };
  kit.model.add(
      {top, [=, &kit](double u, double v) { return Rgb(foliage(kit, green, top(u, v), 0.085) * 1.12); }, 0.8});
}

void add_tree(SceneKit& kit, const Point& foot, double size) {
  const double tall = 1.75 * size;
  const auto trunk = [=](double v) {
    return Point(foot + Point(0.06 * std::sin(2.5 * v), 0.03 * std::sin(4 * v), tall * v));
  };
  const Paint bark = [&kit](double u, double v) {
    const double ridges = kit.noise(Point(u * 14, v * 5, 3)) + 0.5 * kit.noise(Point(u * 30, v * 12, 8));
    return Rgb(Rgb(0.42, 0.31, 0.23) * (1 + 0.35 * ridges));
  };
  kit.model.add_tube(
      trunk, [=](double v) { return size * (0.1 - 0.045 * v + 0.07 * std::exp(-v * 14)); }, bark, 1.6);
  const Point crown = trunk(1);
  const std::array<Point, 3> ends = {Point(-0.45, -0.15, 0.45), Point(0.45, 0.1, 0.5), Point(0.05, 0.35, 0.65)};
  for (const Point& end : ends)
    kit.model.add_tube([=](double v) { return Point(trunk(0.82) + v * size * end); },
                       [=](double v) { return size * (0.05 - 0.03 * v); }, bark, 1);
  const std::array<std::pair<Point, double>, 6> balls = {{{Point(-0.5, -0.2, 0.35), 0.52},
                                                          {Point(0.5, -0.1, 0.4), 0.55},
                                                          {Point(0, -0.25, 0.75), 0.6},
                                                          {Point(0.1, 0.4, 0.5), 0.55},
                                                          {Point(-0.1, -0.4, 0.2), 0.4},
                                                          {Point(-0.85, 0.1, 0.6), 0.4}}};
  for (const auto& [at, radius] : balls)
    add_bush(kit, crown + size * at, Point(1, 1, 0.82) * (size * radius), kit.varied(Rgb(0.32, 0.5, 0.2), 0.1), 0.22,
             0.7);
}

void add_flower(SceneKit& kit, const Point& foot, double height) {
  const std::array<Rgb, 6> colors = {Rgb(0.9, 0.25, 0.25), Rgb(0.97, 0.8, 0.2),  Rgb(0.93, 0.5, 0.7),
                                     Rgb(0.62, 0.4, 0.78), Rgb(0.97, 0.95, 0.9), Rgb(0.95, 0.55, 0.2)};
  const Rgb petal = kit.varied(colors[kit.random.below(colors.size())], 0.08);
  const double turn = 2 * kPi * kit.random.uniform(), lean = 0.25 * height * (kit.random.uniform() - 0.3);
  const Point tip = foot + Point(lean * std::cos(turn), lean * std::sin(turn), height);
  const Rgb green = kit.varied(Rgb(0.28, 0.47, 0.18), 0.15);
  kit.tube(foot, tip, 0.006, green, 1);
  for (int i = 0; i < 2; ++i) {
    const double angle = turn + 1 + kPi * i;
    const Point out(std::cos(angle), std::sin(angle), 0), across(-std::sin(angle), std::cos(angle), 0);
    const SheetShape leaf = [=](double u, double v) {
      const double w = 0.035 * std::sin(kPi * v) * (2 * u - 1);
      return Point(foot + out * (0.16 * height / 0.35 * v) + Point(0, 0, height * (0.1 + 0.62 * v * (1.4 - v))) +
                   w * across);
    };
    kit.model.add({leaf, plain(green * (0.9 + 0.25 * i)), 1.2});
  }
  const double r = 0.035 + 0.02 * kit.random.uniform();
  const SheetShape blossom = [=](double u, double v) {  // a cup that looks at the camera
    const double angle = 2 * kPi * u, radius = r * v * (1 + 0.18 * std::cos(5 * angle));
    const Point side(1, 0, 0), up = Point(0, 0.45, 0.9), front = Point(0, -0.9, 0.45);
    return Point(tip + radius * (std::cos(angle) * side + std::sin(angle) * up) + 0.4 * r * v * v * front);
  };
  kit.model.add({blossom, [petal](double, double v) { return v < 0.3 ? Rgb(0.85, 0.65, 0.15) : petal; }, 3});
}

}  // namespace hsi4d::detail
