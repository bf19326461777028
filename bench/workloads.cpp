#include "bench/workloads.h"

#include <array>
#include <cmath>

#include "core/angles.h"
#include "core/random.h"

namespace hsi4d {

namespace {

SplatView square_view(int side) {
  SplatView view;
  view.camera.width = view.camera.height = side;
  view.camera.fx = view.camera.fy = side;
  view.camera.cx = view.camera.cy = side / 2.0;
  return view;
}

/// A Gaussian before it is written down.
struct Made {
  Vector3<double> mean;
  Vector4<double> quat;
  Vector3<double> scales;
  double opacity;
  Vector3<double> color;
};

void append_gaussians(Workload& w, const Made& g) {
  for (int i = 0; i < 3; ++i) w.means.push_back(static_cast<float>(g.mean[i]));
  for (int i = 0; i < 4; ++i) w.quats.push_back(static_cast<float>(g.quat[i]));
  for (int i = 0; i < 3; ++i) w.log_scales.push_back(static_cast<float>(std::log(g.scales[i])));
  w.opacities.push_back(static_cast<float>(g.opacity));
  for (int i = 0; i < 3; ++i) w.colors.push_back(static_cast<float>(g.color[i]));
  ++w.count;
}

// --- figure ----------------------------------------------------------------------------------------------------------

struct Capsule {
  Vector3<double> from, to;  ///< metres, y down, the pelvis at the origin
  double radius;
};

/// Head, trunk, arms held off the body, legs.
const std::array<Capsule, 12>& capsules() {
  static const std::array<Capsule, 12> all = {{{{0, -0.66, 0}, {0, -0.58, 0}, 0.105},
                                               {{0, -0.45, 0}, {0, 0, 0}, 0.15},
                                               {{-0.08, -0.38, 0}, {0.08, -0.38, 0}, 0.13},
                                               {{-0.07, 0.02, 0}, {0.07, 0.02, 0}, 0.13},
                                               {{-0.2, -0.4, 0}, {-0.38, -0.17, 0}, 0.055},
                                               {{0.2, -0.4, 0}, {0.38, -0.17, 0}, 0.055},
                                               {{-0.38, -0.17, 0}, {-0.52, 0.06, 0.05}, 0.045},
                                               {{0.38, -0.17, 0}, {0.52, 0.06, 0.05}, 0.045},
                                               {{-0.1, 0.08, 0}, {-0.14, 0.47, 0}, 0.085},
                                               {{0.1, 0.08, 0}, {0.14, 0.47, 0}, 0.085},
                                               {{-0.14, 0.47, 0}, {-0.17, 0.87, 0.02}, 0.06},
                                               {{0.14, 0.47, 0}, {0.17, 0.87, 0.02}, 0.06}}};
  return all;
}

/// The rotation that takes z to `normal`, then a turn about it.
Vector4<double> facing(const Vector3<double>& normal, double turn) {
  Vector4<double> lift(1 + normal[2], -normal[1], normal[0], 0);
  lift = lift.norm() > 1e-6 ? Vector4<double>(lift / lift.norm()) : Vector4<double>(0, 1, 0, 0);
  const double c = std::cos(turn / 2), s = std::sin(turn / 2);
  return {lift[0] * c - lift[3] * s, lift[1] * c + lift[2] * s, lift[2] * c - lift[1] * s, lift[3] * c + lift[0] * s};
}

Made on_capsule(const Capsule& capsule, RandomSequence& random, double size) {
  const Vector3<double> axis = capsule.to - capsule.from;
  const double length = axis.norm();
  const double z = random.uniform(-capsule.radius, length + capsule.radius), angle = random.uniform(0.0, 2 * kPi);
  const double held = std::min(std::max(z, 0.0), length), beyond = z - held;
  const double around = std::sqrt(std::max(0.0, capsule.radius * capsule.radius - beyond * beyond));
  const Vector3<double> forward = axis / length, side = cross(forward, Vector3<double>(0, 0, 1)).normalized();
  const Vector3<double> up = cross(side, forward);
  const Vector3<double> out = forward * beyond + side * (around * std::cos(angle)) + up * (around * std::sin(angle));
  Made g;
  g.mean = capsule.from + forward * held + out;
  g.quat = facing(out / capsule.radius, random.uniform(0.0, 2 * kPi));
  const double s = size * std::exp(0.35 * random.normal());
  g.scales = {s * std::exp(0.3 * random.normal()), s, 0.3 * s};
  g.opacity = random.uniform(0.35, 0.98);
  for (int i = 0; i < 3; ++i) g.color[i] = 0.5 + 0.5 * std::sin(9 * g.mean[i] + 2 * i);
  return g;
}

constexpr double kFigureSize = 0.0046, kScenePixels = 2.4;  // chosen for 6.5 and 71 million fragments

/// How much larger `count` Gaussians are that cover what `usual` cover.
double enlarged(Index count, Index usual) { return std::sqrt(static_cast<double>(usual) / static_cast<double>(count)); }

/// @param scale  of the figure and its distance, so that it looks the same
void append_figure(Workload& w, Index count, double scale) {
  const Vector3<double> pelvis(0, -0.05, 2.05);
  RandomSequence random(11);
  double area = 0;
  for (const Capsule& c : capsules()) area += c.radius * ((c.to - c.from).norm() + 2 * c.radius);
  double wanted = 0;
  Index made = 0;
  for (const Capsule& c : capsules()) {
    wanted += static_cast<double>(count) * c.radius * ((c.to - c.from).norm() + 2 * c.radius) / area;
    for (; made < static_cast<Index>(std::lround(wanted)); ++made) {
      Made g = on_capsule(c, random, kFigureSize * enlarged(count, WorkloadSize().figure));
      g.mean = (g.mean + pelvis) * scale;
      g.scales *= scale;
      append_gaussians(w, g);
    }
  }
}

// --- scene -----------------------------------------------------------------------------------------------------------

/// Gaussians spread over the view and beyond its border, nearer ones rarer.
void append_scene(Workload& w, Index count) {
  const WorkloadSize usual;
  const double pixels = kScenePixels * enlarged(count, usual.scene) * w.view.camera.fx / usual.side_px;
  RandomSequence random(12);
  for (Index n = 0; n < count; ++n) {
    const double z = 2 * std::pow(6.0, std::sqrt(random.uniform())), focal = w.view.camera.fx;
    Made g;
    g.mean = {random.uniform(-0.54, 0.54) * z, random.uniform(-0.54, 0.54) * z, z};
    g.quat = random.rotation();
    const double s = pixels * z / focal * std::exp(0.5 * random.normal());
    g.scales = {s * std::exp(0.4 * random.normal()), s * std::exp(0.4 * random.normal()), 0.3 * s};
    const double u = random.uniform();
    g.opacity = 0.03 + 0.92 * u * u;
    for (int i = 0; i < 3; ++i) g.color[i] = random.uniform();
    append_gaussians(w, g);
  }
}

}  // namespace

Workload avatar_workload(const WorkloadSize& size) {
  Workload w{.name = "avatar", .view = square_view(size.side_px)};
  append_figure(w, size.figure, 1);
  w.moving_begin = 0;
  return w;
}

Workload scene_workload(const WorkloadSize& size) {
  Workload w{.name = "scene", .view = square_view(size.side_px)};
  append_scene(w, size.scene);
  w.moving_begin = w.count;
  return w;
}

Workload avatar_in_scene_workload(const WorkloadSize& size) {
  Workload w = scene_workload(size);
  w.name = "avatar_in_scene";
  append_figure(w, size.figure, 1.27);  // 2.6 m away: some of the scene is in front
  return w;
}

Workload small_workload() {
  Workload w{.name = "small", .view = square_view(512)};
  RandomSequence random(13);
  for (Index n = 0; n < 100000; ++n) {
    const double z = random.uniform(2.0, 4.0), s = std::sqrt(1 - w.view.settings.blur) * z / w.view.camera.fx;
    append_gaussians(w, {{random.uniform(-0.5, 0.5) * z, random.uniform(-0.5, 0.5) * z, z},
                         random.rotation(),
                         {s, s, s},
                         random.uniform(0.1, 0.95),
                         {random.uniform(), random.uniform(), random.uniform()}});
  }
  w.moving_begin = w.count;
  return w;
}

}  // namespace hsi4d
