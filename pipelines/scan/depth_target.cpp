#include "pipelines/scan/depth_target.h"

#include <cmath>

#include "core/check.h"
#include "core/parallel.h"

namespace hsi4d {

namespace {

bool is_whole(const Image& share, int x, int y) {
  constexpr float kWhole = 0.999F;
  return share.empty() || share(0, y, x) >= kWhole;
}

/// Whether 1/z is straight enough over three pixels in a row, all known.
bool is_straight(float before, float z, float after) {
  return before > 0 && after > 0 && std::abs(z / before + z / after - 2) <= kMostBend;
}

}  // namespace

void write_depth_target(const Photo& photo, const Array<float>& target) {
  const Image& depth = photo.depth;
  const int width = depth.width(), height = depth.height();
  HSI4D_CHECK(!depth.empty(), "no depths");
  HSI4D_CHECK_EQ(target.shape.rows, height);
  HSI4D_CHECK_EQ(target.shape.cols, width);
  const auto counts = [&](int x, int y) {
    if (x == 0 || y == 0 || x + 1 == width || y + 1 == height) return false;
    const float z = depth(0, y, x);
    return z > 0 && is_whole(photo.alpha, x, y) && is_whole(photo.weight, x, y) &&
           is_straight(depth(0, y, x - 1), z, depth(0, y, x + 1)) &&
           is_straight(depth(0, y - 1, x), z, depth(0, y + 1, x));
  };
  parallel_for(height, 16, [&](Index begin, Index end) {
    for (auto y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < width; ++x) target(y, x) = counts(x, y) ? depth(0, y, x) : 0;
    }
  });
}

}  // namespace hsi4d
