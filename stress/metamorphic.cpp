// Rows R: relations that every render has to keep. None needs to know what the picture is; those that are kept to the
// last bit are asked for to the last bit.
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "core/parallel.h"
#include "core/quaternion.h"
#include "core/random.h"
#include "splat/files/sh_rotation.h"
#include "stress/measures.h"
#include "stress/pixel_walk.h"
#include "stress/rows.h"
#include "stress/splat_scene.h"
#include "stress/vector_targets.h"

namespace hsi4d::stress {

namespace {

std::vector<double> times(std::vector<double> numbers, double factor) {
  for (double& x : numbers) x *= factor;
  return numbers;
}

/// In front of a camera whose principal point is not its centre.
Scene in_front(Index n, std::uint64_t seed) {
  Scene scene = random_scene(n, seed, 48, 32);
  scene.camera = front_camera(48, 32);
  scene.camera.cx = 21.25;
  for (std::size_t i = 2; i < scene.gaussians.means.size(); i += 3) scene.gaussians.means[i] += 4;
  return scene;
}

/// The image, and the gradients by means where every pixel counts alike.
struct OrderedImage {
  std::vector<double> image, d_means;
};

/// @param by_depth  or in the order of the rows
OrderedImage composited(const Scene& scene, bool by_depth) {
  TapedScene<float> taped(scene);
  Projected<float> projected = taped.rendered.projected;
  if (!by_depth) {
    projected.depths = taped.tape.constant("ones", projected.depths.shape());
    projected.depth_low = taped.tape.constant("zeros", projected.depths.shape());
    taped.tape.set(projected.depths, std::vector<float>(static_cast<std::size_t>(scene.gaussians.count()), 1.0F));
  }
  const Var<float> image =
      composite(SplatSet<float>{projected, taped.opacities, taped.colors}, taped.view, taped.background).channels;
  taped.tape.forward(image);
  taped.tape.backward(image, std::vector<float>(static_cast<std::size_t>(image.shape().count()), 1.0F));
  return {taped.value(image), taped.gradient(taped.means)};
}

/// Σ of rows of an image in float, cut into one piece a thread.
std::vector<double> sums_by_thread(const std::vector<double>& image, int threads) {
  std::vector<double> sums;
  for (std::size_t row = 0; row + 48 <= image.size(); row += 48) {
    float sum = 0;
    for (int piece = 0; piece < threads; ++piece) {
      float partial = 0;
      for (int i = 48 * piece / threads; i < 48 * (piece + 1) / threads; ++i) {
        partial += static_cast<float>(image[row + static_cast<std::size_t>(i)]);
      }
      sum += partial;
    }
    sums.push_back(sum);
  }
  return sums;
}

struct ExtremeKind {
  double depth;            ///< metres
  Vector3<double> scales;  ///< metres
  double opacity_logit;
};

/// Huge, tiny, far, near, hardly opaque, saturated, long, flat.
std::vector<ExtremeKind> extreme_kinds() {
  return {{10, {1e6, 1e6, 1e6}, 0},       {2, {1e-5, 1e-5, 1e-5}, 2}, {1e6, {3e4, 3e4, 3e4}, 1},
          {0.011, {1e-3, 1e-3, 1e-3}, 1}, {2, {0.3, 0.3, 0.3}, -5.2}, {2, {0.3, 0.3, 0.3}, 40},
          {3, {1e3, 1e-4, 1e-4}, 3},      {3, {0.4, 0.4, 3e-9}, 1}};
}

/// What guards against extreme numbers reject.
bool is_guarded(const ExtremeKind& kind) {
  const double opacity = 1 / (1 + std::exp(-kind.opacity_logit));
  return kind.depth > 1e4 || kind.scales.maxCoeff() > 100 || kind.scales.minCoeff() < 1e-4 || opacity < 0.01 ||
         opacity > 1 - 1e-6;
}

}  // namespace

/// R1: with a power of two no number is rounded otherwise.
std::vector<StressFigure> scaled_world(Remedy remedy) {
  const Scene scene = random_scene(60, 1, 48, 32);
  const std::vector<double> axes = [&] {
    TapedScene<float> taped(scene);
    taped.tape.forward(taped.axes);
    return taped.value(taped.axes);
  }();
  const auto rendering = [&](double factor) {
    Scene other = scaled(scene, factor);
    if (remedy == Remedy::kOff) other.camera.camera_from_world.translation[2] += 1e-7;  // 1/z as 1/(z + 1e-7)
    return render_scene<float>(other, times(axes, factor));
  };
  const Rendering here = rendering(1);
  double image = 0, gradients = 0;
  for (const double factor : {0x1p-10, 0x1p10, 0x1p20}) {
    const Rendering there = rendering(factor);
    image += unequal(there.image, here.image);
    gradients += unequal(times(there.means, factor), here.means) + unequal(there.sh, here.sh);
  }
  return {{"numbers of the image with other bits", image, 0}, {"gradients with other bits", gradients, 0}};
}

/// R2
std::vector<StressFigure> moved_world(Remedy remedy) {
  const Scene scene = random_scene(80, 2, 48, 32);
  const Rendering here = render_scene<float>(scene);
  Largest image, gradients;
  for (const double far : {1e2, 1e4, 1e6}) {
    const Scene there = translated(scene, {-0.7 * far, far, 0.3 * far});
    const Rendering r = render_scene<float>(remedy == Remedy::kOn ? there : in_world(there));
    image.add(largest_difference(r.image, here.image));
    gradients.add(relative_l2(r.gradients(), here.gradients()));
  }
  return {{"image, moved by 100 m to 1000 km", image.value(), 1e-5}, {"gradients, relative", gradients.value(), 1e-4}};
}

/// R3
std::vector<StressFigure> turned_world(Remedy remedy) {
  const Scene scene = random_scene(80, 3, 48, 32);
  const Vector4<double> turn = Random(3, random_stream("turn")).rotation(0);
  const Matrix3<double> r = quaternion_to_matrix(turn);
  const ShRotation harmonics(r, kHighestShDegree);
  Scene turned = scene;
  Gaussians& g = turned.gaussians;
  for (Index n = 0; n < g.count(); ++n) {
    Eigen::Map<Vector3<float>> mean(g.means.data() + 3 * n);
    Eigen::Map<Vector4<float>> quat(g.quats.data() + 4 * n);
    mean = Vector3<double>(r * mean.cast<double>()).cast<float>();
    quat = quaternion_product(turn, Vector4<double>(quat.cast<double>())).cast<float>();
    if (remedy == Remedy::kOn) harmonics.apply(std::span(g.sh).subspan(static_cast<std::size_t>(48 * n), 48));
  }
  turned.camera.camera_from_world.rotation = scene.camera.camera_from_world.rotation * r.transpose();
  const Rendering here = render_scene<float>(scene), there = render_scene<float>(turned);
  std::vector<double> back = there.means;
  for (std::size_t i = 0; i < back.size(); i += 3) {
    Eigen::Map<Vector3<double>> d(back.data() + i);
    d = Vector3<double>(r.transpose() * d);
  }
  return {{"image of the turned world", largest_difference(there.image, here.image), 1e-5},
          {"gradients turned back, relative", relative_l2(back, here.means), 1e-4}};
}

/// R4
std::vector<StressFigure> mirror_image(Remedy remedy) {
  const Scene scene = in_front(80, 4);
  Scene mirrored = scene;
  const double last = remedy == Remedy::kOn ? 48 : 47;  // as if pixels' centres were whole numbers
  mirrored.camera.cx = last - scene.camera.cx;
  Gaussians& g = mirrored.gaussians;
  for (std::size_t n = 0; n < static_cast<std::size_t>(g.count()); ++n) {
    g.means[3 * n] *= -1;
    g.quats[4 * n + 2] *= -1;
    g.quats[4 * n + 3] *= -1;
    for (const std::size_t odd : {3, 4, 7, 10, 13, 15}) {  // harmonics that are odd in x
      for (std::size_t c = 0; c < 3; ++c) g.sh[48 * n + 3 * odd + c] *= -1;
    }
  }
  const Rendering here = render_scene<float>(scene);
  Rendering there = render_scene<float>(mirrored);
  for (std::size_t row = 0; row < 3 * 32; ++row) {
    std::reverse(there.image.begin() + static_cast<Index>(48 * row),
                 there.image.begin() + static_cast<Index>(48 * (row + 1)));
  }
  return {{"mirrored image of the mirrored scene", largest_difference(there.image, here.image), 1e-6}};
}

/// R5
std::vector<StressFigure> crop_of_render(Remedy remedy) {
  Scene scene = random_scene(60, 5, 48, 32);
  apply_quality(scene.settings, Quality::kReference);
  scene.settings.frustum_clamp = 100;  // the limits of the Jacobian belong to the image: here they hold nothing
  Scene part = scene;
  part.camera = cropped(scene.camera, 11, 7, 21, 19);
  if (remedy == Remedy::kOff) part.camera.cx -= 0.5, part.camera.cy -= 0.5;  // another convention of centres
  return {{"render of a crop, crop of the render", crop_difference(scene, part, 11, 7), 1e-5}};
}

/// R6
std::vector<StressFigure> shuffled_rows(Remedy remedy) {
  const Scene scene = random_scene(300, 6, 48, 32);
  const std::vector<Index> order = Random(6, random_stream("order")).permutation(0, 300);
  Scene shuffled = scene;
  shuffled.gaussians = selected(scene.gaussians, order);
  const OrderedImage here = composited(scene, remedy == Remedy::kOn);
  const OrderedImage there = composited(shuffled, remedy == Remedy::kOn);
  std::vector<double> back(there.d_means.size());
  for (std::size_t i = 0; i < back.size(); ++i) {
    back[3 * static_cast<std::size_t>(order[i / 3]) + i % 3] = there.d_means[i];
  }
  return {{"numbers of the image with other bits", unequal(there.image, here.image), 0},
          {"gradients with other bits", unequal(back, here.d_means), 0}};
}

/// R7: 1 − (1 − a)(1 − b), for Gaussians so wide that they are equally opaque all over the image.
std::vector<StressFigure> gaussians_in_two(Remedy remedy) {
  Scene scene = random_scene(40, 7, 48, 32);
  if (remedy == Remedy::kOn) apply_quality(scene.settings, Quality::kReference);
  Gaussians& g = scene.gaussians;
  RandomSequence random(7, random_stream("opacities"));
  std::fill(g.log_scales.begin(), g.log_scales.end(), 18.0F);
  const auto logit = [](double opacity) { return static_cast<float>(std::log(opacity / (1 - opacity))); };
  std::array<std::vector<float>, 2> parts;
  for (float& x : g.opacity_logits) {
    const double opacity = random.uniform(0.0041, 0.02);
    x = logit(opacity);
    for (std::size_t i = 0; i < 2; ++i)
      parts[i].push_back(logit(-std::expm1((i == 0 ? 0.3 : 0.7) * std::log1p(-opacity))));
  }
  Scene two = scene;
  std::array halves = {g, g};
  for (std::size_t i = 0; i < 2; ++i) halves[i].opacity_logits = parts[i];
  two.gaussians = concatenated(std::array<const Gaussians*, 2>{&halves[0], &halves[1]});
  return {{"image of Gaussians split in two",
           largest_difference(render_scene<float>(two).image, render_scene<float>(scene).image), 1e-6}};
}

/// R8: every Gaussian looked at in every pixel, by the compositor's own functions. Few large ones, some, and many.
std::vector<StressFigure> without_culling(Remedy remedy) {
  double bits = 0;
  Largest transmittance, image, gradient;
  for (const auto& [count, width, height] : {std::array{30, 33, 25}, {200, 75, 50}, {1500, 96, 64}}) {
    Scene scene = random_scene(count, 8, width, height);
    for (float& x : scene.gaussians.opacity_logits) x += 2;  // the square cuts those most that are opaque
    const WalkedScene walked(scene);
    if (remedy == Remedy::kOff) scene.settings.footprint = Footprint::kSquare3Sigma;
    TapedScene<float> taped(scene);
    taped.run();
    const WalkedPixels all = walked.everything(taped.gradient(taped.rendered.image));
    const std::vector<double> t = taped.value(taped.rendered.transmittance);
    bits += unequal(t, all.transmittance);
    transmittance.add(largest_difference(t, all.transmittance));
    image.add(largest_difference(taped.value(taped.rendered.image), all.image));
    gradient.add(relative_l2(taped.gradient(taped.colors), all.d_colors));
  }
  return {{"pixels whose T has other bits without culling", bits, 0},
          {"largest difference of T", transmittance.value(), 0},
          {"largest difference of the image", image.value(), 1e-6},
          {"gradient by colours, relative", gradient.value(), 1e-6}};
}

/// R9
std::vector<StressFigure> numbers_of_threads(Remedy remedy) {
  const Scene scene = random_scene(1500, 9, 48, 32);
  const auto numbers = [&](int count) {
    std::vector<double> all;
    with_threads(count, [&] {
      const Rendering r = render_scene<float>(scene);
      all = remedy == Remedy::kOn ? r.image : sums_by_thread(r.image, count);
      const std::vector<double> gradients = r.gradients();
      all.insert(all.end(), gradients.begin(), gradients.end());
    });
    return all;
  };
  const std::vector<double> one = numbers(1);
  double other = 0;
  for (const int count : {2, 3, 8, 16}) other += unequal(numbers(count), one);
  return {{"numbers with other bits, 2, 3, 8 and 16 threads", other, 0}};
}

/// R10
std::vector<StressFigure> sizes_of_tiles(Remedy remedy) {
  Scene scene = random_scene(200, 10, 75, 50);
  const auto t = [&](int tile) {
    scene.settings.tile = tile;
    if (remedy == Remedy::kOn) return render_scene<float>(scene).transmittance;
    return WalkedScene(scene).transmittance_by_tiles(tile);
  };
  return {{"T, tiles of 8 pixels against 16", largest_difference(t(8), t(16)), 2e-6}};
}

/// R11
std::vector<StressFigure> instruction_sets(Remedy remedy) {
  const Scene scene = random_scene(120, 11, 49, 37);
  std::vector<Rendering> renderings;
  if (remedy == Remedy::kOn) {
    on_every_vector_target([&](const char*) { renderings.push_back(render_scene<float>(scene)); });
  } else {  // 1/sqrt as AVX2 approximates it, and as AVX-512 does
    for (const int bits : {12, 14}) {
      Rendering r = render_scene<float>(scene);
      r.transmittance = WalkedScene(scene).transmittance_of_digits(bits);
      renderings.push_back(std::move(r));
    }
  }
  Largest t, gradients;
  for (const Rendering& r : renderings) {
    t.add(largest_difference(r.transmittance, renderings.front().transmittance));
    gradients.add(relative_l2(r.gradients(), renderings.front().gradients()));
  }
  return {{"T, one instruction set against another", t.value(), 2e-6},
          {"gradients, relative", gradients.value(), 5e-6}};
}

/// R12: powers of two commute with every rounding.
std::vector<StressFigure> scaled_loss(Remedy remedy) {
  const Scene scene = random_scene(100, 12, 48, 32);
  const auto gradients = [&](float factor) {
    TapedScene<float> taped(scene);
    taped.tape.forward(taped.loss);
    taped.tape.backward(taped.loss, std::array{factor});
    std::vector<double> all;
    for (const Var<float> var :
         {taped.means, taped.quats, taped.log_scales, taped.opacity_logits, taped.sh, taped.xi}) {
      const std::vector<double> d = taped.gradient(var);
      all.insert(all.end(), d.begin(), d.end());
    }
    if (remedy == Remedy::kOff) {  // what is below an absolute threshold is left out
      for (double& x : all) x = std::abs(x) < 1e-8 ? 0 : x;
    }
    return times(all, 1 / static_cast<double>(factor));
  };
  const std::vector<double> one = gradients(1);
  double other = 0;
  for (const float factor : {0x1p-30F, 0x1p-10F, 0x1p10F, 0x1p30F}) other += unequal(gradients(factor), one);
  return {{"gradients with other bits, loss times 2^-30 to 2^30", other, 0}};
}

/// R13
std::vector<StressFigure> extremes(Remedy remedy) {
  double unseen = 0;
  Largest difference;
  for (const ExtremeKind& kind : extreme_kinds()) {
    Scene scene = empty_scene(front_camera(33, 25));
    scene.add({0, 0, kind.depth}, kind.scales, kind.opacity_logit, {0.9, 0.1, 0.4});
    const std::vector<double> exact = reference_rendering(scene).image;
    if (remedy == Remedy::kOff && is_guarded(kind)) scene.gaussians = selected(scene.gaussians, {});
    const Rendering r = render_scene<float>(scene);
    unseen += 1 - *std::min_element(r.transmittance.begin(), r.transmittance.end()) < kAlphaMin;
    difference.add(largest_difference(r.image, exact));
  }
  return {{"valid Gaussians that are not seen", unseen, 0},
          {"their images against brute force", difference.value(), 1e-5}};
}

}  // namespace hsi4d::stress
