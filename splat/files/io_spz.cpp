#include "splat/files/io_spz.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>

#include "core/check.h"
#include "splat/files/far_means.h"
#include "splat/files/list.h"
#include "splat/files/splat_rows.h"
#include "splat/files/spz_container.h"

namespace hsi4d {
namespace {

constexpr int kMostChosenBits = 20;                            // a micrometre
constexpr std::uint32_t kAxesExtension = 0xADBE0003U;          // SPZ_ADOBE_coordinate_system
constexpr std::uint32_t kQuantisationExtension = 0xADBE0001U;  // SPZ_ADOBE_sh_quantization
constexpr double kColorScale = 0.15;

/// Signs that take the file's axes to ours.
struct Axes {
  double x = 1, y = -1, z = -1;
};

/// The signs of the real harmonics when the axes change theirs: the parity of each polynomial in x, y and z.
std::array<float, 16> harmonic_signs(const Axes& a) {
  const std::array<double, 16> signs = {1,   a.y, a.z, a.x, a.x * a.y, a.y * a.z, 1, a.x * a.z, 1, a.y, a.x * a.y * a.z,
                                        a.y, a.z, a.x, a.z, a.x};
  std::array<float, 16> result;
  std::transform(signs.begin(), signs.end(), result.begin(), [](double sign) { return static_cast<float>(sign); });
  return result;
}

// Reading -------------------------------------------------------------------------------------------------------------

/// Signs of a named set of axes. The names count letter by letter: left or right, down or up, back or forward.
Axes axes_named(std::uint64_t number, const std::string& name) {
  if (number == 0) return {};  // not said
  if (number > 8)
    throw DataError(name + ": the file has axes number " + std::to_string(number) +
                    ", which are not read; allowed: 1 to 8, x left or right, y up or down, z forward or back");
  const std::uint64_t bits = number - 1;
  return {(bits & 1U) != 0 ? 1.0 : -1.0, (bits & 2U) != 0 ? -1.0 : 1.0, (bits & 4U) != 0 ? 1.0 : -1.0};
}

/// Walks over the records of extensions. Returns the axes that the file has.
Axes read_extensions(const SpzContent& content, SplatRows& rows, const std::string& name) {
  Axes axes;
  const Bytes& bytes = content.extensions;
  if ((content.header.flags & kSpzHasExtensions) == 0) {
    if (!bytes.empty())
      throw DataError(name + ": " + std::to_string(bytes.size()) +
                      " bytes lie before the table of lengths, but the header names no extensions");
    return axes;
  }
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t left = bytes.size() - at;
    const std::uint64_t size = left < 8 ? 0 : load_uint(&bytes[at + 4], 4);
    if (left < 8 || size > left - 8)
      throw DataError(name + ": the record of an extension " + std::to_string(at) +
                      " bytes into them does not fit: " + std::to_string(left) + " bytes are left");
    const auto type = static_cast<std::uint32_t>(load_uint(&bytes[at], 4));
    if (type == kQuantisationExtension)
      throw DataError(name + ": the file's harmonics are quantised by an extension that is not read");
    if (type == kAxesExtension && size >= 4) {
      axes = axes_named(load_uint(&bytes[at + 8], 4), name);
    } else {
      rows.add_caution("an extension of type " + std::to_string(type) + " is passed over");
    }
    at += 8 + static_cast<std::size_t>(size);
  }
  return axes;
}

/// A half float.                                                                                           [IEEE 754]
float half(std::uint64_t bits) {
  const double sign = (bits & 0x8000U) != 0 ? -1 : 1;
  const int exponent = static_cast<int>(bits >> 10 & 31U);
  const double fraction = static_cast<double>(bits & 1023U) / 1024;
  if (exponent == 31) return static_cast<float>(fraction > 0 ? NAN : sign * INFINITY);
  return static_cast<float>(sign *
                            (exponent == 0 ? std::ldexp(fraction, -14) : std::ldexp(1 + fraction, exponent - 15)));
}

/// A 24-bit signed integer.
double fixed_point(const std::uint8_t* bytes) {
  const auto value = static_cast<std::int32_t>(load_uint(bytes, 3));
  return value >= 0x800000 ? value - 0x1000000 : value;
}

/// x, y, z, w.
std::array<double, 4> first_three(const std::uint8_t* bytes) {
  std::array<double, 4> q{};
  double rest = 1;
  for (std::size_t i = 0; i < 3; ++i) {
    q[i] = bytes[i] / 127.5 - 1;
    rest -= q[i] * q[i];
  }
  q[3] = std::sqrt(std::max(0.0, rest));
  return q;
}

/// x, y, z, w.
std::array<double, 4> smallest_three(std::uint64_t bits) {
  std::array<double, 4> q{};
  const auto largest = static_cast<std::size_t>(bits >> 30);
  double rest = 1;
  int shift = 20;
  for (std::size_t i = 0; i < 4; ++i) {
    if (i == largest) continue;
    const std::uint64_t field = bits >> shift & 1023U;
    const double magnitude = static_cast<double>(field & 511U) / (511 * std::numbers::sqrt2);
    q[i] = (field & 512U) != 0 ? -magnitude : magnitude;
    rest -= q[i] * q[i];
    shift -= 10;
  }
  q[largest] = std::sqrt(std::max(0.0, rest));
  return q;
}

class Decoder {
 public:
  Decoder(const SpzContent& content, const Axes& axes)
      : content_(content), axes_{axes.x, axes.y, axes.z}, signs_(harmonic_signs(axes)) {
    kept_rest_ = std::min(content.header.rest_count(), (kHighestShDegree + 1) * (kHighestShDegree + 1) - 1);
  }

