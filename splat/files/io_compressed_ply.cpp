#include "splat/files/io_compressed_ply.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "core/check.h"
#include "splat/files/far_means.h"
#include "splat/files/list.h"
#include "splat/files/splat_rows.h"
#include "splat/sh_basis.h"

namespace hsi4d {
namespace {

constexpr Index kChunk = 256;
constexpr double kMostHarmonic = 4;
constexpr int kMostRest = 45;  // f_rest_ of degree 3

/// Bounds of a chunk: least x y z, greatest x y z of positions, log-scales and colours.
using Bounds = std::array<float, 18>;
enum BoundsOf : std::size_t { kPositions = 0, kScales = 6, kColors = 12 };

const std::vector<std::string>& bound_names() {
  static const std::vector<std::string> names = {
      "min_x",       "min_y",       "min_z",       "max_x",       "max_y",       "max_z",
      "min_scale_x", "min_scale_y", "min_scale_z", "max_scale_x", "max_scale_y", "max_scale_z",
      "min_r",       "min_g",       "min_b",       "max_r",       "max_g",       "max_b"};
  return names;
}

const std::vector<std::string>& packed_names() {
  static const std::vector<std::string> names = {"packed_position", "packed_rotation", "packed_scale", "packed_color"};
  return names;
}

std::vector<std::string> rest_names(int count) {
  std::vector<std::string> names;
  for (int i = 0; i < count; ++i) names.push_back("f_rest_" + std::to_string(i));
  return names;
}

/// A field of a packed number: `bits` wide, `shift` bits from the right.
struct Field {
  int shift, bits;
  double levels() const { return static_cast<double>((1U << bits) - 1); }
  double share(std::uint32_t packed) const {
    return static_cast<double>((packed >> shift) & ((1U << bits) - 1)) / levels();
  }
  std::uint32_t packed(double share) const {
    const double level = std::clamp(std::floor(share * levels() + 0.5), 0.0, levels());
    return static_cast<std::uint32_t>(level) << shift;
  }
};
constexpr std::array<Field, 3> kTriple = {{{21, 11}, {11, 10}, {0, 11}}};
constexpr std::array<Field, 4> kBytes = {{{24, 8}, {16, 8}, {8, 8}, {0, 8}}};
constexpr std::array<Field, 3> kQuatFields = {{{20, 10}, {10, 10}, {0, 10}}};
constexpr int kLargestShift = 30;

// Reading -------------------------------------------------------------------------------------------------------------

/// One element of the file, with the places of the columns that are wanted.
struct Table {
  int element = -1;
  Index rows = 0;
  std::vector<int> columns;
};

Table find_table(const PlyHeader& header, const std::string& element, const std::vector<std::string>& columns,
                 PlyType type, const char* type_name, const std::string& name) {
  Table table;
  table.element = header.find(element);
  if (table.element < 0) throw DataError(name + ": there is no element \"" + element + "\"; a compressed PLY has one");
  const PlyElement& found = header.elements[static_cast<std::size_t>(table.element)];
  table.rows = found.rows;
  for (const std::string& column : columns) {
    const int place = found.find(column);
    if (place < 0)
      throw DataError(name + ": element \"" + element + "\" has no property " + column + "; a compressed PLY has it");
    const PlyProperty& property = found.properties[static_cast<std::size_t>(place)];
    if (property.count_type || property.type != type)
      throw DataError(name + ": property " + column + " of element \"" + element + "\" is not of type " + type_name);
    table.columns.push_back(place);
  }
  return table;
}

/// A number that has to be a whole one of this many values: ascii files can say anything.
std::uint32_t whole(double value, double most, Index row, const std::string& name) {
  if (!(value >= 0 && value <= most) || value != std::floor(value))
    throw DataError(name + ": row " + std::to_string(row) + " has a packed number that is no whole number from 0 to " +
                    std::to_string(static_cast<std::uint32_t>(most)));
  return static_cast<std::uint32_t>(value);
}

std::vector<Bounds> read_bounds(std::span<const std::uint8_t> file, const PlyHeader& header, const std::string& name) {
  const int place = header.find("chunk");
  const bool colors = place >= 0 && header.elements[static_cast<std::size_t>(place)].find("min_r") >= 0;
  std::vector<std::string> wanted = bound_names();
  if (!colors) wanted.resize(kColors);
  const Table table = find_table(header, "chunk", wanted, PlyType::kFloat32, "float", name);
  std::vector<Bounds> all(static_cast<std::size_t>(table.rows));
  read_ply_rows(file, header, name, table.element, table.columns, [&](Index row, std::span<const double> values) {
    Bounds& bounds = all[static_cast<std::size_t>(row)];
    bounds = {};
    std::fill(bounds.begin() + kColors + 3, bounds.end(), 1.0F);
    std::transform(values.begin(), values.end(), bounds.begin(), [](double v) { return static_cast<float>(v); });
  });
  return all;
}

/// Levels [N,3(K-1)] of the harmonics, as in the file; empty without them.
Bytes read_harmonics(std::span<const std::uint8_t> file, const PlyHeader& header, Index rows, int& degree,
                     const std::string& name) {
  degree = 0;
  const int place = header.find("sh");
  if (place < 0) return {};
  const PlyElement& element = header.elements[static_cast<std::size_t>(place)];
  const int count =
      static_cast<int>(std::count_if(element.properties.begin(), element.properties.end(),
                                     [](const PlyProperty& property) { return property.name.starts_with("f_rest_"); }));
  degree = count == 9 ? 1 : count == 24 ? 2 : count == 45 ? 3 : 0;
  if (degree == 0)
    throw DataError(name + ": element \"sh\" has " + std::to_string(count) +
                    " properties f_rest_; allowed: 9, 24 or 45 (spherical harmonics of degree 1 to 3)");
  if (element.rows != rows)
    throw DataError(name + ": element \"sh\" has " + std::to_string(element.rows) + " rows for " +
                    std::to_string(rows) + " Gaussians");
  const Table table = find_table(header, "sh", rest_names(count), PlyType::kUint8, "uchar", name);
  Bytes levels;
  levels.reserve(static_cast<std::size_t>(rows * count));
  read_ply_rows(file, header, name, place, table.columns, [&](Index row, std::span<const double> values) {
    for (const double value : values) levels.push_back(static_cast<std::uint8_t>(whole(value, 255, row, name)));
  });
  return levels;
}

float harmonic(std::uint8_t level) {
  if (level == 0) return -static_cast<float>(kMostHarmonic);
  if (level == 255) return static_cast<float>(kMostHarmonic);
  return static_cast<float>(2 * kMostHarmonic * ((level + 0.5) / 256 - 0.5));
}

/// `share` of the way from one bound to the other.
double between(const Bounds& bounds, std::size_t first, std::size_t axis, double share) {
  const double least = bounds[first + axis], most = bounds[first + 3 + axis];
  return least * (1 - share) + most * share;
}

std::array<float, 4> unpacked_quat(std::uint32_t packed) {
  std::array<float, 4> quat{};
  const std::uint32_t largest = packed >> kLargestShift;
  double rest = 1;
  std::size_t field = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    if (i == largest) continue;
    const double value = std::numbers::sqrt2 * (kQuatFields[field++].share(packed) - 0.5);
    quat[i] = static_cast<float>(value);
    rest -= value * value;
  }
  quat[largest] = static_cast<float>(std::sqrt(std::max(0.0, rest)));
  return quat;
}

SplatRow unpacked(const std::array<std::uint32_t, 4>& packed, const Bounds& bounds,
                  std::span<const std::uint8_t> rest) {
  SplatRow row;
  for (std::size_t c = 0; c < 3; ++c) {
    row.mean[c] = between(bounds, kPositions, c, kTriple[c].share(packed[0]));
    row.log_scale[c] = static_cast<float>(between(bounds, kScales, c, kTriple[c].share(packed[2])));
    const double color = between(bounds, kColors, c, kBytes[c].share(packed[3]));
    row.sh[c] = static_cast<float>((color - 0.5) / kShC0);
  }
  row.quat = unpacked_quat(packed[1]);
  row.opacity_logit = opacity_logit(static_cast<std::uint8_t>(packed[3] & 255U));
  const std::size_t k_rest = rest.size() / 3;
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t k = 0; k < k_rest; ++k) row.sh[3 * (k + 1) + c] = harmonic(rest[c * k_rest + k]);
  }
  return row;
}

