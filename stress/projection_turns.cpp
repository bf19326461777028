// What turns: the camera, flat Gaussians, quaternions (A11 to A13).
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "autodiff/dual.h"
#include "stress/measures.h"
#include "stress/rows.h"
#include "stress/splat_scene.h"

namespace hsi4d::stress {

// --- A11: the order of a camera that turns -------------------------------------------------------------------------

namespace {

/// The image in double, its Gaussians in order of camera z, or of the distance from the camera.
std::vector<double> image_in_order(const Scene& scene, Remedy remedy) {
  TapedScene<double> taped(scene);
  taped.tape.forward(taped.rendered.image);
  if (remedy == Remedy::kOn) return taped.value(taped.rendered.image);
  const std::vector<double> means = taped.value(taped.means);
  const Vector3<double> center = camera_center_world(scene.camera);
  std::vector<double> distances;
  for (std::size_t n = 0; n < means.size() / 3; ++n) {
    distances.push_back((Vector3<double>(means[3 * n], means[3 * n + 1], means[3 * n + 2]) - center).norm());
  }
  Projected<double> projected = taped.rendered.projected;
  projected.depths = taped.tape.constant("distances", projected.depths.shape());
  taped.tape.set(projected.depths, distances);
  const Composited<double> out =
      composite(SplatSet<double>{projected, taped.opacities, taped.colors}, taped.view, taped.background);
  taped.tape.forward(out.channels);
  return taped.value(out.channels);
}

}  // namespace

std::vector<StressFigure> turning_camera(Remedy remedy) {
  // 1e-3 rad are 0.1 pixels, and the order of some Gaussians whose depths are nearly equal.
  const Scene scene = random_scene(300, 36, 96, 64);
  Scene turned = scene;
  turned.camera.camera_from_world =
      se3_update(Vector6<double>{0, 0, 0, 0.6e-3, 0.8e-3, 0}, scene.camera.camera_from_world);
  const std::vector<double> a = image_in_order(scene, remedy), b = image_in_order(turned, remedy);
  double squares = 0;
  for (std::size_t i = 0; i < a.size(); ++i) squares += (a[i] - b[i]) * (a[i] - b[i]);
  return {
      {"image against brute force", largest_difference(a, reference_rendering(scene).image), 1e-10},
      {"the same of the camera turned by 1e-3 rad", largest_difference(b, reference_rendering(turned).image), 1e-10},
      // Reported rather than bounded: a picture that moves by 0.1 pixels.
      {"change of the frame, root mean square", std::sqrt(squares / static_cast<double>(a.size())), 0.02}};
}

// --- A12: edge-on --------------------------------------------------------------------------------------------------

namespace {

constexpr double kDiscRadius = 0.3, kDiscDepth = 2, kDiscOffset = 3e-5;  // metres

/// cos t, sin t of a disc whose normal and the view are at 10^-k of a right angle's cosine.
std::array<double, 2> turn_of(int k) {
  const double c = std::pow(10.0, -k);
  return {c, std::sqrt(1 - c * c)};
}

/// A flat Gaussian around the central pixel's centre, turned about the image's y axis.
Scene disc(int k) {
  Scene scene = empty_scene(front_camera(33, 33));
  apply_quality(scene.settings, Quality::kReference);
  scene.add({kDiscOffset, 0, kDiscDepth}, {kDiscRadius, kDiscRadius, 2e-9}, 2, {1, 1, 1});
  const double angle = std::acos(turn_of(k)[0]);
  scene.gaussians.quats = {static_cast<float>(std::cos(angle / 2)), 0, static_cast<float>(std::sin(angle / 2)), 0};
  return scene;
}

/// α of pixels of the central row and its gradient by x and z of the mean, per metre, for each disc.
struct EdgeOn {
  std::vector<double> alphas, slopes;
  double not_finite = 0;
  Largest steepest;

