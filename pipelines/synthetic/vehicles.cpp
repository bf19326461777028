// A pickup truck and a bicycle.
#include <cmath>

#include "core/angles.h"
#include "pipelines/synthetic/furniture.h"

namespace hsi4d::detail {
namespace {

const Rgb kRubber(0.07, 0.07, 0.08), kChrome(0.74, 0.75, 0.78);

/// A wheel in the plane of left and up; `side` 1: its outer side looks forward.
void add_wheel(const Piece& piece, const Point& center, double radius, double half_width) {
  const Ground ground = piece.ground();
  const auto around = [=](double u, double r, double forward) {
    const double angle = 2 * kPi * u;
    return ground.point(center + Point(r * std::cos(angle), forward, r * std::sin(angle)));
  };
  piece.kit.model.add(
      {[=](double u, double v) { return around(u, radius, half_width * (1 - 2 * v)); }, plain(kRubber), 1});
  const Paint face = [](double u, double v) {
    if (v > 0.62) return std::abs(std::remainder(u * 40, 1.0)) < 0.1 ? Rgb(0.13, 0.13, 0.14) : kRubber;
    if (v > 0.54) return kChrome;
    if (v < 0.14) return Rgb(0.5, 0.51, 0.54);
    return std::abs(std::remainder(u * 6, 1.0)) < 0.17 ? Rgb(0.2, 0.2, 0.22) : Rgb(0.66, 0.67, 0.7);
  };
  piece.kit.model.add({[=](double u, double v) { return around(1 - u, radius * v, half_width); }, face, 1.6});
}

/// Side windows: glass that shows the sky, a dark frame.
Paint windows(double from, double to, double post) {
  return [=](double u, double v) {
    const bool is_frame = v < 0.1 || v > 0.9 || u < from || u > to || std::abs(u - post) < 0.03;
    if (is_frame) return Rgb(-1, 0, 0);
    return mixed(Rgb(0.2, 0.26, 0.3), Rgb(0.66, 0.78, 0.86), v * 0.7 + 0.35 * std::sin(3 * u + 1));
  };
}

}  // namespace

void add_pickup(SceneKit& kit, const Ground& ground, const Rgb& paint) {
  const Piece piece(kit, ground);
  // the hood is at negative left
  constexpr double kHalf = 2.25, kWide = 0.84, kLow = 0.42, kWaist = 1.02;
  const auto over = [&](const Paint& glass, const Rgb& body) {
    return Paint([=](double u, double v) {
      const Rgb color = glass(u, v);
      return color[0] < 0 ? body : color;
    });
  };
  const Paint door = [=](double u, double v) {  // the long side: doors, handle, a stripe, dust below
    const double x = (2 * u - 1) * kHalf, z = kLow + v * (kWaist - kLow);
    const bool is_seam = (std::abs(x - 0.62) < 0.012 || std::abs(x + 0.42) < 0.012) && z > 0.5;
    if (is_seam) return Rgb(paint * 0.35);
    if (std::abs(x + 0.28) < 0.09 && std::abs(z - 0.9) < 0.018) return kChrome;
    if (std::abs(z - 0.72) < 0.03) return Rgb(0.93, 0.9, 0.82);
    const double wheel = std::min(std::hypot(x - 1.38, z - 0.37), std::hypot(x + 1.38, z - 0.37));
    if (wheel < 0.44) return Rgb(0.05, 0.05, 0.06);
    return Rgb(paint * (0.72 + 0.34 * v) * (1 - 0.25 * ramp(0.3, 0.0, v)));
  };
  piece.painted(
      {0, -kWide, (kLow + kWaist) / 2}, {kHalf, kWide, (kWaist - kLow) / 2},
      [&](int face) { return face == 2   ? door
                             : face == 5 ? plain(paint * 1.08)
                                         : plain(paint * 0.85); }, 1.5);
  // hood, to negative left; cab; bed
  piece.painted(
      {-1.45, -kWide, 1.1}, {0.78, kWide - 0.05, 0.09},
      [&](int face) { return plain(face == 5 ? Rgb(paint * 1.12) : Rgb(paint * 0.92)); }, 1.2);
  piece.painted(
      {0.12, -kWide, 1.36}, {0.72, kWide - 0.06, 0.34},
      [&](int face) {
        if (face == 5) return plain(paint * 1.12);
        return over(face == 2 || face == 3 ? windows(0.08, 0.92, 0.5) : windows(0.06, 0.94, -1), paint);
      },
      1.6);
  for (const double forward : {-0.03, -2 * kWide + 0.03})  // walls of the bed
    piece.box({1.55, forward, 1.12}, {0.68, 0.03, 0.1}, paint * 1.02, 1.2);
  piece.box({2.22, -kWide, 1.12}, {0.025, kWide, 0.1}, paint * 0.95, 1);
  piece.panel(
      {-2.26, -0.1, 0.55}, {0, -2 * kWide + 0.2, 0}, {0, 0, 0.42},
      [](double u, double v) {
        if (std::hypot((u - 0.12) * 2, v - 0.6) < 0.2 || std::hypot((u - 0.88) * 2, v - 0.6) < 0.2)
          return Rgb(0.96, 0.95, 0.85);
        return std::abs(std::remainder(v * 5, 1.0)) < 0.25 ? kChrome : Rgb(0.15, 0.15, 0.17);
      },
      1.2);
  for (const double left : {-2.3, 2.3}) piece.box({left, -kWide, 0.48}, {0.06, kWide + 0.02, 0.08}, kChrome, 1);
  for (const double left : {-1.38, 1.38})
    for (const double forward : {-0.1, -2 * kWide + 0.1}) add_wheel(piece, {left, forward, 0.36}, 0.36, 0.115);
  piece.box({-0.68, 0.08, 1.13}, {0.035, 0.07, 0.075}, Rgb(0.1, 0.1, 0.11), 1.5);  // a mirror
}

void add_bicycle(SceneKit& kit, const Ground& ground, const Rgb& frame) {
  const Piece piece(kit, ground);
  // wheels lie in the plane of left and up
  Ground across = ground;
  across.heading_deg += 90;  // forward of these is to the left
  const Piece wheels(kit, across);
  constexpr double kRadius = 0.33, kBase = 0.52;
  for (const double along : {kBase, -kBase}) {
    wheels.ring({0, along, kRadius}, kRadius - 0.02, 0.02, kRubber, 2.5);
    wheels.ring({0, along, kRadius}, kRadius - 0.05, 0.007, kChrome, 2);
    for (int i = 0; i < 5; ++i) {
      const double a = kPi * i / 5, c = 0.27 * std::cos(a), s = 0.27 * std::sin(a);
      wheels.bar({0, along - c, kRadius - s}, {0, along + c, kRadius + s}, 0.0035, kChrome, 2);
    }
  }
  const auto at = [](double along, double up) { return Point(0, along, up); };
  const Point crank = at(-0.08, 0.28), seat = at(-0.24, 0.82), head = at(0.36, 0.86), fork = at(0.4, 0.7),
              front = at(kBase, kRadius), rear = at(-kBase, kRadius);
  const auto tube = [&](const Point& a, const Point& b, double r, const Rgb& color) { wheels.bar(a, b, r, color, 3); };
  tube(crank, fork, 0.019, frame);
  tube(at(-0.21, 0.72), head, 0.018, frame);
  tube(crank, seat, 0.018, frame);
  tube(rear, at(-0.21, 0.72), 0.012, frame);
  tube(rear, crank, 0.012, frame);
  tube(head, fork, 0.02, frame);
  tube(fork, front, 0.015, frame);
  tube(head, at(0.33, 1.0), 0.014, kChrome);
  wheels.bow({0.24, 0.22, 0.98}, {0, 0.4, 1.03}, {-0.24, 0.22, 0.98}, 0.013, kRubber);
  wheels.cushion(seat + Point(0, -0.03, 0.05), {0.07, 0.13, 0.03}, plain(Rgb(0.16, 0.12, 0.1)), 3);
  wheels.ring(crank, 0.085, 0.009, kChrome, 3);
  tube(crank, crank + Point(0.06, 0.12, -0.12), 0.01, kChrome);
  tube(crank, crank + Point(-0.06, -0.12, 0.12), 0.01, kChrome);
  wheels.box(crank + Point(0.1, 0.12, -0.12), {0.045, 0.035, 0.01}, kRubber, 3);
  wheels.bow(rear + Point(0, -0.3, 0.22), rear + Point(0, -0.12, 0.42), rear + Point(0, 0.22, 0.32), 0.016, frame);
}

}  // namespace hsi4d::detail
