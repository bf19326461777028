#include "tests/support/splat_scenes.h"

#include <cmath>
#include <limits>
#include <utility>

#include "core/random.h"

namespace hsi4d::test {
namespace {

constexpr double kY00 = 0.28209479177387814;  // the constant harmonic
using Triple = std::array<double, 3>;

/// Draws Gaussians into a scene.
class Painter {
 public:
  Painter(const std::string& name, int sh_degree, const Camera& camera, std::uint64_t seed)
      : draw_(seed, random_stream(name)) {
    scene.name = name;
    scene.sh_degree = sh_degree;
    scene.camera = camera;
    for (float& channel : scene.background) channel = static_cast<float>(between(0, 1));
  }

  double between(double low, double high) { return draw_.uniform(low, high); }
  /// Uniform in the logarithm.
  double scale_between(double low, double high) { return std::exp(between(std::log(low), std::log(high))); }
  Triple in_ball(double radius) {
    Triple p;
    do {
      for (double& x : p) x = between(-1, 1);
    } while (p[0] * p[0] + p[1] * p[1] + p[2] * p[2] > 1);
    return {radius * p[0], radius * p[1], radius * p[2]};
  }
  std::vector<Index> shuffled(Index n) { return draw_.permutation(n); }

  /// A Gaussian with a random rotation (its quaternion of this length) and random colours.
  void add(const Triple& mean, const Triple& scales, double logit, double quat_length = 1) {
    const Vector4<double> q = draw_.rotation();
    push(scene.means, mean);
    for (int i = 0; i < 4; ++i) scene.quats.push_back(static_cast<float>(quat_length * q[i]));
    push(scene.log_scales, {std::log(scales[0]), std::log(scales[1]), std::log(scales[2])});
    scene.opacity_logits.push_back(static_cast<float>(logit));
    for (int k = 0; k < scene.sh_coefficients(); ++k)
      for (int c = 0; c < 3; ++c)
        scene.sh.push_back(static_cast<float>(k == 0 ? between(-0.4, 0.4) / kY00 : 0.1 * draw_.normal()));
  }
  void add_in_ball(double quat_length = 1) {
    add(in_ball(1.6), {scale_between(0.03, 0.5), scale_between(0.03, 0.5), scale_between(0.03, 0.5)}, between(-3, 3),
        quat_length);
  }

  SplatScene scene;

 private:
  static void push(std::vector<float>& to, const Triple& numbers) {
    for (const double x : numbers) to.push_back(static_cast<float>(x));
  }