// Writing -------------------------------------------------------------------------------------------------------------

/// What of a Gaussian goes into packed numbers, in the order of Bounds.
struct Unpacked {
  std::array<float, 9> values{};  // position, log-scales, colour
};

Unpacked values_of(const Gaussians& g, Index n, HeldNumbers& scales) {
  Unpacked u;
  const Vector3<double> mean = mean_world(g, n);
  for (std::size_t c = 0; c < 3; ++c) {
    u.values[c] = static_cast<float>(mean[static_cast<Index>(c)]);
    u.values[3 + c] = static_cast<float>(scales.hold(g.log_scales[static_cast<std::size_t>(3 * n) + c]));
    const double dc = g.sh[static_cast<std::size_t>(3 * g.sh_coefficients() * n) + c];
    u.values[6 + c] = static_cast<float>(0.5 + kShC0 * dc);
  }
  return u;
}

Bounds bounds_of(std::span<const Unpacked> chunk) {
  Bounds bounds{};
  for (std::size_t i = 0; i < 9; ++i) {
    const auto [least, most] = std::minmax_element(
        chunk.begin(), chunk.end(), [i](const Unpacked& a, const Unpacked& b) { return a.values[i] < b.values[i]; });
    bounds[6 * (i / 3) + i % 3] = least->values[i];
    bounds[6 * (i / 3) + 3 + i % 3] = most->values[i];
  }
  return bounds;
}