  SplatRow row(std::size_t n) const {
    SplatRow row;
    const std::uint8_t* position = at(kSpzPositions, n);
    for (std::size_t c = 0; c < 3; ++c) {
      const double value = content_.header.version == 1
                               ? half(load_uint(position + 2 * c, 2))
                               : std::ldexp(fixed_point(position + 3 * c), -content_.header.fractional_bits);
      row.mean[c] = value * axes_[c];
      row.log_scale[c] = static_cast<float>(at(kSpzScales, n)[c] / 16.0 - 10);
      row.sh[c] = static_cast<float>((at(kSpzColors, n)[c] / 255.0 - 0.5) / kColorScale);
    }
    row.opacity_logit = opacity_logit(*at(kSpzOpacities, n));
    row.quat = quat(n);
    for (std::size_t i = 0; i < static_cast<std::size_t>(3 * kept_rest_); ++i)
      row.sh[3 + i] = signs_[i / 3 + 1] * static_cast<float>((at(kSpzHarmonics, n)[i] - 128) / 128.0);
    return row;
  }

 private:
  const std::uint8_t* at(std::size_t attribute, std::size_t n) const {
    return content_.attributes[attribute].data() + n * content_.header.row_bytes(attribute);
  }

  /// wxyz. Axes that change sign take a rotation along: its axis is a pseudovector.
  std::array<float, 4> quat(std::size_t n) const {
    const std::uint8_t* bytes = at(kSpzRotations, n);
    const auto q = content_.header.version < 3 ? first_three(bytes) : smallest_three(load_uint(bytes, 4));
    return {static_cast<float>(q[3]), static_cast<float>(axes_[1] * axes_[2] * q[0]),
            static_cast<float>(axes_[0] * axes_[2] * q[1]), static_cast<float>(axes_[0] * axes_[1] * q[2])};
  }

