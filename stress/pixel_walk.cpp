#include "stress/pixel_walk.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/parallel.h"
#include "splat/render/block_kernel.h"

namespace hsi4d::stress {

namespace {

constexpr Index kBlockSide = 16;  // pixels: places within a tile are rounded in float

/// Three standard deviations along the longer axis, pixels: cov⁻¹ = Lᵀ L.
double square_radius(const detail::SplatRecord<float>& r) {
  const double a = r.l11, b = r.l21, c = r.l22, mid = (a * a + b * b + c * c) / 2, root = a * c;
  return 3 / std::sqrt(mid - std::sqrt(std::max(mid * mid - root * root, 0.0)));
}

}  // namespace

WalkedScene::WalkedScene(const Scene& scene)
    : camera_(scene.camera), settings_(scene.settings), background_(scene.background) {
  TapedScene<float> taped(scene);
  taped.tape.forward(taped.rendered.image);
  const Projected<float>& p = taped.rendered.projected;
  const Tape<float>& tape = taped.tape;
  const detail::SplatArrays<float> splats = {
      tape.value(p.means_px),  tape.value(p.factors),       tape.value(p.depths),    tape.value(p.depth_low),
      tape.value(p.means_low), tape.value(taped.opacities), tape.value(taped.colors)};
  const Index n = splats.rows();
  std::vector<detail::SplatRecord<float>> records(static_cast<std::size_t>(n));
  std::vector<detail::Extent> extents(records.size());
  const detail::TileGrid grid = detail::tile_grid(camera_.width, camera_.height, kBlockSide);
  detail::make_records(splats, settings_, grid, 0, n, records.data(), extents.data());
  rows_.resize(records.size());
  std::iota(rows_.begin(), rows_.end(), Index(0));
  std::stable_sort(rows_.begin(), rows_.end(),
                   [&](Index a, Index b) { return splats.depths.data[a] < splats.depths.data[b]; });
  for (const Index i : rows_) records_.push_back(records[static_cast<std::size_t>(i)]);
  colors_ = taped.value(taped.colors);
}

template <class Touches, class Visit>
std::vector<double> WalkedScene::walk(const detail::CompositeRules<float>& rules, const Touches& touches,
                                      const Visit& visit) const {
  const FlushDenormals flush;  // as in the renderer
  std::vector<double> result;
  for (Index row = 0; row < camera_.height; ++row) {
    for (Index col = 0; col < camera_.width; ++col) {
      const Index top = row / kBlockSide * kBlockSide, left = col / kBlockSide * kBlockSide;
      float t = 1;
      for (std::size_t place = 0; place < records_.size(); ++place) {
        const detail::SplatRecord<float>& record = records_[place];
        if (!touches(record, row, col)) continue;
        const auto pixel = detail::block_pixel_alpha(kBlockSide, record, rules, left, top, row - top, col - left);
        if (!pixel.drawn) continue;
        visit(result.size(), place, static_cast<double>(t) * static_cast<double>(pixel.alpha));
        t = detail::block_transmittance(t, pixel.alpha);
        if (t < rules.stop_below) break;
      }
      result.push_back(static_cast<double>(t));
    }
  }
  return result;
}

std::vector<double> WalkedScene::transmittance() const { return everything({}).transmittance; }

WalkedPixels WalkedScene::everything(const std::vector<double>& cotangent) const {
  const auto pixels = static_cast<std::size_t>(camera_.width) * static_cast<std::size_t>(camera_.height);
  WalkedPixels result{{}, std::vector<double>(3 * pixels), std::vector<double>(colors_.size())};
  result.transmittance = walk(
      detail::composite_rules<float>(settings_), [](const auto&, Index, Index) { return true; },
      [&](std::size_t pixel, std::size_t place, double weight) {
        for (std::size_t k = 0; k < 3; ++k) {
          const std::size_t number = 3 * static_cast<std::size_t>(rows_[place]) + k;
          result.image[k * pixels + pixel] += weight * colors_[number];
          if (!cotangent.empty()) result.d_colors[number] += weight * cotangent[k * pixels + pixel];
        }
      });
  for (std::size_t i = 0; i < 3 * pixels; ++i)
    result.image[i] += result.transmittance[i % pixels] * static_cast<double>(background_[i / pixels]);
  return result;
}

std::vector<double> WalkedScene::transmittance_by_tiles(Index tile) const {
  detail::CompositeRules<float> rules = detail::composite_rules<float>(settings_);
  rules.alpha_min = 0;
  return walk(
      rules,
      [tile](const detail::SplatRecord<float>& record, Index row, Index col) {
        const double radius = square_radius(record);
        const auto reaches = [&](double at, Index pixel) {
          const Index first = pixel / tile * tile;
          return at + radius >= static_cast<double>(first) && at - radius <= static_cast<double>(first + tile);
        };
        return reaches(record.x, col) && reaches(record.y, row);
      },
      [](std::size_t, std::size_t, double) {});
}

std::vector<double> WalkedScene::transmittance_of_digits(int bits) const {
  WalkedScene rounded = *this;
  for (detail::SplatRecord<float>& record : rounded.records_) {
    for (float* const number : {&record.l11, &record.l21, &record.l22}) {
      int exponent = 0;
      const float share = std::frexp(*number, &exponent);
      *number = std::ldexp(std::nearbyint(std::ldexp(share, bits)), exponent - bits);
    }
  }
  return rounded.transmittance();
}

}  // namespace hsi4d::stress
