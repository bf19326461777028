#include "pipelines/synthetic/furniture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/angles.h"

namespace hsi4d::detail {
namespace {

const Rgb kSteel(0.62, 0.63, 0.66), kIron(0.13, 0.13, 0.14);

/// Cloth: a fine weave and darker seams at the edges.
Paint woven(const SceneKit& kit, const Rgb& cloth) {
  return [&kit, cloth](double u, double v) {
    const double rim = ramp(0, 0.04, std::min({u, 1 - u, v, 1 - v}));
    return Rgb(cloth * (0.8 + 0.2 * rim) * (1 + 0.07 * kit.noise(Point(u * 90, v * 60, 4))));
  };
}

}  // namespace

void Piece::box(const Point& center, const Point& half, const Rgb& color, double detail) const {
  painted(
      center, half, [&](int) { return plain(color); }, detail);
}

void Piece::painted(const Point& center, const Point& half, const std::function<Paint(int face)>& paint,
                    double detail) const {
  kit.model.add_box(at(center), half, ground_.heading_deg * kPi / 180, paint, detail, 0, true);
}

void Piece::board(const Point& center, const Point& half, const Rgb& color, double detail) const {
  kit.board(at(center), half, color, detail, ground_.heading_deg * kPi / 180);
}

void Piece::bar(const Point& from, const Point& to, double radius, const Rgb& color, double detail) const {
  kit.tube(at(from), at(to), radius, color, detail);
}

void Piece::bow(const Point& from, const Point& over, const Point& to, double radius, const Rgb& color) const {
  const Point a = at(from), b = at(over), c = at(to);
  const auto curve = [=](double v) {  // through b at the middle
    const Point control = 2 * b - 0.5 * (a + c);
    return Point((1 - v) * (1 - v) * a + 2 * v * (1 - v) * control + v * v * c);
  };
  kit.model.add_tube(
      curve, [radius](double) { return radius; }, plain(color), 1);
}

void Piece::panel(const Point& corner, const Point& edge_u, const Point& edge_v, const Paint& paint,
                  double detail) const {
  kit.model.add_rectangle(at(corner), ground_.direction(edge_u), ground_.direction(edge_v), paint, detail);
}

void Piece::cushion(const Point& center, const Point& half, const Paint& paint, double detail) const {
  const Ground ground = ground_;
  kit.model.add({[=](double u, double v) {  // |x/a|⁴ + |y/b|⁴ + |z/c|⁴ = 1
                   const double a = 2 * kPi * u, b = kPi * (v - 0.5);
                   const Point d(std::cos(b) * std::cos(a), -std::cos(b) * std::sin(a), std::sin(b));
                   const double n = std::pow(d.x(), 4) + std::pow(d.y(), 4) + std::pow(d.z(), 4);
                   return ground.point(center + (d * std::pow(n, -0.25)).cwiseProduct(half));
                 },
                 paint, detail});
}

void Piece::ring(const Point& center, double radius, double thick, const Rgb& color, double detail) const {
  const Ground ground = ground_;
  for (const double half : {0.0, 1.0})
    kit.model.add_tube(
        [=](double v) {
          const double angle = kPi * (v + half);
          return ground.point(center + Point(0, radius * std::cos(angle), radius * std::sin(angle)));
        },
        [thick](double) { return thick; }, plain(color), detail);
}

void Piece::disc(const Point& center, double radius, double side, const Paint& paint, double detail) const {
  const Ground ground = ground_;
  kit.model.add({[=](double u, double v) {
                   const double angle = 2 * kPi * u * side, r = radius * v;
                   return ground.point(center + Point(0, r * std::cos(angle), r * std::sin(angle)));
                 },
                 paint, detail});
}

void add_sofa(SceneKit& kit, const Ground& ground, const SofaSize& size, const Rgb& cloth) {
  const Piece piece(kit, ground);
  const auto [w, h, d, back] = size;
  const auto body = [&](const Point& center, const Point& half, double bright, double detail = 1) {
    piece.painted(
        center, half, [&](int) { return woven(kit, cloth * bright); }, detail);
  };
  body({0, -d / 2 - 0.06, (h - 0.14 + 0.06) / 2}, {w / 2, d / 2 + 0.04, (h - 0.14 - 0.06) / 2}, 0.8, 1.2);
  for (const double side : {-1.0, 1.0}) {
    body({side * w / 4, -d / 2, h - 0.075}, {w / 4 - 0.006, d / 2, 0.075}, 1, 1.6);
    body({side * (w / 2 + 0.09), -d / 2 - 0.07, (h + 0.19) / 2}, {0.088, d / 2 + 0.05, (h + 0.19) / 2}, 0.9, 1.5);
    piece.cushion({side * w / 4, -d - 0.03, h + 0.17}, {w / 4 - 0.01, 0.07, 0.19}, woven(kit, cloth * 1.05), 1.6);
    for (const double forward : {-0.02, -d - 0.1})
      piece.bar({side * (w / 2 + 0.04), forward, 0}, {side * (w / 2 + 0.04), forward, 0.08}, 0.02, kIron);
  }
  body({0, -d - 0.16, back / 2 + 0.02}, {w / 2 + 0.17, 0.09, back / 2 - 0.02}, 0.9, 1.2);
}

void add_sofa_from_behind(SceneKit& kit, const Ground& ground, const SofaSize& size, const Rgb& cloth) {
  Ground turned;
  turned.place = ground.point({0, -size.depth - 0.25, 0}).head<2>();
  turned.heading_deg = ground.heading_deg + 180;
  add_sofa(kit, turned, size, cloth);
}

void add_chair(SceneKit& kit, const Ground& ground, double seat, const Rgb& color) {
  const Piece piece(kit, ground);
  constexpr double kHalf = 0.21, kLeg = 0.018;
  piece.board({0, -kHalf, seat - 0.018}, {kHalf + 0.01, kHalf, 0.018}, color, 2.5);
  const double back = -2 * kHalf + 0.02;
  for (const double side : {-1.0, 1.0}) {
    const double x = side * (kHalf - 0.02);
    piece.bar({x, -0.03, 0}, {x, -0.03, seat - 0.03}, kLeg, color * 0.9, 2);
    piece.bar({x, back, 0}, {x, back, seat - 0.02}, kLeg, color * 0.9, 2);
    piece.bar({x, back, seat - 0.02}, {x, back - 0.06, seat + 0.42}, kLeg, color * 0.95, 2);
    piece.bar({x, -0.03, seat * 0.45}, {x, back, seat * 0.45}, 0.011, color * 0.85, 2);
  }
  for (int i = 0; i < 3; ++i) {
    const double z = seat + 0.14 + 0.125 * i, y = back - 0.06 * (z - seat) / 0.42;
    piece.board({0, y, z}, {kHalf - 0.02, 0.009, 0.03}, color, 2.5);
  }
}

void add_park_bench(SceneKit& kit, const ScenePlace& place, const Rgb& color) {
  const Piece piece(kit, place.ground);
  const double h = place.height, half = place.width / 2;
  for (int i = 0; i < 4; ++i) piece.board({0, -0.055 - 0.105 * i, h - 0.018}, {half, 0.045, 0.018}, color, 2);
  for (int i = 0; i < 3; ++i)
    piece.board({0, -0.43 - 0.035 * i, h + 0.14 + 0.13 * i}, {half, 0.013, 0.048}, color * 1.05, 2);
  for (const double x : {-half + 0.12, half - 0.12}) {
    piece.bow({x, 0.0, 0}, {x, -0.03, h * 0.5}, {x, -0.03, h - 0.03}, 0.022, kIron);
    piece.bow({x, -0.47, 0}, {x, -0.4, h * 0.5}, {x, -0.42, h - 0.03}, 0.022, kIron);
    piece.bar({x, -0.42, h - 0.03}, {x, -0.52, h + 0.45}, 0.02, kIron);
    piece.bar({x, -0.02, h - 0.04}, {x, -0.43, h - 0.04}, 0.018, kIron);
    piece.bow({x, -0.03, h}, {x, -0.1, h + 0.2}, {x, -0.46, h + 0.22}, 0.016, kIron);
  }
}

void add_dining_table(SceneKit& kit, const Ground& ground, const Point& size, const Rgb& color) {
  const Piece piece(kit, ground);
  const double w = size.x() / 2, d = size.y() / 2, h = size.z();
  piece.board({0, -d, h - 0.02}, {w, d, 0.02}, color, 2);
  piece.board({0, -0.06, h - 0.08}, {w - 0.07, 0.012, 0.04}, color * 0.85, 1.5);
  for (const double x : {-w + 0.06, w - 0.06})
    for (const double y : {-0.06, -2 * d + 0.06})
      piece.board({x, y, h / 2 - 0.02}, {0.033, 0.033, h / 2 - 0.02}, color * 0.9, 1.5);
}

void add_round_table(SceneKit& kit, const Point& foot, double radius, double height, const Rgb& top) {
  const Point up(0, 0, height);
  kit.model.add_revolution(
      foot + up, [radius](double v) { return Vector2<double>(radius * (1 - v) + 1e-4, 0); },
      kit.mottled(top, 0.12, 0.06, 2, 0.5), 2.5);
  kit.model.add_revolution(
      foot + up, [radius](double v) { return Vector2<double>(radius, -0.03 * (1 - v)); }, plain(top * 0.7), 2);
  kit.tube(foot + Point(0, 0, 0.02), foot + Point(0, 0, height - 0.03), 0.026, kIron, 1.5);
  kit.model.add_revolution(
      foot, [radius](double v) { return Vector2<double>(0.6 * radius * (1 - 0.9 * v), 0.035 * v); }, plain(kIron), 1.5);
}

void add_step_ladder(SceneKit& kit, const ScenePlace& place) {
  const Piece piece(kit, place.ground);
  const Rgb wood(0.78, 0.58, 0.34);
  const double half = place.width / 2, top = 1.86;
  // the nearer side leans away: at the height where the lower hand rests it is `reach` ahead
  const double slope = 0.22, foot = place.reach + 0.06 - slope * place.height;
  const auto near = [&](double x, double z) { return Point(x, foot + slope * z, z); };
  const auto far = [&](double x, double z) { return Point(x, foot + 2 * slope * top - slope * z + 0.03, z); };
  for (const double x : {-half, half}) {
    piece.bar(near(x, 0), near(x, top), 0.026, wood, 2);
    piece.bar(far(x, 0), far(x, top), 0.022, wood * 0.85, 2);
    piece.bar(near(x, 0.5), far(x, 0.5), 0.008, kSteel, 2);
  }
  for (int i = 1; i < 7; ++i) {
    const double z = 0.26 * i;
    piece.board(near(0, z) + Point(0, 0.03, 0), {half, 0.05, 0.014}, wood * 1.05, 2);
  }
  piece.board(near(0, top) + Point(0, 0.02, 0), {half + 0.03, 0.09, 0.018}, wood, 2);
  for (const double z : {0.5, 1.1}) piece.bar(far(-half, z), far(half, z), 0.014, wood * 0.85, 2);
}

void add_counter(SceneKit& kit, const Ground& ground, const Point& size, const Rgb& front, const Rgb& top) {
  const Piece piece(kit, ground);
  const double w = size.x() / 2, d = size.y() / 2, h = size.z();
  piece.painted(
      {0, -d, (h - 0.05) / 2}, {w - 0.03, d - 0.05, (h - 0.05) / 2},
      [&](int) {
        return Paint([&kit, front, w](double u, double v) {  // upright boards between two rails
          const double x = u * 2 * w / 0.14, seam = ramp(0, 0.08, std::abs(std::remainder(x, 1.0)));
          const double rail = v > 0.92 || v < 0.08 ? 0.8 : 1;
          return Rgb(front * rail * (0.55 + 0.45 * seam) * (1 + 0.1 * kit.noise(Point(x * 7, v * 3, 2))));
        });
      },
      1.3);
  piece.board({0, -d, h - 0.025}, {w, d, 0.025}, top, 2);
  piece.bar({-w, 0.06, 0.18}, {w, 0.06, 0.18}, 0.018, Rgb(0.8, 0.62, 0.3), 1.5);
}

void add_stool(SceneKit& kit, const Point& foot, double height, const Rgb& seat) {
  kit.tube(foot, foot + Point(0, 0, height - 0.05), 0.024, kSteel, 1.5);
  kit.model.add_revolution(
      foot, [](double v) { return Vector2<double>(0.2 * (1 - 0.9 * v), 0.03 * v); }, plain(kSteel), 1.2);
  kit.model.add_revolution(
      foot + Point(0, 0, height - 0.08),
      [](double v) { return Vector2<double>(v < 0.7 ? 0.18 : 0.6 * (1 - v) + 1e-4, 0.08 * std::min(1.0, v / 0.7)); },
      plain(seat), 2);
  for (const double half : {0.0, kPi})
    kit.model.add_tube(
        [=](double v) {
          return Point(foot + Point(0.17 * std::cos(half + kPi * v), 0.17 * std::sin(half + kPi * v), 0.25));
        },
        [](double) { return 0.01; }, plain(kSteel), 1);
}

void add_treadmill(SceneKit& kit, const ScenePlace& place) {
  const Piece piece(kit, place.ground);
  const double h = place.height, half = place.width / 2;
  const Rgb belt(0.1, 0.1, 0.11), rim(0.72, 0.73, 0.76), dark(0.2, 0.2, 0.22);
  piece.painted(
      {0, -0.05, h - 0.05}, {half, 0.82, 0.05},
      [&](int face) {
        return face != 5 ? plain(dark) : Paint([belt](double u, double v) {
          const double mark = std::abs(std::remainder(v * 6, 1.0)) < 0.03 || std::abs(u - 0.5) > 0.47 ? 0.12 : 0;
          return Rgb(belt + Rgb(mark, mark, mark));
        });
      },
      1.5);
  for (const double x : {-half - 0.05, half + 0.05}) {
    piece.box({x, -0.05, h - 0.04}, {0.05, 0.84, 0.055}, rim, 1.5);
    piece.bar({x, 0.72, h}, {x, place.reach + 0.02, 1.28}, 0.03, dark, 2);
    piece.bar({x, place.reach + 0.03, 1.12}, {x, place.reach - 0.42, 1.06}, 0.02, rim, 2);
  }
  piece.box({0, 0.72, h + 0.04}, {half + 0.05, 0.13, 0.1}, dark, 1.5);
  piece.box({0, place.reach + 0.05, 1.3}, {half + 0.1, 0.05, 0.1}, dark, 2);
  piece.panel(
      {half - 0.08, place.reach - 0.005, 1.25}, {-2 * half + 0.16, 0, 0}, {0, 0.02, 0.12},
      [](double u, double v) {
        return std::abs(v - 0.5 - 0.3 * std::sin(9 * u)) < 0.1 ? Rgb(0.4, 0.95, 0.6) : Rgb(0.1, 0.2, 0.3);
      },
      3);
}

void add_slide(SceneKit& kit, const ScenePlace& place) {
  const Piece piece(kit, place.ground);
  const Rgb chute(0.93, 0.75, 0.16), rail(0.82, 0.22, 0.18), post(0.2, 0.42, 0.66);
  const double half = place.width / 2, deck = 0.75, h = place.height;
  const auto surface = [&](double behind) { return Point(0, -behind, slide_height(place, behind)); };
  constexpr int kParts = 14;
  for (int i = 0; i < kParts; ++i) {
    const Point a = surface(place.reach * i / kParts), b = surface(place.reach * (i + 1) / kParts);
    piece.panel(a + Point(-half, 0, 0), {2 * half, 0, 0}, b - a, plain(chute * (0.95 + 0.05 * (i % 2))), 1.6);
    for (const double x : {-half, half}) {
      piece.panel(a + Point(x, 0, -0.02), b - a, {0, 0, 0.17}, plain(chute * 0.85), 1.4);
      piece.bar(a + Point(x, 0, 0.16), b + Point(x, 0, 0.16), 0.024, rail, 1.6);
    }
  }
  piece.board({0, -place.reach - deck / 2, h - 0.03}, {half + 0.06, deck / 2, 0.03}, Rgb(0.7, 0.5, 0.32), 1.5);
  for (const double x : {-half - 0.06, half + 0.06}) {
    for (const double y : {-place.reach - 0.02, -place.reach - deck}) {
      piece.bar({x, y, 0}, {x, y, h + 0.85}, 0.04, post, 1.5);
    }
    piece.bar({x, -place.reach - 0.02, h + 0.75}, {x, -place.reach - deck, h + 0.75}, 0.022, rail, 1.5);
    piece.bar({x, -place.reach - 0.02, h + 0.4}, {x, -place.reach - deck, h + 0.4}, 0.018, rail, 1.5);
    piece.bar({x * 0.9, -place.reach - deck - 0.35, 0}, {x * 0.9, -place.reach - deck, h + 0.1}, 0.026, rail, 1.5);
    piece.bar({x * 0.7, -0.05, 0}, {x * 0.7, -0.1, slide_height(place, 0.1)}, 0.03, post, 1.2);
  }
  for (int i = 1; i < 6; ++i) {
    const double t = i / 6.0;
    piece.bar({-half, -place.reach - deck - 0.35 * (1 - t), h * t}, {half, -place.reach - deck - 0.35 * (1 - t), h * t},
              0.02, rail, 1.5);
  }
  for (const double side : {-1.0, 1.0})  // a roof
    piece.panel({side * (half + 0.2), -place.reach + 0.1, h + 0.85}, {0, -deck - 0.2, 0},
                {-side * (half + 0.2), 0, 0.35}, plain(rail * (side > 0 ? 1 : 0.85)), 1.2);
}

}  // namespace hsi4d::detail
