#include "splat/io_ply.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "core/check.h"
#include "core/file.h"
#include "splat/limits.h"
#include "splat/ply_table.h"

namespace hsi4d {
namespace {

/// Where the numbers of a row lie, in the order in which columns are asked for.
enum Column : std::size_t { kMean = 0, kScale = 3, kQuat = 6, kOpacity = 10, kDc = 11, kRest = 14 };

std::string numbered(const char* name, int number) { return name + std::to_string(number); }

std::vector<std::string> column_names(int rest_count) {
  std::vector<std::string> names = {"x",     "y",     "z",     "scale_0", "scale_1", "scale_2", "rot_0",
                                    "rot_1", "rot_2", "rot_3", "opacity", "f_dc_0",  "f_dc_1",  "f_dc_2"};
  for (int i = 0; i < rest_count; ++i) names.push_back(numbered("f_rest_", i));
  return names;
}

/// Degree of the harmonics that so many f_rest_ properties are, or -1.
int degree_of(int rest_count) {
  for (int degree = 0; degree <= 3; ++degree) {
    if (rest_count == 3 * ((degree + 1) * (degree + 1) - 1)) return degree;
  }
  return -1;
}

int count_rest(const PlyElement& vertex) {
  return static_cast<int>(
      std::count_if(vertex.properties.begin(), vertex.properties.end(),
                    [](const PlyProperty& property) { return property.name.starts_with("f_rest_"); }));
}

const PlyElement& vertex_of(const PlyHeader& header, const std::string& name) {
  const int place = header.find("vertex");
  if (place < 0) throw DataError(name + ": there is no element \"vertex\"; a file of Gaussians has one");
  return header.elements[static_cast<std::size_t>(place)];
}

/// The places of the wanted properties. Throws DataError with all that are missing.
std::vector<int> columns_of(const PlyElement& vertex, int rest_count, const std::string& name) {
  std::vector<int> columns;
  std::string missing;
  for (const std::string& wanted : column_names(rest_count)) {
    columns.push_back(vertex.find(wanted));
    if (columns.back() < 0) {
      missing += (missing.empty() ? "" : ", ") + wanted;
    } else if (vertex.properties[static_cast<std::size_t>(columns.back())].count_type) {
      throw DataError(name + ": property \"" + wanted + "\" is a list; it must be one number");
    }
  }
  if (missing.empty()) return columns;
  const bool packed = vertex.find("packed_position") >= 0;
  throw DataError(name + ": element \"vertex\" has no property " + missing +
                  (packed ? "; this is a compressed PLY, which is not read: save it uncompressed"
                          : "; a file of Gaussians has x, y, z, f_dc_0 to 2, opacity, scale_0 to 2, rot_0 to 3"));
}

/// Counts by reason, told in a fixed order.
template <std::size_t N>
struct Tally {
  std::array<const char*, N> reasons;
  std::array<Index, N> counts{};

  std::vector<std::pair<std::string, Index>> list() const {
    std::vector<std::pair<std::string, Index>> found;
    for (std::size_t i = 0; i < N; ++i) {
      if (counts[i] > 0) found.emplace_back(reasons[i], counts[i]);
    }
    return found;
  }
};

bool all_finite(std::span<const float> values) {
  return std::all_of(values.begin(), values.end(), [](float value) { return std::isfinite(value); });
}

/// Takes rows one by one into Gaussians that have room for all.
class Collector {
 public:
  Collector(Index rows, int sh_degree) {
    Gaussians& g = scene_.gaussians;
    g.sh_degree = sh_degree;
    coefficients_ = g.sh_coefficients();
    resize(rows);
    scene_.report.rows = rows;
    scene_.report.row_of.reserve(static_cast<std::size_t>(rows));
    row_.resize(kRest + 3 * static_cast<std::size_t>(coefficients_ - 1));
  }

