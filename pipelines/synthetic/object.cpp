#include "pipelines/synthetic/object.h"

#include <algorithm>
#include <cmath>

#include "core/angles.h"
#include "core/check.h"
#include "core/log.h"
#include "core/rotation.h"
#include "pipelines/input/clip.h"
#include "pipelines/synthetic/kit.h"
#include "pipelines/synthetic/object_shapes.h"
#include "splat/files/splat_file.h"
#include "splat/files/transform.h"

namespace hsi4d {
namespace {

using namespace detail;

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

void add_vase(SurfaceModel& model) {
  constexpr double kHeight = 0.34;
  const auto radius = [](double v) {
    return 0.055 + 0.05 * std::sin(kPi * std::pow(v, 0.8)) * (1 - 0.35 * v) + 0.018 * std::pow(v, 8.0);
  };
  const Paint glaze = [](double u, double v) {
    const Rgb white(0.93, 0.93, 0.9), blue(0.12, 0.22, 0.58), pale(0.45, 0.58, 0.82);
    if (v < 0.05 || v > 0.95 || std::abs(v - 0.74) < 0.012 || std::abs(v - 0.16) < 0.012) return blue;
    if (v > 0.76) {  // a border of waves below the rim
      const double wave = 0.855 + 0.045 * std::sin(2 * kPi * 8 * u);
      return std::abs(v - wave) < 0.022 ? blue : white;
    }
    if (v < 0.16) return std::abs(std::remainder(u * 16, 1.0)) < 0.22 ? blue : white;
    const double x = std::remainder(u * 4, 1.0) * 4, y = (v - 0.45) * 7.5;  // four flowers
    const double r = std::hypot(x, y), angle = std::atan2(y, x);
    if (r < 0.22) return Rgb(0.9, 0.72, 0.2);
    if (r < 0.78 + 0.26 * std::cos(5 * angle)) return r < 0.5 ? pale : blue;
    const double stem = std::abs(std::remainder(u * 4 + 0.5, 1.0)) * 4;
    return stem < 0.12 + 0.3 * std::max(0.0, std::sin(9 * y)) ? pale : white;
  };
  model.add_revolution(
      Point::Zero(), [=](double v) { return Vector2<double>(radius(v), kHeight * v); }, glaze, 1.2, 0.12);
  const SheetShape inside = [=](double u, double v) {  // seen over the rim
    const double r = radius(1 - 0.4 * v) - 0.004, angle = -2 * kPi * u;
    return Point(r * std::cos(angle), r * std::sin(angle), kHeight * (1 - 0.4 * v));
  };
  model.add({inside, plain(Rgb(0.3, 0.33, 0.42)), 0.5});
  model.add_revolution(
      Point::Zero(), [=](double v) { return Vector2<double>(radius(0) * v, 0.002); }, plain(Rgb(0.35, 0.33, 0.3)), 0.4);
}

/// Half the width of a guitar's body at a height.
double guitar_half(double z) {
  const auto blend = [](double from, double to, double t) { return from + (to - from) * (1 - std::cos(kPi * t)) / 2; };
  if (z < 0.15) return 0.19 * std::sqrt(std::max(0.0, 1 - std::pow((0.15 - z) / 0.15, 2)));
  if (z < 0.29) return blend(0.19, 0.118, (z - 0.15) / 0.14);
  if (z < 0.39) return blend(0.118, 0.142, (z - 0.29) / 0.1);
  return 0.142 * std::sqrt(std::max(0.0, 1 - std::pow((z - 0.39) / 0.09, 2)));
}

void add_guitar(SurfaceModel& model) {
  constexpr double kBody = 0.48, kDeep = 0.05;
  const Rgb spruce(0.9, 0.66, 0.34), mahogany(0.45, 0.2, 0.11), ebony(0.13, 0.1, 0.09), ivory(0.92, 0.88, 0.76);
  const Paint top = [=](double u, double v) {
    const double half = guitar_half(v * kBody), y = (2 * u - 1) * half, z = v * kBody;
    const double hole = std::hypot(y, z - 0.325);
    if (hole < 0.043) return Rgb(0.09, 0.06, 0.05);
    if (hole < 0.056) return std::abs(std::remainder(std::atan2(y, z - 0.325) * 8, 2.0)) < 0.5 ? ivory : ebony;
    if (std::abs(z - 0.155) < 0.013 && std::abs(y) < 0.085) return ebony;  // the bridge
    if (half - std::abs(y) < 0.012 || z < 0.012) return ivory;
    if (y < -0.03 && y > -0.1 && std::abs(z - 0.245) < 0.055 + 0.3 * (y + 0.03)) return Rgb(0.32, 0.1, 0.08);
    const double grain = 0.05 * std::sin(170 * y) + 0.05 * std::sin(37 * y + 1);
    const double burst = 1 - 0.35 * ramp(0.55, 1, std::hypot(std::abs(y) / 0.19, (z - 0.2) / 0.3));
    return Rgb(spruce * (burst + grain));
  };
  const Paint back = [=](double u, double v) {
    const double y = (2 * u - 1) * guitar_half(v * kBody);
    if (std::abs(y) < 0.006) return ivory;
    return Rgb(mahogany * (1 + 0.1 * std::sin(60 * y) + 0.06 * std::sin(23 * v)));
  };
  const Paint band = [=](double u, double) { return std::abs(u - 0.5) > 0.42 ? ivory : mahogany; };
  model.add({[=](double u, double v) { return Point(kDeep, (2 * u - 1) * guitar_half(v * kBody), v * kBody); }, top,
             1.2, 0.08});
  model.add({[=](double u, double v) { return Point(-kDeep, (1 - 2 * u) * guitar_half(v * kBody), v * kBody); }, back,
             0.7, 0.08});
  for (const double side : {1.0, -1.0}) {
    model.add({[=](double u, double v) {
                 return Point(side * (1 - 2 * u) * kDeep, side * guitar_half(v * kBody), v * kBody);
               },
               band, 0.8, 0.05});
  }
  const Paint fret_board = [=](double, double v) {
    return std::abs(std::remainder(v * 17, 1.0)) < 0.09 ? Rgb(0.75, 0.7, 0.55) : ebony;
  };
  model.add_box(Point(0.045, 0, 0.64), Point(0.016, 0.026, 0.24), 0,
                [&](int face) { return face == 1 ? fret_board : plain(mahogany * 1.15); });
  const Paint head = [=](double u, double v) {
    const bool peg = std::abs(u - 0.5) > 0.24 && std::abs(std::remainder(v * 3 - 0.5, 1.0)) < 0.16;
    return peg ? Rgb(0.85, 0.82, 0.75) : ebony;
  };
  model.add_box(Point(0.035, 0, 0.955), Point(0.011, 0.036, 0.085), 0,
                [&](int face) { return face == 1 ? head : plain(mahogany); });
  for (int i = 0; i < 3; ++i)
    for (const double side : {-1.0, 1.0})
      model.add_box(
          Point(0.035, side * 0.047, 0.905 + 0.05 * i), Point(0.006, 0.011, 0.007), 0,
          [&](int) { return plain(ivory * 0.92); }, 1, 0, true);
  for (const double y : {-0.014, 0.0, 0.014})
    model.add_tube([=](double v) { return Point(0.063, y, 0.16 + 0.74 * v); }, [](double) { return 0.0018; },
                   plain(Rgb(0.8, 0.76, 0.66)), 0.8);
}

void add_cushion(SurfaceModel& model, const Point& center, const Point& half, const Rgb& cloth) {
  const Paint weave = [cloth](double u, double v) {
    const double rim = ramp(0, 0.07, std::min({u, 1 - u, v, 1 - v}));
    const bool is_dot = std::abs(std::remainder(u * 9, 1.0)) < 0.17 && std::abs(std::remainder(v * 9, 1.0)) < 0.17;
    return Rgb((is_dot ? Rgb(cloth * 1.5) : cloth) * (0.72 + 0.28 * rim));
  };
  // a box with round corners: |x/a|^4 + |y/b|^4 + |z/c|^4 = 1
  const auto rounded = [=](const Point& d) {
    const double n = std::pow(std::abs(d.x()), 4) + std::pow(std::abs(d.y()), 4) + std::pow(std::abs(d.z()), 4);
    return Point(center + (d * std::pow(n, -0.25)).cwiseProduct(half));
  };
  for (int axis = 0; axis < 3; ++axis)
    for (const double sign : {1.0, -1.0})
      model.add({[=](double u, double v) {
                   Point d;
                   d[axis] = sign;
                   d[(axis + 1) % 3] = sign * (2 * u - 1);
                   d[(axis + 2) % 3] = 2 * v - 1;
                   return rounded(d);
                 },
                 weave, 1});
}

void add_office_chair(SurfaceModel& model) {
  const Rgb cloth(0.16, 0.34, 0.5), plastic(0.13, 0.13, 0.14), steel(0.62, 0.63, 0.66);
  add_cushion(model, Point(0, 0, kChairSeat - 0.035), Point(0.24, 0.24, 0.04), cloth);
  add_cushion(model, Point(-kChairBack, 0, 0.735), Point(0.035, 0.215, 0.2), cloth);
  const auto bar = [&](const Point& a, const Point& b, double radius, const Rgb& color) {
    model.add_tube([=](double v) { return Point(a + v * (b - a)); }, [=](double) { return radius; }, plain(color), 0.7,
                   0.05);
  };
  bar(Point(0, 0, 0.1), Point(0, 0, 0.39), 0.027, steel);
  bar(Point(-0.12, 0, 0.4), Point(-kChairBack - 0.045, 0, 0.42), 0.022, plastic);
  bar(Point(-kChairBack - 0.045, 0, 0.4), Point(-kChairBack - 0.03, 0, 0.72), 0.02, plastic);
  for (int i = 0; i < 5; ++i) {
    const double angle = 2 * kPi * (i + 0.5) / 5;
    const Point out(std::cos(angle), std::sin(angle), 0);
    model.add_tube([=](double v) { return Point(0.3 * v * out + Point(0, 0, 0.115 - 0.05 * v)); },
                   [](double v) { return 0.026 - 0.008 * v; }, plain(plastic), 0.7);
    const Point wheel = 0.29 * out + Point(0, 0, 0.002);
    model.add_revolution(
        wheel,
        [](double v) { return Vector2<double>(0.028 * std::sin(kPi * v) + 1e-4, 0.028 * (1 - std::cos(kPi * v))); },
        plain(Rgb(0.07, 0.07, 0.08)), 0.7);
  }
  for (const double side : {-1.0, 1.0}) {  // arm rests
    bar(Point(-0.1, side * 0.255, 0.42), Point(-0.06, side * 0.27, 0.64), 0.014, plastic);
    model.add_box(
        Point(-0.03, side * 0.27, 0.65), Point(0.11, 0.028, 0.013), 0, [&](int) { return plain(plastic * 1.2); }, 0.8,
        0, true);
  }
}

/// How a kind of object is held, in coordinates whose origin is on the ground below its middle.
struct Hold {
  Point grip;
  std::array<std::optional<HandGrip>, 2> hands;
  Point carried;
  bool on_floor;
};

/// Both hands over a bar that runs along y: thumbs inwards. @param fingers  where stretched ones would point
Hold held_bar(const Point& middle, double half, const Point& fingers, const Point& carried) {
  return {middle,
          {HandGrip{middle + Point(0, half, 0), -Point::UnitY(), fingers},
           HandGrip{middle - Point(0, half, 0), Point::UnitY(), fingers}},
          carried,
          true};
}

Hold hold_of(SyntheticObjectKind kind) {
  const double inward = 15 * kDegree;
  const auto handle = [&](const Point& grip, double forward) {  // runs along x: the hand points down over it
    const HandGrip right{grip, Point::UnitX(), std::sin(inward) * Point::UnitY() - std::cos(inward) * Point::UnitZ()};
    return Hold{grip, {std::nullopt, right}, Point(-0.2, forward, 0.98), false};
  };
  switch (kind) {
    case SyntheticObjectKind::kBox:
      return handle(Point(0, 0, 0.26), 0.33);
    case SyntheticObjectKind::kVase: {  // both palms on its sides
      const Point up = Point::UnitZ(), ahead = Point::UnitX();
      const double radius = 0.075, height = 0.16;
      return {Point(0, 0, height),
              {HandGrip{Point(-0.02, radius, height), up, ahead}, HandGrip{Point(-0.02, -radius, height), up, ahead}},
              Point(-0.03, 0.31, 1.1),
              false};
    }
    case SyntheticObjectKind::kGuitar: {  // the fist around its neck
      const Point neck(0.045, 0, 0.6);
      return {neck, {std::nullopt, HandGrip{neck, Point::UnitZ(), Point::UnitX()}}, Point(-0.27, 0.31, 0.98), true};
    }
    case SyntheticObjectKind::kOfficeChair: {  // palms down on its back
      const Point top(-kChairBack, 0, 0.935), ahead = Point(0.9, 0, -std::sqrt(1 - 0.81));
      return {top,
              {HandGrip{top + Point(0, 0.15, 0), -Point::UnitY(), ahead},
               HandGrip{top - Point(0, 0.15, 0), Point::UnitY(), ahead}},
              Point(0, 0.44, 0.935),
              true};
    }
    case SyntheticObjectKind::kBarbell:
      return held_bar(Point(0, 0, kBarbellHeight), 0.26, -Point::UnitZ(), Point(0, 0.2, 0.8));
    case SyntheticObjectKind::kShoppingCart:
      return held_bar(Point(kCartHandle[0], 0, kCartHandle[1]), 0.17, Point(0.9, 0, -std::sqrt(1 - 0.81)),
                      Point(0, 0.42, kCartHandle[1]));
    case SyntheticObjectKind::kMower:
      return held_bar(Point(kMowerHandle[0], 0, kMowerHandle[1]), 0.15, Point(0.9, 0, -std::sqrt(1 - 0.81)),
                      Point(0, 0.42, kMowerHandle[1]));
    case SyntheticObjectKind::kGate: {  // the fist around its upright handle
      const Point bar(kGateHandle[0], kGateHandle[1], kGateHandle[2]);
      return {bar, {std::nullopt, HandGrip{bar, Point::UnitZ(), Point::UnitX()}}, Point::Zero(), true};
    }
    case SyntheticObjectKind::kWateringCan:
    case SyntheticObjectKind::kNone:
      break;
  }
  return handle(Point(0, 0, 0.27), 0.3);
}

void add_kind(SurfaceModel& model, SyntheticObjectKind kind) {
  switch (kind) {
    case SyntheticObjectKind::kWateringCan:
      return add_can(model);
    case SyntheticObjectKind::kBox:
      return add_striped_box(model);
    case SyntheticObjectKind::kVase:
      return add_vase(model);
    case SyntheticObjectKind::kGuitar:
      return add_guitar(model);
    case SyntheticObjectKind::kOfficeChair:
      return add_office_chair(model);
    case SyntheticObjectKind::kBarbell:
      return add_barbell(model);
    case SyntheticObjectKind::kShoppingCart:
      return add_shopping_cart(model);
    case SyntheticObjectKind::kMower:
      return add_mower(model);
    case SyntheticObjectKind::kGate:
      return add_gate(model);
    case SyntheticObjectKind::kNone:
      break;
  }
}

/// Moves the Gaussians so that the mean of their centres is the origin; returns where it was.
Point moved_to_centroid(Gaussians& gaussians) {
  std::vector<float>& means = gaussians.means;
  Point sum = Point::Zero();
  for (std::size_t i = 0; i < means.size(); ++i) sum[Eigen::Index(i % 3)] += double(means[i]);
  const Point centroid = sum / double(gaussians.count());
  for (std::size_t i = 0; i < means.size(); ++i)
    means[i] = static_cast<float>(double(means[i]) - centroid[Eigen::Index(i % 3)]);
  return centroid;
}

/// The object of Gaussians that stand on z = 0 and are held as `hold` says.
SyntheticObject object_of(std::string name, Gaussians gaussians, const Hold& hold, SyntheticObjectKind kind) {
  SyntheticObject object;
  object.name = std::move(name);
  object.gaussians = std::move(gaussians);
  const Point centroid = moved_to_centroid(object.gaussians);
  object.grip = hold.grip - centroid;
  object.hands = hold.hands;
  for (auto& hand : object.hands)
    if (hand) hand->point -= centroid;
  object.above_ground = centroid.z();
  object.carried = hold.carried;
  object.on_floor = hold.on_floor;
  if (kind == SyntheticObjectKind::kGate) object.hinge = Point(0, kGateHinge, 0) - centroid;
  object.is_heavy = kind == SyntheticObjectKind::kBarbell;
  object.is_long = kind == SyntheticObjectKind::kShoppingCart || kind == SyntheticObjectKind::kMower;
  return object;
}

/// The box that holds all but the outermost hundredth of the means on every side.
std::array<Point, 2> bulk_of(const Gaussians& gaussians) {
  std::array<Point, 2> corners;
  std::vector<float> values;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    values.clear();
    for (std::size_t i = axis; i < gaussians.means.size(); i += 3) values.push_back(gaussians.means[i]);
    std::sort(values.begin(), values.end());
    const std::size_t cut = values.size() / 100;
    corners[0][Eigen::Index(axis)] = double(values[cut]);
    corners[1][Eigen::Index(axis)] = double(values[values.size() - 1 - cut]);
  }
  return corners;
}

/// The Gaussians of object_file on z = 0, turned and scaled, and where they are held.
SyntheticObject object_of_file(const SyntheticSettings& settings) {
  const std::string path = settings.object_file.string(), name = settings.object_file.stem().string();
  if (name == kHumanMasks)
    throw UserError(path + ": an object is called by its file's name, and masks of \"" + name +
                    "\" are those of the person; rename the file");
  SplatFile file = read_splats_with_warnings(path);
  if (file.report.antialiased)
    log_warning(path +
                ": its Gaussians were trained with antialiasing, which the dataset's files cannot say; "
                "render.antialias=true draws them as they were trained");
  if (file.gaussians.count() == 0) throw DataError(path + ": holds no Gaussians that can be used");
  Similarity placed;
  placed.scale = settings.object_scale;
  placed.rotation = so3_exp(Point(0, 0, settings.object_turn_deg * kDegree));
  Gaussians gaussians = transformed(file.gaussians, placed);
  const Point origin = gaussians.origin_world;
  gaussians.origin_world.setZero();
  const auto [low, high] = bulk_of(gaussians);
  const Point base((low.x() + high.x()) / 2, (low.y() + high.y()) / 2, low.z());
  for (std::size_t i = 0; i < gaussians.means.size(); ++i)
    gaussians.means[i] = static_cast<float>(double(gaussians.means[i]) - base[Eigen::Index(i % 3)]);
  Point grip(0, 0, high.z() - low.z());
  if (settings.object_grip.size() == 3)
    grip = transform_point(placed, Point(settings.object_grip.data())) - origin - base;
  Hold hold = hold_of(settings.object);
  for (auto& hand : hold.hands)
    if (hand) hand->point += grip - hold.grip;
  hold.grip = grip;
  SyntheticObject object = object_of(name, std::move(gaussians), hold, settings.object);
  object.has_normals = false;
  return object;
}

}  // namespace

