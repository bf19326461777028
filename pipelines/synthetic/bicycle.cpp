// The bicycle: a bench in a park with a bicycle leaning on its end; a lawn, a path, trees and a lake of sky behind.
#include <array>
#include <cmath>

#include "pipelines/synthetic/furniture.h"
#include "pipelines/synthetic/plants.h"

namespace hsi4d::detail {
namespace {

const ScenePlace& bench_place() { return places_of(SyntheticSceneKind::kBicycle)[0]; }

Ground bicycle_ground() {
  Ground ground = bench_place().ground;
  ground.place = bench_place().ground.point({bench_place().width / 2 + 0.42, 0.02, 0}).head<2>();
  ground.heading_deg += 14;
  return ground;
}

}  // namespace

void make_bicycle(SceneKit& kit) {
  add_sky(kit);
  add_floor(
      kit, 5.2, 5.2,
      [&kit](const Point& p) {
        const double path = p.y() - 0.75 - 0.12 * p.x() + 0.08 * kit.noise(p * 1.5);
        if (std::abs(path) < 0.75) {
          const double edge = ramp(0.6, 0.75, std::abs(path));
          const Rgb gravel = Rgb(0.72, 0.66, 0.56) * (1 + 0.13 * kit.noise(p * 45) + 0.08 * kit.rough(p * 5));
          return mixed(gravel, Rgb(0.45, 0.5, 0.28), edge);
        }
        Rgb grass = Rgb(0.34, 0.53, 0.19) * (1 + 0.24 * kit.noise(p * 40) + 0.2 * kit.rough(p * 1.6));
        if (kit.noise(Point(p.x() * 15, p.y() * 15, 4)) > 0.75) grass = mixed(grass, Rgb(0.97, 0.85, 0.3), 0.8);
        return grass;
      },
      1);
  add_park_bench(kit, bench_place(), Rgb(0.52, 0.34, 0.2));
  add_bicycle(kit, bicycle_ground(), Rgb(0.9, 0.9, 0.88));
  add_tree(kit, Point(-2.35, 3.5, 0), 1.35);
  add_tree(kit, Point(3.0, 4.4, 0), 1.5);
  add_tree(kit, Point(0.3, 5.0, 0), 1.2);
  add_hedge(kit, -5, -0.6, 4.6, 0.5, 0.9);
  for (int i = 0; i < 5; ++i)
    add_bush(kit, Point(1.2 + 0.75 * i, 4.5 + 0.2 * std::sin(3.0 * i), 0.3), Point(0.5, 0.4, 0.42),
             kit.varied(Rgb(0.3, 0.46, 0.18), 0.15), 0.25, 0.6);
  const Point lamp(1.9, 2.9, 0);
  kit.tube(lamp, lamp + Point(0, 0, 2.7), 0.04, Rgb(0.14, 0.16, 0.15), 1.2);
  kit.model.add_revolution(
      lamp + Point(0, 0, 2.7),
      [](double v) { return Vector2<double>(0.12 + 0.06 * v - 0.18 * ramp(0.7, 1, v), 0.34 * v); },
      [](double, double v) { return v < 0.7 ? Rgb(0.95, 0.93, 0.8) : Rgb(0.14, 0.16, 0.15); }, 1.5);
  const Point bin(-1.62, 1.95, 0);
  kit.model.add_revolution(
      bin, [](double v) { return Vector2<double>(0.17 + 0.02 * v, 0.12 + 0.6 * v); },
      [](double u, double) {
        return std::abs(std::remainder(u * 16, 1.0)) < 0.3 ? Rgb(0.2, 0.35, 0.25) : Rgb(0.1, 0.17, 0.13);
      },
      1.5);
}

double bicycle_light(const ScenePlan& plan, const Point& p, const Point& normal) {
  if (p.y() > 7) return 1;
  static const std::array<FloorShade, 4> shades = {{{{-0.15, 1.95}, {0.8, 0.3}, 4, 0.4},
                                                    {{1.05, 1.85}, {0.5, 0.06}, 18, 0.3},
                                                    {{-2.1, 3.7}, {0.9, 0.7}, 0, 0.35},
                                                    {{3.3, 4.6}, {1, 0.7}, 0, 0.35}}};
  return sun_light(normal) * support_shadow(plan, p) * floor_shades(shades, p);
}

}  // namespace hsi4d::detail