  void take(Index file_row, std::span<const double> values) {
    for (std::size_t i = 0; i < row_.size(); ++i) row_[i] = static_cast<float>(values[i]);
    const int reason = why_rejected();
    if (reason >= 0) {
      ++rejections_.counts[static_cast<std::size_t>(reason)];
      return;
    }
    store(static_cast<Index>(scene_.report.row_of.size()));
    scene_.report.row_of.push_back(file_row);
  }

  PlyScene finish() {
    const Index kept = static_cast<Index>(scene_.report.row_of.size());
    resize(kept);
    scene_.report.rejected = scene_.report.rows - kept;
    scene_.report.rejections = rejections_.list();
    repairs_.counts = {std::ssize(scene_.report.held_log_scales), std::ssize(scene_.report.held_opacity_logits)};
    scene_.report.repairs = repairs_.list();
    return std::move(scene_);
  }

 private:
  std::span<const float> part(std::size_t begin, std::size_t count) const {
    return std::span<const float>(row_).subspan(begin, count);
  }

  /// The first reason against the row, or -1.
  int why_rejected() const {
    const auto quat = part(kQuat, 4);
    if (!all_finite(part(kMean, 3))) return 0;
    if (!all_finite(part(kScale, 3))) return 1;
    if (!all_finite(quat)) return 2;
    const bool zero =
        std::all_of(quat.begin(), quat.end(), [](float q) { return std::fabs(q) < std::numeric_limits<float>::min(); });
    if (zero) return 3;
    if (std::isnan(row_[kOpacity])) return 4;
    if (!all_finite(part(kDc, row_.size() - kDc))) return 5;
    return -1;
  }

  /// The number put at a place of an array; where it is beyond its limit it is held there, which `places` records.
  static void put_held(float value, double limit, std::vector<float>& array, Index place, std::vector<Index>& places) {
    const float bound = static_cast<float>(limit);
    const float inside = std::clamp(value, -bound, bound);
    if (inside != value) places.push_back(place);
    array[static_cast<std::size_t>(place)] = inside;
  }

  void store(Index n) {
    Gaussians& g = scene_.gaussians;
    std::copy_n(row_.begin() + kMean, 3, g.means.begin() + 3 * n);
    std::copy_n(row_.begin() + kQuat, 4, g.quats.begin() + 4 * n);
    PlyReport& report = scene_.report;
    for (Index c = 0; c < 3; ++c) {
      const float value = row_[kScale + static_cast<std::size_t>(c)];
      put_held(value, kLogScaleLimit, g.log_scales, 3 * n + c, report.held_log_scales);
    }
    put_held(row_[kOpacity], kOpacityLogitLimit, g.opacity_logits, n, report.held_opacity_logits);
    const auto k_count = static_cast<std::size_t>(coefficients_);
    float* sh = g.sh.data() + 3 * coefficients_ * n;
    for (std::size_t c = 0; c < 3; ++c) {
      sh[c] = row_[kDc + c];
      for (std::size_t k = 1; k < k_count; ++k) sh[3 * k + c] = row_[kRest + c * (k_count - 1) + k - 1];
    }
  }

  void resize(Index rows) {
    Gaussians& g = scene_.gaussians;
    const auto n = static_cast<std::size_t>(rows);
    g.means.resize(3 * n);
    g.quats.resize(4 * n);
    g.log_scales.resize(3 * n);
    g.opacity_logits.resize(n);
    g.sh.resize(3 * n * static_cast<std::size_t>(coefficients_));
  }