  const SpzContent& content_;
  std::array<double, 3> axes_;
  std::array<float, 16> signs_;
  int kept_rest_ = 0;
};

// Writing -------------------------------------------------------------------------------------------------------------

void check_options(const SpzOptions& o) {
  const auto check = [](int value, int least, int most, const std::string& what) {
    if (value >= least && value <= most) return;
    throw UserError(".spz: " + what + " is " + std::to_string(value) + "; allowed: " + std::to_string(least) + " to " +
                    std::to_string(most));
  };
  check(o.version, 2, kSpzVersionInFrames, "the version to write");
  check(o.sh1_bits, 1, 8, "the number of bits of harmonics of degree 1");
  check(o.sh_rest_bits, 1, 8, "the number of bits of harmonics above degree 1");
  if (o.fractional_bits != -1) check(o.fractional_bits, 0, 23, "the number of fractional bits of positions");
}

constexpr double kMostFixed = 8388607;  // 2^23 − 1

/// Fractional bits that leave room for the farthest mean. Throws UserError where the wanted ones do not.
int fractional_bits(const Gaussians& g, int wanted) {
  double farthest = 0;
  Index which = 0;
  for (Index n = 0; n < g.count(); ++n) {
    const double reach = mean_world(g, n).cwiseAbs().maxCoeff();
    if (reach > farthest) farthest = reach, which = n;
  }
  int bits = wanted >= 0 ? wanted : kMostChosenBits;
  while (wanted < 0 && bits > 0 && std::ldexp(farthest, bits) > kMostFixed) --bits;
  if (std::ldexp(farthest, bits) > kMostFixed)
    throw UserError(".spz: Gaussian " + std::to_string(which) + " is " + std::to_string(farthest) +
                    " m from the origin along an axis; with " + std::to_string(bits) +
                    " fractional bits it may be at most " + std::to_string(std::ldexp(kMostFixed, -bits)));
  return bits;
}

std::uint8_t level(double value) { return static_cast<std::uint8_t>(std::lround(value)); }

/// The nearest multiple of 2^(8 − bits) of the levels 0 to 255.
std::uint8_t harmonic_byte(double value, int bits) {
  const double step = 1 << (8 - bits);
  return static_cast<std::uint8_t>(std::clamp(std::round((128 * value + 128) / step) * step, 0.0, 255.0));
}

void append_quat(Bytes& out, const Vector4<double>& unit, int version) {
  const std::array<double, 4> q = {unit[1], -unit[2], -unit[3], unit[0]};  // x, y, z, w in the file's axes
  if (version < 3) {
    const double sign = q[3] < 0 ? -1 : 1;
    for (std::size_t i = 0; i < 3; ++i) out.push_back(level(std::clamp(127.5 * (sign * q[i] + 1), 0.0, 255.0)));
    return;
  }
  std::size_t largest = 0;
  for (std::size_t i = 1; i < 4; ++i) {
    if (std::fabs(q[i]) > std::fabs(q[largest])) largest = i;
  }
  std::uint32_t packed = static_cast<std::uint32_t>(largest);
  for (std::size_t i = 0; i < 4; ++i) {
    if (i == largest) continue;
    const auto magnitude =
        static_cast<std::uint32_t>(std::min(511.0, std::round(511 * std::numbers::sqrt2 * std::fabs(q[i]))));
    const bool negative = (q[i] < 0) != (q[largest] < 0) && magnitude > 0;
    packed = packed << 10 | (negative ? 512U : 0U) | magnitude;
  }
  append_uint(out, packed, 4);
}

/// The six attributes, unpacked.
std::array<Bytes, kSpzAttributes> attributes_of(const Gaussians& g, const SpzOptions& options, int bits,
                                                Counts& losses) {
  std::array<Bytes, kSpzAttributes> all;
  HeldNumbers scales(-10, 5.9375), colors(-0.5 / kColorScale, 0.5 / kColorScale), harmonics(-1, 127.0 / 128);
  const std::array<float, 16> signs = harmonic_signs({});
  const int k_count = g.sh_coefficients();
  for (Index n = 0; n < g.count(); ++n) {
    const Vector3<double> mean = mean_world(g, n);
    for (int c = 0; c < 3; ++c) {
      const double fixed = std::round(std::ldexp(c == 0 ? mean[c] : -mean[c], bits));
      append_uint(all[kSpzPositions], static_cast<std::uint32_t>(static_cast<std::int32_t>(fixed)), 3);
    }
    const auto row = static_cast<std::size_t>(n);
    all[kSpzOpacities].push_back(opacity_level(g.opacity_logits[row]));
    const float* sh = g.sh.data() + 3 * k_count * n;
    for (std::size_t c = 0; c < 3; ++c) {
      all[kSpzColors].push_back(level(255 * (kColorScale * colors.hold(sh[c]) + 0.5)));
      all[kSpzScales].push_back(level(16 * (scales.hold(g.log_scales[3 * row + c]) + 10)));
    }
    append_quat(all[kSpzRotations], unit_quat(g, n), options.version);
    for (int k = 1; k < k_count; ++k) {
      const int sh_bits = k < 4 ? options.sh1_bits : options.sh_rest_bits;
      for (int c = 0; c < 3; ++c) {
        const float value = sh[3 * k + c] * signs[static_cast<std::size_t>(k)];
        all[kSpzHarmonics].push_back(harmonic_byte(harmonics.hold(value), sh_bits));
      }
    }
  }
  add_loss(losses, "log-scales held within -10 to 5.94", scales.count());
  add_loss(losses, "colours held within ±3.33", colors.count());
  add_loss(losses, "harmonics held within -1 to 0.992", harmonics.count());
  return all;
}

}  // namespace

