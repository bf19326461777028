// The gym: a rubber floor, mirrors over a rack of dumbbells, wall bars, a treadmill beside another, a ball,
// kettlebells. 6 × 5 × 3 m.
#include <array>
#include <cmath>

#include "pipelines/synthetic/furniture.h"

namespace hsi4d::detail {
namespace {

constexpr RoomSize kGymRoom{2.8, 3.4, 2.9};
const Ground kSecondMill{{2.0, 2.2}, 66};
const Ground kRack{{0.6, 3.15}, 0};

void add_mirrors(SceneKit& kit) {
  for (int i = 0; i < 3; ++i) {  // the room behind, blurred
    const Paint mirror = [i](double u, double v) {
      if (std::min(u, 1 - u) < 0.012 || std::min(v, 1 - v) < 0.01) return Rgb(0.55, 0.56, 0.58);
      const double shine = std::max(0.0, 0.4 - std::abs(u - v + 0.25 * i - 0.1) * 2);
      const Rgb room = v < 0.3 ? Rgb(0.34, 0.35, 0.38) : mixed(Rgb(0.56, 0.6, 0.64), Rgb(0.8, 0.83, 0.85), v);
      return Rgb(room * (1 + 0.3 * shine));
    };
    kit.model.add_rectangle(Point(0.85 * i, kGymRoom.back - 0.02, 0.55), Point(0.83, 0, 0), Point(0, 0, 1.55), mirror,
                            0.9, 0.12);
  }
}

void add_dumbbells(SceneKit& kit) {
  const Piece piece(kit, kRack);
  const Rgb steel(0.2, 0.2, 0.22);
  for (const double z : {0.28, 0.62}) {
    piece.box({0, -0.02, z}, {1.1, 0.16, 0.02}, steel, 1.2);
    for (int i = 0; i < 7; ++i) {
      const double x = -0.95 + 0.315 * i, r = 0.05 + 0.007 * i;
      const Rgb tone = i % 2 == 0 ? Rgb(0.1, 0.1, 0.11) : Rgb(0.17, 0.17, 0.19);
      for (const double forward : {-0.1, 0.1}) {
        piece.painted(
            {x, forward - 0.02, z + 0.02 + r}, {r, 0.05, r},
            [&](int face) {
              return face != 2 ? plain(tone) : Paint([tone](double u, double v) {
                return std::hypot(u - 0.5, v - 0.5) < 0.28 ? Rgb(0.85, 0.3, 0.2) : tone;
              });
            },
            1.5);
      }
      piece.bar({x, -0.1, z + 0.02 + r}, {x, 0.1, z + 0.02 + r}, 0.016, Rgb(0.6, 0.6, 0.62), 1);
    }
  }
  for (const double x : {-1.08, 1.08}) piece.box({x, -0.02, 0.33}, {0.03, 0.15, 0.33}, steel, 1);
}

void add_wall_bars(SceneKit& kit) {
  const Rgb wood(0.82, 0.63, 0.4);
  const double y = kGymRoom.back - 0.1;
  for (const double x : {-1.6, -0.75}) kit.board(Point(x, y, 1.2), Point(0.03, 0.05, 1.2), wood * 0.9, 1);
  for (int i = 0; i < 11; ++i)
    kit.tube(Point(-1.6, y - 0.04, 0.2 + 0.2 * i), Point(-0.75, y - 0.04, 0.2 + 0.2 * i), 0.02, wood, 1.4);
}

void add_sign(SceneKit& kit) {
  // G Y M of bars
  const std::array<std::array<int, 7>, 3> letters = {{{0b01110, 0b10001, 0b10000, 0b10111, 0b10001, 0b10001, 0b01110},
                                                      {0b10001, 0b10001, 0b01010, 0b00100, 0b00100, 0b00100, 0b00100},
                                                      {0b10001, 0b11011, 0b10101, 0b10101, 0b10001, 0b10001, 0b10001}}};
  const Paint sign = [letters](double u, double v) {
    const double x = u * 19 - 1, y = (1 - v) * 9 - 1;
    const int column = static_cast<int>(std::floor(x)), row = static_cast<int>(std::floor(y));
    const int letter = column / 6, bit = column % 6;
    if (x < 0 || row < 0 || row > 6 || letter > 2 || bit > 4) return Rgb(0.85, 0.27, 0.16);
    const int line = letters[static_cast<std::size_t>(letter)][static_cast<std::size_t>(row)];
    return (line >> (4 - bit) & 1) != 0 ? Rgb(0.98, 0.96, 0.92) : Rgb(0.85, 0.27, 0.16);
  };
  kit.model.add_rectangle(Point(-0.1, kGymRoom.back - 0.03, 2.22), Point(1.1, 0, 0), Point(0, 0, 0.5), sign, 2.5);
}

void add_ball(SceneKit& kit, const Point& center, double r, const Rgb& color) {
  kit.model.add_revolution(
      center,
      [r](double v) {
        const double a = 3.14159265 * (v - 0.5);
        return Vector2<double>(r * std::cos(a) + 1e-4, r * std::sin(a));
      },
      [color](double, double v) { return Rgb(color * (std::abs(std::remainder(v * 12, 1.0)) < 0.1 ? 0.8 : 1)); }, 1.5,
      0.05);
}

}  // namespace

void make_gym(SceneKit& kit) {
  add_room(kit, kGymRoom, Rgb(0.62, 0.66, 0.68), Rgb(0.9, 0.9, 0.9));
  add_floor(kit, kGymRoom.half_width, kGymRoom.back, [&kit](const Point& p) {
    const bool is_seam = std::abs(std::remainder(p.x(), 0.7)) < 0.008 || std::abs(std::remainder(p.y(), 0.7)) < 0.008;
    const double speck = kit.noise(p * 45);
    const Rgb base = is_seam ? Rgb(0.16, 0.17, 0.18) : Rgb(0.29, 0.3, 0.32);
    return speck > 0.6 ? Rgb(0.3, 0.5, 0.7) : speck < -0.65 ? Rgb(0.6, 0.6, 0.62) : base;
  });
  kit.model.add_rectangle(Point(-kGymRoom.half_width, kGymRoom.back - 0.01, 1.15), Point(1.0, 0, 0), Point(0, 0, 0.18),
                          plain(Rgb(0.85, 0.27, 0.16)), 0.6);
  add_mirrors(kit);
  add_dumbbells(kit);
  add_wall_bars(kit);
  add_sign(kit);
  ScenePlace mill = places_of(SyntheticSceneKind::kGym)[0];
  add_treadmill(kit, mill);
  mill.ground = kSecondMill;
  add_treadmill(kit, mill);
  add_ball(kit, Point(-2.0, 2.75, 0.33), 0.33, Rgb(0.2, 0.5, 0.75));
  for (int i = 0; i < 3; ++i) {
    const Point foot(-1.75 + 0.27 * i, 1.75, 0.1);
    add_ball(kit, foot, 0.1, i == 1 ? Rgb(0.75, 0.25, 0.2) : Rgb(0.13, 0.13, 0.15));
    kit.model.add_tube(
        [foot](double v) {
          const double a = 3.14159265 * v;
          return Point(foot + Point(0.06 * std::cos(a), 0, 0.09 + 0.08 * std::sin(a)));
        },
        [](double) { return 0.014; }, plain(Rgb(0.2, 0.2, 0.22)), 2);
  }
}

double gym_light(const ScenePlan& plan, const Point& p, const Point& normal) {
  static const std::array<FloorShade, 4> shades = {{{{-0.7, 2}, {0.4, 0.9}, 66, 0.3},
                                                    {{2.0, 2.2}, {0.4, 0.9}, 66, 0.3},
                                                    {{0.95, 3.1}, {1.1, 0.2}, 0, 0.4},
                                                    {{-2.0, 2.75}, {0.2, 0.2}, 0, 0.4}}};
  return faced_light(normal) * room_corner_light(kGymRoom, p) * support_shadow(plan, p) * floor_shades(shades, p);
}

}  // namespace hsi4d::detail
