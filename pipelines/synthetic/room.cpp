// Rooms of any size, their light, and shelves full of things.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "pipelines/synthetic/furniture.h"

namespace hsi4d::detail {
namespace {

constexpr double kDeep = 0.1;  // share of the detail where no camera looks

/// A row of packages: boxes of other widths and colours, with labels.
Paint packages(const SceneKit& kit, double shift, double length) {
  return [&kit, shift, length](double u, double v) {
    const double x = u * length / 0.115 + shift, column = std::floor(x), inside = x - column;
    const auto pick = [&](double salt) {
      return 0.5 + 0.5 * kit.noise(Point(column * 7.31 + salt, shift, salt * 3.1));
    };
    const double high = 0.62 + 0.36 * pick(1.7);
    if (v > high || inside < 0.05) return Rgb(0.2, 0.19, 0.18);
    const double hue = std::fmod(7.7 * pick(5.1) + 3 * pick(9.2), 1.0) * 6;
    const auto channel = [&](double at) {
      const double d = std::abs(std::remainder(hue - at, 6.0));
      return 0.22 + 0.7 * std::clamp(2 - d, 0.0, 1.0);
    };
    const Rgb base(channel(0), channel(2), channel(4));
    const double w = v / high;
    if (w > 0.36 && w < 0.6 && inside > 0.16 && inside < 0.9) return Rgb(0.95, 0.93, 0.88);
    if (w > 0.78 && w < 0.86) return Rgb(base * 0.6);
    if (std::hypot(inside - 0.52, 0.9 * (w - 0.2)) < 0.11) return Rgb(0.96, 0.85, 0.3);
    return Rgb(base * (0.9 + 0.15 * w));
  };
}

/// A row of bottles before a lit wall.
Paint bottles(const SceneKit& kit, double shift, double length) {
  return [&kit, shift, length](double u, double v) {
    const double x = u * length / 0.105 + shift, column = std::floor(x), inside = x - column - 0.5;
    const double kind = kit.noise(Point(column * 5.7 + 0.3, shift, 2.2));
    const double high = 0.75 + 0.2 * kit.noise(Point(column * 3.1, shift, 7.7));
    const double neck = 0.62 * high, half = v < neck ? 0.36 : v < neck + 0.1 ? 0.36 - 2.2 * (v - neck) : 0.13;
    if (v > high || std::abs(inside) > half) return mixed(Rgb(0.5, 0.34, 0.2), Rgb(0.95, 0.74, 0.42), v);
    const std::array<Rgb, 4> tints = {Rgb(0.16, 0.36, 0.18), Rgb(0.6, 0.32, 0.1), Rgb(0.72, 0.78, 0.78),
                                      Rgb(0.32, 0.1, 0.12)};
    const Rgb tint = tints[static_cast<std::size_t>(std::clamp(2 + 3 * kind, 0.0, 3.99))];
    if (v > 0.18 && v < 0.42) return Rgb(0.93, 0.89, 0.78);
    return Rgb(tint * (1.25 - 1.6 * std::abs(inside)));
  };
}

}  // namespace

void add_shelves(SceneKit& kit, const Ground& ground, const ShelfSize& size, const Rgb& frame) {
  const Piece piece(kit, ground);
  const double w = size.width / 2, d = size.depth, h = size.height, low = 0.1;
  piece.box({0, -d + 0.012, h / 2}, {w, 0.012, h / 2}, frame * 0.7, 0.8);
  for (const double x : {-w, w}) piece.box({x, -d / 2, h / 2}, {0.016, d / 2, h / 2}, frame, 1);
  const double step = (h - low) / size.rows;
  for (int i = 0; i <= size.rows; ++i) {
    const double z = low + i * step;
    piece.box({0, -d / 2, z}, {w, d / 2, 0.014}, frame, 1.2);
    if (i == size.rows) break;
    const double shift = 30 * kit.random.uniform(), front = size.has_bottles ? -0.5 * d : -0.06;
    const Paint goods = size.has_bottles ? bottles(kit, shift, size.width) : packages(kit, shift, size.width);
    piece.panel({-w + 0.02, front, z + 0.014}, {2 * w - 0.04, 0, 0}, {0, 0, step - 0.03}, goods, 4);
    if (!size.has_bottles) {
      piece.panel(
          {-w, 0.002, z - 0.03}, {2 * w, 0, 0}, {0, 0, 0.045},
          [](double u, double) {
            return std::abs(std::remainder(u * 9, 1.0)) < 0.18 ? Rgb(0.97, 0.9, 0.4) : Rgb(0.86, 0.86, 0.86);
          },
          2.5);
    }
  }
}

void add_room(SceneKit& kit, const RoomSize& room, const Rgb& wall, const Rgb& ceiling) {
  const double w = room.half_width, front = -2, side = room.back - front, h = room.height;
  const Rgb skirting(wall * 0.7);
  const auto add_wall = [&](const Point& corner, const Point& along, double length, double detail) {
    kit.model.add_rectangle(corner, along * length, Point(0, 0, 0.09), plain(skirting), detail);
    kit.model.add_rectangle(corner + Point(0, 0, 0.09), along * length, Point(0, 0, h - 0.09),
                            kit.mottled(wall, 0.05, 0.3, length, h), detail);
  };
  add_wall(Point(-w, room.back, 0), Point(1, 0, 0), 2 * w, 0.5);
  add_wall(Point(-w, front, 0), Point(0, 1, 0), side, 0.25);
  add_wall(Point(w, room.back, 0), Point(0, -1, 0), side, 0.25);
  kit.model.add_rectangle(Point(-w, room.back, h), Point(2 * w, 0, 0), Point(0, -side, 0), plain(ceiling), 0.06);
}

void add_floor(SceneKit& kit, double half_width, double back, const std::function<Rgb(const Point&)>& paint,
               double detail) {
  const auto strip = [&](double low, double high, double share) {
    const Paint at = [=](double u, double v) {
      return paint(Point(-half_width + u * 2 * half_width, low + v * (high - low), 0));
    };
    kit.model.add_rectangle(Point(-half_width, low, 0), Point(2 * half_width, 0, 0), Point(0, high - low, 0), at,
                            share);
  };
  const double from = std::clamp(kit.plan.seen_from_y - 0.2, -2.0, back - 0.5);
  if (from > -2) strip(-2, from, kDeep * detail);
  strip(from, back, detail);
}

double room_corner_light(const RoomSize& room, const Point& p) {
  double light = 1;
  for (const double distance :
       {p.x() + room.half_width, room.half_width - p.x(), room.back - p.y(), p.z(), room.height - p.z()})
    light *= 1 - 0.2 * std::exp(-std::max(0.0, distance) / 0.35);
  return std::min(1.0, light / (1 - 0.2));
}

double floor_shades(std::span<const FloorShade> shades, const Point& p) {
  if (p.z() > 0.03) return 1;
  double light = 1;
  for (const FloorShade& shade : shades)
    light *= shadow(p, shade.center, shade.half, shade.turn_deg * std::numbers::pi / 180, shade.strength);
  return light;
}

}  // namespace hsi4d::detail