std::uint32_t packed_triple(const Bounds& bounds, const Unpacked& u, std::size_t part, std::span<const Field> fields) {
  std::uint32_t packed = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const double least = bounds[6 * part + c], most = bounds[6 * part + 3 + c];
    const double share = most > least ? (u.values[3 * part + c] - least) / (most - least) : 0;
    packed |= fields[c].packed(share);
  }
  return packed;
}

std::uint32_t packed_quat(const Vector4<double>& quat) {
  int largest = 0;
  for (int i = 1; i < 4; ++i) {
    if (std::fabs(quat[i]) > std::fabs(quat[largest])) largest = i;
  }
  const double sign = quat[largest] < 0 ? -1 : 1;
  std::uint32_t packed = static_cast<std::uint32_t>(largest) << kLargestShift;
  std::size_t field = 0;
  for (int i = 0; i < 4; ++i) {
    if (i != largest) packed |= kQuatFields[field++].packed(sign * quat[i] / std::numbers::sqrt2 + 0.5);
  }
  return packed;
}

std::uint8_t harmonic_level(double value) {
  const double level = std::floor((value / (2 * kMostHarmonic) + 0.5) * 256);
  return static_cast<std::uint8_t>(std::clamp(level, 0.0, 255.0));
}

void append_packed_header(Bytes& file, Index rows, int rest_count) {
  std::string text =
      "ply\nformat binary_little_endian 1.0\nelement chunk " + std::to_string((rows + kChunk - 1) / kChunk) + "\n";
  for (const std::string& name : bound_names()) text += "property float " + name + "\n";
  text += "element vertex " + std::to_string(rows) + "\n";
  for (const std::string& name : packed_names()) text += "property uint " + name + "\n";
  if (rest_count > 0) text += "element sh " + std::to_string(rows) + "\n";
  for (const std::string& name : rest_names(rest_count)) text += "property uchar " + name + "\n";
  text += "end_header\n";
  file.insert(file.end(), text.begin(), text.end());
}

/// Bits of a 21-bit number, two zeros after each.
std::uint64_t spread(std::uint64_t bits) {
  std::uint64_t result = 0;
  for (int i = 0; i < 21; ++i) result |= (bits >> i & 1U) << (3 * i);
  return result;
}

}  // namespace

bool is_compressed_ply(const PlyHeader& header) {
  const int vertex = header.find("vertex");
  return vertex >= 0 && header.elements[static_cast<std::size_t>(vertex)].find("packed_position") >= 0;
}

SplatFile decode_compressed_ply(std::span<const std::uint8_t> file, const PlyHeader& header, const std::string& name,
                                const Vector3<double>& origin_world) {
  const Table table = find_table(header, "vertex", packed_names(), PlyType::kUint32, "uint", name);
  const std::vector<Bounds> bounds = read_bounds(file, header, name);
  const Index chunks = table.rows / kChunk + (table.rows % kChunk > 0 ? 1 : 0);
  if (std::ssize(bounds) != chunks)
    throw DataError(name + ": element \"chunk\" has " + std::to_string(bounds.size()) + " rows; " +
                    std::to_string(table.rows) + " Gaussians in chunks of 256 need " + std::to_string(chunks));
  int degree = 0;
  const Bytes levels = read_harmonics(file, header, table.rows, degree, name);
  const std::size_t rest_count = table.rows == 0 ? 0 : levels.size() / static_cast<std::size_t>(table.rows);
  SplatRows rows(table.rows, degree, "compressed PLY", origin_world);
  const std::array known = {PlyNames{"chunk", bound_names()}, PlyNames{"vertex", packed_names()},
                            PlyNames{"sh", rest_names(kMostRest)}};
  caution_of_others(names_beside(header, known), rows);
  read_ply_rows(file, header, name, table.element, table.columns, [&](Index row, std::span<const double> values) {
    std::array<std::uint32_t, 4> packed{};
    for (std::size_t i = 0; i < 4; ++i) packed[i] = whole(values[i], 4294967295.0, row, name);
    const auto n = static_cast<std::size_t>(row);
    rows.take(unpacked(packed, bounds[n / kChunk], std::span(levels).subspan(rest_count * n, rest_count)));
  });
  return rows.finish();
}

