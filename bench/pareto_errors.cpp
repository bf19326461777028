// Errors, and what no other setting beats.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "bench/pareto.h"
#include "core/check.h"

namespace hsi4d {

namespace {

/// Of positive numbers.
double geometric_mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double x : values) sum += std::log(x);
  return std::exp(sum / static_cast<double>(values.size()));
}

/// The middle one; the larger of two in the middle.
double middle(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// A class of derivatives whose true length is this share of the longest class's has none but for rounding in double:
/// those of quaternions by which balls are turned.
constexpr double kNoGradient = 1e-12;
/// What rounding in float may make of it.
constexpr double kRounding = 1e-5;

double length(std::span<const double> numbers) {
  double sum = 0;
  for (const double x : numbers) sum += x * x;
  return std::sqrt(sum);
}

/// What a setting measured, by scene.
struct Gathered {
  ParetoPoint point;
  std::vector<double> times, images, gradients;
};

void gather(const ParetoRow& row, std::vector<Gathered>& all) {
  auto at = std::find_if(all.begin(), all.end(), [&row](const Gathered& g) { return g.point.name() == row.name(); });
  if (at == all.end()) {
    all.push_back({{row.knob, row.value}, {}, {}, {}});
    at = all.end() - 1;
  }
  at->times.push_back(row.time_ratio);
  at->images.push_back(row.image.rms);
  at->gradients.push_back(row.worst_gradient());
}

}  // namespace

std::optional<double> ImageError::psnr_db() const {
  if (!(rms > 0)) return std::nullopt;
  return -20 * std::log10(rms);
}

double ParetoRow::mfragments_per_s() const {
  return both.median_s > 0 ? 1e-6 * static_cast<double>(fragments) / both.median_s : 0;
}

double ParetoRow::worst_gradient() const {
  double worst = 0;
  for (const GradientError& error : gradients) worst = std::max(worst, error.relative_l2);
  return worst;
}

ImageError image_error(std::span<const double> image, std::span<const double> truth) {
  HSI4D_CHECK_EQ(image.size(), truth.size());
  ImageError error;
  if (image.empty()) return error;
  std::vector<double> absolute(image.size());
  double squares = 0, sum = 0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    const double d = image[i] - truth[i];
    absolute[i] = std::abs(d);
    squares += d * d;
    sum += d;
  }
  const auto count = static_cast<double>(image.size());
  error.rms = std::sqrt(squares / count);
  error.bias = sum / count;
  std::sort(absolute.begin(), absolute.end());
  error.max = absolute.back();
  error.p999 = absolute[static_cast<std::size_t>(0.999 * (count - 1))];
  return error;
}

GradientError gradient_error(std::span<const double> gradient, std::span<const double> truth) {
  HSI4D_CHECK_EQ(gradient.size(), truth.size());
  double gg = 0, tt = 0, gt = 0, dd = 0, dt = 0;
  for (std::size_t i = 0; i < gradient.size(); ++i) {
    const double g = gradient[i], t = truth[i], d = g - t;
    gg += g * g, tt += t * t, gt += g * t, dd += d * d, dt += d * t;
  }
  if (dd == 0) return {};
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  if (tt == 0) return {kInfinite, 1, kInfinite};
  // 1 − cos from the part of g across t, where a difference of two numbers near 1 would be rounding.
  const double along = gt / tt;
  double across = 0;
  for (std::size_t i = 0; i < gradient.size(); ++i) {
    const double rest = gradient[i] - along * truth[i];
    across += rest * rest;
  }
  const double sine2 = gg > 0 ? std::min(1.0, across / gg) : 1;
  const double cosine = (gt < 0 ? -1 : 1) * std::sqrt(1 - sine2);
  return {std::sqrt(dd / tt), cosine > 0 ? sine2 / (1 + cosine) : 1 - cosine, dt / tt};
}

GradientErrors gradient_errors(const SceneGradients& gradients, const SceneGradients& truth) {
  const auto classes = [](const SceneGradients& of) {
    return std::array<std::span<const double>, kGradientClasses.size()>{of.means,          of.quats, of.log_scales,
                                                                        of.opacity_logits, of.sh,    of.camera};
  };
  const auto mine = classes(gradients), exact = classes(truth);
  double largest = 0;
  for (const std::span<const double> of : exact) largest = std::max(largest, length(of));
  GradientErrors errors;
  for (std::size_t c = 0; c < errors.size(); ++c) {
    HSI4D_CHECK_EQ(mine[c].size(), exact[c].size());
    const bool has_none = length(exact[c]) <= kNoGradient * largest && length(mine[c]) <= kRounding * largest;
    if (!has_none) errors[c] = gradient_error(mine[c], exact[c]);
  }
  return errors;
}

std::vector<std::size_t> pareto_front(const std::vector<TimeAndError>& points) {
  std::vector<std::size_t> order(points.size());
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::stable_sort(order.begin(), order.end(), [&points](std::size_t a, std::size_t b) {
    const TimeAndError &p = points[a], &q = points[b];
    return p.time != q.time ? p.time < q.time : p.error < q.error;
  });
  std::vector<std::size_t> front;
  for (const std::size_t i : order)
    if (front.empty() || points[i].error < points[front.back()].error) front.push_back(i);
  return front;
}

std::vector<ParetoPoint> pareto_points(const std::vector<ParetoRow>& rows, const std::string& scene) {
  std::vector<Gathered> all;
  for (const ParetoRow& row : rows) {
    if (row.is_extreme || row.model != ParetoModel::kOwn || (!scene.empty() && row.scene != scene)) continue;
    gather(row, all);
  }
  std::vector<ParetoPoint> points;
  for (Gathered& g : all) {
    g.point.time_ratio = geometric_mean(g.times);
    g.point.image_rms = middle(g.images);
    g.point.worst_image_rms = *std::max_element(g.images.begin(), g.images.end());
    g.point.gradient = middle(g.gradients);
    g.point.worst_gradient = *std::max_element(g.gradients.begin(), g.gradients.end());
    points.push_back(std::move(g.point));
  }
  return points;
}

std::vector<std::size_t> pareto_front(const std::vector<ParetoPoint>& points, double ParetoPoint::*error) {
  std::vector<std::size_t> places;  // of those that may be on it
  std::vector<TimeAndError> candidates;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (is_machine_knob(points[i].knob)) continue;
    places.push_back(i);
    candidates.push_back({points[i].time_ratio, points[i].*error});
  }
  std::vector<std::size_t> front = pareto_front(candidates);
  for (std::size_t& i : front) i = places[i];
  return front;
}

}  // namespace hsi4d
