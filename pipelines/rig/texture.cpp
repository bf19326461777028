#include "pipelines/rig/texture.h"

#include <algorithm>
#include <cmath>

namespace hsi4d {

namespace {

using Rgba = std::array<float, 4>;

/// Sum of colours, weighted by alpha.
struct Blend {
  Rgba sum = {};
  void add(const std::uint8_t* texel, float weight) {
    constexpr float kUnit = 1 / 255.0F;
    const float alpha = static_cast<float>(texel[3]) * kUnit * weight, share = alpha * kUnit;
    for (std::size_t c = 0; c < 3; ++c) sum[c] += static_cast<float>(texel[c]) * share;
    sum[3] += alpha;
  }
};

std::size_t texel_at(const Texture::Level& level, int x, int y) {
  return 4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(level.width) + static_cast<std::size_t>(x));
}

std::uint8_t as_byte(float x) { return static_cast<std::uint8_t>(std::lround(std::clamp(x, 0.0F, 1.0F) * 255)); }

Texture::Level halved(const Texture::Level& from) {
  Texture::Level to{std::max(1, from.width / 2), std::max(1, from.height / 2), {}};
  to.rgba.resize(4 * static_cast<std::size_t>(to.width) * static_cast<std::size_t>(to.height));
  for (int y = 0; y < to.height; ++y) {
    for (int x = 0; x < to.width; ++x) {
      Blend blend;
      for (int k = 0; k < 4; ++k) {
        const int col = std::min(2 * x + k % 2, from.width - 1), row = std::min(2 * y + k / 2, from.height - 1);
        blend.add(from.rgba.data() + texel_at(from, col, row), 0.25F);
      }
      std::uint8_t* const texel = to.rgba.data() + texel_at(to, x, y);
      for (std::size_t c = 0; c < 3; ++c) texel[c] = blend.sum[3] > 0 ? as_byte(blend.sum[c] / blend.sum[3]) : 0;
      texel[3] = as_byte(blend.sum[3]);
    }
  }
  return to;
}

Texture::Level level_of(const Image& image) {
  Texture::Level level{image.width(), image.height(), {}};
  level.rgba.resize(4 * static_cast<std::size_t>(level.width) * static_cast<std::size_t>(level.height));
  const bool has_alpha = image.channels() % 2 == 0;
  for (int y = 0; y < level.height; ++y) {
    for (int x = 0; x < level.width; ++x) {
      std::uint8_t* const texel = level.rgba.data() + texel_at(level, x, y);
      for (int c = 0; c < 3; ++c) texel[c] = as_byte(image(image.channels() < 3 ? 0 : c, y, x));
      texel[3] = has_alpha ? as_byte(image(image.channels() - 1, y, x)) : 255;
    }
  }
  return level;
}

int wrapped(int x, int size, TextureWrap wrap) {
  if (x >= 0 && x < size) return x;
  if (wrap == TextureWrap::kClamp) return std::clamp(x, 0, size - 1);
  const int period = wrap == TextureWrap::kMirror ? 2 * size : size;
  x %= period;
  if (x < 0) x += period;
  return x < size ? x : 2 * size - 1 - x;
}

/// A coordinate without its whole turns, so that it fits an int at any size.
double folded(double x) {
  constexpr double kPeriod = 2;  // of kMirror; a multiple of kRepeat's
  return std::isfinite(x) ? x - kPeriod * std::floor(x / kPeriod) : 0;
}

void add_bilinear(const Texture::Level& level, double u, double v, TextureWrap wrap_u, TextureWrap wrap_v, float weight,
                  Blend& blend) {
  const double x = u * level.width - 0.5, y = (1 - v) * level.height - 0.5;
  const double left = std::floor(x), top = std::floor(y);
  const auto right_share = static_cast<float>(x - left), below_share = static_cast<float>(y - top);
  const int cols[2] = {wrapped(static_cast<int>(left), level.width, wrap_u),
                       wrapped(static_cast<int>(left) + 1, level.width, wrap_u)};
  const int rows[2] = {wrapped(static_cast<int>(top), level.height, wrap_v),
                       wrapped(static_cast<int>(top) + 1, level.height, wrap_v)};
  const float across[2] = {1 - right_share, right_share}, down[2] = {1 - below_share, below_share};
  for (int k = 0; k < 4; ++k)
    blend.add(level.rgba.data() + texel_at(level, cols[k % 2], rows[k / 2]), weight * across[k % 2] * down[k / 2]);
}

}  // namespace

Texture texture_from(const Image& image) {
  Texture texture;
  Texture::Level level = level_of(image);
  while (std::max(level.width, level.height) > kLargestTexture) level = halved(level);
  for (std::size_t i = 3; i < level.rgba.size(); i += 4) texture.has_alpha = texture.has_alpha || level.rgba[i] < 255;
  texture.levels.push_back(std::move(level));
  while (texture.levels.back().width > 1 || texture.levels.back().height > 1)
    texture.levels.push_back(halved(texture.levels.back()));
  return texture;
}

std::array<float, 4> look_up(const Texture& texture, double u, double v, double texels, TextureWrap wrap_u,
                             TextureWrap wrap_v) {
  u = wrap_u == TextureWrap::kClamp ? std::clamp(u, -1.0, 2.0) : folded(u);
  v = wrap_v == TextureWrap::kClamp ? std::clamp(v, -1.0, 2.0) : folded(v);
  const double coarse = texels > 1 ? std::log2(texels) : 0;
  const auto last = static_cast<double>(texture.levels.size() - 1);
  const double level = std::min(coarse, last);
  const auto below = static_cast<std::size_t>(level);
  const auto share = static_cast<float>(level - std::floor(level));
  Blend blend;
  add_bilinear(texture.levels[below], u, v, wrap_u, wrap_v, 1 - share, blend);
  if (share > 0) add_bilinear(texture.levels[below + 1], u, v, wrap_u, wrap_v, share, blend);
  Rgba color = blend.sum;
  for (std::size_t c = 0; c < 3; ++c) color[c] = blend.sum[3] > 0 ? color[c] / blend.sum[3] : 0;
  return color;
}

}  // namespace hsi4d