std::vector<Index> compressed_ply_order(const Gaussians& g) {
  std::vector<Index> order(static_cast<std::size_t>(g.count()));
  std::iota(order.begin(), order.end(), Index{0});
  if (order.empty()) return order;
  Vector3<double> least = mean_world(g, 0), most = least;
  for (Index n = 1; n < g.count(); ++n) {
    least = least.cwiseMin(mean_world(g, n));
    most = most.cwiseMax(mean_world(g, n));
  }
  std::vector<std::uint64_t> codes;
  codes.reserve(order.size());
  for (Index n = 0; n < g.count(); ++n) {
    const Vector3<double> mean = mean_world(g, n);
    std::uint64_t code = 0;
    for (int c = 0; c < 3; ++c) {
      const double share = most[c] > least[c] ? (mean[c] - least[c]) / (most[c] - least[c]) : 0;
      code |= spread(static_cast<std::uint64_t>(std::clamp(share, 0.0, 1.0) * 2097151)) << c;
    }
    codes.push_back(code);
  }
  std::stable_sort(order.begin(), order.end(), [&codes](Index a, Index b) {
    return codes[static_cast<std::size_t>(a)] < codes[static_cast<std::size_t>(b)];
  });
  return order;
}

EncodedSplats encode_compressed_ply(const Gaussians& g) {
  check_finite(g, "compressed PLY");
  const std::vector<Index> order = compressed_ply_order(g);
  const int k_count = g.sh_coefficients();
  EncodedSplats encoded;
  append_packed_header(encoded.bytes, g.count(), 3 * (k_count - 1));
  HeldNumbers scales(-kLogScaleLimit, kLogScaleLimit), harmonics(-kMostHarmonic, kMostHarmonic);
  Bytes vertices;
  vertices.reserve(16 * order.size());
  std::vector<Unpacked> chunk;
  for (std::size_t begin = 0; begin < order.size(); begin += kChunk) {
    const std::size_t end = std::min(order.size(), begin + static_cast<std::size_t>(kChunk));
    chunk.clear();
    for (std::size_t i = begin; i < end; ++i) chunk.push_back(values_of(g, order[i], scales));
    const Bounds bounds = bounds_of(chunk);
    for (const float bound : bounds) append_float(encoded.bytes, bound);
    for (std::size_t i = begin; i < end; ++i) {
      const Unpacked& u = chunk[i - begin];
      append_uint(vertices, packed_triple(bounds, u, 0, kTriple), 4);
      append_uint(vertices, packed_quat(unit_quat(g, order[i])), 4);
      append_uint(vertices, packed_triple(bounds, u, 1, kTriple), 4);
      const std::uint32_t opacity = opacity_level(g.opacity_logits[static_cast<std::size_t>(order[i])]);
      append_uint(vertices, packed_triple(bounds, u, 2, kBytes) | opacity, 4);
    }
  }
  encoded.bytes.insert(encoded.bytes.end(), vertices.begin(), vertices.end());
  for (const Index n : order) {
    const float* sh = g.sh.data() + 3 * k_count * n;
    for (int c = 0; c < 3; ++c) {
      for (int k = 1; k < k_count; ++k) encoded.bytes.push_back(harmonic_level(harmonics.hold(sh[3 * k + c])));
    }
  }
  add_loss(encoded.losses, "means in steps wider than their Gaussian", far_means(g, g.origin_world).count);
  add_loss(encoded.losses, "log-scales held within ±20", scales.count());
  add_loss(encoded.losses, "harmonics held within ±4", harmonics.count());
  return encoded;
}

SplatFormat compressed_ply_format() {
  SplatFormat format = ply_format();  // whose reader knows both
  format.ending = ".compressed.ply";
  format.kind = "compressed";
  format.encode = [](const Gaussians& g, const SplatWriteOptions&) { return encode_compressed_ply(g); };
  return format;
}

}  // namespace hsi4d
