#include "pipelines/follow/plane_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>

#include "pipelines/follow/pictures.h"
#include "pipelines/follow/vision_library.h"

namespace hsi4d {

namespace {

constexpr double kLargestMismatch = 2;  // pixels, of the way there and back
constexpr std::size_t kFewPixels = 60;
constexpr int kFitRounds = 8;
constexpr double kShapePrior = 0.05;  // of the pixels' own weight: that the shape stays as it is

/// BT.601.
Image brightness(const Image& image) {
  Image grey(1, image.height(), image.width());
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x)
      grey(0, y, x) = 0.299F * image(0, y, x) + 0.587F * image(1, y, x) + 0.114F * image(2, y, x);
  }
  return grey;
}

/// How far the way there and back ends from where it began.
double mismatch(const FlowPair& flow, int y, int x) {
  const double u = flow.there(0, y, x), v = flow.there(1, y, x);
  return std::hypot(u + sample(flow.back, 0, y + v, x + u), v + sample(flow.back, 1, y + v, x + u));
}

/// A pixel and its way.
struct MovedPixel {
  double x, y, u, v;
};

std::vector<MovedPixel> moved_pixels(const Image& mask, const FlowPair& flow) {
  std::vector<MovedPixel> pixels;
  for (int y = 0; y < mask.height(); ++y) {
    for (int x = 0; x < mask.width(); ++x) {
      if (mask(0, y, x) > 0.5F && mismatch(flow, y, x) < kLargestMismatch)
        pixels.push_back({static_cast<double>(x), static_cast<double>(y), flow.there(0, y, x), flow.there(1, y, x)});
    }
  }
  return pixels;
}

double median_of(const std::vector<MovedPixel>& pixels, double MovedPixel::*member) {
  std::vector<double> values;
  for (const MovedPixel& pixel : pixels) values.push_back(pixel.*member);
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

FlowPair flow_between(const Image& from, const Image& to) {
  const Image a = brightness(from), b = brightness(to);
  FlowPair flow{Image(2, from.height(), from.width()), Image(2, from.height(), from.width())};
  must_work(vision_library().find_flow(a, b, flow.there), "optical flow");
  must_work(vision_library().find_flow(b, a, flow.back), "optical flow");
  return flow;
}

PlaneMotion common_motion(const Image& mask, const FlowPair& flow, bool only_shift) {
  const std::vector<MovedPixel> pixels = moved_pixels(mask, flow);
  if (pixels.empty()) return {};
  PlaneMotion motion;
  motion.u = median_of(pixels, &MovedPixel::u);
  motion.v = median_of(pixels, &MovedPixel::v);
  if (only_shift || pixels.size() < kFewPixels) return motion;
  const auto count = static_cast<double>(pixels.size());
  double center_x = 0, center_y = 0, spread = 0;
  for (const MovedPixel& pixel : pixels) {
    center_x += pixel.x / count;
    center_y += pixel.y / count;
  }
  for (const MovedPixel& pixel : pixels)
    spread += (pixel.x - center_x) * (pixel.x - center_x) + (pixel.y - center_y) * (pixel.y - center_y);
  // Rows: the way of the centre, and how the way changes to the right and down; columns: u and v.
  Eigen::Matrix<double, 3, 2> fit = Eigen::Matrix<double, 3, 2>::Zero();
  fit.row(0) << motion.u, motion.v;
  for (int round = 0; round < kFitRounds; ++round) {
    Eigen::Matrix3d normal = Eigen::Vector3d(1e-9, kShapePrior * spread / 2, kShapePrior * spread / 2).asDiagonal();
    Eigen::Matrix<double, 3, 2> right = Eigen::Matrix<double, 3, 2>::Zero();
    for (const MovedPixel& pixel : pixels) {
      const Eigen::Vector3d row(1, pixel.x - center_x, pixel.y - center_y);
      const Eigen::RowVector2d way(pixel.u, pixel.v);
      const double weight = std::pow(1 + (way - row.transpose() * fit).squaredNorm(), -2);
      normal += weight * row * row.transpose();
      right += weight * row * way;
    }
    fit = normal.ldlt().solve(right);
  }
  motion = {1 + fit(1, 0), fit(2, 0), fit(1, 1), 1 + fit(2, 1), fit(0, 0), fit(0, 1)};
  motion.u -= fit(1, 0) * center_x + fit(2, 0) * center_y;
  motion.v -= fit(1, 1) * center_x + fit(2, 1) * center_y;
  return motion;
}

Image carried(const Image& image, const PlaneMotion& m) {
  Image result(image.channels(), image.height(), image.width());
  const double area = m.a * m.d - m.b * m.c;
  if (std::abs(area) < 1e-3) return result;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      const double right = x - m.u, down = y - m.v;
      for (int c = 0; c < image.channels(); ++c)
        result(c, y, x) = sample(image, c, (m.a * down - m.c * right) / area, (m.d * right - m.b * down) / area);
    }
  }
  return result;
}

Image carried(const Image& image, const Image& back) {
  Image result(1, image.height(), image.width());
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      const double from_x = back(0, y, x), from_y = back(1, y, x);
      result(0, y, x) = sample(image, 0, y + from_y, x + from_x);
    }
  }
  return result;
}

}  // namespace hsi4d