SplatFile decode_spz(std::span<const std::uint8_t> file, const std::string& name, const Vector3<double>& origin_world) {
  const SpzContent content = unpack_spz(file, name);
  const SpzHeader& header = content.header;
  SplatRows rows(static_cast<Index>(header.count), std::min(header.degree, kHighestShDegree),
                 ".spz version " + std::to_string(header.version), origin_world);
  if ((header.flags & kSpzAntialiased) != 0) rows.set_antialiased();
  if ((header.flags & ~(kSpzAntialiased | kSpzHasExtensions)) != 0)
    rows.add_caution("the header's flags are " + std::to_string(header.flags) + "; those above 3 are not known");
  if (header.degree > kHighestShDegree) rows.add_repair(kWithoutDegree4, static_cast<Index>(header.count));
  const Decoder decoder(content, read_extensions(content, rows, name));
  for (std::size_t n = 0; n < header.count; ++n) rows.take(decoder.row(n));
  return rows.finish();
}

EncodedSplats encode_spz(const Gaussians& gaussians, const SpzOptions& options) {
  check_options(options);
  check_finite(gaussians, ".spz");
  if (gaussians.count() > 0xffffffffLL) throw UserError(".spz: more Gaussians than the format can count (2^32)");
  const int bits = fractional_bits(gaussians, options.fractional_bits);
  EncodedSplats encoded;
  const std::array<Bytes, kSpzAttributes> attributes = attributes_of(gaussians, options, bits, encoded.losses);
  SpzHeader header;
  header.version = options.version;
  header.count = static_cast<std::uint64_t>(gaussians.count());
  header.degree = gaussians.sh_degree;
  header.fractional_bits = bits;
  if (options.antialiased) header.flags |= kSpzAntialiased;
  add_loss(encoded.losses, "means in steps wider than their Gaussian",
           means_narrower_than(std::ldexp(1, -bits), gaussians).count);
  encoded.bytes = pack_spz(header, attributes);
  return encoded;
}

SplatFormat spz_format() {
  return {.ending = ".spz",
          .magic = {"NGSP"},
          .gzip = true,
          .decode = decode_spz,
          .encode = [](const Gaussians& g, const SplatWriteOptions& o) { return encode_spz(g, o.spz); }};
}

}  // namespace hsi4d
