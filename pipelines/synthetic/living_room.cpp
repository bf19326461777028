// The living room: plank floor, rug, wallpaper over a panelled wainscot, window with curtains, pictures, a bookcase and
// a potted plant. 4 × 4 × 2.6 m.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string_view>

#include "pipelines/synthetic/furniture.h"

namespace hsi4d::detail {
namespace {

constexpr double kWainscot = 0.92;  // metres, top of the panelling
const Vector2<double> kRugHalf{1.05, 0.75};

bool on_rug(const ScenePlan& plan, const Point& p) {
  return std::abs(p.x() - plan.middle[0]) < kRugHalf[0] && std::abs(p.y() - plan.middle[1]) < kRugHalf[1];
}

void add_rug(SceneKit& kit) {
  const Vector2<double> half = kRugHalf;
  const Paint paint = [&kit, half](double u, double v) {
    const double x = (2 * u - 1) * half[0], y = (2 * v - 1) * half[1];
    const double edge = std::min(half[0] - std::abs(x), half[1] - std::abs(y));
    const Rgb red(0.62, 0.17, 0.16), navy(0.13, 0.2, 0.38), cream(0.9, 0.83, 0.68), ochre(0.82, 0.58, 0.22);
    Rgb color = red;
    if (edge < 0.06) {
      color = navy;
    } else if (edge < 0.12) {
      color = cream;
    } else if (edge < 0.3) {  // a border of triangles
      const double along = (half[0] - std::abs(x) < half[1] - std::abs(y) ? y : x) / 0.18;
      const double saw = std::abs(along - std::round(along)) * 2;
      color = saw < (edge - 0.12) / 0.18 ? navy : ochre;
    } else if (edge < 0.34) {
      color = cream;
    } else {  // diamonds
      const double a = (x + y) / 0.3, b = (x - y) / 0.3;
      const double nearest = std::max(std::abs(a - std::round(a)), std::abs(b - std::round(b)));
      color = nearest < 0.14 ? cream : nearest < 0.27 ? ochre : nearest < 0.36 ? navy : red;
    }
    return Rgb(color * (1 + 0.07 * kit.noise(Point(x * 45, y * 45, 3))));
  };
  kit.model.add_rectangle(Point(kit.plan.middle[0] - half[0], kit.plan.middle[1] - half[1], 0.008),
                          Point(2 * half[0], 0, 0), Point(0, 2 * half[1], 0), paint, 3);
}

/// One wall: skirting, panelled wainscot, rail, striped wallpaper. `u` runs to the right as one looks at it.
void add_wall(SceneKit& kit, const Point& corner, const Point& along, double length, double detail) {
  const Point up(0, 0, 1);
  const auto band = [&](double low, double high, const Paint& paint, double more) {
    kit.model.add_rectangle(corner + low * up, along * length, (high - low) * up, paint, detail * more);
  };
  const Rgb white(0.9, 0.89, 0.85);
  band(0, 0.11, plain(white * 0.98), 1);
  constexpr double kPanel = 0.5;
  const int panels = static_cast<int>(std::round(length / kPanel));
  for (int i = 0; i < panels; ++i) {
    const Paint paint = [white](double u, double v) {
      const double x = std::min(u, 1 - u) * kPanel, y = std::min(v, 1 - v) * (kWainscot - 0.15);
      const double frame = std::min(x, y);
      const double groove = std::exp(-std::pow((frame - 0.075) / 0.014, 2));
      const double inside = ramp(0.07, 0.09, frame);
      return Rgb(mixed(white, Rgb(0.82, 0.86, 0.83), inside) * (1 - 0.25 * groove));
    };
    kit.model.add_rectangle(corner + along * (length * i / panels) + 0.11 * up, along * (length / panels),
                            up * (kWainscot - 0.15), paint, detail * 1.3);
  }
  band(kWainscot - 0.04, kWainscot, plain(white * 1.04), 1);
  constexpr double kStripe = 0.16;
  const int stripes = static_cast<int>(std::round(length / kStripe));
  const double height = kCeiling - 0.08 - kWainscot;
  for (int i = 0; i < stripes; ++i) {
    const Rgb base = i % 2 == 0 ? Rgb(0.56, 0.68, 0.62) : Rgb(0.68, 0.77, 0.69);
    const Rgb leaf = i % 2 == 0 ? Rgb(0.76, 0.82, 0.7) : Rgb(0.5, 0.63, 0.58);
    const Paint paint = [base, leaf, height, i](double u, double v) {
      const double y = v * height / 0.24 + (i % 2) * 0.5, x = (u - 0.5) * 2;
      const double in_cell = (y - std::floor(y) - 0.5) * 2;
      const double flower = x * x / 0.25 + in_cell * in_cell / 0.45;
      return mixed(leaf, base, ramp(0.55, 1.1, flower));
    };
    kit.model.add_rectangle(corner + along * (length * i / stripes) + kWainscot * up, along * (length / stripes),
                            height * up, paint, detail * 1.2);
  }
  band(kCeiling - 0.08, kCeiling, plain(white * 1.02), 1);
}

void add_walls(SceneKit& kit) {
  const double side = 2 * kWall;
  add_wall(kit, Point(-kWall, kWall, 0), Point(1, 0, 0), side, 1);     // back: outer side -y
  add_wall(kit, Point(-kWall, -kWall, 0), Point(0, 1, 0), side, 0.1);  // left: outer side +x
  add_wall(kit, Point(kWall, kWall, 0), Point(0, -1, 0), side, 0.1);   // right: outer side -x
  kit.model.add_rectangle(Point(-kWall, kWall, kCeiling), Point(side, 0, 0), Point(0, -side, 0),
                          plain(Rgb(0.93, 0.92, 0.88)), 0.03);
}

void add_pictures(SceneKit& kit) {
  const Paint abstract = [](double u, double v) {  // a sun over waves
    const double r = std::hypot(u - 0.62, (v - 0.62) * 1.2);
    Rgb color = mixed(Rgb(0.95, 0.8, 0.55), Rgb(0.93, 0.55, 0.4), v);
    if (r < 0.2) color = Rgb(0.98, 0.93, 0.75);
    for (int i = 0; i < 3; ++i)
      if (v < 0.42 - 0.12 * i + 0.05 * std::sin(9 * u + 2 * i))
        color = mixed(Rgb(0.2, 0.5, 0.62), Rgb(0.08, 0.22, 0.4), i / 2.0);
    return color;
  };
  kit.add_framed(0.02, 0.5, 1.62, 2.22, 0.035, Rgb(0.2, 0.14, 0.1), abstract, 3, 0.04);
  const Paint blocks = [](double u, double v) {
    if (std::abs(u - 0.36) < 0.02 || std::abs(v - 0.55) < 0.025 || (u > 0.36 && std::abs(v - 0.24) < 0.025))
      return Rgb(0.1, 0.1, 0.1);
    if (u < 0.36) return v > 0.55 ? Rgb(0.95, 0.94, 0.9) : Rgb(0.15, 0.32, 0.7);
    if (v > 0.55) return Rgb(0.85, 0.2, 0.16);
    return v > 0.24 ? Rgb(0.95, 0.94, 0.9) : Rgb(0.95, 0.78, 0.2);
  };
  kit.add_framed(0.98, 1.42, 1.98, 2.36, 0.03, Rgb(0.85, 0.83, 0.78), blocks, 3, 0.04);
}

void add_books(SceneKit& kit, double left, double right, double front, double ground, double room) {
  const std::array<Rgb, 10> covers = {
      Rgb(0.72, 0.2, 0.17),  Rgb(0.16, 0.32, 0.55), Rgb(0.2, 0.45, 0.3),  Rgb(0.88, 0.7, 0.25), Rgb(0.85, 0.82, 0.74),
      Rgb(0.42, 0.22, 0.42), Rgb(0.12, 0.13, 0.17), Rgb(0.82, 0.44, 0.2), Rgb(0.3, 0.6, 0.65),  Rgb(0.55, 0.3, 0.2)};
  double x = left;
  while (x < right - 0.03) {
    const double width = std::min(right - x, 0.035 + 0.045 * kit.random.uniform());
    const double height = room * (0.62 + 0.28 * kit.random.uniform()), back = 0.02 + 0.05 * kit.random.uniform();
    if (kit.random.uniform() < 0.1) {  // a gap
      x += width * 1.5;
      continue;
    }
    const Rgb cover = kit.varied(covers[kit.random.below(covers.size())], 0.1);
    const Rgb title = cover.sum() > 1.5 ? Rgb(0.25, 0.18, 0.14) : Rgb(0.9, 0.82, 0.6);
    const double label = 0.55 + 0.25 * kit.random.uniform();
    const Paint spine = [cover, title, label](double u, double v) {
      const double round = 1 - 0.25 * std::pow(2 * u - 1, 4);
      const bool is_title = std::abs(v - label) < 0.09 || std::abs(v - 0.12) < 0.025;
      return Rgb((is_title ? title : cover) * round);
    };
    const Point corner(x + 0.002, front + back, ground);
    kit.model.add_rectangle(corner, Point(width - 0.004, 0, 0), Point(0, 0, height), spine, 3);
    kit.model.add_rectangle(corner + Point(0, 0, height), Point(width - 0.004, 0, 0), Point(0, 0.2, 0),
                            plain(Rgb(0.85, 0.81, 0.72)), 0.6);
    x += width;
  }
}

void add_bookcase(SceneKit& kit) {
  constexpr double kLeft = 0.72, kRight = 1.72, kDepth = 0.3, kTop = 1.78, kBoard = 0.028;
  const double front = kWall - kDepth - 0.02;
  const Rgb oak(0.5, 0.32, 0.19);
  const auto board = [&](double x0, double x1, double z0, double z1) {
    kit.model.add_box(
        Point((x0 + x1) / 2, front + kDepth / 2, (z0 + z1) / 2), Point((x1 - x0) / 2, kDepth / 2, (z1 - z0) / 2), 0,
        [&](int) { return kit.wood(oak, x1 - x0 + z1 - z0, kDepth); }, 1.2);
  };
  board(kLeft, kLeft + kBoard, 0, kTop);
  board(kRight - kBoard, kRight, 0, kTop);
  constexpr int kShelves = 5;
  constexpr double kStep = (kTop - kBoard) / kShelves;
  for (int i = 0; i <= kShelves; ++i) board(kLeft + kBoard, kRight - kBoard, i * kStep, i * kStep + kBoard);
  kit.model.add_rectangle(Point(kLeft, kWall - 0.03, 0), Point(kRight - kLeft, 0, 0), Point(0, 0, kTop),
                          plain(oak * 0.45), 0.8);
  for (int i = 0; i < kShelves; ++i)
    add_books(kit, kLeft + kBoard + 0.01, kRight - kBoard - 0.01, front, i * kStep + kBoard, kStep - kBoard);
}

/// What the person acts at.
void add_place(SceneKit& kit) {
  if (kit.plan.place == nullptr) return;
  const ScenePlace& place = *kit.plan.place;
  const std::string_view name = place.name;
  const Rgb cloth(0.5, 0.27, 0.18);
  if (name == "sofa") add_sofa(kit, place.ground, {place.width, place.height, place.reach, 0.86}, cloth);
  if (name == "sofa_back") add_sofa_from_behind(kit, place.ground, {place.width, 0.43, 0.5, place.height}, cloth);
  if (name == "table")
    add_dining_table(kit, place.ground, {place.width, place.reach, place.height}, Rgb(0.72, 0.5, 0.3));
}

}  // namespace

void make_living_room(SceneKit& kit) {
  kit.add_planks(Rgb(0.62, 0.42, 0.25), Rgb(0.74, 0.54, 0.34), [&kit](const Point& p) { return !on_rug(kit.plan, p); });
  add_rug(kit);
  add_walls(kit);
  const double left = -1.35, right = -0.45;
  const Rgb bottom(0.78, 0.42, 0.22), top(0.86, 0.55, 0.32);
  kit.add_window(left, right, 1.08, 2.12);
  kit.add_curtain(left - 0.3, left + 0.02, 0.35, 2.3, bottom, top);
  kit.add_curtain(right - 0.02, right + 0.3, 0.35, 2.3, bottom, top);
  kit.tube(Point(left - 0.4, kWall - 0.12, 2.32), Point(right + 0.4, kWall - 0.12, 2.32), 0.016, Rgb(0.45, 0.28, 0.15),
           1.5);
  add_pictures(kit);
  add_bookcase(kit);
  kit.add_plant(Point(-1.44, 1.45, 0));
  add_place(kit);
}

double living_room_light(const ScenePlan& plan, const Point& p, const Point& normal) {
  double light = faced_light(normal) * corner_light(p) * support_shadow(plan, p);
  if (p.z() < 0.02)
    light *= shadow(p, {1.22, 1.82}, {0.5, 0.15}, 0, 0.35) * shadow(p, {-1.5, 1.45}, {0.15, 0.15}, 0, 0.45);
  if (p.z() < 0.02 && plan.place != nullptr) {
    const ScenePlace& place = *plan.place;
    const Point middle = place.ground.point({0, -0.5 * place.reach - 0.1, 0});
    light *= shadow(p, middle.head<2>(), {place.width / 2 + 0.1, place.reach / 2 + 0.15},
                    place.ground.heading_deg * std::numbers::pi / 180, 0.4);
  }
  return light;
}

}  // namespace hsi4d::detail
