// From the world to the image: camera, units, sizes, places (A2, A3, A8 to A10).
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "autodiff/complex_step.h"
#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "core/random.h"
#include "stress/measures.h"
#include "stress/rows.h"
#include "stress/splat_scene.h"

namespace hsi4d::stress {

namespace {

constexpr double kFar = 1e6;  // metres from the origin, at most

std::vector<double> random_numbers(std::size_t count, std::uint64_t seed) {
  const Random random(seed, random_stream("stress numbers"));
  std::vector<double> numbers(count);
  for (std::size_t i = 0; i < count; ++i) numbers[i] = 2 * random.uniform<float>(i) - 1;
  return numbers;
}

}  // namespace

// --- A2: x/z and y/z held ------------------------------------------------------------------------------------------

namespace {

/// Where x/z and y/z are held, for a camera at the origin.
struct Limits {
  double low[2], high[2];

  Limits(const Camera& c, double clamp)
      : low{-c.cx / c.fx - (clamp - 1) * c.width / (2 * c.fx), -c.cy / c.fy - (clamp - 1) * c.height / (2 * c.fy)},
        high{low[0] + clamp * c.width / c.fx, low[1] + clamp * c.height / c.fy} {}
};

/// u, v and V of a Gaussian of mean (0 to 2) and axes (3 to 11), times weights.
template <class T>
T weighted_projection(const Camera& camera, const Limits& limits, const std::array<T, 12>& x, const double* weights) {
  const double focal[2] = {camera.fx, camera.fy};
  T sum(0.0);
  for (std::size_t i = 0; i < 2; ++i) {
    const T ratio = x[i] / x[2], held = clamp(ratio, limits.low[i], limits.high[i]);
    sum += ratio * focal[i] * weights[i];
    for (std::size_t c = 0; c < 3; ++c) {
      sum += focal[i] / x[2] * (x[3 + 3 * i + c] - held * x[9 + c]) * weights[2 + 3 * i + c];
    }
  }
  return sum;
}

/// What the gradient by z has too much where a held ratio is taken for x/z: ∂J/∂z = 2 h/z² instead of h/z².
double surplus_of_free_ratio(const Camera& camera, const Limits& limits, const double* x, const double* weights) {
  const double focal[2] = {camera.fx, camera.fy};
  double surplus = 0;
  for (std::size_t i = 0; i < 2; ++i) {
    const double ratio = x[i] / x[2], held = std::clamp(ratio, limits.low[i], limits.high[i]);
    if (ratio == held) continue;
    for (std::size_t c = 0; c < 3; ++c) surplus += focal[i] / x[2] * x[9 + c] * weights[2 + 3 * i + c] * held / x[2];
  }
  return surplus;
}

/// Gaussians at 0 to 3 times each of the four limits; 12 numbers each, floats.
std::vector<std::array<double, 12>> gaussians_at(const Limits& limits) {
  const std::vector<double> axes = random_numbers(9, 2);
  std::vector<std::array<double, 12>> result;
  for (const double times : {0., 0.99, 1.01, 3.}) {
    for (std::size_t side = 0; side < 4; ++side) {
      const double z = 2 + 0.3 * static_cast<double>(side);
      std::array<double, 12> x{};
      x[side / 2] = static_cast<float>(times * (side % 2 == 0 ? limits.low : limits.high)[side / 2] * z);
      x[1 - side / 2] = 0.125;
      x[2] = static_cast<float>(z);
      std::copy(axes.begin(), axes.end(), x.begin() + 3);
      result.push_back(x);
    }
  }
  return result;
}

/// Gradients by mean and axes, [N,12], as the program has them.
template <class S>
std::vector<double> projection_gradients(const Camera& camera, const std::vector<std::array<double, 12>>& gaussians,
                                         const std::vector<double>& weights) {
  const Index n = std::ssize(gaussians);
  Tape<S> tape;
  const auto leaf = [&](const char* name, Index cols, auto&& number) {
    const Var<S> var = tape.parameter(name, shape_of(n, cols));
    for (Index r = 0; r < n; ++r) {
      for (Index c = 0; c < cols; ++c) tape.write(var)(r, c) = static_cast<S>(number(r, static_cast<std::size_t>(c)));
    }
    return var;
  };
  const auto of = [&](std::size_t first) {
    return [&, first](Index r, std::size_t c) { return gaussians[static_cast<std::size_t>(r)][first + c]; };
  };
  const auto weight = [&](std::size_t first) {
    return [&, first](Index, std::size_t c) { return weights[first + c]; };
  };
  const Var<S> means = leaf("means", 3, of(0)), axes = leaf("axes", 9, of(3));
  const Projected<S> p = project(means, axes, tape.constant("xi", shape_of(1, 6)), SplatView{camera, {0, 0, 0}, {}});
  const Var<S> loss = sum(p.means_px * leaf("weights", 2, weight(0))) + sum(p.factors * leaf("weights", 6, weight(2)));
  tape.forward(loss);
  tape.backward(loss);
  std::vector<double> result;
  for (Index r = 0; r < n; ++r) {
    for (Index c = 0; c < 12; ++c) {
      result.push_back(static_cast<double>(c < 3 ? tape.gradient(means)(r, c) : tape.gradient(axes)(r, c - 3)));
    }
  }
  return result;
}

}  // namespace

std::vector<StressFigure> held_ratios(Remedy remedy) {
  Camera camera = front_camera(40, 30);
  camera.cx = 30, camera.cy = 5, camera.fy = 50;
  const Limits limits(camera, kFrustumClamp);
  const auto gaussians = gaussians_at(limits);
  const std::vector<double> weights = random_numbers(8, 3);
  const auto error = [&](std::vector<double> gradients) {
    Largest worst;
    for (std::size_t n = 0; n < gaussians.size(); ++n) {
      if (remedy == Remedy::kOff) {
        gradients[12 * n + 2] += surplus_of_free_ratio(camera, limits, gaussians[n].data(), weights.data());
      }
      Largest off, size;
      for (std::size_t k = 0; k < 12; ++k) {
        const double exact = complex_step_derivative<12>(
            [&](auto... x) { return weighted_projection(camera, limits, std::array{x...}, weights.data()); },
            gaussians[n], k);
        off.add(std::abs(gradients[12 * n + k] - exact));
        size.add(std::abs(exact));
      }
      worst.add(off.value() / size.value());
    }
    return worst.value();
  };
  return {
      {"relative error of gradients, double", error(projection_gradients<double>(camera, gaussians, weights)), 2e-15},
      {"relative error of gradients, float", error(projection_gradients<float>(camera, gaussians, weights)), 3e-7}};
}

// --- A3: beside the view -------------------------------------------------------------------------------------------

namespace {

/// Pixels that a long, thin Gaussian along the view marks, `beside` half-widths of the view out. Its far end is outside
/// of the view, too, by three standard deviations.
double marked_pixels(int side, double beside, double z, double clamp) {
  Scene scene = empty_scene(front_camera(64, 64));
  scene.camera.cx += 6;
  scene.camera.cy -= 5;
  scene.settings.frustum_clamp = clamp;
  Vector3<double> mean(0, 0, z);
  mean[side % 2] = (side < 2 ? 0.5 : -0.5) * beside * z;
  scene.add(mean, {0.01 * z, 0.01 * z, 0.4 * z}, 8, {1, 1, 1});
  TapedScene<float> taped(scene);
  taped.tape.forward(taped.rendered.transmittance);
  double count = 0;
  for (const double t : taped.value(taped.rendered.transmittance)) count += 1 - t >= scene.settings.alpha_min;
  return count;
}

/// Error of V, relative, for Gaussians inside of the view of a camera whose principal point is far off its centre.
double factor_error_inside(Remedy remedy) {
  Camera camera = front_camera(64, 48);
  camera.cx = 0.95 * camera.width;
  camera.cy = 0.1 * camera.height;
  const Limits centred = [&] {
    Camera c = camera;
    c.cx = 0.5 * c.width, c.cy = 0.5 * c.height;
    return Limits(c, kFrustumClamp);
  }();
  Scene scene = empty_scene(camera);
  for (double col = 1; col < 64; col += 6) {
    for (double row = 1; row < 48; row += 5) {
      scene.add({2 * (col - camera.cx) / camera.fx, 2 * (row - camera.cy) / camera.fy, 2}, {0.1, 0.2, 0.3}, 0,
                {1, 1, 1});
    }
  }
  TapedScene<float> taped(scene);
  taped.tape.forward(taped.rendered.projected.factors);
  const std::vector<double> means = taped.value(taped.means), axes = taped.value(taped.axes);
  const std::vector<double> factors = taped.value(taped.rendered.projected.factors);
  Largest error;
  for (std::size_t n = 0; n < means.size() / 3; ++n) {
    for (std::size_t i = 0; i < 6; ++i) {
      const double* const a = axes.data() + 9 * n;
      const double focal = (i < 3 ? camera.fx : camera.fy) / means[3 * n + 2];
      const double ratio = means[3 * n + i / 3] / means[3 * n + 2];
      const double held = std::clamp(ratio, centred.low[i / 3], centred.high[i / 3]);
      const double exact = focal * (a[i] - ratio * a[6 + i % 3]);
      const double v = remedy == Remedy::kOn ? factors[6 * n + i] : focal * (a[i] - held * a[6 + i % 3]);
      error.add(std::abs(v - exact) / (focal * 0.3));
    }
  }
  return error.value();
}

/// A crop's render against the crop of the render: where limits belong to the window, what lies beside it is bent
/// otherwise. They belong to the image here too, so the remedy is limits so wide that nothing is held.
double crop_error(Remedy remedy) {
  Scene scene = random_scene(60, 31, 48, 32);
  apply_quality(scene.settings, Quality::kReference);
  scene.settings.frustum_clamp = remedy == Remedy::kOn ? 100 : 1;
  Scene part = scene;
  part.camera = cropped(scene.camera, 11, 7, 21, 19);
  return crop_difference(scene, part, 11, 7);
}

}  // namespace

std::vector<StressFigure> beside_the_view(Remedy remedy) {
  double fan = 0;
  for (const int side : {0, 1, 2, 3}) {
    for (const double z : {0.2, 2.0, 30.0}) {
      for (const double beside : {3.5, 5.0, 10.0}) {
        fan += marked_pixels(side, beside, z, remedy == Remedy::kOn ? kFrustumClamp : 100);
      }
    }
  }
  return {{"pixels marked by what lies beside the view", fan, 0},
          {"relative error of V in an off-centre view", factor_error_inside(remedy), 1e-6},
          {"render of a crop, crop of the render", crop_error(remedy), 1e-5}};
}

// --- A8: units of length -------------------------------------------------------------------------------------------

namespace {

/// Scales are held at a millimetre or more, as inverses of scales are in some renderers.
Scene with_least_scale(Scene scene) {
  for (float& x : scene.gaussians.log_scales) x = std::max(x, std::log(1e-3F));
  return scene;
}

/// Gradient by the log-scales of one small Gaussian under a small blur, against the brute-force renderer.
double error_under_small_blur(Remedy remedy) {
  Scene scene = empty_scene(front_camera(9, 9));
  apply_quality(scene.settings, Quality::kReference);
  scene.settings.blur = 0.01;
  const double pixel = 2 / scene.camera.fx;
  scene.add({0.02 * pixel, -0.04 * pixel, 2}, {0.05 * pixel, 0.04 * pixel, 0.03 * pixel}, 1, {0.9, 0.4, 0.1});
  TapedScene<float> taped(scene);
  const Var<float> t = taped.rendered.transmittance;
  taped.tape.forward(t);
  taped.tape.backward(t, std::vector<float>(81, 1.0F));
  std::vector<double> gradient = taped.gradient(taped.log_scales);
  if (remedy == Remedy::kOff) {  // 1/det² as 1/(det² + 1e-7)
    const double determinant = (0.05 * 0.05 + 0.01) * (0.04 * 0.04 + 0.01), square = determinant * determinant;
    for (double& x : gradient) x *= square / (square + 1e-7);
  }
  reference::Image<double> cotangent;
  cotangent.transmittance.assign(81, 1);
  cotangent.color.assign(3 * 81, 0);
  cotangent.depth_sum.assign(81, 0);
  const auto exact = reference::gradients(reference_scene(scene), reference_pinhole(scene.camera), {0, 0, 0},
                                          scene.settings, cotangent);
  return relative_l2(gradient, exact.log_scales);
}

}  // namespace

std::vector<StressFigure> units_of_length(Remedy remedy) {
  const Scene scene = random_scene(40, 19, 48, 32);
  const Rendering here = render_scene<float>(scene);
  Largest image, gradient;
  for (const double scale : {1e-3, 1e-2, 8., 1e3}) {
    const Scene other = remedy == Remedy::kOn ? scaled(scene, scale) : with_least_scale(scaled(scene, scale));
    Rendering r = render_scene<float>(other);
    image.add(largest_difference(r.image, here.image));
    for (double& x : r.means) x *= scale;
    gradient.add(relative_l2(r.means, here.means));
    gradient.add(relative_l2(r.log_scales, here.log_scales));
  }
  return {{"image, scene scaled by 1e-3 to 1e3", image.value(), 1e-5},
          {"gradients scaled back, relative", gradient.value(), 1e-4},
          {"relative error of gradients, blur 0.01 px^2", error_under_small_blur(remedy), 1e-4}};
}

// --- A9: smaller than a pixel --------------------------------------------------------------------------------------

std::vector<StressFigure> small_gaussians(Remedy remedy) {
  Largest error;
  for (const double scale_px : {0.01, 0.1, 0.5}) {
    Scene scene = empty_scene(front_camera(32, 32));
    apply_quality(scene.settings, Quality::kReference);
    scene.settings.antialias = remedy == Remedy::kOn;
    const double scale = scale_px / scene.camera.fx, opacity = 0.8;
    scene.add({0.01, -0.02, 1}, {scale, scale, scale}, std::log(opacity / (1 - opacity)), {1, 1, 1});
    double sum = 0;
    TapedScene<double> taped(scene);  // in float 1 − T of single pixels has lost its digits
    taped.tape.forward(taped.rendered.transmittance);
    for (const double t : taped.value(taped.rendered.transmittance)) sum += 1 - t;
    error.add(std::abs(sum / (opacity * 2 * std::numbers::pi * scale_px * scale_px) - 1));
  }
  return {{"sum of alpha, relative error, 0.01 to 0.5 px", error.value(), 0.01}};
}

// --- A10: far from the origin --------------------------------------------------------------------------------------

namespace {

/// Pixels that means are off, against R (p − c) in long double near the origin.
double misplaced_px(const Scene& scene, const Scene& far, const Vector3<double>& offset, Remedy remedy) {
  TapedScene<float> taped(far);
  taped.tape.forward(taped.rendered.projected.means_px);
  const std::vector<double> px = taped.value(taped.rendered.projected.means_px);
  const Rigid<double>& pose = far.camera.camera_from_world;
  const Vector3<double> center = camera_center_world(scene.camera);
  Largest largest;
  for (Index n = 0; n < scene.gaussians.count(); ++n) {
    const float* const m = scene.gaussians.means.data() + 3 * n;
    long double exact[3] = {};
    float p[3];
    for (Index r = 0; r < 3; ++r) {
      p[r] = static_cast<float>(pose.translation[r]);
      for (Index c = 0; c < 3; ++c) {
        exact[r] += static_cast<long double>(pose.rotation(r, c)) * (static_cast<long double>(m[c]) - center[c]);
        p[r] += static_cast<float>(pose.rotation(r, c)) * static_cast<float>(m[c] + offset[c]);
      }
    }
    const double f = scene.camera.fx, half[2] = {scene.camera.cx, scene.camera.cy};
    for (std::size_t i = 0; i < 2; ++i) {
      const double at = remedy == Remedy::kOn ? px[2 * static_cast<std::size_t>(n) + i]
                                              : f * static_cast<double>(p[i] / p[2]) + half[i];
      largest.add(std::abs(at - static_cast<double>(f * exact[i] / exact[2] + half[i])));
    }
  }
  return largest.value();
}

}  // namespace

std::vector<StressFigure> far_from_the_origin(Remedy remedy) {
  const Scene scene = random_scene(60, 23, 96, 64);
  Scene wide = scene;
  wide.camera.fx = wide.camera.fy = 1000;
  const Rendering here = render_scene<float>(scene);
  Largest image, gradient, pixels;
  for (const double far : {1e2, 1e3, 1e4, kFar}) {
    const Vector3<double> offset(far, -far, 0.5 * far);
    const auto moved = [&](const Scene& by) {
      const Scene there = translated(by, offset);
      return remedy == Remedy::kOn ? there : in_world(there);
    };
    const Rendering there = render_scene<float>(moved(scene));
    image.add(largest_difference(there.image, here.image));
    gradient.add(relative_l2(there.gradients(), here.gradients()));
    pixels.add(misplaced_px(wide, moved(wide), offset, remedy));
  }
  return {{"pixels off, f = 1000 px, up to 1000 km", pixels.value(), 7e-5},
          {"image, up to 1000 km", image.value(), 6e-7},
          {"gradients, up to 1000 km, relative", gradient.value(), 5e-7}};
}

}  // namespace hsi4d::stress
