#include "pipelines/synthetic_scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/check.h"
#include "core/random.h"
#include "core/rotation.h"
#include "pipelines/synthetic_surface.h"

namespace hsi4d {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kWall = 2;                    // metres from the middle to the walls
constexpr double kCeiling = 2.6;               // metres
const Vector2<double> kTableHalf{0.38, 0.27};  // metres
constexpr double kWainscot = 0.92;             // metres, top of the panelling

const Vector3<double> kToLight = Vector3<double>(-0.35, -0.55, 0.76).normalized();

using Point = Vector3<double>;

Rgb mixed(const Rgb& a, const Rgb& b, double part) { return a + (b - a) * std::clamp(part, 0.0, 1.0); }

/// 0 below `low`, 1 above `high`, smooth between.
double ramp(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

Paint plain(const Rgb& color) {
  return [color](double, double) { return color; };
}

/// Darker near the edges where floor, walls and ceiling meet.
double corner_light(const Point& p) {
  double light = 1;
  for (const double distance : {p.x() + kWall, kWall - p.x(), kWall - p.y(), p.z(), kCeiling - p.z()})
    light *= 1 - 0.2 * std::exp(-std::max(0.0, distance) / 0.3);
  return std::min(1.0, light / (1 - 0.2));  // a point on one of them meets that one always
}

/// Share of light left under a thing that stands at `center` and is about `half` wide; 1 far from it.
double shadow(const Point& p, const Vector2<double>& center, const Vector2<double>& half, double turn,
              double strength) {
  const Vector2<double> d(p.x() - center[0], p.y() - center[1]);
  const double x = std::abs(std::cos(turn) * d[0] + std::sin(turn) * d[1]) - half[0];
  const double y = std::abs(std::cos(turn) * d[1] - std::sin(turn) * d[0]) - half[1];
  return 1 - strength * (1 - ramp(-0.12, 0.18, x)) * (1 - ramp(-0.12, 0.18, y));
}

double faced_light(const Point& normal) { return 0.66 + 0.4 * std::max(0.0, dot(normal, kToLight)); }

/// Collects the room. `add_` functions are one thing each.
class RoomBuilder {
 public:
  RoomBuilder(const RoomPlan& plan, std::uint64_t seed)
      : plan_(plan), random_(seed, random_stream("synthetic.room")), noise_(seed, "synthetic.texture") {
    add_floor();
    add_rug();
    add_walls();
    add_window();
    add_pictures();
    add_bookcase();
    add_plant(Point(-1.44, 1.45, 0));
    add_table();
  }
  const SurfaceModel& model() const { return model_; }

 private:
  double noise(const Point& p, double fx, double fy, double fz) const {
    return noise_.at(Point(p.x() * fx, p.y() * fy, p.z() * fz));
  }
  Rgb varied(const Rgb& color, double amount) { return color * (1 + amount * (2 * random_.uniform() - 1)); }

  /// Wood whose grain runs along u of a sheet that is `length` × `width` metres.
  Paint wood(const Rgb& color, double length, double width) {
    const double shift = 100 * random_.uniform();
    return [this, color, length, width, shift](double u, double v) {
      const double rings = noise_.at(Point(u * length * 1.5, v * width * 28, shift));
      const double fibres = noise_.at(Point(u * length * 6, v * width * 120, shift + 9));
      return Rgb(color * (1 + 0.1 * rings + 0.06 * fibres));
    };
  }

  bool on_rug(const Point& p) const {
    return std::abs(p.x() - plan_.rug[0]) < kRugHalf[0] && std::abs(p.y() - plan_.rug[1]) < kRugHalf[1];
  }

  void add_floor() {
    constexpr int kPlanks = 20;
    constexpr double kWidth = 2 * kWall / kPlanks;
    for (int row = 0; row < kPlanks; ++row) {
      double y = -kWall - 0.6 * random_.uniform();
      while (y < kWall) {
        const double begin = std::max(-kWall, y);
        y += 1.1 + 0.8 * random_.uniform();
        const double length = std::min(kWall, y) - begin;
        const Rgb tone = varied(mixed(Rgb(0.62, 0.42, 0.25), Rgb(0.74, 0.54, 0.34), random_.uniform()), 0.05);
        const Paint grain = wood(tone, length, kWidth);
        const Paint paint = [grain, length](double u, double v) {
          const double seam = ramp(0, 0.05, std::min(v, 1 - v)) * ramp(0, 0.012, std::min(u, 1 - u) * length);
          return Rgb(grain(u, v) * (0.72 + 0.28 * seam));
        };
        const double x = -kWall + (row + 1) * kWidth;  // u along +y, v along -x: the outer side is up
        SheetShape shape = [=](double u, double v) { return Point(x - v * kWidth, begin + u * length, 0); };
        const double detail = y < 0.2 ? 0.2 : 1.2;  // less where no camera of the clip looks
        model_.add({shape, paint, detail, 0.06, [this](const Point& p) { return !on_rug(p); }});
      }
    }
  }

  void add_rug() {
    const Vector2<double> half = kRugHalf;
    const Paint paint = [this, half](double u, double v) {
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
      return Rgb(color * (1 + 0.07 * noise_.at(Point(x * 45, y * 45, 3))));
    };
    model_.add_rectangle(Point(plan_.rug[0] - half[0], plan_.rug[1] - half[1], 0.008), Point(2 * half[0], 0, 0),
                         Point(0, 2 * half[1], 0), paint, 3);
  }

  /// One wall: skirting, panelled wainscot, rail, striped wallpaper. `u` runs to the right as one looks at it.
  void add_wall(const Point& corner, const Point& along, double length, double detail) {
    const Point up(0, 0, 1);
    const auto band = [&](double low, double high, const Paint& paint, double more) {
      model_.add_rectangle(corner + low * up, along * length, (high - low) * up, paint, detail * more);
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
      model_.add_rectangle(corner + along * (length * i / panels) + 0.11 * up, along * (length / panels),
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
      model_.add_rectangle(corner + along * (length * i / stripes) + kWainscot * up, along * (length / stripes),
                           height * up, paint, detail * 1.2);
    }
    band(kCeiling - 0.08, kCeiling, plain(white * 1.02), 1);
  }

  void add_walls() {
    const double side = 2 * kWall;
    add_wall(Point(-kWall, kWall, 0), Point(1, 0, 0), side, 1);     // back: outer side -y
    add_wall(Point(-kWall, -kWall, 0), Point(0, 1, 0), side, 0.1);  // left: outer side +x
    add_wall(Point(kWall, kWall, 0), Point(0, -1, 0), side, 0.1);   // right: outer side -x
    model_.add_rectangle(Point(-kWall, kWall, kCeiling), Point(side, 0, 0), Point(0, -side, 0),
                         plain(Rgb(0.93, 0.92, 0.88)), 0.03);
  }

  /// A flat thing on the back wall with a frame around it.
  void add_framed(double left, double right, double low, double high, double frame, const Rgb& frame_color,
                  const Paint& paint, double detail, double out) {
    const double y = kWall - out;
    model_.add_rectangle(Point(left, y, low), Point(right - left, 0, 0), Point(0, 0, high - low), paint, detail);
    const double front = y - 0.02;
    const auto bar = [&](double x0, double x1, double z0, double z1) {
      model_.add_rectangle(Point(x0, front, z0), Point(x1 - x0, 0, 0), Point(0, 0, z1 - z0), plain(frame_color),
                           detail);
    };
    bar(left - frame, right + frame, high, high + frame);
    bar(left - frame, right + frame, low - frame, low);
    bar(left - frame, left, low, high);
    bar(right, right + frame, low, high);
  }

  void add_window() {
    const double left = -1.35, right = -0.45, low = 1.08, high = 2.12;
    const Paint view = [this](double u, double v) {
      const Rgb sky = mixed(Rgb(0.93, 0.95, 0.95), Rgb(0.45, 0.69, 0.93), v * 1.3 - 0.3);
      const double cloud =
          ramp(0.1, 0.5, noise_.at(Point(u * 4, v * 9, 20)) + 0.5 * noise_.at(Point(u * 9, v * 20, 5)));
      const double far = 0.36 + 0.06 * std::sin(6 * u + 1) + 0.03 * std::sin(15 * u);
      const double near = 0.22 + 0.07 * std::sin(4 * u + 3.5);
      if (v < near) return mixed(Rgb(0.25, 0.47, 0.19), Rgb(0.45, 0.62, 0.25), v / near);
      if (v < far) return Rgb(0.43, 0.6, 0.52);
      return mixed(sky, Rgb(1, 1, 1), 0.8 * cloud * ramp(0.4, 0.6, v));
    };
    add_framed(left, right, low, high, 0.06, Rgb(0.97, 0.96, 0.93), view, 2, 0.05);
    const double middle = (left + right) / 2, y = kWall - 0.08, white = 0.96;
    model_.add_rectangle(Point(middle - 0.02, y, low), Point(0.04, 0, 0), Point(0, 0, high - low),
                         plain(Rgb(white, white, white * 0.97)), 2);
    model_.add_rectangle(Point(left, y, low + 0.66), Point(right - left, 0, 0), Point(0, 0, 0.035),
                         plain(Rgb(white, white, white * 0.97)), 2);
    model_.add_box(
        Point(middle, kWall - 0.09, low - 0.07), Point(0.6, 0.09, 0.018), 0,
        [](int) { return plain(Rgb(0.95, 0.94, 0.9)); }, 1.5);
    add_curtain(left - 0.3, left + 0.02, 0.35, 2.3);
    add_curtain(right - 0.02, right + 0.3, 0.35, 2.3);
    model_.add_tube([=](double v) { return Point(left - 0.4 + v * (right - left + 0.8), kWall - 0.12, 2.32); },
                    [](double) { return 0.016; }, plain(Rgb(0.45, 0.28, 0.15)), 1.5);
  }

  void add_curtain(double left, double right, double low, double high) {
    const auto fold = [](double u) { return std::cos(2 * kPi * 3.5 * u); };
    const SheetShape shape = [=](double u, double v) {
      const double gathered = 1 - 0.12 * std::sin(kPi * v);
      const double middle = (left + right) / 2;
      return Point(middle + (left + u * (right - left) - middle) * gathered, kWall - 0.12 - 0.025 * fold(u),
                   low + v * (high - low));
    };
    const Paint paint = [fold](double u, double v) {
      const Rgb cloth = mixed(Rgb(0.78, 0.42, 0.22), Rgb(0.86, 0.55, 0.32), v);
      const double hem = v < 0.05 ? 0.8 : 1;
      return Rgb(cloth * hem * (0.86 + 0.16 * fold(u)));
    };
    model_.add({shape, paint, 2.5, 0, {}});
  }

  void add_pictures() {
    const Paint abstract = [](double u, double v) {  // a sun over waves
      const double r = std::hypot(u - 0.62, (v - 0.62) * 1.2);
      Rgb color = mixed(Rgb(0.95, 0.8, 0.55), Rgb(0.93, 0.55, 0.4), v);
      if (r < 0.2) color = Rgb(0.98, 0.93, 0.75);
      for (int i = 0; i < 3; ++i)
        if (v < 0.42 - 0.12 * i + 0.05 * std::sin(9 * u + 2 * i))
          color = mixed(Rgb(0.2, 0.5, 0.62), Rgb(0.08, 0.22, 0.4), i / 2.0);
      return color;
    };
    add_framed(0.02, 0.5, 1.62, 2.22, 0.035, Rgb(0.2, 0.14, 0.1), abstract, 3, 0.04);
    const Paint blocks = [](double u, double v) {
      if (std::abs(u - 0.36) < 0.02 || std::abs(v - 0.55) < 0.025 || (u > 0.36 && std::abs(v - 0.24) < 0.025))
        return Rgb(0.1, 0.1, 0.1);
      if (u < 0.36) return v > 0.55 ? Rgb(0.95, 0.94, 0.9) : Rgb(0.15, 0.32, 0.7);
      if (v > 0.55) return Rgb(0.85, 0.2, 0.16);
      return v > 0.24 ? Rgb(0.95, 0.94, 0.9) : Rgb(0.95, 0.78, 0.2);
    };
    add_framed(0.98, 1.42, 1.98, 2.36, 0.03, Rgb(0.85, 0.83, 0.78), blocks, 3, 0.04);
  }

  void add_bookcase() {
    constexpr double kLeft = 0.72, kRight = 1.72, kDepth = 0.3, kTop = 1.78, kBoard = 0.028;
    const double front = kWall - kDepth - 0.02;
    const Rgb oak(0.5, 0.32, 0.19);
    const auto board = [&](double x0, double x1, double z0, double z1) {
      model_.add_box(
          Point((x0 + x1) / 2, front + kDepth / 2, (z0 + z1) / 2), Point((x1 - x0) / 2, kDepth / 2, (z1 - z0) / 2), 0,
          [&](int) { return wood(oak, x1 - x0 + z1 - z0, kDepth); }, 1.2);
    };
    board(kLeft, kLeft + kBoard, 0, kTop);
    board(kRight - kBoard, kRight, 0, kTop);
    constexpr int kShelves = 5;
    constexpr double kStep = (kTop - kBoard) / kShelves;
    for (int i = 0; i <= kShelves; ++i) board(kLeft + kBoard, kRight - kBoard, i * kStep, i * kStep + kBoard);
    model_.add_rectangle(Point(kLeft, kWall - 0.03, 0), Point(kRight - kLeft, 0, 0), Point(0, 0, kTop),
                         plain(oak * 0.45), 0.8);
    for (int i = 0; i < kShelves; ++i)
      add_books(kLeft + kBoard + 0.01, kRight - kBoard - 0.01, front, i * kStep + kBoard, kStep - kBoard);
  }

  void add_books(double left, double right, double front, double ground, double room) {
    const std::array<Rgb, 10> covers = {
        Rgb(0.72, 0.2, 0.17),  Rgb(0.16, 0.32, 0.55), Rgb(0.2, 0.45, 0.3),  Rgb(0.88, 0.7, 0.25), Rgb(0.85, 0.82, 0.74),
        Rgb(0.42, 0.22, 0.42), Rgb(0.12, 0.13, 0.17), Rgb(0.82, 0.44, 0.2), Rgb(0.3, 0.6, 0.65),  Rgb(0.55, 0.3, 0.2)};
    double x = left;
    while (x < right - 0.03) {
      const double width = std::min(right - x, 0.035 + 0.045 * random_.uniform());
      const double height = room * (0.62 + 0.28 * random_.uniform()), back = 0.02 + 0.05 * random_.uniform();
      if (random_.uniform() < 0.1) {  // a gap
        x += width * 1.5;
        continue;
      }
      const Rgb cover = varied(covers[random_.below(covers.size())], 0.1);
      const Rgb title = cover.sum() > 1.5 ? Rgb(0.25, 0.18, 0.14) : Rgb(0.9, 0.82, 0.6);
      const double label = 0.55 + 0.25 * random_.uniform();
      const Paint spine = [cover, title, label](double u, double v) {
        const double round = 1 - 0.25 * std::pow(2 * u - 1, 4);
        const bool is_title = std::abs(v - label) < 0.09 || std::abs(v - 0.12) < 0.025;
        return Rgb((is_title ? title : cover) * round);
      };
      const Point corner(x + 0.002, front + back, ground);
      model_.add_rectangle(corner, Point(width - 0.004, 0, 0), Point(0, 0, height), spine, 3);
      model_.add_rectangle(corner + Point(0, 0, height), Point(width - 0.004, 0, 0), Point(0, 0.2, 0),
                           plain(Rgb(0.85, 0.81, 0.72)), 0.6);
      x += width;
    }
  }

  void add_plant(const Point& foot) {
    const auto pot = [](double v) { return Vector2<double>(0.13 + 0.05 * v + (v > 0.86 ? 0.02 : 0), 0.32 * v); };
    const Paint clay = [](double u, double v) {
      const bool zigzag = std::abs(v - 0.5 - 0.12 * (std::abs(std::remainder(u * 9, 1.0)) * 4 - 1)) < 0.07;
      return zigzag ? Rgb(0.93, 0.86, 0.72) : Rgb(0.72, 0.38, 0.24);
    };
    model_.add_revolution(foot, pot, clay, 2);
    model_.add_revolution(
        foot + Point(0, 0, 0.29), [](double v) { return Vector2<double>(0.17 * (1 - v), 0.01 * v); },
        plain(Rgb(0.2, 0.14, 0.1)), 1);
    constexpr int kLeaves = 26;
    for (int i = 0; i < kLeaves; ++i) {
      const double turn = 2.399963 * i + 0.4 * random_.uniform();  // golden angle
      const double rise = 1 - double(i) / kLeaves, length = 0.42 + 0.5 * rise + 0.12 * random_.uniform();
      const double lean = 0.95 - 0.75 * rise + 0.15 * random_.uniform();
      const double width = 0.055 + 0.03 * random_.uniform();
      const Point out(std::cos(turn), std::sin(turn), 0), side(-std::sin(turn), std::cos(turn), 0), up(0, 0, 1);
      const SheetShape leaf = [=](double u, double v) {
        const double reach = lean * v + 0.45 * lean * v * v, climb = v * (1.15 - 0.55 * lean * v);
        const double across = (2 * u - 1) * width * (0.12 + std::pow(std::sin(kPi * std::pow(v, 0.75)), 0.9));
        return Point(foot + Point(0, 0, 0.28) + length * (reach * out * 0.75 + climb * up) + across * side +
                     0.35 * std::abs(across) * up);
      };
      const Rgb green = varied(mixed(Rgb(0.16, 0.42, 0.17), Rgb(0.38, 0.62, 0.24), random_.uniform()), 0.1);
      const Paint paint = [green](double u, double v) {
        const double vein = std::exp(-std::pow((u - 0.5) / 0.09, 2));
        return mixed(Rgb(green * (0.75 + 0.35 * v)), Rgb(0.68, 0.8, 0.45), 0.6 * vein);
      };
      model_.add({leaf, paint, 3, 0.04, {}});
    }
  }

  void add_table() {
    const Vector2<double> half = kTableHalf;
    const Rgb pine(0.84, 0.65, 0.43);
    const double turn = plan_.table_turn, thick = 0.016;
    const Point top = plan_.table_top;
    const Matrix3<double> axes = so3_exp(Vector3<double>(0, 0, turn));
    model_.add_box(
        top - Point(0, 0, thick), Point(half[0], half[1], thick), turn,
        [&](int face) {
          return wood(face == 5 ? pine : Rgb(pine * 0.94), 2 * half[0], face == 5 ? 2 * half[1] : 2 * thick);
        },
        2.5, 0.08, true);
    const double leg = 0.021, height = top.z() - 2 * thick;
    for (const double sx : {-1.0, 1.0})
      for (const double sy : {-1.0, 1.0}) {
        const Point at = top + axes * Point(sx * (half[0] - 0.05), sy * (half[1] - 0.05), 0);
        model_.add_box(
            Point(at.x(), at.y(), height / 2), Point(leg, leg, height / 2), turn,
            [&](int) { return wood(pine * 0.9, 2 * leg, height); }, 1.5);
      }
    for (const double side : {-1.0, 1.0}) {  // aprons
      const Point middle = top + axes * Point(0, side * (half[1] - 0.05), 0);
      model_.add_box(
          Point(middle.x(), middle.y(), height - 0.03), Point(half[0] - 0.06, 0.01, 0.03), turn,
          [&](int) { return wood(pine * 0.88, 2 * half[0], 0.08); }, 1.5);
    }
  }

  static inline const Vector2<double> kRugHalf{1.05, 0.75};

  RoomPlan plan_;
  RandomSequence random_;
  SmoothNoise noise_;
  SurfaceModel model_;
};

double room_light(const RoomPlan& plan, const Point& p, const Point& normal) {
  double light = faced_light(normal) * corner_light(p);
  if (p.z() < 0.02) {
    light *= shadow(p, plan.table_top.head<2>(), kTableHalf, plan.table_turn, 0.38);
    light *= shadow(p, {1.22, 1.82}, {0.5, 0.15}, 0, 0.35) * shadow(p, {-1.5, 1.45}, {0.15, 0.15}, 0, 0.45);
  } else if (p.z() < plan.table_top.z() - 0.02) {
    light *= shadow(p, plan.table_top.head<2>(), kTableHalf, plan.table_turn, 0.12);
  }
  return light;
}

void add_can(SurfaceModel& model) {
  constexpr double kRadius = 0.088, kHeight = 0.17;
  const Paint enamel = [](double u, double v) {
    const Rgb teal(0.08, 0.5, 0.52), yellow(0.97, 0.79, 0.2), cream(0.97, 0.94, 0.85);
    if (v < 0.07 || v > 0.93) return yellow;
    const double petals = 6;  // daisies all around
    const double around = u * petals, x = (around - std::floor(around) - 0.5) * 2 * kPi * kRadius / petals;
    const double y = (v - 0.5) * kHeight, r = std::hypot(x, y), angle = std::atan2(y, x);
    if (r < 0.011) return yellow;
    return r < 0.03 + 0.007 * std::cos(6 * angle) ? cream : teal;
  };
  const auto body = [](double v) { return Vector2<double>(kRadius * (1.08 - 0.16 * v), kHeight * v); };
  model.add_revolution(Point::Zero(), body, enamel, 1.2, 0.1);
  model.add_revolution(
      Point(0, 0, kHeight),
      [](double v) { return Vector2<double>(kRadius * 0.92 * (1 - v), 0.03 * std::sin(v * kPi / 2)); },
      plain(Rgb(0.06, 0.4, 0.43)), 1, 0.1);
  model.add_revolution(
      Point::Zero(), [](double v) { return Vector2<double>(kRadius * 1.08 * v, 0); }, plain(Rgb(0.05, 0.3, 0.33)), 0.5);
  const auto spout = [](double v) { return Point(0.075 + 0.135 * v, 0, 0.035 + 0.16 * v + 0.02 * v * v); };
  model.add_tube(
      spout, [](double v) { return 0.021 - 0.008 * v; }, plain(Rgb(0.08, 0.5, 0.52)), 1, 0.1);
  const Point end = spout(1), along = (spout(1) - spout(0.95)).normalized();
  const auto rose = [=](double v) { return Point(end + 0.035 * v * along); };
  model.add_tube(
      rose, [](double v) { return 0.013 + 0.024 * v; }, plain(Rgb(0.97, 0.79, 0.2)), 1, 0.1);
  model.add_tube([=](double v) { return Point(rose(1) + 0.002 * v * along); },
                 [](double v) { return 0.037 * (1.001 - v); }, plain(Rgb(0.6, 0.45, 0.12)), 1);
  const auto handle = [](double v) {
    const double angle = kPi * (1.12 - 1.12 * v) + 0.02;
    return Point(0.085 * std::cos(angle), 0, 0.165 + 0.105 * std::sin(angle));
  };
  model.add_tube(
      handle, [](double) { return 0.011; }, plain(Rgb(0.97, 0.79, 0.2)), 1.2, 0.1);
}

void add_striped_box(SurfaceModel& model) {
  const Point half(0.15, 0.11, 0.1);
  const std::array<Rgb, 6> tints = {Rgb(0.85, 0.3, 0.22), Rgb(0.2, 0.45, 0.75), Rgb(0.93, 0.75, 0.25),
                                    Rgb(0.3, 0.62, 0.38), Rgb(0.55, 0.4, 0.28), Rgb(0.75, 0.58, 0.4)};
  model.add_box(
      Point(0, 0, half.z()), half, 0,
      [&](int face) {
        const Rgb tint = tints[static_cast<std::size_t>(face)];
        return [tint, face](double u, double v) {
          const double along = face == 5 ? v * 4 : (face % 2 == 0 ? u + v : u - v) * 4;
          return along - std::floor(along) < 0.5 ? tint : Rgb(0.82, 0.68, 0.5);
        };
      },
      1, 0, true);
  const auto handle = [=](double v) { return Point(0.1 * (2 * v - 1), 0, 0.2 + 0.06 * std::sin(kPi * v)); };
  model.add_tube(
      handle, [](double) { return 0.011; }, plain(Rgb(0.25, 0.2, 0.18)), 1.2);
}

}  // namespace

Gaussians synthetic_room(Index most, const RoomPlan& plan, std::uint64_t seed) {
  const RoomBuilder room(plan, seed);
  return room.model().covered(
      most, [&](const Point& p, const Point& normal) { return room_light(plan, p, normal); }, seed);
}

SyntheticObject synthetic_object(SyntheticObjectKind kind, Index most, std::uint64_t seed) {
  SurfaceModel model;
  const bool is_can = kind == SyntheticObjectKind::kWateringCan;
  if (is_can) {
    add_can(model);
  } else {
    add_striped_box(model);
  }
  SyntheticObject object;
  object.name = choice_name<SyntheticObjectKind>(kSyntheticObjectKinds, kind);
  object.gaussians = model.covered(
      most, [](const Point&, const Point& normal) { return faced_light(normal); }, seed);
  std::vector<float>& means = object.gaussians.means;
  Point sum = Point::Zero();
  for (std::size_t i = 0; i < means.size(); ++i) sum[Eigen::Index(i % 3)] += double(means[i]);
  const Point centroid = sum / double(object.gaussians.count());
  for (std::size_t i = 0; i < means.size(); ++i)
    means[i] = static_cast<float>(double(means[i]) - centroid[Eigen::Index(i % 3)]);
  object.grip = Point(0, 0, is_can ? 0.27 : 0.26) - centroid;
  object.above_ground = centroid.z();
  return object;
}

}  // namespace hsi4d
