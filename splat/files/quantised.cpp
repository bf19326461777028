#include "splat/files/quantised.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/check.h"
#include "core/quaternion.h"

namespace hsi4d {

void add_loss(Counts& losses, const std::string& reason, Index count) {
  if (count > 0) losses.emplace_back(reason, count);
}

std::uint8_t opacity_level(float logit) {
  const double opacity = 1 / (1 + std::exp(-static_cast<double>(logit)));
  return static_cast<std::uint8_t>(std::lround(255 * opacity));
}

float opacity_logit(std::uint8_t level) {
  const double steps = level == 0 ? 0.25 : level == 255 ? 254.75 : level;
  return static_cast<float>(std::log(steps / (255 - steps)));
}

void check_finite(const Gaussians& g, const std::string& format) {
  check_sizes(g);
  const auto check = [&](const std::vector<float>& values, const char* what) {
    const auto found = std::find_if(values.begin(), values.end(), [](float value) { return !std::isfinite(value); });
    if (found == values.end()) return;
    const Index width = std::ssize(values) / g.count();
    throw UserError("Gaussian " + std::to_string((found - values.begin()) / width) + " has a " + what +
                    " that is not finite, which a " + format + " file cannot hold");
  };
  check(g.means, "mean");
  check(g.log_scales, "scale");
  check(g.quats, "quaternion");
  check(g.sh, "colour");
  for (std::size_t n = 0; n < g.opacity_logits.size(); ++n) {
    if (std::isnan(g.opacity_logits[n]))
      throw UserError("Gaussian " + std::to_string(n) + " has an opacity that is no number, which a " + format +
                      " file cannot hold");
  }
}

Vector3<double> mean_world(const Gaussians& g, Index n) {
  const float* m = g.means.data() + 3 * n;
  return g.origin_world + Vector3<double>(m[0], m[1], m[2]);
}

Vector4<double> unit_quat(const Gaussians& g, Index n) {
  const float* q = g.quats.data() + 4 * n;
  return quaternion_normalized(Vector4<double>(q[0], q[1], q[2], q[3]));
}

void append_uint(Bytes& bytes, std::uint64_t value, int size) {
  for (int i = 0; i < size; ++i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

void append_float(Bytes& bytes, float value) { append_uint(bytes, std::bit_cast<std::uint32_t>(value), 4); }

std::uint64_t load_uint(const std::uint8_t* bytes, int size) {
  std::uint64_t value = 0;
  for (int i = 0; i < size; ++i) value |= static_cast<std::uint64_t>(bytes[i]) << (8 * i);
  return value;
}

float load_float(const std::uint8_t* bytes) {
  return std::bit_cast<float>(static_cast<std::uint32_t>(load_uint(bytes, 4)));
}

}  // namespace hsi4d
