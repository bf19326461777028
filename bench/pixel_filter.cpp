#include "bench/pixel_filter.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/check.h"

namespace hsi4d {

namespace {

constexpr int kBandRows = 64;  // of the small image

std::size_t place(const SceneImage& image, int row, int column) {
  return static_cast<std::size_t>(row) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(column);
}

/// 0 outside of the image.
double alpha_at(const SceneImage& image, int row, int column) {
  const bool inside = row >= 0 && row < image.height && column >= 0 && column < image.width;
  return inside ? image.alpha[place(image, row, column)] : 0;
}

/// Adds a band of the large image to the rows of the small one that begin at `first_row`.
void add_reduced(const SceneImage& band, int factor, int first_row, SceneImage& result) {
  const double share = 1.0 / (factor * factor);
  for (int row = 0; row < band.height; ++row) {
    for (int column = 0; column < band.width; ++column) {
      const std::size_t from = place(band, row, column), to = place(result, first_row + row / factor, column / factor);
      result.alpha[to] += share * band.alpha[from];
      for (std::size_t c = 0; c < 3; ++c) result.image[3 * to + c] += share * band.image[3 * from + c];
    }
  }
}

/// [H,W,C] convolved along rows or columns with weights for −r … r.
std::vector<double> convolved(const std::vector<double>& from, const SceneImage& size, int channels, bool along_rows,
                              const std::vector<double>& weights) {
  std::vector<double> result(from.size());
  const int reach = static_cast<int>(weights.size()) / 2;
  for (int row = 0; row < size.height; ++row) {
    for (int column = 0; column < size.width; ++column) {
      for (int k = -reach; k <= reach; ++k) {
        const int r = along_rows ? row : row + k, x = along_rows ? column + k : column;
        if (r < 0 || r >= size.height || x < 0 || x >= size.width) continue;
        const std::size_t n = static_cast<std::size_t>(channels), to = n * place(size, row, column);
        for (std::size_t c = 0; c < n; ++c)
          result[to + c] += weights[static_cast<std::size_t>(k + reach)] * from[n * place(size, r, x) + c];
      }
    }
  }
  return result;
}

/// Pixels² within which the opacity is above ½; the crossings of each row are interpolated between pixel centres.
double area_above_half(const SceneImage& image) {
  double area = 0;
  for (int row = 0; row < image.height; ++row) {
    for (int column = -1; column < image.width; ++column) {
      const double a = alpha_at(image, row, column) - 0.5, b = alpha_at(image, row, column + 1) - 0.5;
      if (a > 0 && b > 0)
        area += 1;
      else if (a > 0 || b > 0)
        area += std::max(a, b) / std::abs(a - b);
    }
  }
  return area;
}

}  // namespace

SceneImage supersampled(const PosedGaussians& scene, const SceneView& view, int factor) {
  HSI4D_CHECK(factor >= 1, "a factor of " + std::to_string(factor) + " makes no image");
  const Camera& small = view.camera;
  SceneImage result{small.width, small.height, {}, {}, {}, {}};
  result.alpha.assign(static_cast<std::size_t>(small.width) * static_cast<std::size_t>(small.height), 0);
  result.image.assign(3 * result.alpha.size(), 0);
  for (int first = 0; first < small.height; first += kBandRows) {
    SceneView band = view;
    band.camera.width = small.width * factor;
    band.camera.height = std::min(kBandRows, small.height - first) * factor;
    band.camera.fx = small.fx * factor;
    band.camera.fy = small.fy * factor;
    band.camera.cx = small.cx * factor;
    band.camera.cy = (small.cy - first) * factor;
    add_reduced(render_scene(scene, band), factor, first, result);
  }
  return result;
}

SceneImage softened(const SceneImage& image, double variance) {
  HSI4D_CHECK(variance > 0, "a lens of variance " + std::to_string(variance));
  const int reach = static_cast<int>(std::ceil(5 * std::sqrt(variance)));
  std::vector<double> weights;
  for (int k = -reach; k <= reach; ++k) weights.push_back(std::exp(-0.5 * k * k / variance));
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  for (double& w : weights) w /= sum;
  SceneImage result = image;
  result.depth.clear();
  result.drawn.reset();
  for (const bool along_rows : {true, false}) {
    result.image = convolved(result.image, image, 3, along_rows, weights);
    result.alpha = convolved(result.alpha, image, 1, along_rows, weights);
  }
  return result;
}

SilhouetteError silhouette_error(const SceneImage& render, const SceneImage& truth) {
  HSI4D_CHECK_EQ(render.width, truth.width);
  HSI4D_CHECK_EQ(render.height, truth.height);
  double contour = 0, excess = 0;
  for (int row = 0; row < truth.height; ++row) {
    for (int column = 0; column < truth.width; ++column) {
      const double across = alpha_at(truth, row, column + 1) - alpha_at(truth, row, column - 1);
      const double down = alpha_at(truth, row + 1, column) - alpha_at(truth, row - 1, column);
      contour += std::hypot(across, down) / 2;
      excess += alpha_at(render, row, column) - alpha_at(truth, row, column);
    }
  }
  HSI4D_CHECK(contour > 0, "the true image has no silhouette");
  const double area = std::accumulate(truth.alpha.begin(), truth.alpha.end(), 0.0);
  const double light = std::accumulate(render.image.begin(), render.image.end(), 0.0);
  const double true_light = std::accumulate(truth.image.begin(), truth.image.end(), 0.0);
  const double distance = std::transform_reduce(render.image.begin(), render.image.end(), truth.image.begin(), 0.0,
                                                std::plus<>(), [](double a, double b) { return (a - b) * (a - b); });
  SilhouetteError error;
  error.width_px = 2 * excess / contour;
  error.half_width_px = 2 * (area_above_half(render) - area_above_half(truth)) / contour;
  error.brightness = true_light > 0 ? light / true_light - 1 : 0;
  error.rms = std::sqrt(distance / (3 * area));
  return error;
}

}  // namespace hsi4d
