#include "splat/files/splat_rows.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "core/text.h"
#include "splat/files/far_means.h"

namespace hsi4d {
namespace {

constexpr std::array<const char*, 6> kRejections = {"a mean that is not finite",       "a scale that is not finite",
                                                    "a quaternion that is not finite", "a quaternion that is zero",
                                                    "an opacity that is no number",    "a colour that is not finite"};

bool all_finite(std::span<const float> values) {
  return std::all_of(values.begin(), values.end(), [](float value) { return std::isfinite(value); });
}

void add_count(Counts& counts, const char* reason, Index count) {
  if (count > 0) counts.emplace_back(reason, count);
}

/// The number put at a place of an array; where it is beyond its limit it is held there, which `places` records.
void put_held(float value, double limit, std::vector<float>& array, Index place, std::vector<Index>& places) {
  const float bound = static_cast<float>(limit);
  const float inside = std::clamp(value, -bound, bound);
  if (inside != value) places.push_back(place);
  array[static_cast<std::size_t>(place)] = inside;
}

}  // namespace

std::string counts_text(const Counts& counts) {
  std::string text;
  for (const auto& [reason, count] : counts) text += (text.empty() ? "" : ", ") + reason + ": " + std::to_string(count);
  return text;
}

std::string summary_text(const SplatReport& report) {
  std::string text;
  if (report.rejected > 0)
    text = std::to_string(report.rejected) + " of " + std::to_string(report.rows) + " Gaussians are left out (" +
           counts_text(report.rejections) + ")";
  if (!report.repairs.empty()) text += (text.empty() ? "" : "; ") + counts_text(report.repairs);
  return text;
}

void caution_of_others(const std::vector<std::string>& names, SplatRows& rows) {
  if (!names.empty())
    rows.add_caution("not known, and passed over, though the picture may depend on it: " + few_names(names));
}

SplatRows::SplatRows(Index rows, int sh_degree, std::string format, const Vector3<double>& origin_world) {
  file_.gaussians.origin_world = origin_world;
  file_.gaussians.sh_degree = sh_degree;
  resize(rows);
  file_.report.format = std::move(format);
  file_.report.rows = rows;
  file_.report.row_of.reserve(static_cast<std::size_t>(rows));
}

void SplatRows::take(const SplatRow& row) {
  const Index file_row = next_row_++;
  std::array<float, 3> mean{};
  for (std::size_t c = 0; c < 3; ++c) {
    mean[c] = static_cast<float>(row.mean[c] - file_.gaussians.origin_world[static_cast<Index>(c)]);
    is_finer_ = is_finer_ || static_cast<double>(static_cast<float>(row.mean[c])) != row.mean[c];
  }
  const int reason = why_rejected(row, mean);
  if (reason >= 0) {
    ++rejections_[static_cast<std::size_t>(reason)];
    return;
  }
  store(row, mean, static_cast<Index>(file_.report.row_of.size()));
  file_.report.row_of.push_back(file_row);
}

SplatFile SplatRows::finish() {
  SplatReport& report = file_.report;
  const Index kept = static_cast<Index>(report.row_of.size());
  resize(kept);
  report.rejected = report.rows - kept;
  for (std::size_t i = 0; i < kRejections.size(); ++i) add_count(report.rejections, kRejections[i], rejections_[i]);
  add_count(report.repairs, "log-scales held within ±20", std::ssize(report.held_log_scales));
  add_count(report.repairs, "opacity logits held within ±20", std::ssize(report.held_opacity_logits));
  report.repairs.insert(report.repairs.end(), more_repairs_.begin(), more_repairs_.end());
  const FarMeans far = far_means(file_.gaussians, Vector3<double>::Zero());
  if (far.count > 0) report.cautions.push_back(far_means_text(far, kept, is_finer_));
  return std::move(file_);
}

/// The first reason against the row, or -1.
int SplatRows::why_rejected(const SplatRow& row, const std::array<float, 3>& mean) const {
  if (!all_finite(mean)) return 0;
  if (!all_finite(row.log_scale)) return 1;
  if (!all_finite(row.quat)) return 2;
  const bool zero = std::all_of(row.quat.begin(), row.quat.end(),
                                [](float q) { return std::fabs(q) < std::numeric_limits<float>::min(); });
  if (zero) return 3;
  if (std::isnan(row.opacity_logit)) return 4;
  const auto sh_count = static_cast<std::size_t>(3 * file_.gaussians.sh_coefficients());
  if (!all_finite(std::span(row.sh).first(sh_count))) return 5;
  return -1;
}

void SplatRows::store(const SplatRow& row, const std::array<float, 3>& mean, Index n) {
  Gaussians& g = file_.gaussians;
  SplatReport& report = file_.report;
  std::copy(mean.begin(), mean.end(), g.means.begin() + 3 * n);
  std::copy(row.quat.begin(), row.quat.end(), g.quats.begin() + 4 * n);
  for (Index c = 0; c < 3; ++c) {
    const float value = row.log_scale[static_cast<std::size_t>(c)];
    put_held(value, kLogScaleLimit, g.log_scales, 3 * n + c, report.held_log_scales);
  }
  put_held(row.opacity_logit, kOpacityLogitLimit, g.opacity_logits, n, report.held_opacity_logits);
  const Index sh_count = 3 * Index{g.sh_coefficients()};
  std::copy_n(row.sh.begin(), sh_count, g.sh.begin() + sh_count * n);
}

void SplatRows::resize(Index rows) {
  Gaussians& g = file_.gaussians;
  const auto n = static_cast<std::size_t>(rows);
  g.means.resize(3 * n);
  g.quats.resize(4 * n);
  g.log_scales.resize(3 * n);
  g.opacity_logits.resize(n);
  g.sh.resize(3 * n * static_cast<std::size_t>(g.sh_coefficients()));
}

}  // namespace hsi4d
