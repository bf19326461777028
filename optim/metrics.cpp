#include "optim/metrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "autodiff/ssim.h"
#include "core/check.h"
#include "optim/similarity.h"

namespace hsi4d {
namespace {

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();

Vector3<double> point(std::span<const double> points, Index j) {
  return {points[3 * j], points[3 * j + 1], points[3 * j + 2]};
}

/// How many joints count, of two arrays that must have the same.
Index counted_joints(std::span<const double> joints, std::span<const double> truth) {
  HSI4D_CHECK_EQ(joints.size(), truth.size());
  HSI4D_CHECK(!joints.empty() && joints.size() % 3 == 0,
              "joints are [J,3], not " + std::to_string(joints.size()) + " numbers");
  return std::min(kMetricJoints, static_cast<Index>(joints.size()) / 3);
}

void check_images(const Image& image, const Image& target) {
  HSI4D_CHECK_EQ(image.channels(), target.channels());
  HSI4D_CHECK_EQ(image.height(), target.height());
  HSI4D_CHECK_EQ(image.width(), target.width());
  HSI4D_CHECK(!image.empty(), "an image without pixels cannot be compared");
}

/// Σ w d², and Σ w, over rows that are summed one by one.
struct WeightedSquares {
  double squares = 0, weights = 0;
};

WeightedSquares weighted_squares(const Image& image, const Image& target, const Image* weight) {
  WeightedSquares sum;
  for (int c = 0; c < image.channels(); ++c) {
    for (int y = 0; y < image.height(); ++y) {
      const float* const a = image.row(c, y);
      const float* const b = target.row(c, y);
      const float* const w = weight ? weight->row(0, y) : nullptr;
      double squares = 0, weights = 0;
      for (int x = 0; x < image.width(); ++x) {
        const double difference = static_cast<double>(a[x]) - static_cast<double>(b[x]);
        const double share = w ? static_cast<double>(w[x]) : 1;
        if (share == 0) continue;  // what is masked out may be anything, infinity included
        squares += share * difference * difference;
        weights += share;
      }
      sum.squares += squares;
      sum.weights += weights;
    }
  }
  return sum;
}

double psnr_of(double mean_square) {
  if (std::isnan(mean_square)) return mean_square;
  const double least = std::pow(10, -kLargestPsnrDb / 10);
  return -10 * std::log10(std::max(mean_square, least));
}

ConstArray<float> view_of_image(const Image& image) {
  return {image.data().data(), {image.channels(), image.height(), image.width(), image.row_stride()}};
}

}  // namespace

double mpjpe_mm(std::span<const double> joints, std::span<const double> truth) {
  const Index count = counted_joints(joints, truth);
  double sum = 0;
  for (Index j = 0; j < count; ++j)
    sum += ((point(joints, j) - point(joints, 0)) - (point(truth, j) - point(truth, 0))).norm();
  return kMillimetres * sum / static_cast<double>(count);
}

double pa_mpjpe_mm(std::span<const double> joints, std::span<const double> truth) {
  const Index count = counted_joints(joints, truth);
  const auto numbers = static_cast<std::size_t>(3 * count);
  const std::array from = {joints.first(numbers)}, to = {truth.first(numbers)};
  const Similarity fit = fit_similarity(from, to, FitScale::kFree);
  double sum = 0;
  for (Index j = 0; j < count; ++j) {
    const Vector3<double> aligned = fit.rotation * (point(joints, j) - fit.from_mean) * fit.scale;
    sum += (aligned - (point(truth, j) - fit.to_mean)).norm();
  }
  return kMillimetres * sum / static_cast<double>(count);
}

double world_mpjpe_mm(std::span<const double> joints, std::span<const double> truth) {
  const Index count = counted_joints(joints, truth);
  double sum = 0;
  for (Index j = 0; j < count; ++j) sum += (point(joints, j) - point(truth, j)).norm();
  return kMillimetres * sum / static_cast<double>(count);
}

WorldErrorParts world_error_parts(std::span<const double> joints, std::span<const double> truth,
                                  const Matrix3<double>& camera_from_world) {
  const Index count = counted_joints(joints, truth);
  WorldErrorParts sum;
  for (Index j = 0; j < count; ++j) {
    const Vector3<double> error = camera_from_world * (point(joints, j) - point(truth, j));
    sum.image_mm += error.head<2>().norm();
    sum.depth_mm += std::fabs(error[2]);
  }
  const double factor = kMillimetres / static_cast<double>(count);
  return {sum.image_mm * factor, sum.depth_mm * factor};
}

double root_translation_mm(std::span<const double> joints, std::span<const double> truth) {
  counted_joints(joints, truth);
  return kMillimetres * (point(joints, 0) - point(truth, 0)).norm();
}

double rotation_error_deg(const Matrix3<double>& a, const Matrix3<double>& b) {
  if (!a.allFinite() || !b.allFinite()) return kNotANumber;
  return kDegrees * so3_log(Matrix3<double>(a.transpose() * b)).norm();
}

double rotation_error_deg(const Vector3<double>& a, const Vector3<double>& b) {
  return rotation_error_deg(so3_exp(a), so3_exp(b));
}

PoseError camera_error(const Rigid<double>& camera, const Rigid<double>& truth) {
  return {kCentimetres * (inverse(camera).translation - inverse(truth).translation).norm(),
          rotation_error_deg(camera.rotation, truth.rotation)};
}

PoseError object_error(const Rigid<double>& object, const Rigid<double>& truth) {
  return {kCentimetres * (object.translation - truth.translation).norm(),
          rotation_error_deg(object.rotation, truth.rotation)};
}

double psnr_db(const Image& image, const Image& target) {
  check_images(image, target);
  const WeightedSquares sum = weighted_squares(image, target, nullptr);
  return psnr_of(sum.squares / sum.weights);
}

std::optional<double> psnr_db(const Image& image, const Image& target, const Image& weight) {
  check_images(image, target);
  HSI4D_CHECK_EQ(weight.channels(), 1);
  HSI4D_CHECK_EQ(weight.height(), image.height());
  HSI4D_CHECK_EQ(weight.width(), image.width());
  const WeightedSquares sum = weighted_squares(image, target, &weight);
  if (sum.weights == 0) return std::nullopt;
  return psnr_of(sum.squares / sum.weights);
}

std::optional<double> mask_iou(const Image& mask, const Image& truth) {
  HSI4D_CHECK_EQ(mask.width(), truth.width());
  HSI4D_CHECK_EQ(mask.height(), truth.height());
  constexpr float kCovered = 0.5F;
  Index both = 0, either = 0, all = 0;
  for (int y = 0; y < truth.height(); ++y) {
    for (int x = 0; x < truth.width(); ++x) {
      const bool is_in_mask = mask(0, y, x) >= kCovered, is_in_truth = truth(0, y, x) >= kCovered;
      both += is_in_mask && is_in_truth ? 1 : 0;
      either += is_in_mask || is_in_truth ? 1 : 0;
      all += is_in_truth ? 1 : 0;
    }
  }
  if (all == 0) return std::nullopt;
  return static_cast<double>(both) / static_cast<double>(either);
}

double image_ssim(const Image& image, const Image& target) {
  check_images(image, target);
  return mean_ssim(view_of_image(image), view_of_image(target));
}

std::optional<double> jitter(std::span<const std::span<const double>> joints, double rate) {
  if (joints.size() < 4) return std::nullopt;
  const Index count = counted_joints(joints[0], joints[0]);
  for (const auto& frame : joints) HSI4D_CHECK_EQ(frame.size(), joints[0].size());
  double sum = 0;
  for (size_t t = 0; t + 3 < joints.size(); ++t) {
    for (Index j = 0; j < count; ++j) {
      // As differences of differences: exact for a motion that stands far from the origin.
      const Vector3<double> first = point(joints[t + 1], j) - point(joints[t], j);
      const Vector3<double> second = point(joints[t + 2], j) - point(joints[t + 1], j);
      const Vector3<double> third = point(joints[t + 3], j) - point(joints[t + 2], j);
      sum += ((third - second) - (second - first)).norm();
    }
  }
  return sum * rate * rate * rate / static_cast<double>(count * static_cast<Index>(joints.size() - 3));
}

}  // namespace hsi4d