  PlyScene scene_;
  int coefficients_ = 1;
  std::vector<float> row_;
  Tally<6> rejections_{{"a mean that is not finite", "a scale that is not finite", "a quaternion that is not finite",
                        "a quaternion that is zero", "an opacity that is no number", "a colour that is not finite"}};
  Tally<2> repairs_{{"log-scales held within ±20", "opacity logits held within ±20"}};
};

std::string listed(const std::vector<std::pair<std::string, Index>>& counts) {
  std::string text;
  for (const auto& [reason, count] : counts) text += (text.empty() ? "" : ", ") + reason + ": " + std::to_string(count);
  return text;
}

}  // namespace

std::string summary_text(const PlyReport& report) {
  std::string text;
  if (report.rejected > 0)
    text = std::to_string(report.rejected) + " of " + std::to_string(report.rows) + " Gaussians are left out (" +
           listed(report.rejections) + ")";
  if (!report.repairs.empty()) text += (text.empty() ? "" : "; ") + listed(report.repairs);
  return text;
}

PlyScene decode_ply(std::span<const std::uint8_t> file, const std::string& name) {
  const PlyHeader header = read_ply_header(file, name);
  const PlyElement& vertex = vertex_of(header, name);
  const int rest_count = count_rest(vertex);
  const int degree = degree_of(rest_count);
  if (degree < 0)
    throw DataError(name + ": there are " + std::to_string(rest_count) +
                    " properties f_rest_; allowed: 0, 9, 24 or 45 (spherical harmonics of degree 0 to 3)");
  const std::vector<int> columns = columns_of(vertex, rest_count, name);
  Collector collector(vertex.rows, degree);
  const auto take = [&](Index row, std::span<const double> values) { collector.take(row, values); };
  read_ply_rows(file, header, name, header.find("vertex"), columns, take);
  return collector.finish();
}

PlyScene read_ply(const std::string& path) { return decode_ply(read_file(path), path); }

namespace {

void append_text(Bytes& file, const std::string& text) { file.insert(file.end(), text.begin(), text.end()); }

void append_float(Bytes& file, float value) {
  const auto raw = std::bit_cast<std::array<std::uint8_t, sizeof(float)>>(value);
  file.insert(file.end(), raw.begin(), raw.end());
}

void append_header(Bytes& file, Index rows, int rest_count) {
  append_text(file, "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(rows) + "\n");
  std::vector<std::string> names = {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"};
  for (int i = 0; i < rest_count; ++i) names.push_back(numbered("f_rest_", i));
  for (const char* name : {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    names.emplace_back(name);
  for (const std::string& name : names) append_text(file, "property float " + name + "\n");
  append_text(file, "end_header\n");
}

}  // namespace

std::vector<std::uint8_t> encode_ply(const Gaussians& gaussians) {
  check_sizes(gaussians);
  const Gaussians& g = gaussians;
  const int k_count = g.sh_coefficients();
  const bool moved = g.origin_world != Vector3<double>::Zero();  // −0 + 0 would lose a sign
  Bytes file;
  append_header(file, g.count(), 3 * (k_count - 1));
  file.reserve(file.size() + static_cast<std::size_t>(g.count() * (14 + 3 * k_count) * 4));
  for (Index n = 0; n < g.count(); ++n) {
    for (int c = 0; c < 3; ++c) {
      const float mean = g.means[static_cast<std::size_t>(3 * n + c)];
      append_float(file, moved ? static_cast<float>(static_cast<double>(mean) + g.origin_world[c]) : mean);
    }
    for (int c = 0; c < 3; ++c) append_float(file, 0);
    const float* sh = g.sh.data() + 3 * k_count * n;
    for (int c = 0; c < 3; ++c) append_float(file, sh[c]);
    for (int c = 0; c < 3; ++c) {
      for (int k = 1; k < k_count; ++k) append_float(file, sh[3 * k + c]);
    }
    append_float(file, g.opacity_logits[static_cast<std::size_t>(n)]);
    for (int c = 0; c < 3; ++c) append_float(file, g.log_scales[static_cast<std::size_t>(3 * n + c)]);
    for (int c = 0; c < 4; ++c) append_float(file, g.quats[static_cast<std::size_t>(4 * n + c)]);
  }
  return file;
}

void write_ply(const std::string& path, const Gaussians& gaussians) { write_file(path, encode_ply(gaussians)); }

}  // namespace hsi4d