SyntheticObject synthetic_object(SyntheticObjectKind kind, Index most, std::uint64_t seed) {
  SyntheticObject none;
  none.name = choice_name<SyntheticObjectKind>(kSyntheticObjectKinds, kind);
  if (kind == SyntheticObjectKind::kNone) return none;
  SurfaceModel model;
  add_kind(model, kind);
  return object_of(none.name,
                   model.covered(
                       most, [](const Point&, const Point& normal) { return faced_light(normal); }, seed),
                   hold_of(kind), kind);
}

SyntheticObject synthetic_object(const SyntheticSettings& settings) {
  if (!settings.object_file.empty()) return object_of_file(settings);
  return synthetic_object(settings.object, settings.object_gaussians, static_cast<std::uint64_t>(settings.seed));
}

const char* object_summary(SyntheticObjectKind kind) {
  switch (kind) {
    case SyntheticObjectKind::kWateringCan:
      return "a watering can, held by its handle";
    case SyntheticObjectKind::kBox:
      return "a striped box, held by its handle";
    case SyntheticObjectKind::kVase:
      return "a painted vase, held in both hands";
    case SyntheticObjectKind::kGuitar:
      return "a guitar, held by its neck";
    case SyntheticObjectKind::kOfficeChair:
      return "an office chair on castors";
    case SyntheticObjectKind::kBarbell:
      return "a barbell with four plates, held in both hands";
    case SyntheticObjectKind::kShoppingCart:
      return "a shopping cart, pushed by its handle";
    case SyntheticObjectKind::kMower:
      return "a lawn mower with a bag, pushed by its handle";
    case SyntheticObjectKind::kGate:
      return "a garden gate on its hinge, held by its handle";
    case SyntheticObjectKind::kNone:
      break;
  }
  return "nothing: a person alone";
}

}  // namespace hsi4d
