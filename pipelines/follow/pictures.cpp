#include "pipelines/follow/pictures.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"

namespace hsi4d {

void must_work(const std::string& error, const char* what) {
  if (!error.empty()) throw InternalError(std::string(what) + ": " + error);
}

Image reduced_to(const Image& image, int longest_side_px) {
  const int longest = std::max(image.width(), image.height());
  if (longest <= longest_side_px) return image;
  const auto reduced = [&](int side) {
    return std::max(1, static_cast<int>(std::lround(static_cast<double>(side) * longest_side_px / longest)));
  };
  return resize_area(image, reduced(image.height()), reduced(image.width()));
}

bool shows_something(const Image& mask) {
  for (int y = 0; y < mask.height(); ++y) {
    if (std::any_of(mask.row(0, y), mask.row(0, y) + mask.width(), [](float share) { return share > 0.5F; }))
      return true;
  }
  return false;
}

float sample(const Image& image, int c, double y, double x) {
  const int left = static_cast<int>(std::floor(x)), top = static_cast<int>(std::floor(y));
  const auto across = static_cast<float>(x - left), down = static_cast<float>(y - top);
  const auto at = [&](int v, int u) {
    return u < 0 || v < 0 || u >= image.width() || v >= image.height() ? 0.0F : image(c, v, u);
  };
  const float upper = (1 - across) * at(top, left) + across * at(top, left + 1);
  const float lower = (1 - across) * at(top + 1, left) + across * at(top + 1, left + 1);
  return (1 - down) * upper + down * lower;
}

Image enlarged_mask(const Image& mask, int height, int width) {
  if (mask.height() == height && mask.width() == width) return mask;
  Image large(1, height, width);
  for (int y = 0; y < height; ++y) {
    const double v = std::clamp((y + 0.5) * mask.height() / height - 0.5, 0.0, mask.height() - 1.0);
    for (int x = 0; x < width; ++x) {
      const double u = std::clamp((x + 0.5) * mask.width() / width - 0.5, 0.0, mask.width() - 1.0);
      large(0, y, x) = sample(mask, 0, v, u);
    }
  }
  return large;
}

}  // namespace hsi4d
