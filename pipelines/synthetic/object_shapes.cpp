#include "pipelines/synthetic/object_shapes.h"

#include <array>
#include <cmath>

#include "core/angles.h"
#include "pipelines/synthetic/kit.h"

namespace hsi4d::detail {
namespace {

const Rgb kCanSteel(0.72, 0.73, 0.76), kSoleRubber(0.09, 0.09, 0.1);

void bar(SurfaceModel& model, const Point& a, const Point& b, double radius, const Rgb& color, double detail = 1) {
  model.add_tube([=](double v) { return Point(a + v * (b - a)); }, [=](double) { return radius; }, plain(color), detail,
                 0.05);
}

/// A drum around y: its rim and both faces.
void add_drum(SurfaceModel& model, const Point& center, double radius, double half_width, const Rgb& rim,
              const Paint& face) {
  const auto at = [=](double u, double r, double y) {
    const double angle = 2 * kPi * u;
    return Point(center + Point(r * std::cos(angle), y, r * std::sin(angle)));
  };
  model.add({[=](double u, double v) { return at(u, radius, half_width * (1 - 2 * v)); }, plain(rim), 1});
  for (const double side : {-1.0, 1.0})
    model.add({[=](double u, double v) { return at(side > 0 ? 1 - u : u, radius * v, side * half_width); }, face, 1});
}

}  // namespace

void add_barbell(SurfaceModel& model) {
  const double h = kBarbellHeight;
  bar(model, {0, -0.88, h}, {0, 0.88, h}, 0.014, kCanSteel, 1.4);
  for (const double side : {-1.0, 1.0}) {
    const auto plate = [&](double y, double radius, const Rgb& color) {
      add_drum(model, {0, side * y, h}, radius, 0.022, color * 0.8, [=](double u, double v) {
        if (v < 0.16) return Rgb(0.6, 0.61, 0.63);
        if (v > 0.55 && v < 0.72 && std::abs(std::remainder(u * 2, 1.0)) < 0.3) return Rgb(0.95, 0.94, 0.9);
        return Rgb(v > 0.9 ? color * 0.75 : color);
      });
    };
    plate(0.6, 0.225, Rgb(0.8, 0.16, 0.15));
    plate(0.655, 0.18, Rgb(0.15, 0.32, 0.66));
    bar(model, {0, side * 0.7, h}, {0, side * 0.73, h}, 0.034, Rgb(0.3, 0.3, 0.32));
    bar(model, {0, side * 0.54, h}, {0, side * 0.56, h}, 0.03, Rgb(0.5, 0.5, 0.52));
  }
}

void add_shopping_cart(SurfaceModel& model) {
  const Rgb red(0.82, 0.16, 0.14);
  const double back = -0.42, front = 0.46, high = 0.96, low = 0.5, wide = 0.27, narrow = 0.2;
  // the basket: narrower in front and below
  const auto rim = [=](double x, double side) {
    return Point(x, side * (wide + (narrow - wide) * (x - back) / (front - back)), high - 0.05 * (x - back));
  };
  const auto floor = [=](double x, double side) {
    return Point(0.94 * x - 0.01, 0.85 * rim(x, side).y(), low + 0.04 * (front - x));
  };
  for (const double side : {-1.0, 1.0}) {
    bar(model, rim(back, side), rim(front, side), 0.013, kCanSteel, 1.4);
    bar(model, floor(back, side), floor(front, side), 0.009, kCanSteel);
    for (const double part : {0.33, 0.67}) {
      const auto middle = [&](double x) { return Point(rim(x, side) + part * (floor(x, side) - rim(x, side))); };
      bar(model, middle(back), middle(front), 0.006, kCanSteel);
    }
    for (int i = 0; i <= 6; ++i) {
      const double x = back + (front - back) * i / 6;
      bar(model, rim(x, side), floor(x, side), 0.006, kCanSteel);
    }
    bar(model, {-0.4, side * 0.23, 0.14}, {kCartHandle[0], side * 0.25, kCartHandle[1]}, 0.014, kCanSteel, 1.2);
    bar(model, {-0.42, side * 0.23, 0.14}, {0.4, side * 0.17, 0.14}, 0.013, kCanSteel);
    bar(model, {0.36, side * 0.17, 0.14}, {0.1, side * 0.2, low}, 0.012, kCanSteel);
    for (const double x : {-0.4, 0.38})
      model.add_revolution(
          Point(x, side * (x < 0 ? 0.23 : 0.17), 0),
          [](double v) { return Vector2<double>(0.05 * std::sin(kPi * v) + 1e-4, 0.065 * (1 - std::cos(kPi * v))); },
          plain(kSoleRubber), 1);
  }
  for (const double x : {back, front}) {
    bar(model, rim(x, -1), rim(x, 1), 0.013, kCanSteel, 1.2);
    bar(model, floor(x, -1), floor(x, 1), 0.008, kCanSteel);
  }
  for (int i = 0; i < 3; ++i) {
    const double y = 0.5 * (i - 1);
    bar(model, Point(rim(front, y)), Point(floor(front, y)), 0.006, kCanSteel);
  }
  const Paint mesh = [](double u, double v) {  // the floor of the basket, and what lies in it
    const bool is_wire = std::abs(std::remainder(u * 12, 1.0)) < 0.2 || std::abs(std::remainder(v * 12, 1.0)) < 0.2;
    return is_wire ? Rgb(0.65, 0.66, 0.69) : Rgb(0.35, 0.36, 0.38);
  };
  model.add({[=](double u, double v) { return floor(back + (front - back) * v, 1 - 2 * u); }, mesh, 0.6});
  model.add_box(
      Point(0.2, 0.03, low + 0.12), Point(0.11, 0.08, 0.1), 0.3,
      [](int face) { return plain(face == 5 ? Rgb(0.9, 0.75, 0.3) : Rgb(0.93, 0.62, 0.16)); }, 0.7);
  model.add_tube([](double v) { return Point(kCartHandle[0], -0.27 + 0.54 * v, kCartHandle[1]); },
                 [](double) { return 0.018; }, plain(red), 1.6);
  model.add_box(
      Point(-0.41, 0, 0.84), Point(0.012, 0.2, 0.1), 0, [&](int) { return plain(red); }, 0.7);
}

void add_mower(SurfaceModel& model) {
  const Rgb green(0.16, 0.5, 0.2), yellow(0.95, 0.78, 0.15), iron(0.18, 0.18, 0.19);
  model.add_box(
      Point(0.02, 0, 0.165), Point(0.3, 0.24, 0.065), 0,
      [&](int face) { return plain(face == 5 ? green : green * 0.85); }, 1.2);
  model.add_revolution(
      Point(0.05, 0, 0.22), [](double v) { return Vector2<double>(0.13 - 0.02 * v, 0.12 * v); },
      [iron](double u, double v) {
        return std::abs(std::remainder(v * 5, 1.0)) < 0.2 ? Rgb(0.45, 0.45, 0.46)
                                                          : Rgb(iron * (1 + 0.2 * std::sin(40 * u)));
      },
      1);
  model.add_revolution(
      Point(0.05, 0, 0.34), [](double v) { return Vector2<double>(0.12 * (1 - v * v) + 1e-4, 0.05 * v); },
      plain(yellow), 1);
  model.add_box(
      Point(0.2, 0.12, 0.28), Point(0.06, 0.06, 0.05), 0, [&](int) { return plain(Rgb(0.7, 0.12, 0.1)); }, 0.8);
  const Paint wheel = [](double u, double v) {
    if (v > 0.6) return kSoleRubber;
    return std::abs(std::remainder(u * 5, 1.0)) < 0.2 ? Rgb(0.5, 0.4, 0.1) : Rgb(0.95, 0.78, 0.15);
  };
  for (const double x : {-0.26, 0.28})
    for (const double y : {-0.28, 0.28}) {
      const double r = x < 0 ? 0.115 : 0.095;
      add_drum(model, {x, y, r}, r, 0.028, kSoleRubber, wheel);
    }
  // the bag
  model.add_box(
      Point(-0.5, 0, 0.31), Point(0.19, 0.2, 0.17), 0,
      [](int face) {
        return Paint([face](double u, double v) {
          const double seam = std::min({u, 1 - u, v, 1 - v}) < 0.05 ? 0.6 : 1;
          return Rgb(Rgb(0.2, 0.24, 0.22) * seam * (face == 5 ? 1.3 : 1));
        });
      },
      0.9);
  const Point handle(kMowerHandle[0], 0, kMowerHandle[1]);
  for (const double side : {-1.0, 1.0}) {
    const Point from(-0.2, side * 0.22, 0.2);
    bar(model, from, handle + Point(0, side * 0.22, 0), 0.013, iron, 1.2);
  }
  bar(model, handle + Point(0, -0.22, 0), handle + Point(0, 0.22, 0), 0.016, iron, 1.6);
  bar(model, handle + Point(0.12, -0.21, -0.12), handle + Point(0.12, 0.21, -0.12), 0.008, Rgb(0.8, 0.15, 0.1), 1.4);
}

void add_gate(SurfaceModel& model) {
  constexpr double kHigh = 1.15, kThick = 0.012;
  constexpr int kSlats = 5;
  const Rgb teal(0.13, 0.45, 0.47), cream(0.9, 0.86, 0.74), rust(0.74, 0.36, 0.2);
  const double wide = 2 * kGateHinge / kSlats;
  for (int i = 0; i < kSlats; ++i) {
    const double y = kGateHinge - (i + 0.5) * wide, high = kHigh - 0.02 * std::abs(i - 2);
    const Rgb color = i % 2 == 0 ? teal : Rgb(teal * 1.35);
    const Paint boards = [=](double u, double v) {
      if (v > 0.93) return cream;
      const double grain = 0.1 * std::sin(23 * v + 5 * i) + 0.06 * std::sin(61 * u + 9 * v);
      return Rgb(color * (1 + grain));
    };
    model.add_box(
        Point(0, y, 0.01 + high / 2), Point(kThick, 0.44 * wide, high / 2), 0, [&](int) { return boards; },
        1.15 + 0.04 * i, 0, true);
  }
  for (const double side : {-1.0, 1.0}) {  // rails, and a brace between them
    const double x = side * 1.9 * kThick;
    for (const double z : {0.22, 0.9})
      model.add_box(
          Point(x, 0, z), Point(0.9 * kThick, kGateHinge, 0.045), 0,
          [&](int) {
            return [=](double u, double) { return std::abs(std::remainder(u * 6, 1.0)) < 0.12 ? cream : rust; };
          },
          1.2, 0, true);
    bar(model, {x, kGateHinge - 0.03, 0.26}, {x, -kGateHinge + 0.03, 0.86}, 0.022, rust, 1.2);
  }
  const double x = kGateHandle[0], y = kGateHandle[1], z = kGateHandle[2];
  bar(model, {x, y, z - 0.1}, {x, y, z + 0.1}, 0.012, kCanSteel, 1.4);
  for (const double end : {-0.1, 0.1}) bar(model, {x, y, z + end}, {0, y, z + end}, 0.01, kCanSteel);
}

}  // namespace hsi4d::detail