  void add(double alpha, double d_x, double d_z) {
    alphas.push_back(alpha);
    slopes.insert(slopes.end(), {d_x, d_z});
    steepest.add(std::hypot(d_x, d_z));
  }
};

constexpr std::size_t kSide = 33, kFirstPixel = 8, kLastPixel = 24;
const double kDiscOpacity = 1 / (1 + std::exp(-2.0));

std::size_t in_central_row(std::size_t col) { return kSide / 2 * kSide + col; }

void add_by_program(const Scene& scene, EdgeOn& found) {
  TapedScene<float> taped(scene);
  taped.tape.forward(taped.rendered.transmittance);
  const std::vector<double> t = taped.value(taped.rendered.transmittance);
  for (std::size_t col = kFirstPixel; col <= kLastPixel; ++col) {
    std::vector<float> cotangent(kSide * kSide, 0.0F);
    cotangent[in_central_row(col)] = -1;
    taped.tape.backward(taped.rendered.transmittance, cotangent);
    const std::vector<double> d = taped.gradient(taped.means);
    for (const Var<float> var : {taped.means, taped.quats, taped.log_scales})
      found.not_finite += not_finite(taped.gradient(var));
    found.add(1 - t[in_central_row(col)], d[0], d[2]);
  }
}

void add_by_brute_force(const Scene& scene, EdgeOn& found) {
  const reference::Scene<double> gaussian = reference_scene(scene);
  const reference::Pinhole<double> camera = reference_pinhole(scene.camera);
  const auto image = reference::render(gaussian, camera, {0, 0, 0}, scene.settings);
  reference::Image<double> cotangent;
  cotangent.color.assign(3 * kSide * kSide, 0);
  cotangent.depth_sum.assign(kSide * kSide, 0);
  for (std::size_t col = kFirstPixel; col <= kLastPixel; ++col) {
    cotangent.transmittance.assign(kSide * kSide, 0);
    cotangent.transmittance[in_central_row(col)] = -1;
    const std::vector<double> d = reference::gradients(gaussian, camera, {0, 0, 0}, scene.settings, cotangent).means;
    found.add(1 - image.transmittance[in_central_row(col)], d[0], d[2]);
  }
}

/// Where the ray of a pixel meets the disc's plane, t = n·m / n·r, and α there.
void add_by_rays(int k, EdgeOn& found) {
  const auto [c, s] = turn_of(k);
  const double focal = kSide;
  for (std::size_t col = kFirstPixel; col <= kLastPixel; ++col) {
    const double r = (static_cast<double>(col) - 16) / focal;  // the ray (r, 0, 1)
    const auto x = dual_variable<0>(kDiscOffset);
    const auto z = dual_variable<1>(kDiscDepth);
    const auto t = (s * x + c * z) / (s * r + c);
    const auto along = (c * (t * r - x) - s * (t - z)) / kDiscRadius;
    const auto g = kDiscOpacity * exp(-0.5 * square(along));
    found.not_finite += not_finite(std::array{g.value, g.partial(0), g.partial(1)});
    found.add(g.value, g.partial(0), g.partial(1));
  }
}

}  // namespace

std::vector<StressFigure> edge_on(Remedy remedy) {
  EdgeOn found, exact;
  for (int k = 0; k <= 8; ++k) {
    remedy == Remedy::kOn ? add_by_program(disc(k), found) : add_by_rays(k, found);
    add_by_brute_force(disc(k), exact);
  }
  // In the image no Gaussian is narrower than the blur: |dG/du| ≤ exp(−½)/sqrt(blur) a pixel.
  const double steepest = kDiscOpacity * std::exp(-0.5) / std::sqrt(kBlur) * 33 / kDiscDepth;
  return {{"gradients that are not finite", found.not_finite, 0},
          {"alpha off brute force", largest_difference(found.alphas, exact.alphas), 3e-7},
          {"gradient by the mean off brute force, of the steepest",
           largest_difference(found.slopes, exact.slopes) / steepest, 1e-6},
          {"steepest slope by the mean, of that of the blur", found.steepest.value() / steepest, 1}};
}

// --- A13: quaternions of any length --------------------------------------------------------------------------------

namespace {

/// R(q) as if q were of unit length, by rows.
std::array<double, 9> raw_rotation(const std::array<double, 4>& q) {
  const auto [w, x, y, z] = q;
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}

std::array<double, 4> quaternion_of(const Scene& scene, Index n) {
  const float* const q = scene.gaussians.quats.data() + 4 * n;
  return {q[0], q[1], q[2], q[3]};
}

/// Axes by raw_rotation, and the gradients by quaternions that follow from those by axes.
Rendering render_raw(const Scene& scene) {
  std::vector<double> axes;
  for (Index n = 0; n < scene.gaussians.count(); ++n) {
    const auto r = raw_rotation(quaternion_of(scene, n));
    for (std::size_t i = 0; i < 9; ++i) {
      axes.push_back(
          r[i] * std::exp(static_cast<double>(scene.gaussians.log_scales[3 * static_cast<std::size_t>(n) + i % 3])));
    }
  }
  TapedScene<float> taped(scene, axes);
  taped.run();
  const std::vector<double> d_axes = taped.gradient(taped.axes);
  Rendering result;
  result.image = taped.value(taped.rendered.image);
  for (Index n = 0; n < scene.gaussians.count(); ++n) {
    const std::array<double, 4> q = quaternion_of(scene, n);
    const double step = std::hypot(q[0], q[1], std::hypot(q[2], q[3]));
    for (std::size_t k = 0; k < 4; ++k) {  // R is quadratic in q: the central difference is exact
      std::array<double, 4> up = q, down = q;
      up[k] += step, down[k] -= step;
      const auto a = raw_rotation(up), b = raw_rotation(down);
      double d = 0;
      for (std::size_t i = 0; i < 9; ++i) {
        const std::size_t row = 9 * static_cast<std::size_t>(n) + i;
        const double scale =
            std::exp(static_cast<double>(scene.gaussians.log_scales[3 * static_cast<std::size_t>(n) + i % 3]));
        d += d_axes[row] * scale * (a[i] - b[i]) / (2 * step);
      }
      result.quats.push_back(d);
    }
  }
  return result;
}

/// The largest |g·q| / (|g| |q|).
double along_quaternions(const Scene& scene, const std::vector<double>& gradient) {
  Largest largest;
  for (Index n = 0; n < scene.gaussians.count(); ++n) {
    const std::array<double, 4> q = quaternion_of(scene, n);
    const double* const g = gradient.data() + 4 * n;
    const double size =
        std::sqrt(std::inner_product(g, g + 4, g, 0.0) * std::inner_product(q.begin(), q.end(), q.begin(), 0.0));
    if (size > 0) largest.add(std::abs(std::inner_product(q.begin(), q.end(), g, 0.0)) / size);
  }
  return largest.value();
}

}  // namespace

std::vector<StressFigure> lengths_of_quaternions(Remedy remedy) {
  const Scene scene = random_scene(40, 29, 48, 32);
  const std::vector<double> image = render_scene<float>(scene).image;
  Largest difference, along;
  for (const double length : {1e-6, 1e-3, 1e3, 1e6}) {
    Scene longer = scene;
    for (float& x : longer.gaussians.quats) x = static_cast<float>(x * length);
    const Rendering r = remedy == Remedy::kOn ? render_scene<float>(longer) : render_raw(longer);
    difference.add(largest_difference(r.image, image));
    along.add(along_quaternions(longer, r.quats));
  }
  return {{"image, quaternions of length 1e-6 to 1e6", difference.value(), 1e-6},
          {"gradient along the quaternion, relative", along.value(), 1e-6}};
}

}  // namespace hsi4d::stress
