#include "splat/files/io_ply.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/check.h"
#include "core/file.h"
#include "splat/files/far_means.h"
#include "splat/files/io_compressed_ply.h"
#include "splat/files/list.h"
#include "splat/files/ply_table.h"
#include "splat/files/quantised.h"
#include "splat/files/splat_rows.h"

namespace hsi4d {
namespace {

/// Where the numbers of a row lie, in the order in which columns are asked for.
enum Column : std::size_t { kMean = 0, kScale = 3, kQuat = 6, kOpacity = 10, kDc = 11, kRest = 14 };

std::string numbered(const char* name, int number) { return name + std::to_string(number); }

/// @param rest_count  of the file's f_rest_, a third for each channel; of each channel the first `kept` are read
std::vector<std::string> column_names(int rest_count, int kept) {
  std::vector<std::string> names = {"x",     "y",     "z",     "scale_0", "scale_1", "scale_2", "rot_0",
                                    "rot_1", "rot_2", "rot_3", "opacity", "f_dc_0",  "f_dc_1",  "f_dc_2"};
  for (int c = 0; c < 3; ++c) {
    for (int k = 0; k < kept; ++k) names.push_back(numbered("f_rest_", c * (rest_count / 3) + k));
  }
  return names;
}

constexpr const char* kFilter = "filter_3D";  // of Mip-Splatting, before it is fused

/// Properties that are read, or say nothing of the picture: INRIA's normals are zero.
std::vector<std::string> known_names(int rest_count) {
  std::vector<std::string> names = column_names(rest_count, rest_count / 3);
  names.insert(names.end(), {"nx", "ny", "nz", kFilter});
  return names;
}

constexpr int kHighestDegreeOfFiles = 4;  // of which no more than kHighestShDegree is kept

/// Harmonics of a channel above degree 0.
int rest_of(int degree) { return (degree + 1) * (degree + 1) - 1; }

/// Degree of the harmonics that so many f_rest_ properties are, or -1.
int degree_of(int rest_count) {
  for (int degree = 0; degree <= kHighestDegreeOfFiles; ++degree) {
    if (rest_count == 3 * rest_of(degree)) return degree;
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

/// The place of a property, or -1. Throws DataError for a list.
int column_of(const PlyElement& vertex, const std::string& wanted, const std::string& name) {
  const int column = vertex.find(wanted);
  if (column >= 0 && vertex.properties[static_cast<std::size_t>(column)].count_type)
    throw DataError(name + ": property \"" + wanted + "\" is a list; it must be one number");
  return column;
}

/// The places of the wanted properties. Throws DataError with all that are missing.
std::vector<int> columns_of(const PlyElement& vertex, int rest_count, int kept, const std::string& name) {
  std::vector<int> columns;
  std::string missing;
  for (const std::string& wanted : column_names(rest_count, kept)) {
    columns.push_back(column_of(vertex, wanted, name));
    if (columns.back() < 0) missing += (missing.empty() ? "" : ", ") + wanted;
  }
  if (missing.empty()) return columns;
  throw DataError(name + ": element \"vertex\" has no property " + missing +
                  "; a file of Gaussians has x, y, z, f_dc_0 to 2, opacity, scale_0 to 2, rot_0 to 3");
}

/// A row with Mip-Splatting's filter of radius `filter` laid over it, as its authors fuse it.     [Yu et al. 2024,
/// §4.1]
///
///   s' = sqrt(s² + f²),   o' = o Π s/s'
void fuse_filter(double filter, SplatRow& row) {
  if (filter == 0) return;
  const double log_filter = std::log(std::fabs(filter));  // not finite: the scales become so, and the row is left out
  double log_share = 0;
  for (float& log_scale : row.log_scale) {
    const double s = log_scale;
    const double fused = std::max(s, log_filter) + 0.5 * std::log1p(std::exp(-2 * std::fabs(s - log_filter)));
    log_share += s - fused;
    log_scale = static_cast<float>(fused);
  }
  const double x = row.opacity_logit, opacity = 1 / (1 + std::exp(-x));
  const double log_opacity = log_share - (x < 0 ? std::log1p(std::exp(x)) - x : std::log1p(std::exp(-x)));
  row.opacity_logit =
      static_cast<float>(log_opacity - std::log(1 / (1 + std::exp(x)) - opacity * std::expm1(log_share)));
}

/// A row of columns, in the order of column_names.
SplatRow row_of(std::span<const double> values, int coefficients) {
  const auto number = [&](std::size_t column) { return static_cast<float>(values[column]); };
  SplatRow row;
  for (std::size_t c = 0; c < 3; ++c) {
    row.mean[c] = values[kMean + c];
    row.log_scale[c] = number(kScale + c);
  }
  for (std::size_t c = 0; c < 4; ++c) row.quat[c] = number(kQuat + c);
  row.opacity_logit = number(kOpacity);
  const auto k_count = static_cast<std::size_t>(coefficients);
  for (std::size_t c = 0; c < 3; ++c) {
    row.sh[c] = number(kDc + c);
    for (std::size_t k = 1; k < k_count; ++k) row.sh[3 * k + c] = number(kRest + c * (k_count - 1) + k - 1);
  }
  return row;
}

/// What trainers write of their Gaussians as comments: Brush "SplatRenderMode: mip" and "Vertical axis: y", Postshot
/// "antialiased 1".
void read_comments(const PlyHeader& header, SplatRows& rows) {
  constexpr std::string_view kUp = "Vertical axis: ";
  for (const std::string& comment : header.comments) {
    if (comment == "SplatRenderMode: mip" || comment == "antialiased 1" || comment == "antialiased true")
      rows.set_antialiased();
    if (comment.starts_with(kUp) && comment.size() == kUp.size() + 1 && comment.back() != 'z')
      rows.add_note("its up axis is " + comment.substr(kUp.size()) + ", by a comment; here it is z");
  }
}

}  // namespace

SplatFile decode_ply(std::span<const std::uint8_t> file, const std::string& name, const Vector3<double>& origin_world) {
  const PlyHeader header = read_ply_header(file, name);
  if (is_compressed_ply(header)) return decode_compressed_ply(file, header, name, origin_world);
  const PlyElement& vertex = vertex_of(header, name);
  const int rest_count = count_rest(vertex);
  const int degree = degree_of(rest_count);
  if (degree < 0)
    throw DataError(name + ": there are " + std::to_string(rest_count) +
                    " properties f_rest_; allowed: 0, 9, 24, 45 or 72 (spherical harmonics of degree 0 to 4)");
  const int kept_degree = std::min(degree, kHighestShDegree), kept = rest_of(kept_degree);
  std::vector<int> columns = columns_of(vertex, rest_count, kept, name);
  const bool has_filter = vertex.find(kFilter) >= 0;
  if (has_filter) columns.push_back(column_of(vertex, kFilter, name));
  SplatRows rows(vertex.rows, kept_degree, "INRIA PLY", origin_world);
  caution_of_others(names_beside(header, std::array{PlyNames{"vertex", known_names(rest_count)}}), rows);
  read_comments(header, rows);
  if (has_filter) {
    rows.add_note("filter_3D is fused into scales and opacities, as Mip-Splatting does; it draws with render.blur=0.1");
    rows.set_antialiased();
  }
  if (degree > kept_degree) rows.add_repair(kWithoutDegree4, vertex.rows);
  const int coefficients = kept + 1;
  const auto take = [&](Index, std::span<const double> values) {
    SplatRow row = row_of(values, coefficients);
    if (has_filter) fuse_filter(values.back(), row);
    rows.take(row);
  };
  read_ply_rows(file, header, name, header.find("vertex"), columns, take);
  return rows.finish();
}

SplatFile read_ply(const std::string& path) { return decode_ply(read_file(path), path); }

namespace {

void append_text(Bytes& file, const std::string& text) { file.insert(file.end(), text.begin(), text.end()); }

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

SplatFormat ply_format() {
  return {.ending = ".ply",
          .kind = "INRIA's",
          .magic = {"ply\n", "ply\r"},
          .decode = decode_ply,
          .encode = [](const Gaussians& g, const SplatWriteOptions&) {
            EncodedSplats encoded{encode_ply(g), {}};
            add_loss(encoded.losses, "means in steps wider than their Gaussian", far_means(g, g.origin_world).count);
            return encoded;
          }};
}

}  // namespace hsi4d
