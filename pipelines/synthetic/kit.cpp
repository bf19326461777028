#include "pipelines/synthetic/kit.h"

#include <algorithm>
#include <cmath>

#include "core/angles.h"
#include "core/rotation.h"

namespace hsi4d::detail {

Rgb mixed(const Rgb& a, const Rgb& b, double part) { return a + (b - a) * std::clamp(part, 0.0, 1.0); }

double ramp(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

Paint plain(const Rgb& color) {
  return [color](double, double) { return color; };
}

double corner_light(const Point& p) {
  double light = 1;
  for (const double distance : {p.x() + kWall, kWall - p.x(), kWall - p.y(), p.z(), kCeiling - p.z()})
    light *= 1 - 0.2 * std::exp(-std::max(0.0, distance) / 0.3);
  return std::min(1.0, light / (1 - 0.2));  // a point on one of them meets that one always
}

double shadow(const Point& p, const Vector2<double>& center, const Vector2<double>& half, double turn,
              double strength) {
  const Vector2<double> d(p.x() - center[0], p.y() - center[1]);
  const double x = std::abs(std::cos(turn) * d[0] + std::sin(turn) * d[1]) - half[0];
  const double y = std::abs(std::cos(turn) * d[1] - std::sin(turn) * d[0]) - half[1];
  return 1 - strength * (1 - ramp(-0.12, 0.18, x)) * (1 - ramp(-0.12, 0.18, y));
}

double faced_light(const Point& normal) { return 0.66 + 0.4 * std::max(0.0, dot(normal, kToLight)); }

double support_shadow(const ScenePlan& plan, const Point& p) {
  if (!plan.has_table) return 1;
  const Vector2<double> center = plan.support.head<2>();
  if (p.z() < 0.02) return shadow(p, center, kTableHalf, plan.support_turn, 0.38);
  return p.z() < plan.support.z() - 0.02 ? shadow(p, center, kTableHalf, plan.support_turn, 0.12) : 1;
}

double SceneKit::rough(const Point& p) const {
  return (noise_.at(p) + 0.5 * noise_.at(p * 2.03) + 0.25 * noise_.at(p * 4.11)) / 1.75;
}

Paint SceneKit::wood(const Rgb& color, double length, double width) {
  const double shift = 100 * random.uniform();
  return [this, color, length, width, shift](double u, double v) {
    const double rings = noise_.at(Point(u * length * 1.5, v * width * 28, shift));
    const double fibres = noise_.at(Point(u * length * 6, v * width * 120, shift + 9));
    return Rgb(color * (1 + 0.1 * rings + 0.06 * fibres));
  };
}

Paint SceneKit::mottled(const Rgb& color, double amount, double size, double u_length, double v_length) {
  const double shift = 100 * random.uniform();
  return [this, color, amount, shift, u = u_length / size, v_scale = v_length / size](double x, double y) {
    return Rgb(color * (1 + amount * rough(Point(x * u, y * v_scale, shift))));
  };
}

void SceneKit::box(const Point& center, const Point& half, const Paint& paint, double detail, double turn,
                   double gloss) {
  model.add_box(
      center, half, turn, [&paint](int) { return paint; }, detail, gloss);
}

void SceneKit::board(const Point& center, const Point& half, const Rgb& color, double detail, double turn) {
  const double length = 2 * std::max({half.x(), half.y(), half.z()});
  model.add_box(
      center, half, turn, [&](int) { return wood(color, length, 0.2); }, detail, 0, true);
}

void SceneKit::tube(const Point& from, const Point& to, double radius, const Rgb& color, double detail) {
  model.add_tube([=](double v) { return Point(from + v * (to - from)); }, [=](double) { return radius; }, plain(color),
                 detail);
}

void SceneKit::add_planks(const Rgb& dark, const Rgb& light, const std::function<bool(const Point&)>& keep) {
  constexpr int kPlanks = 20;
  constexpr double kWidth = 2 * kWall / kPlanks;
  for (int row = 0; row < kPlanks; ++row) {
    double y = -kWall - 0.6 * random.uniform();
    while (y < kWall) {
      const double begin = std::max(-kWall, y);
      y += 1.1 + 0.8 * random.uniform();
      const double length = std::min(kWall, y) - begin;
      const Rgb tone = varied(mixed(dark, light, random.uniform()), 0.05);
      const Paint grain = wood(tone, length, kWidth);
      const Paint paint = [grain, length](double u, double v) {
        const double seam = ramp(0, 0.05, std::min(v, 1 - v)) * ramp(0, 0.012, std::min(u, 1 - u) * length);
        return Rgb(grain(u, v) * (0.72 + 0.28 * seam));
      };
      const double x = -kWall + (row + 1) * kWidth;  // u along +y, v along -x: the outer side is up
      SheetShape shape = [=](double u, double v) { return Point(x - v * kWidth, begin + u * length, 0); };
      const double detail = y < plan.seen_from_y ? 0.2 : 1.2;  // less where no camera of the clip looks
      model.add({shape, paint, detail, 0.06, keep});
    }
  }
}

void SceneKit::add_framed(double left, double right, double low, double high, double frame, const Rgb& frame_color,
                          const Paint& paint, double detail, double out) {
  const double y = kWall - out;
  model.add_rectangle(Point(left, y, low), Point(right - left, 0, 0), Point(0, 0, high - low), paint, detail);
  const double front = y - 0.02;
  const auto bar = [&](double x0, double x1, double z0, double z1) {
    model.add_rectangle(Point(x0, front, z0), Point(x1 - x0, 0, 0), Point(0, 0, z1 - z0), plain(frame_color), detail);
  };
  bar(left - frame, right + frame, high, high + frame);
  bar(left - frame, right + frame, low - frame, low);
  bar(left - frame, left, low, high);
  bar(right, right + frame, low, high);
}

void SceneKit::add_window(double left, double right, double low, double high) {
  const Paint view = [this](double u, double v) {
    const Rgb sky = mixed(Rgb(0.93, 0.95, 0.95), Rgb(0.45, 0.69, 0.93), v * 1.3 - 0.3);
    const double cloud = ramp(0.1, 0.5, noise_.at(Point(u * 4, v * 9, 20)) + 0.5 * noise_.at(Point(u * 9, v * 20, 5)));
    const double far = 0.36 + 0.06 * std::sin(6 * u + 1) + 0.03 * std::sin(15 * u);
    const double near = 0.22 + 0.07 * std::sin(4 * u + 3.5);
    if (v < near) return mixed(Rgb(0.25, 0.47, 0.19), Rgb(0.45, 0.62, 0.25), v / near);
    if (v < far) return Rgb(0.43, 0.6, 0.52);
    return mixed(sky, Rgb(1, 1, 1), 0.8 * cloud * ramp(0.4, 0.6, v));
  };
  add_framed(left, right, low, high, 0.06, Rgb(0.97, 0.96, 0.93), view, 2, 0.05);
  const double middle = (left + right) / 2, y = kWall - 0.08, white = 0.96;
  model.add_rectangle(Point(middle - 0.02, y, low), Point(0.04, 0, 0), Point(0, 0, high - low),
                      plain(Rgb(white, white, white * 0.97)), 2);
  model.add_rectangle(Point(left, y, low + 0.66 * ((high - low) / 1.04)), Point(right - left, 0, 0), Point(0, 0, 0.035),
                      plain(Rgb(white, white, white * 0.97)), 2);
  model.add_box(
      Point(middle, kWall - 0.09, low - 0.07), Point((right - left) / 2 + 0.15, 0.09, 0.018), 0,
      [](int) { return plain(Rgb(0.95, 0.94, 0.9)); }, 1.5);
}

void SceneKit::add_curtain(double left, double right, double low, double high, const Rgb& bottom, const Rgb& top) {
  const auto fold = [](double u) { return std::cos(2 * kPi * 3.5 * u); };
  const SheetShape shape = [=](double u, double v) {
    const double gathered = 1 - 0.12 * std::sin(kPi * v);
    const double middle = (left + right) / 2;
    return Point(middle + (left + u * (right - left) - middle) * gathered, kWall - 0.12 - 0.025 * fold(u),
                 low + v * (high - low));
  };
  const Paint paint = [fold, bottom, top](double u, double v) {
    const Rgb cloth = mixed(bottom, top, v);
    const double hem = v < 0.05 ? 0.8 : 1;
    return Rgb(cloth * hem * (0.86 + 0.16 * fold(u)));
  };
  model.add({shape, paint, 2.5});
}

void SceneKit::add_plant(const Point& foot, double size) {
  const auto pot = [size](double v) {
    return Vector2<double>(size * Vector2<double>(0.13 + 0.05 * v + (v > 0.86 ? 0.02 : 0), 0.32 * v));
  };
  const Paint clay = [](double u, double v) {
    const bool zigzag = std::abs(v - 0.5 - 0.12 * (std::abs(std::remainder(u * 9, 1.0)) * 4 - 1)) < 0.07;
    return zigzag ? Rgb(0.93, 0.86, 0.72) : Rgb(0.72, 0.38, 0.24);
  };
  model.add_revolution(foot, pot, clay, 2);
  model.add_revolution(
      foot + Point(0, 0, 0.29 * size), [size](double v) { return Vector2<double>(0.17 * size * (1 - v), 0.01 * v); },
      plain(Rgb(0.2, 0.14, 0.1)), 1);
  constexpr int kLeaves = 26;
  for (int i = 0; i < kLeaves; ++i) {
    const double turn = 2.399963 * i + 0.4 * random.uniform();  // golden angle
    const double rise = 1 - double(i) / kLeaves, length = size * (0.42 + 0.5 * rise + 0.12 * random.uniform());
    const double lean = 0.95 - 0.75 * rise + 0.15 * random.uniform();
    const double width = size * (0.055 + 0.03 * random.uniform());
    const Point out(std::cos(turn), std::sin(turn), 0), side(-std::sin(turn), std::cos(turn), 0), up(0, 0, 1);
    const SheetShape leaf = [=](double u, double v) {
      const double reach = lean * v + 0.45 * lean * v * v, climb = v * (1.15 - 0.55 * lean * v);
      const double across = (2 * u - 1) * width * (0.12 + std::pow(std::sin(kPi * std::pow(v, 0.75)), 0.9));
      return Point(foot + Point(0, 0, 0.28 * size) + length * (reach * out * 0.75 + climb * up) + across * side +
                   0.35 * std::abs(across) * up);
    };
    const Rgb green = varied(mixed(Rgb(0.16, 0.42, 0.17), Rgb(0.38, 0.62, 0.24), random.uniform()), 0.1);
    const Paint paint = [green](double u, double v) {
      const double vein = std::exp(-std::pow((u - 0.5) / 0.09, 2));
      return mixed(Rgb(green * (0.75 + 0.35 * v)), Rgb(0.68, 0.8, 0.45), 0.6 * vein);
    };
    model.add({leaf, paint, 3, 0.04});
  }
}

void SceneKit::add_table() {
  const Vector2<double> half = kTableHalf;
  const Rgb pine(0.84, 0.65, 0.43);
  const double turn = plan.support_turn, thick = 0.016;
  const Point top = plan.support;
  const Matrix3<double> axes = so3_exp(Vector3<double>(0, 0, turn));
  model.add_box(
      top - Point(0, 0, thick), Point(half[0], half[1], thick), turn,
      [&](int face) {
        return wood(face == 5 ? pine : Rgb(pine * 0.94), 2 * half[0], face == 5 ? 2 * half[1] : 2 * thick);
      },
      2.5, 0.08, true);
  const double leg = 0.021, height = top.z() - 2 * thick;
  for (const double sx : {-1.0, 1.0})
    for (const double sy : {-1.0, 1.0}) {
      const Point at = top + axes * Point(sx * (half[0] - 0.05), sy * (half[1] - 0.05), 0);
      model.add_box(
          Point(at.x(), at.y(), height / 2), Point(leg, leg, height / 2), turn,
          [&](int) { return wood(pine * 0.9, 2 * leg, height); }, 1.5);
    }
  for (const double side : {-1.0, 1.0}) {  // aprons
    const Point middle = top + axes * Point(0, side * (half[1] - 0.05), 0);
    model.add_box(
        Point(middle.x(), middle.y(), height - 0.03), Point(half[0] - 0.06, 0.01, 0.03), turn,
        [&](int) { return wood(pine * 0.88, 2 * half[0], 0.08); }, 1.5);
  }
}

/// Cameras look along +y: it stands on their side of what the table carries, and is higher than that.
void SceneKit::add_screen() {
  const Point half(0.27, 0.02, 0.2);
  board(plan.support + Point(0.03, -0.2, half.z()), half, Rgb(0.36, 0.43, 0.5), 2, 0);
}

void SceneKit::add_stand() {
  const Matrix3<double> axes = so3_exp(Point(0, 0, plan.support_turn));
  const auto at = [&](double left, double forward, double up) {
    return Point(plan.support + axes * Point(left, -forward, 0) + Point(0, 0, up - plan.support.z()));
  };
  const Rgb steel(0.16, 0.16, 0.18);
  for (const double side : {-1.0, 1.0}) {
    tube(at(0.17 * side, 0.11, 0.01), at(0.05 * side, -0.1, 0.32), 0.009, steel, 2);
    tube(at(0.12 * side, -0.11, 0.026), at(0.12 * side, 0.1, 0.03), 0.009, steel, 2);
  }
  tube(at(-0.19, 0.11, 0.01), at(0.19, 0.11, 0.01), 0.009, steel, 2);
}

void SceneKit::add_posts() {
  constexpr double kHalf = 0.035, kHigh = 1.25, kGap = 0.05, kGate = 0.6;
  // Across the gate's middle way: it swings from one side to the other.
  const Point along = so3_exp(Point(0, 0, plan.support_turn + 20 * kDegree)) * Point::UnitY();
  for (const double way : {kGap, -kGate - kGap}) {
    const Point foot = plan.support + way * along;
    model.add_box(
        Point(foot.x(), foot.y(), kHigh / 2), Point(kHalf, kHalf, kHigh / 2), plan.support_turn,
        [&](int) { return wood(Rgb(0.5, 0.36, 0.24), 2 * kHalf, kHigh); }, 1.5);
  }
}

void SceneKit::add_support() {
  if (plan.has_table) add_table();
  if (plan.has_screen) add_screen();
  if (plan.has_stand) add_stand();
  if (plan.has_posts) add_posts();
}

}  // namespace hsi4d::detail
