#include "splat/reference/reference.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include "core/check.h"
#include "splat/reference/reference_gaussian.h"

namespace hsi4d::reference {
namespace {

template <class T>
void check_scene(const Scene<T>& scene) {
  const auto n = static_cast<std::size_t>(scene.n);
  const int k = scene.sh_coefficients;
  HSI4D_CHECK(scene.n >= 0, std::to_string(scene.n));
  HSI4D_CHECK(k == 1 || k == 4 || k == 9 || k == 16, std::to_string(k) + " coefficients of spherical harmonics");
  HSI4D_CHECK_EQ(scene.means.size(), 3 * n);
  HSI4D_CHECK_EQ(scene.quats.size(), 4 * n);
  HSI4D_CHECK_EQ(scene.log_scales.size(), 3 * n);
  HSI4D_CHECK_EQ(scene.opacity_logits.size(), n);
  HSI4D_CHECK_EQ(scene.sh.size(), 3 * static_cast<std::size_t>(k) * n);
  if (!scene.transforms.empty()) HSI4D_CHECK_EQ(scene.transforms.size(), 12 * n);
  if (!scene.groups.empty()) HSI4D_CHECK_EQ(scene.groups.size(), n);
  for (const int group : scene.groups) HSI4D_CHECK(group >= -1, "group " + std::to_string(group));
}

/// G of reference.h.
template <class T>
std::size_t group_count(const Scene<T>& scene) {
  int highest = -1;
  for (const int group : scene.groups) highest = std::max(highest, group);
  return static_cast<std::size_t>(highest + 1);
}

/// The Gaussians that draw anything, nearest first.
template <class T>
std::vector<Drawn<T>> draw_all(const Scene<T>& scene, const View<T>& view, const RenderSettings& settings) {
  std::vector<Drawn<T>> all;
  for (Index i = 0; i < scene.n; ++i) {
    Drawn<T> drawn;
    if (draw(scene, i, view, settings, drawn)) all.push_back(drawn);
  }
  std::sort(all.begin(), all.end(), [](const Drawn<T>& a, const Drawn<T>& b) {
    return a.depth_key != b.depth_key ? a.depth_key < b.depth_key : a.index < b.index;
  });
  return all;
}

/// A Gaussian composited in a pixel, with what its adjoint needs.
template <class T>
struct Hit {
  std::size_t place;       // in the depth order
  T alpha, transmittance;  // T in front of it
  T gaussian;              // G
  T d_alpha;               // dα/d(o G): 1, or 0 where the cap holds
  std::array<T, 2> slope;  // cov⁻¹ d
};

/// Exponent ½ dᵀ cov⁻¹ d and cov⁻¹ d, in the axes of the ellipse.
template <class T>
T exponent(const Ellipse<T>& ellipse, T dx, T dy, std::array<T, 2>& slope) {
  const auto [ax, ay] = ellipse.axis;
  const T along = ax * dx + ay * dy, across = ax * dy - ay * dx;
  const T q_along = along / ellipse.long_variance, q_across = across / ellipse.short_variance;
  slope = {ax * q_along - ay * q_across, ay * q_along + ax * q_across};
  return (along * q_along + across * q_across) / 2;
}

template <class T>
bool past_threshold(T transmittance, const RenderSettings& settings) {
  const T stop = settings.transmittance_stop;
  if (stop == 0) return false;
  return settings.stop_when == StopWhen::kAtOrBelow ? transmittance <= stop : transmittance < stop;
}

/// Where a pixel's compositing ended.
struct End {
  std::size_t place;  // in the depth order: after the last one looked at
  bool stopped, refused;
};

/// Step 6: the Gaussians composited in a pixel, front to back. Returns T behind them. Those with α = 0 change nothing
/// and are left out.
///
/// @param misses  may be null: those that are left out for their α, and the one that the exclusive stop leaves out
template <class T>
T composite_pixel(const std::vector<Drawn<T>>& order, const RenderSettings& settings, int row, int column,
                  std::vector<Hit<T>>& hits, std::vector<Hit<T>>* misses = nullptr, End* end = nullptr) {
  hits.clear();
  T transmittance = 1;
  const std::array<int, 2> tile = {column / kInriaTile, row / kInriaTile};
  if (end != nullptr) *end = {order.size(), false, false};
  for (std::size_t place = 0; place < order.size(); ++place) {
    const Drawn<T>& drawn = order[place];
    if (tile[0] < drawn.tile_begin[0] || tile[0] >= drawn.tile_end[0] || tile[1] < drawn.tile_begin[1] ||
        tile[1] >= drawn.tile_end[1])
      continue;
    Hit<T> hit;
    hit.place = place;
    hit.gaussian =
        std::exp(-exponent(drawn.ellipse, column + T(0.5) - drawn.mean[0], row + T(0.5) - drawn.mean[1], hit.slope));
    const T uncapped = drawn.opacity * hit.gaussian, cap = settings.alpha_cap;
    hit.alpha = std::min(cap, uncapped);
    hit.d_alpha = uncapped > cap && settings.cap_gradient == CapGradient::kZero ? 0 : 1;
    hit.transmittance = transmittance;
    if (hit.alpha < T(settings.alpha_min) || hit.alpha == 0) {
      if (misses != nullptr) misses->push_back(hit);
      continue;
    }
    const T behind = transmittance * (1 - hit.alpha);
    const bool stops = past_threshold(behind, settings), refused = stops && settings.stop_rule == StopRule::kExclusive;
    if (stops && end != nullptr) *end = {place + 1, true, refused};
    if (refused && misses != nullptr) misses->push_back(hit);
    if (refused) break;
    hits.push_back(hit);
    transmittance = behind;
    if (stops) break;
  }
  return transmittance;
}

/// Cotangent of one pixel; zeros where the arrays are empty.
template <class T>
struct PixelCotangent {
  Vec3<T> color{};
  T transmittance = 0, depth_sum = 0;
  const T* groups = nullptr;  // of group 0; the next is `group_stride` on
  std::size_t group_stride = 0;

