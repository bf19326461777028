// The greenhouse: glass between white ribs under the sky, a brick path, benches and beds full of plants, a chair.
#include <array>
#include <cmath>

#include "pipelines/synthetic/furniture.h"
#include "pipelines/synthetic/plants.h"

namespace hsi4d::detail {
namespace {

constexpr double kBack = 3.3, kHalfWidth = 2.6, kEaves = 2.1, kRidge = 3.1;  // metres
const Rgb kWhite(0.93, 0.95, 0.94);

const ScenePlace& flowers_place() { return places_of(SyntheticSceneKind::kGreenhouse)[1]; }

void add_ribs(SceneKit& kit) {
  const auto roof = [](double x) { return kEaves + (kRidge - kEaves) * (1 - std::abs(x) / kHalfWidth); };
  for (int i = 0; i <= 8; ++i) {  // the far gable
    const double x = -kHalfWidth + 2 * kHalfWidth * i / 8;
    kit.tube(Point(x, kBack, 0.5), Point(x, kBack, roof(x)), 0.024, kWhite, 1.2);
  }
  for (const double z : {0.5, 1.3, kEaves})
    kit.tube(Point(-kHalfWidth, kBack, z), Point(kHalfWidth, kBack, z), 0.024, kWhite, 1.2);
  for (int j = 0; j <= 4; ++j) {
    const double y = kBack - 0.95 * j;
    for (const double side : {-1.0, 1.0}) {
      kit.tube(Point(side * kHalfWidth, y, 0.5), Point(side * kHalfWidth, y, kEaves), 0.026, kWhite, 1);
      kit.tube(Point(side * kHalfWidth, y, kEaves), Point(0, y, kRidge), 0.026, kWhite, 1);
    }
  }
  for (const double side : {-1.0, 1.0}) {
    for (const double part : {0.0, 0.5}) {
      const double x = side * kHalfWidth * (1 - part);
      kit.tube(Point(x, kBack, roof(x)), Point(x, -0.5, roof(x)), 0.022, kWhite, 0.8);
    }
    kit.tube(Point(side * kHalfWidth, kBack, 1.3), Point(side * kHalfWidth, -0.5, 1.3), 0.02, kWhite, 0.8);
  }
  kit.tube(Point(0, kBack, kRidge), Point(0, -0.5, kRidge), 0.03, kWhite, 0.8);
  const auto wall = [&](const Point& center, const Point& half) {
    kit.box(center, half, kit.mottled(Rgb(0.66, 0.38, 0.28), 0.3, 0.06, 2, 0.5), 0.9);
  };
  wall(Point(0, kBack, 0.25), Point(kHalfWidth, 0.06, 0.25));
  for (const double side : {-1.0, 1.0}) wall(Point(side * kHalfWidth, 1.3, 0.25), Point(0.06, 2, 0.25));
}

void add_pot(SceneKit& kit, const Point& foot, double size, int kind) {
  kit.model.add_revolution(
      foot, [size](double v) { return Vector2<double>(size * (0.1 + 0.05 * v), size * 0.24 * v); },
      plain(kit.varied(Rgb(0.74, 0.42, 0.27), 0.1)), 1.5);
  const Point top = foot + Point(0, 0, 0.24 * size);
  if (kind % 3 == 0) {
    add_bush(kit, top + Point(0, 0, 0.17 * size), Point(0.2, 0.2, 0.22) * size, Rgb(0.28, 0.5, 0.2), 0.3, 1);
  } else {
    for (int i = 0; i < 3; ++i)
      add_flower(kit, top + size * Point(0.07 * std::cos(2.1 * i), 0.07 * std::sin(2.1 * i), -0.03), 0.3 * size);
  }
}

}  // namespace

void make_greenhouse(SceneKit& kit) {
  add_sky(kit);
  add_floor(kit, kHalfWidth, kBack, [&kit](const Point& p) {
    const double row = std::floor(p.y() / 0.12), x = p.x() / 0.24 + 0.5 * row, fx = x - std::floor(x),
                 fy = p.y() / 0.12 - row;
    if (std::min({fx * 0.24, (1 - fx) * 0.24, fy * 0.12, (1 - fy) * 0.12}) < 0.008) return Rgb(0.6, 0.56, 0.5);
    const double tone = kit.noise(Point(std::floor(x) * 3.7, row * 2.3, 4));
    return mixed(Rgb(0.62, 0.42, 0.33), Rgb(0.75, 0.58, 0.46), 0.5 + 0.7 * tone);
  });
  kit.model.add_rectangle(Point(-8, kBack + 0.1, -0.05), Point(16, 0, 0), Point(0, 5, 0),
                          kit.mottled(Rgb(0.36, 0.55, 0.22), 0.3, 0.2, 16, 5), 0.06);
  add_ribs(kit);
  const Rgb bench(0.7, 0.6, 0.46);
  kit.board(Point(-0.7, kBack - 0.4, 0.68), Point(1.75, 0.28, 0.025), bench, 1);
  for (const double x : {-2.3, -0.7, 0.9})
    kit.board(Point(x, kBack - 0.25, 0.33), Point(0.03, 0.05, 0.33), bench * 0.85, 1);
  for (int i = 0; i < 8; ++i)
    add_pot(kit, Point(-2.25 + 0.44 * i, kBack - 0.42, 0.705), 0.85 + 0.2 * kit.random.uniform(), i);
  for (int i = 0; i < 3; ++i) add_pot(kit, Point(-2.1, 1.5 + 0.45 * i, 0), 1.2 + 0.3 * (i % 2), i);
  const ScenePlace& place = flowers_place();
  const Piece bed(kit, place.ground);
  for (const double side : {-1.0, 1.0}) {
    bed.board({0, place.reach + side * 0.3, place.height / 2}, {0.62, 0.02, place.height / 2}, Rgb(0.6, 0.44, 0.29),
              1.5);
    bed.board({side * 0.62, place.reach, place.height / 2}, {0.02, 0.3, place.height / 2}, Rgb(0.6, 0.44, 0.29), 1.5);
  }
  bed.panel({-0.6, place.reach - 0.3, place.height - 0.05}, {1.2, 0, 0}, {0, 0.6, 0},
            kit.mottled(Rgb(0.3, 0.21, 0.15), 0.3, 0.05, 1.2, 0.6), 1);
  for (int i = 0; i < 22; ++i)
    add_flower(kit, bed.at({-0.54 + 0.05 * i, place.reach + 0.25 * std::sin(4.1 * i), place.height - 0.04}),
               0.26 + 0.1 * kit.random.uniform());
  for (const double x : {-1.5, 1.35}) {  // hanging baskets
    kit.tube(Point(x, 2.3, 2.05), Point(x, 2.3, 2.6), 0.006, Rgb(0.3, 0.3, 0.3), 1);
    add_bush(kit, Point(x, 2.3, 1.95), Point(0.24, 0.24, 0.18), Rgb(0.35, 0.56, 0.24), 0.3, 1.2);
  }
  kit.add_plant(Point(1.95, 2.75, 0), 1.2);
  add_chair(kit, places_of(SyntheticSceneKind::kGreenhouse)[0].ground,
            places_of(SyntheticSceneKind::kGreenhouse)[0].height, Rgb(0.93, 0.93, 0.9));
}

double greenhouse_light(const ScenePlan& plan, const Point& p, const Point& normal) {
  if (p.y() > 6) return 1;
  static const std::array<FloorShade, 3> shades = {{{{-0.5, 1.8}, {0.2, 0.2}, 14, 0.35},
                                                    {{-0.7, kBack - 0.4}, {1.7, 0.3}, 0, 0.4},
                                                    {{0.87, 1.71}, {0.6, 0.3}, 112, 0.35}}};
  double light = sun_light(normal) * support_shadow(plan, p) * floor_shades(shades, p);
  if (p.z() < 0.03 && (std::abs(std::remainder(p.x() - 0.5 * p.y(), 0.65)) < 0.05)) light *= 0.88;  // of the ribs
  return light;
}

}  // namespace hsi4d::detail
