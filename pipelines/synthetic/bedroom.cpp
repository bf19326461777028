// The bedroom: carpet with a round rug, a bed along the wall, a wardrobe with a mirror, a lamp, posters, bunting.
// 4 × 4 × 2.6 m.
#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "core/angles.h"
#include "pipelines/synthetic/furniture.h"

namespace hsi4d::detail {
namespace {

const Point kBed(-1.02, 1.68, 0);  // middle of its place on the floor
const Point kBedHalf(0.93, 0.3, 0.22);

void add_carpet(SceneKit& kit) {
  const double y = std::max(-kWall, kit.plan.seen_from_y - 0.2);
  const Rgb sand(0.76, 0.7, 0.62);
  const auto strip = [&](double low, double high, double detail) {
    kit.model.add_rectangle(Point(-kWall, low, 0), Point(2 * kWall, 0, 0), Point(0, high - low, 0),
                            kit.mottled(sand, 0.16, 0.05, 2 * kWall, high - low), detail);
  };
  if (y > -kWall) strip(-kWall, y, 0.2);
  strip(y, kWall, 0.8);
  const Point middle(kit.plan.middle[0], kit.plan.middle[1], 0.01);
  const SheetShape disc = [middle](double u, double v) {
    const double angle = 2 * kPi * u, r = 0.95 * v;
    return Point(middle + Point(r * std::cos(angle), r * std::sin(angle), 0));
  };
  const Paint rings = [&kit](double u, double v) {
    const std::array<Rgb, 5> tones = {Rgb(0.86, 0.62, 0.3), Rgb(0.93, 0.88, 0.78), Rgb(0.72, 0.35, 0.3),
                                      Rgb(0.93, 0.88, 0.78), Rgb(0.25, 0.42, 0.48)};
    const double petal = 0.05 * std::sin(2 * kPi * 12 * u) * (v > 0.3 ? 1 : 0);
    const auto ring = static_cast<std::size_t>(std::clamp((v + petal) * 5.0, 0.0, 4.99));
    return Rgb(tones[ring] * (1 + 0.08 * kit.noise(Point(u * 180, v * 20, 2))));
  };
  kit.model.add({[disc](double u, double v) { return disc(1 - u, v); }, rings, 2.6});
}

void add_bedroom_walls(SceneKit& kit) {
  const double side = 2 * kWall;
  const Rgb blue(0.42, 0.55, 0.66), white(0.94, 0.93, 0.9);
  const auto wall = [&](const Point& corner, const Point& along, double detail) {
    kit.model.add_rectangle(corner, along * side, Point(0, 0, 0.1), plain(white), detail);
    kit.model.add_rectangle(corner + Point(0, 0, 0.1), along * side, Point(0, 0, kCeiling - 0.1),
                            kit.mottled(blue, 0.07, 0.25, side, kCeiling), detail);
  };
  wall(Point(-kWall, kWall, 0), Point(1, 0, 0), 0.7);
  wall(Point(-kWall, -kWall, 0), Point(0, 1, 0), 0.1);
  wall(Point(kWall, kWall, 0), Point(0, -1, 0), 0.1);
  kit.model.add_rectangle(Point(-kWall, kWall, kCeiling), Point(side, 0, 0), Point(0, -side, 0), plain(white), 0.03);
  for (int row = 0; row < 4; ++row)  // painted dots above the bed
    for (int i = 0; i < 6; ++i) {
      const double x = -1.85 + 0.34 * i + 0.17 * (row % 2), z = 1.02 + 0.33 * row, r = 0.035;
      if (z > 1.25 && z < 2.1 && x > -1.7 && x < -0.3) continue;  // posters hang there
      kit.model.add_rectangle(Point(x - r, kWall - 0.006, z - r), Point(2 * r, 0, 0), Point(0, 0, 2 * r),
                              plain(Rgb(0.9, 0.86, 0.72)), 2);
    }
}

/// A quilt of patches over the mattress, which falls in folds at the front.
void add_quilt(SceneKit& kit) {
  const std::array<Rgb, 6> patches = {Rgb(0.8, 0.36, 0.3), Rgb(0.94, 0.88, 0.76), Rgb(0.28, 0.45, 0.5),
                                      Rgb(0.9, 0.7, 0.36), Rgb(0.6, 0.7, 0.6),    Rgb(0.93, 0.84, 0.8)};
  const auto patch = [patches, &kit](double x, double y, double fold) {
    const int i = static_cast<int>(std::floor(x / 0.16)), j = static_cast<int>(std::floor(y / 0.16));
    const double fx = x / 0.16 - i, fy = y / 0.16 - j;
    const double seam = std::min({fx, 1 - fx, fy, 1 - fy});
    const auto which = static_cast<std::size_t>((i * 5 + j * 3 + 60) % 6);
    const bool is_star = std::abs(fx - 0.5) + std::abs(fy - 0.5) < 0.3 && (i + j) % 2 == 0;
    const Rgb color = is_star ? patches[(which + 2) % 6] : patches[which];
    return Rgb(color * (seam < 0.06 ? 0.8 : 1) * (1 + 0.06 * kit.noise(Point(x * 30, y * 30, 5))) * (1 + 0.1 * fold));
  };
  const double top = 0.47, left = kBed.x() - kBedHalf.x() + 0.5, right = kBed.x() + kBedHalf.x() + 0.01;
  const double front = kBed.y() - kBedHalf.y() - 0.015, back = kWall - 0.02;
  kit.model.add({[&kit, left, right, front, back](double u, double v) {
                   const Point p(left + u * (right - left), front + v * (back - front), 0);
                   return Point(p.x(), p.y(), 0.47 + 0.018 * kit.noise(p * 5));
                 },
                 [=](double u, double v) { return patch(u * (right - left), v * (back - front) + 0.32, 0); }, 2.4});
  const auto fold = [](double x) { return std::sin(21 * x) * 0.6 + std::sin(47 * x) * 0.4; };
  kit.model.add({[=](double u, double v) {
                   const double x = left + u * (right - left), drop = 0.3 + 0.02 * std::sin(9 * x);
                   return Point(x, front - 0.012 * fold(x) * (1 - v), top - drop * (1 - v));
                 },
                 [=](double u, double v) {
                   const double x = u * (right - left);
                   return patch(x, v * 0.32, fold(left + x) * (1 - v));
                 },
                 2.4});
}

void add_pillow(SceneKit& kit, const Point& center, const Point& half, const Rgb& color, bool striped) {
  const SheetShape shape = [=](double u, double v) {
    const double x = 2 * u - 1, y = 2 * v - 1;
    const double high = std::pow(std::max(0.0, (1 - x * x * x * x) * (1 - y * y * y * y)), 0.45);
    return Point(center + Point(x * half.x(), y * half.y(), high * half.z()));
  };
  const Paint paint = [=](double u, double v) {
    return striped && std::abs(std::remainder(u * 7, 1.0)) < 0.2 ? Rgb(color * 0.55) : Rgb(color * (0.86 + 0.14 * v));
  };
  kit.model.add({shape, paint, 2});
}

void add_bed(SceneKit& kit) {
  const Rgb oak(0.66, 0.47, 0.29);
  const double left = kBed.x() - kBedHalf.x(), right = kBed.x() + kBedHalf.x();
  kit.board(kBed + Point(0, 0, 0.24), Point(kBedHalf.x(), kBedHalf.y(), 0.08), oak, 1);
  for (const double x : {left + 0.05, right - 0.05})
    kit.board(Point(x, kBed.y() - kBedHalf.y() + 0.05, 0.08), Point(0.03, 0.03, 0.08), oak * 0.9, 1);
  kit.box(kBed + Point(0, 0, 0.385), Point(kBedHalf.x() - 0.01, kBedHalf.y() - 0.01, 0.07), plain(Rgb(0.94, 0.93, 0.9)),
          1);
  kit.board(Point(left - 0.02, kBed.y(), 0.45), Point(0.025, kBedHalf.y() + 0.01, 0.45), oak * 1.05, 1.2);
  add_quilt(kit);
  add_pillow(kit, Point(left + 0.24, kBed.y(), 0.45), Point(0.2, 0.26, 0.13), Rgb(0.96, 0.95, 0.92), false);
  add_pillow(kit, Point(left + 0.5, kBed.y() + 0.06, 0.47), Point(0.16, 0.2, 0.12), Rgb(0.85, 0.6, 0.3), true);
}

void add_posters(SceneKit& kit) {
  const Paint mountain = [](double u, double v) {
    const double far = 0.52 + 0.16 * std::abs(std::remainder(u * 1.7 + 0.2, 1.0)),
                 near = 0.3 + 0.12 * std::sin(5 * u + 1);
    if (v < near) return Rgb(0.16, 0.3, 0.36);
    if (v < far) return v > far - 0.07 ? Rgb(0.95, 0.95, 0.97) : Rgb(0.36, 0.5, 0.58);
    if (std::hypot(u - 0.7, v - 0.8) < 0.1) return Rgb(0.98, 0.86, 0.5);
    return mixed(Rgb(0.96, 0.72, 0.55), Rgb(0.52, 0.68, 0.8), (v - 0.5) * 2);
  };
  const Paint record = [](double u, double v) {
    const double r = std::hypot(u - 0.5, (v - 0.55) * 1.25);
    if (r < 0.07) return Rgb(0.9, 0.85, 0.75);
    if (r < 0.15) return Rgb(0.85, 0.3, 0.2);
    if (r < 0.37) return std::abs(std::remainder(r * 40, 1.0)) < 0.15 ? Rgb(0.25, 0.25, 0.28) : Rgb(0.1, 0.1, 0.12);
    if (v < 0.16)
      return std::abs(std::remainder(u * 9, 1.0)) < 0.3 && v > 0.06 ? Rgb(0.2, 0.2, 0.25) : Rgb(0.95, 0.8, 0.35);
    return Rgb(0.95, 0.8, 0.35);
  };
  kit.add_framed(-1.55, -1.0, 1.3, 2.02, 0.022, Rgb(0.93, 0.91, 0.86), mountain, 2.6, 0.03);
  kit.add_framed(-0.82, -0.42, 1.42, 1.96, 0.022, Rgb(0.2, 0.16, 0.13), record, 2.6, 0.03);
}

void add_wardrobe(SceneKit& kit) {
  const double left = 0.78, right = 1.82, depth = 0.45, high = 2.02;
  const Rgb white(0.9, 0.88, 0.84);
  kit.box(Point((left + right) / 2, kWall - depth / 2, high / 2), Point((right - left) / 2, depth / 2, high / 2),
          plain(white * 0.94), 0.6);
  const double middle = (left + right) / 2, y = kWall - depth - 0.004;
  const Paint slats = [white](double u, double v) {
    const double rim = std::min(std::min(u, 1 - u) * 0.52, std::min(v, 1 - v) * 1.96);
    if (rim < 0.01) return Rgb(white * 0.6);
    return rim < 0.06 ? white : Rgb(white * (0.8 + 0.2 * std::abs(std::remainder(v * 30, 1.0)) * 2));
  };
  const Paint mirror = [white](double u, double v) {  // the other side of the room, blurred
    const double rim = std::min(std::min(u, 1 - u) * 0.52, std::min(v, 1 - v) * 1.96);
    if (rim < 0.01) return Rgb(white * 0.6);
    if (rim < 0.05) return white;
    if (v < 0.32) return mixed(Rgb(0.62, 0.56, 0.5), Rgb(0.72, 0.68, 0.6), v / 0.32);
    const double shine = std::max(0.0, 0.5 - std::abs(u - v + 0.35) * 2.5);
    return Rgb(mixed(Rgb(0.55, 0.62, 0.68), Rgb(0.8, 0.85, 0.88), v) * (1 + 0.15 * shine));
  };
  kit.model.add_rectangle(Point(left, y, 0.04), Point(middle - left, 0, 0), Point(0, 0, high - 0.06), mirror, 1.3,
                          0.15);
  kit.model.add_rectangle(Point(middle, y, 0.04), Point(right - middle, 0, 0), Point(0, 0, high - 0.06), slats, 1.8);
  for (const double x : {middle - 0.035, middle + 0.035})
    kit.box(Point(x, y - 0.012, 1.02), Point(0.008, 0.01, 0.06), plain(Rgb(0.7, 0.55, 0.3)), 2);
}

void add_lamp(SceneKit& kit) {
  const Point foot(0.4, 1.72, 0);
  const Rgb brass(0.75, 0.58, 0.3);
  kit.model.add_revolution(
      foot, [](double v) { return Vector2<double>(0.13 * (1 - 0.9 * v), 0.03 * v); }, plain(brass), 1.5, 0.08);
  kit.tube(foot + Point(0, 0, 0.02), foot + Point(0, 0, 1.42), 0.011, brass, 2);
  kit.model.add_revolution(
      foot + Point(0, 0, 1.36), [](double v) { return Vector2<double>(0.19 - 0.08 * v, 0.27 * v); },
      [](double, double v) { return mixed(Rgb(1, 0.93, 0.74), Rgb(0.97, 0.85, 0.62), v); }, 1.5);
}

void add_bunting(SceneKit& kit) {
  const std::array<Rgb, 4> flags = {Rgb(0.85, 0.35, 0.3), Rgb(0.95, 0.8, 0.4), Rgb(0.4, 0.6, 0.55),
                                    Rgb(0.95, 0.92, 0.85)};
  constexpr int kFlags = 9;
  for (int i = 0; i < kFlags; ++i) {
    const double a = double(i) / kFlags, b = double(i + 1) / kFlags;
    const auto at = [](double t) { return Point(-0.3 + 1.0 * t, kWall - 0.03, 2.2 - 0.16 * std::sin(kPi * t)); };
    const Point p = at(a), along = at(b) - at(a);
    const SheetShape flag = [=](double u, double v) {
      return Point(p + along * (0.5 + (u - 0.5) * v * 0.9) + Point(0, -0.01, -0.13 * (1 - v)));
    };
    kit.model.add({flag, plain(flags[static_cast<std::size_t>(i % 4)]), 2.5});
  }
}

bool is_at(const ScenePlan& plan, std::string_view place) { return plan.place != nullptr && place == plan.place->name; }

/// A window seat in place of the wardrobe.
void add_window_seat(SceneKit& kit) {
  const ScenePlace& place = *kit.plan.place;
  const Point edge = place.ground.point({0, 0, 0});
  const double half = place.width / 2, deep = kWall - edge.y(), top = place.height;
  const Rgb white(0.93, 0.92, 0.88);
  kit.add_window(edge.x() - half + 0.1, edge.x() + half - 0.1, top + 0.09, 1.95);
  kit.box(Point(edge.x(), edge.y() + deep / 2, top - 0.025), Point(half + 0.06, deep / 2 + 0.02, 0.025), plain(white),
          2);
  kit.box(
      Point(edge.x(), edge.y() + deep / 2 + 0.04, top / 2 - 0.02), Point(half, deep / 2 - 0.05, top / 2 - 0.03),
      [white](double u, double v) {
        const double rim = std::min(std::abs(std::remainder(u * 3, 1.0)) / 3, std::min(v, 1 - v) * 0.5);
        return rim < 0.02 ? Rgb(white * 0.75) : Rgb(white * 0.95);
      },
      1.5);
  for (const double side : {-1.0, 1.0})
    kit.add_curtain(edge.x() + side * half - 0.13, edge.x() + side * half + 0.13, top, 2.15, Rgb(0.72, 0.35, 0.3),
                    Rgb(0.86, 0.62, 0.3));
}

}  // namespace

void make_bedroom(SceneKit& kit) {
  add_carpet(kit);
  add_bedroom_walls(kit);
  add_bed(kit);
  add_posters(kit);
  if (is_at(kit.plan, "windowsill")) {
    add_window_seat(kit);
  } else if (is_at(kit.plan, "ladder")) {
    add_step_ladder(kit, *kit.plan.place);
  } else {
    add_wardrobe(kit);
  }
  add_lamp(kit);
  add_bunting(kit);
  kit.add_plant(Point(0.12, 1.6, 0), 0.55);
}

double bedroom_light(const ScenePlan& plan, const Point& p, const Point& normal) {
  const Point lamp(0.4, 1.72, 1.45);
  const double near = 0.14 * std::exp(-(p - lamp).squaredNorm() / 0.5);
  double light = faced_light(normal) * corner_light(p) * support_shadow(plan, p) + near;
  if (p.z() < 0.02) {
    light *= shadow(p, {kBed.x(), kBed.y()}, {kBedHalf.x(), kBedHalf.y()}, 0, 0.4);
    light *= shadow(p, {1.3, 1.78}, {0.5, 0.22}, 0, 0.35) * shadow(p, {0.4, 1.72}, {0.1, 0.1}, 0, 0.25);
  }
  return light;
}

}  // namespace hsi4d::detail
