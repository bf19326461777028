#include "pipelines/follow/color_model.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace hsi4d {

namespace {

constexpr int kCells = 32;            // a side
constexpr float kMostChroma = 0.35F;  // beyond it colours count as it
constexpr float kLeastDensity = 0.02F;

/// The cell of a colour: Y, Cb and Cr of BT.601.
std::size_t cell_of(const Image& image, int y, int x) {
  const float r = image(0, y, x), g = image(1, y, x), b = image(2, y, x);
  const float luma = 0.299F * r + 0.587F * g + 0.114F * b;
  const auto chroma = [](float value) { return (value / kMostChroma + 1) / 2; };
  const auto index = [](float value) {
    return static_cast<std::size_t>(std::clamp(static_cast<int>(value * kCells), 0, kCells - 1));
  };
  return (index(luma) * kCells + index(chroma((b - luma) * 0.564F))) * kCells + index(chroma((r - luma) * 0.713F));
}

/// Means with the neighbours along one axis, 1 4 6 4 1; the border's value beyond it.
void smooth_along(std::vector<float>& cells, int step) {
  std::array<float, kCells> line;
  for (int i = 0; i < kCells * kCells * kCells; ++i) {
    if ((i / step) % kCells != 0) continue;
    const auto at = [&](int k) -> float& { return cells[static_cast<std::size_t>(i + k * step)]; };
    for (int k = 0; k < kCells; ++k) line[static_cast<std::size_t>(k)] = at(k);
    const auto old = [&line](int k) { return line[static_cast<std::size_t>(std::clamp(k, 0, kCells - 1))]; };
    for (int k = 0; k < kCells; ++k)
      at(k) = (6 * old(k) + 4 * (old(k - 1) + old(k + 1)) + old(k - 2) + old(k + 2)) / 16;
  }
}

}  // namespace

ColorModel colors_of(const Image& image, const Image& weights) {
  std::vector<float> cells(kCells * kCells * kCells);
  double sum = 0;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      const float weight = weights(0, y, x);
      if (weight <= 0) continue;
      cells[cell_of(image, y, x)] += weight;
      sum += weight;
    }
  }
  if (sum == 0) return {};
  for (const int step : {1, kCells, kCells * kCells}) smooth_along(cells, step);
  const auto scale = static_cast<float>(static_cast<double>(cells.size()) / sum);
  for (float& cell : cells) cell *= scale;
  return {std::move(cells)};
}

ColorModel mixed(const ColorModel& a, const ColorModel& b, double share) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  ColorModel result = a;
  const auto part = static_cast<float>(share);
  for (std::size_t i = 0; i < result.densities.size(); ++i)
    result.densities[i] += part * (b.densities[i] - result.densities[i]);
  return result;
}

Image color_odds(const Image& image, const ColorModel& a, const ColorModel& b) {
  Image odds(1, image.height(), image.width());
  if (a.empty() || b.empty()) return odds;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      const std::size_t cell = cell_of(image, y, x);
      odds(0, y, x) = std::clamp(std::log((a.densities[cell] + kLeastDensity) / (b.densities[cell] + kLeastDensity)),
                                 -kMostColorOdds, kMostColorOdds);
    }
  }
  return odds;
}

}  // namespace hsi4d
