#include "splat/files/io_splat.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/check.h"
#include "splat/files/far_means.h"
#include "splat/files/list.h"
#include "splat/files/splat_rows.h"
#include "splat/sh_basis.h"

namespace hsi4d {
namespace {

constexpr std::size_t kRowBytes = 32;

/// Log of a scale: what is below 0 is no number, 0 is finite and below every limit.
float log_scale(float scale) {
  if (scale == 0) return std::numeric_limits<float>::lowest();
  return static_cast<float>(std::log(static_cast<double>(scale)));
}

SplatRow row_at(const std::uint8_t* bytes) {
  SplatRow row;
  for (std::size_t c = 0; c < 3; ++c) {
    row.mean[c] = load_float(bytes + 4 * c);
    row.log_scale[c] = log_scale(load_float(bytes + 12 + 4 * c));
    row.sh[c] = static_cast<float>((bytes[24 + c] / 255.0 - 0.5) / kShC0);
  }
  row.opacity_logit = opacity_logit(bytes[27]);
  for (std::size_t c = 0; c < 4; ++c) row.quat[c] = static_cast<float>((bytes[28 + c] - 128) / 128.0);
  return row;
}

std::uint8_t quat_byte(double value) {
  return static_cast<std::uint8_t>(std::clamp(std::round(128 * value + 128), 0.0, 255.0));
}

}  // namespace

SplatFile decode_splat(std::span<const std::uint8_t> file, const std::string& name,
                       const Vector3<double>& origin_world) {
  if (file.size() % kRowBytes != 0)
    throw DataError(name + ": a .splat file has 32 bytes for each Gaussian; this one has " +
                    std::to_string(file.size()) + " bytes, " + std::to_string(file.size() % kRowBytes) +
                    " too many: it was cut short, or it is no .splat file");
  SplatRows rows(static_cast<Index>(file.size() / kRowBytes), 0, ".splat", origin_world);
  for (std::size_t at = 0; at < file.size(); at += kRowBytes) rows.take(row_at(file.data() + at));
  return rows.finish();
}

EncodedSplats encode_splat(const Gaussians& g) {
  check_finite(g, ".splat");
  EncodedSplats encoded;
  Bytes& file = encoded.bytes;
  file.reserve(kRowBytes * static_cast<std::size_t>(g.count()));
  HeldNumbers colors(0, 1), scales(-kLogScaleLimit, kLogScaleLimit);
  for (Index n = 0; n < g.count(); ++n) {
    const Vector3<double> mean = mean_world(g, n);
    for (int c = 0; c < 3; ++c) append_float(file, static_cast<float>(mean[c]));
    for (int c = 0; c < 3; ++c)
      append_float(file, static_cast<float>(std::exp(scales.hold(g.log_scales[static_cast<std::size_t>(3 * n + c)]))));
    const float* sh = g.sh.data() + 3 * g.sh_coefficients() * n;
    for (int c = 0; c < 3; ++c) {
      const double color = colors.hold(0.5 + kShC0 * static_cast<double>(sh[c]));
      file.push_back(static_cast<std::uint8_t>(std::lround(255 * color)));
    }
    file.push_back(opacity_level(g.opacity_logits[static_cast<std::size_t>(n)]));
    const Vector4<double> quat = unit_quat(g, n);
    for (int c = 0; c < 4; ++c) file.push_back(quat_byte(quat[c]));
  }
  if (g.sh_degree > 0) add_loss(encoded.losses, "Gaussians without their harmonics of degree 1 and more", g.count());
  add_loss(encoded.losses, "means in steps wider than their Gaussian", far_means(g, g.origin_world).count);
  add_loss(encoded.losses, "log-scales held within ±20", scales.count());
  add_loss(encoded.losses, "colours held within 0 to 1", colors.count());
  return encoded;
}

SplatFormat splat_format() {
  return {.ending = ".splat",
          .sh_degree = 0,
          .decode = decode_splat,
          .encode = [](const Gaussians& g, const SplatWriteOptions&) { return encode_splat(g); }};
}

}  // namespace hsi4d