  RandomSequence draw_;
};

}  // namespace

Gaussians SplatScene::gaussians() const {
  Gaussians g;
  g.sh_degree = sh_degree;
  g.means = means;
  g.quats = quats;
  g.log_scales = log_scales;
  g.opacity_logits = opacity_logits;
  g.sh = sh;
  return g;
}

void SplatScene::add(const std::array<double, 3>& mean, double scale, double opacity_logit,
                     const std::array<double, 3>& color) {
  for (const double x : mean) means.push_back(static_cast<float>(x));
  quats.insert(quats.end(), {1, 0, 0, 0});
  for (int i = 0; i < 3; ++i) log_scales.push_back(static_cast<float>(std::log(scale)));
  opacity_logits.push_back(static_cast<float>(opacity_logit));
  for (const double c : color) sh.push_back(static_cast<float>((c - 0.5) / kY00));
  sh.resize(sh.size() + static_cast<std::size_t>(3 * (sh_coefficients() - 1)));
}

Camera plain_camera(const SceneSize& size) {
  Camera camera;
  camera.width = size.width;
  camera.height = size.height;
  camera.fx = camera.fy = size.width;
  camera.cx = 0.5 * size.width;
  camera.cy = 0.5 * size.height;
  return camera;
}

Camera tilted_camera(const SceneSize& size) {
  Camera camera = plain_camera(size);
  camera.camera_from_world = look_at({1.2, -3.6, 1.3}, {0, 0, 0});
  return camera;
}

SplatScene random_splats(Index n, std::uint64_t seed, const SceneSize& size) {
  Painter painter("random", 3, tilted_camera(size), seed);
  for (Index i = 0; i < n; ++i) painter.add_in_ball();
  return painter.scene;
}

SplatScene needles(Index n, double aspect, std::uint64_t seed, const SceneSize& size) {
  Painter painter("needles", 1, tilted_camera(size), seed);
  for (Index i = 0; i < n; ++i) {
    const double length = painter.between(0.4, 0.8);
    painter.add(painter.in_ball(1.2), {length / aspect, length, length / aspect}, painter.between(-1, 4));
  }
  return painter.scene;
}

SplatScene saturated(std::uint64_t seed, const SceneSize& size) {
  Painter painter("saturated", 1, tilted_camera(size), seed);
  const double certain = std::log((1 - 1e-7) / 1e-7), at_cap = std::log(kAlphaCap / (1 - kAlphaCap));
  for (const double logit : {-40., -20., -17., -5., 0., 5., 15., certain, 17., 20., 40., at_cap})
    for (int repeat = 0; repeat < 2; ++repeat) {
      const double scale = painter.scale_between(0.1, 0.4);
      painter.add(painter.in_ball(1.2), {scale, 1.5 * scale, 0.3 * scale}, logit);
    }
  return painter.scene;
}

SplatScene behind_and_beside(std::uint64_t seed, const SceneSize& size) {
  Painter painter("behind and beside", 1, plain_camera(size), seed);
  const Camera& camera = painter.scene.camera;
  const auto add = [&](double x, double y, double z, double scale) {
    painter.add({x, y, z}, {scale, 0.3 * scale, 0.6 * scale}, painter.between(0, 3));
  };
  const double limit_x = kFrustumClamp * camera.width / (2 * camera.fx);
  const double limit_y = kFrustumClamp * camera.height / (2 * camera.fy);
  for (const double times : {0., 0.99, 1.01, 3.})
    for (const double sign : {-1., 1.}) {
      const double z = painter.between(1.5, 2.5);
      add(sign * times * limit_x * z, painter.between(-0.3, 0.3), z, 0.3 + 0.3 * times);
      add(painter.between(-0.3, 0.3), sign * times * limit_y * z, z, 0.3 + 0.3 * times);
    }
  for (const double z : {-3., -0.5, -0.01, 0., 0.01})
    add(painter.between(-0.1, 0.1), painter.between(-0.1, 0.1), z, painter.between(0.2, 2));
  return painter.scene;
}

SplatScene near_plane(std::uint64_t seed, const SceneSize& size) {
  Painter painter("near plane", 1, plain_camera(size), seed);
  const double near = painter.scene.settings.near = 0.25;
  for (const double times : {0.999, 1., 1.001, 1.05, 1.3, 2., 4.})
    for (const double share : {0.03, 0.1, 1.}) {
      const double z = times * near, scale = share * z;
      painter.add({painter.between(-0.5, 0.5) * z, painter.between(-0.4, 0.4) * z, z},
                  {scale, 0.5 * scale, 0.2 * scale}, painter.between(-2, 1));
    }
  return painter.scene;
}

SplatScene raw_quaternions(Index n, std::uint64_t seed, const SceneSize& size) {
  Painter painter("raw quaternions", 1, tilted_camera(size), seed);
  for (Index i = 0; i < n; ++i) painter.add_in_ball(painter.scale_between(1e-6, 1e6));
  return painter.scene;
}

SplatScene off_centre(Index n, std::uint64_t seed, const SceneSize& size) {
  Painter painter("off centre", 3, tilted_camera(size), seed);
  Camera& camera = painter.scene.camera;
  camera.fy = 1.25 * size.width;
  camera.cx = 0.8 * size.width;
  camera.cy = 0.1 * size.height;
  for (Index i = 0; i < n; ++i) painter.add_in_ball();
  return painter.scene;
}

SplatScene depth_ties(std::uint64_t seed, const SceneSize& size) {
  Painter painter("depth ties", 0, plain_camera(size), seed);
  const std::array<double, 4> depths = {2, 2.5, 3, 4};
  for (const Index i : painter.shuffled(32)) {
    const double z = depths[static_cast<std::size_t>(i % 4)];
    painter.add({painter.between(-0.3, 0.3) * z, painter.between(-0.2, 0.2) * z, z},
                {painter.scale_between(0.1, 0.4), painter.scale_between(0.1, 0.4), painter.scale_between(0.1, 0.4)},
                painter.between(-1, 3));
  }
  return painter.scene;
}

SplatScene stack(Index n, double alpha, std::uint64_t seed, const SceneSize& size) {
  Painter painter("stack", 0, plain_camera(size), seed);
  const Camera& camera = painter.scene.camera;
  const double column = size.width / 2 + 0.5, row = size.height / 2 + 0.5;
  for (const Index i : painter.shuffled(n)) {
    const double z = 2 + 2 * static_cast<double>(i) / static_cast<double>(n);
    const double scale = 2 * z / camera.fx;  // 2 pixels
    const double logit = alpha < 1 ? std::log(alpha / (1 - alpha)) : 40;
    painter.add({z * (column - camera.cx) / camera.fx, z * (row - camera.cy) / camera.fy, z},
                {scale, scale * painter.between(0.5, 2), scale}, logit);
  }
  return painter.scene;
}

SplatScene crowded(Index n, std::uint64_t seed, const SceneSize& size) {
  Painter painter("crowded", 0, plain_camera(size), seed);
  for (Index i = 0; i < n; ++i) {
    const double z = painter.between(2, 4), pixel = z / size.width,
                 aspect = static_cast<double>(size.height) / size.width;
    painter.add({painter.between(-0.5, 0.5) * z, painter.between(-0.5, 0.5) * aspect * z, z},
                {painter.scale_between(0.4, 1.2) * pixel, painter.scale_between(0.4, 1.2) * pixel, 0.5 * pixel},
                painter.between(-4, -2.5));
  }
  return painter.scene;
}

SplatScene broken_numbers(std::uint64_t seed, const SceneSize& size) {
  Painter painter("broken numbers", 1, tilted_camera(size), seed);
  const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  const auto spoil = [&](std::vector<float> SplatScene::*array, std::size_t width, float with) {
    painter.add_in_ball();
    std::vector<float>& numbers = painter.scene.*array;
    const auto entry = static_cast<std::size_t>(painter.between(0, static_cast<double>(width)));
    numbers[numbers.size() - width + entry] = with;
    painter.add_in_ball();
  };
  for (const float bad : {nan, inf, -inf}) {
    spoil(&SplatScene::means, 3, bad);
    spoil(&SplatScene::quats, 4, bad);
    spoil(&SplatScene::log_scales, 3, bad);
    spoil(&SplatScene::opacity_logits, 1, bad);
    spoil(&SplatScene::sh, 12, bad);
  }
  for (const float log_scale : {-200.f, -88.f, -40.f, -20.f, 0.f, 20.f, 40.f, 88.f, 200.f})
    spoil(&SplatScene::log_scales, 3, log_scale);
  painter.add_in_ball();
  for (std::size_t i = painter.scene.quats.size() - 4; i < painter.scene.quats.size(); ++i) painter.scene.quats[i] = 0;
  return painter.scene;
}

std::vector<SplatScene> all_scenes(std::uint64_t seed) {
  return {random_splats(40, seed), needles(20, 1e3, seed), saturated(seed),
          behind_and_beside(seed), near_plane(seed),       raw_quaternions(30, seed),
          off_centre(30, seed),    depth_ties(seed),       stack(30, 0.3, seed)};
}

template <class T>
reference::Scene<T> reference_scene(const SplatScene& scene) {
  const auto numbers = [](const std::vector<float>& from) { return std::vector<T>(from.begin(), from.end()); };
  reference::Scene<T> result;
  result.n = scene.count();
  result.sh_coefficients = scene.sh_coefficients();
  result.means = numbers(scene.means);
  result.quats = numbers(scene.quats);
  result.log_scales = numbers(scene.log_scales);
  result.opacity_logits = numbers(scene.opacity_logits);
  result.sh = numbers(scene.sh);
  return result;
}

template <class T>
reference::Pinhole<T> reference_pinhole(const Camera& camera) {
  reference::Pinhole<T> result;
  result.width = camera.width;
  result.height = camera.height;
  result.fx = camera.fx;
  result.fy = camera.fy;
  result.cx = camera.cx;
  result.cy = camera.cy;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c)
      result.camera_from_world[static_cast<std::size_t>(4 * r + c)] = camera.camera_from_world.rotation(r, c);
    result.camera_from_world[static_cast<std::size_t>(4 * r + 3)] = camera.camera_from_world.translation[r];
  }
  return result;
}

template reference::Scene<double> reference_scene(const SplatScene&);
template reference::Scene<long double> reference_scene(const SplatScene&);
template reference::Pinhole<double> reference_pinhole(const Camera&);
template reference::Pinhole<long double> reference_pinhole(const Camera&);

}  // namespace hsi4d::test