  PixelCotangent(const Image<T>& image, std::size_t pixel, std::size_t pixels) : group_stride(pixels) {
    if (!image.color.empty()) color = {image.color[3 * pixel], image.color[3 * pixel + 1], image.color[3 * pixel + 2]};
    if (!image.transmittance.empty()) transmittance = image.transmittance[pixel];
    if (!image.depth_sum.empty()) depth_sum = image.depth_sum[pixel];
    if (!image.group_opacity.empty()) groups = image.group_opacity.data() + pixel;
  }
  /// The loss's derivative by the weight of a Gaussian: what it shows, seen through the cotangent.
  T of(const Drawn<T>& drawn) const {
    T sum = dot(color, drawn.color) + depth_sum * drawn.depth;
    if (groups != nullptr && drawn.group >= 0) sum += groups[static_cast<std::size_t>(drawn.group) * group_stride];
    return sum;
  }
};

/// Adjoint of step 6 for one pixel, back to front: v_i = T_i (c_i − S_i), S_{i−1} = α_i c_i + (1 − α_i) S_i.
template <class T>
void composite_pixel_adjoint(const std::vector<Drawn<T>>& order, const std::vector<Hit<T>>& hits,
                             const PixelCotangent<T>& cotangent, T seen_behind,
                             std::vector<DrawnGradient<T>>& d_order) {
  for (std::size_t h = hits.size(); h-- > 0;) {
    const Hit<T>& hit = hits[h];
    const Drawn<T>& drawn = order[hit.place];
    DrawnGradient<T>& d_drawn = d_order[hit.place];
    const T shown = cotangent.of(drawn), weight = hit.transmittance * hit.alpha;
    add(d_drawn.color, weight, cotangent.color);
    d_drawn.depth += weight * cotangent.depth_sum;
    const T d_uncapped = hit.transmittance * (shown - seen_behind) * hit.d_alpha;
    seen_behind = hit.alpha * shown + (1 - hit.alpha) * seen_behind;
    // o G with G = exp(−s): ds/d(mean) = −cov⁻¹ d, ds/d(cov) = −½ (cov⁻¹ d)(cov⁻¹ d)ᵀ.
    d_drawn.opacity += d_uncapped * hit.gaussian;
    const T d_log = d_uncapped * drawn.opacity * hit.gaussian;
    const auto [qx, qy] = hit.slope;
    d_drawn.mean[0] += d_log * qx;
    d_drawn.mean[1] += d_log * qy;
    d_drawn.cov[0] += d_log * qx * qx / 2;
    d_drawn.cov[1] += d_log * qx * qy / 2;
    d_drawn.cov[2] += d_log * qy * qy / 2;
  }
}

template <class T>
Gradients<T> zero_gradients(const Scene<T>& scene) {
  Gradients<T> zero;
  zero.means.resize(scene.means.size());
  zero.quats.resize(scene.quats.size());
  zero.log_scales.resize(scene.log_scales.size());
  zero.opacity_logits.resize(scene.opacity_logits.size());
  zero.sh.resize(scene.sh.size());
  zero.transforms.resize(scene.transforms.size());
  return zero;
}

void check_cotangent(const char* name, std::size_t size, std::size_t expected) {
  HSI4D_CHECK(size == 0 || size == expected,
              std::string(name) + ": " + std::to_string(size) + " numbers, not 0 or " + std::to_string(expected));
}

}  // namespace

template <class T>
Image<T> render(const Scene<T>& scene, const Pinhole<T>& camera, const std::array<T, 3>& background,
                const RenderSettings& settings) {
  check_scene(scene);
  const View<T> view = view_of(camera, settings);
  const std::vector<Drawn<T>> order = draw_all(scene, view, settings);
  const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  Image<T> image;
  image.color.resize(3 * pixels);
  image.transmittance.resize(pixels);
  image.depth_sum.resize(pixels);
  image.group_opacity.resize(group_count(scene) * pixels);
  std::vector<Hit<T>> hits;
  std::size_t pixel = 0;
  for (int row = 0; row < camera.height; ++row)
    for (int column = 0; column < camera.width; ++column, ++pixel) {
      const T transmittance = composite_pixel(order, settings, row, column, hits);
      Vec3<T> color{};
      for (const Hit<T>& hit : hits) {
        const Drawn<T>& drawn = order[hit.place];
        const T weight = hit.transmittance * hit.alpha;
        add(color, weight, drawn.color);
        image.depth_sum[pixel] += weight * drawn.depth;
        if (drawn.group >= 0) image.group_opacity[static_cast<std::size_t>(drawn.group) * pixels + pixel] += weight;
      }
      add(color, transmittance, background);
      std::copy(color.begin(), color.end(), &image.color[3 * pixel]);
      image.transmittance[pixel] = transmittance;
    }
  return image;
}

template <class T>
Gradients<T> gradients(const Scene<T>& scene, const Pinhole<T>& camera, const std::array<T, 3>& background,
                       const RenderSettings& settings, const Image<T>& cotangent) {
  check_scene(scene);
  const View<T> view = view_of(camera, settings);
  const std::vector<Drawn<T>> order = draw_all(scene, view, settings);
  const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  check_cotangent("color", cotangent.color.size(), 3 * pixels);
  check_cotangent("transmittance", cotangent.transmittance.size(), pixels);
  check_cotangent("depth_sum", cotangent.depth_sum.size(), pixels);
  check_cotangent("group_opacity", cotangent.group_opacity.size(), group_count(scene) * pixels);

  Gradients<T> result = zero_gradients(scene);
  std::vector<DrawnGradient<T>> d_order(order.size());
  std::vector<Hit<T>> hits;
  std::size_t pixel = 0;
  for (int row = 0; row < camera.height; ++row)
    for (int column = 0; column < camera.width; ++column, ++pixel) {
      const T transmittance = composite_pixel(order, settings, row, column, hits);
      const PixelCotangent<T> at(cotangent, pixel, pixels);
      add(result.background, transmittance, at.color);
      composite_pixel_adjoint(order, hits, at, dot(at.color, background) + at.transmittance, d_order);
    }
  for (std::size_t place = 0; place < order.size(); ++place)
    draw_adjoint(scene, order[place].index, view, settings, d_order[place], result);
  return result;
}

template <class T>
PixelFragments<T> fragments(const Scene<T>& scene, const Pinhole<T>& camera, const RenderSettings& settings, int row,
                            int column) {
  check_scene(scene);
  const View<T> view = view_of(camera, settings);
  HSI4D_CHECK(row >= 0 && row < camera.height && column >= 0 && column < camera.width, "the pixel is not in the image");
  const std::vector<Drawn<T>> order = draw_all(scene, view, settings);
  std::vector<Hit<T>> hits, misses;
  End end{};
  PixelFragments<T> result;
  result.transmittance = composite_pixel(order, settings, row, column, hits, &misses, &end);
  result.stopped = end.stopped;
  result.behind_stop = static_cast<Index>(order.size() - end.place);
  const auto add_to = [&](std::vector<Fragment<T>>& list, const Hit<T>& hit) {
    const Drawn<T>& drawn = order[hit.place];
    list.push_back({drawn.index, hit.alpha, hit.transmittance, drawn.opacity * hit.gaussian, drawn.depth, drawn.color});
  };
  for (const Hit<T>& hit : hits) add_to(result.composited, hit);
  if (end.refused) {
    add_to(result.refused, misses.back());
    misses.pop_back();
  }
  for (const Hit<T>& hit : misses) add_to(result.skipped, hit);
  return result;
}

#define HSI4D_REFERENCE(T)                                                                                            \
  template Image<T> render(const Scene<T>&, const Pinhole<T>&, const std::array<T, 3>&, const RenderSettings&);       \
  template Gradients<T> gradients(const Scene<T>&, const Pinhole<T>&, const std::array<T, 3>&, const RenderSettings&, \
                                  const Image<T>&);                                                                   \
  template PixelFragments<T> fragments(const Scene<T>&, const Pinhole<T>&, const RenderSettings&, int, int);
HSI4D_REFERENCE(double)
HSI4D_REFERENCE(long double)
#undef HSI4D_REFERENCE

}  // namespace hsi4d::reference
