#include "splat/render/composite_curvature.h"

#include <algorithm>

#include "core/simd.h"
#include "core/vector_exp.h"
#include "splat/render/block_kernel.h"

namespace hsi4d::detail {

namespace {

constexpr Index kPixels = kBlockPixels;

/// One block of 4×4 pixels on its way from front to back.
template <class S>
class CurvatureBlock {
 public:
  CurvatureBlock(const CurvatureScene<S>& all, const CurvatureTile<S>& tile, CurvatureWorkspace<S>& workspace)
      : all_(all), tile_(tile), workspace_(workspace) {}

  void run(Index block, double* sum) {
    const Index across = tile_.side / kBlockSide;
    left_ = block % across * kBlockSide;
    top_ = block / across * kBlockSide;
    if (left_ >= tile_.width || top_ >= tile_.height || !load_weights()) return;
    load_state(block);
    workspace_.mover_of.clear();
    Index visited = 0;
    for (const TileEntry& entry : tile_.entries) {
      if ((entry.blocks >> block & 1u) == 0) continue;
      composite(entry.index);
      if (++visited % 8 == 0 && !any_alive()) break;
    }
    add_products(sum);
    for (const std::int32_t mover : workspace_.mover_of) workspace_.slot_of[static_cast<std::size_t>(mover)] = -1;
  }

 private:
  static constexpr Index kMostActive = kMostBlockChannels + 1;  // channels, and T

  /// Row of an output at the block's row r, its first pixel.
  template <class T>
  T* row_of(const Array<T>& image, Index plane, Index r) const {
    return &image(plane, tile_.top + top_ + r, tile_.left + left_);
  }
  Index columns() const { return std::min(kBlockSide, tile_.width - left_); }
  Index rows() const { return std::min(kBlockSide, tile_.height - top_); }

  /// Channels with a weight in the block become active. False where there is none.
  bool load_weights() {
    active_ = 0;
    const Index over = all_.images.over.shape.planes, channels = all_.images.channels();
    for (Index k = 0; k <= channels; ++k) {
      const ConstArray<S>& from = k == channels ? all_.weights.transmittance
                                  : k < over    ? all_.weights.over
                                                : all_.weights.rest;
      if (!from) continue;
      const Index plane = k == channels ? 0 : k < over ? k : k - over;
      S* const to = weight_[active_];
      std::fill_n(to, kPixels, S(0));
      S most = 0;
      for (Index r = 0; r < rows(); ++r) {
        const S* const row = row_of(from, plane, r);
        for (Index c = 0; c < columns(); ++c) most = std::max(most, to[r * kBlockSide + c] = row[c]);
      }
      if (most > S(0)) feature_[active_++] = k == channels ? -1 : k;
      if (active_ == kMostActive) break;
    }
    return active_ > 0;
  }

  /// T in front, and what is seen of each active channel from the entries on.
  void load_state(Index block) {
    const Index channels = all_.scene.channels;
    const S* const start = tile_.start != nullptr ? tile_.start + block * (1 + channels) * kPixels : nullptr;
    for (Index i = 0; i < kPixels; ++i) {
      const bool inside = i % kBlockSide < columns() && i / kBlockSide < rows();
      through_[i] = start != nullptr ? start[i] : inside ? S(1) : S(-1);
      x_[i] = static_cast<S>(left_ + i % kBlockSide) + S(0.5);
      y_[i] = static_cast<S>(top_ + i / kBlockSide) + S(0.5);
    }
    for (Index a = 0; a < active_; ++a) {
      std::fill_n(rest_[a], kPixels, S(0));
      for (Index r = 0; r < rows(); ++r) {
        for (Index c = 0; c < columns(); ++c) {
          const Index i = r * kBlockSide + c, y = tile_.top + top_ + r, x = tile_.left + left_ + c;
          rest_[a][i] = feature_[a] < 0 ? all_.images.transmittance(y, x) : *all_.images.at(feature_[a], y, x);
          if (start != nullptr && feature_[a] >= 0) rest_[a][i] -= start[(1 + feature_[a]) * kPixels + i];
        }
      }
    }
  }

  bool any_alive() const {
    return std::any_of(through_, through_ + kPixels, [&](S t) { return t >= all_.scene.rules.stop_below; });
  }

  /// Lays Gaussian n over the block, and adds what its moving does to a.
  void composite(std::int32_t n) {
    const SplatRecord<S>& record = all_.scene.records[static_cast<std::size_t>(n)];
    const CompositeRules<S>& rules = all_.scene.rules;
    const S x = static_cast<S>(record.x - static_cast<double>(tile_.left)),
            y = static_cast<S>(record.y - static_cast<double>(tile_.top));
    alignas(kAlignment) S weight[kPixels], ratio[kPixels], gate[kPixels], u[kPixels], w[kPixels];
    S drawn = 0;
    for (Index i = 0; i < kPixels; ++i) {
      const S dx = x_[i] - x, dy = y_[i] - y;
      u[i] = record.l11 * dx + record.l21 * dy;
      w[i] = record.l22 * dy;
      const S full = record.opacity * vector_exp(S(-0.5) * (u[i] * u[i] + w[i] * w[i]));
      const S alpha = std::min(full, rules.alpha_cap), next = through_[i] * (S(1) - alpha);
      const bool met = through_[i] >= rules.stop_below && alpha >= rules.alpha_min;
      const bool past = met && rules.exclusive && next < rules.stop_below;
      const bool is_drawn = met && !past;
      weight[i] = is_drawn ? through_[i] * alpha : S(0);
      ratio[i] = is_drawn && alpha < S(1) ? alpha / (S(1) - alpha) : S(0);
      gate[i] = full > rules.alpha_cap ? (rules.pass_cap ? full / alpha : S(0)) : S(1);
      through_[i] = past ? -through_[i] : is_drawn ? next : through_[i];
      drawn = std::max(drawn, weight[i]);
    }
    if (!(drawn > S(0))) return;
    alignas(kAlignment) S change[kMostActive][kPixels];  // of the pixel by log α
    for (Index a = 0; a < active_; ++a) {
      const S feature = feature_[a] < 0 ? S(0) : all_.scene.feature(n)[feature_[a]];
      for (Index i = 0; i < kPixels; ++i) {
        const S shown = weight[i] * feature;
        rest_[a][i] -= shown;
        change[a][i] = gate[i] * (shown - ratio[i] * rest_[a][i]);
      }
    }
    const bool second = n >= all_.scene.second;
    const Twists<S>* const twists = all_.twists[second ? 1 : 0];
    if (twists == nullptr) return;
    const Index row = second ? n - all_.scene.second : n;
    for (Index k = 0; k < twists->per_row; ++k) {
      const std::int32_t mover = twists->mover(row, k);
      if (mover >= 0) add_rates(record, mover, twists->rate(row, k), u, w, change);
    }
  }

  /// a += change · (u (L ∂m)_1 + w (L ∂m)_2)
  void add_rates(const SplatRecord<S>& record, std::int32_t mover, const S* rate, const S* u, const S* w,
                 const S (*change)[kPixels]) {
    S* const to = rates_of(mover);
    for (Index k = 0; k < kTwist; ++k) {
      const S by_u = record.l11 * rate[k] + record.l21 * rate[kTwist + k], by_w = record.l22 * rate[kTwist + k];
      alignas(kAlignment) S log_alpha[kPixels];
      for (Index i = 0; i < kPixels; ++i) log_alpha[i] = u[i] * by_u + w[i] * by_w;
      for (Index a = 0; a < active_; ++a) {
        S* const sum = to + (a * kTwist + k) * kPixels;
        for (Index i = 0; i < kPixels; ++i) sum[i] += change[a][i] * log_alpha[i];
      }
    }
  }

  S* rates_of(std::int32_t mover) {
    std::int32_t& slot = workspace_.slot_of[static_cast<std::size_t>(mover)];
    const Index numbers = active_ * kTwist * kPixels;
    if (slot < 0) {
      slot = static_cast<std::int32_t>(workspace_.mover_of.size());
      workspace_.mover_of.push_back(mover);
      std::fill_n(workspace_.rates.data() + slot * numbers, numbers, S(0));
    }
    return workspace_.rates.data() + slot * numbers;
  }

  void add_products(double* sum) {
    const Index numbers = active_ * kTwist * kPixels, size = kTwist * all_.movers;
    const auto slots = static_cast<Index>(workspace_.mover_of.size());
    alignas(kAlignment) S weighted[kMostActive * kTwist * kPixels];
    for (Index s = 0; s < slots; ++s) {
      const S* const of = workspace_.rates.data() + s * numbers;
      for (Index a = 0; a < active_; ++a) {
        for (Index k = 0; k < kTwist; ++k) {
          for (Index i = 0; i < kPixels; ++i) {
            const Index at = (a * kTwist + k) * kPixels + i;
            weighted[at] = weight_[a][i] * of[at];
          }
        }
      }
      const Index mover = workspace_.mover_of[static_cast<std::size_t>(s)];
      for (Index t = 0; t <= s; ++t) {
        const Index other = workspace_.mover_of[static_cast<std::size_t>(t)];
        const S* const by = workspace_.rates.data() + t * numbers;
        for (Index k = 0; k < kTwist; ++k) {
          for (Index l = 0; l < kTwist; ++l) {
            const Index row = mover >= other ? kTwist * mover + k : kTwist * other + l;
            const Index col = mover >= other ? kTwist * other + l : kTwist * mover + k;
            sum[row * size + col] += product(weighted + k * kPixels, by + l * kPixels);
          }
        }
      }
    }
  }

  /// Σ over active channels and pixels.
  double product(const S* weighted, const S* rates) const {
    alignas(kAlignment) S lanes[kPixels] = {};
    for (Index a = 0; a < active_; ++a) {
      const Index at = a * kTwist * kPixels;
      for (Index i = 0; i < kPixels; ++i) lanes[i] += weighted[at + i] * rates[at + i];
    }
    for (Index half = kPixels / 2; half > 0; half /= 2) {
      for (Index i = 0; i < half; ++i) lanes[i] += lanes[i + half];
    }
    return static_cast<double>(lanes[0]);
  }

  const CurvatureScene<S>& all_;
  const CurvatureTile<S>& tile_;
  CurvatureWorkspace<S>& workspace_;
  Index left_ = 0, top_ = 0;  // of the block in the tile
  Index active_ = 0;
  Index feature_[kMostActive];  // of an active channel; −1: T
  alignas(kAlignment) S weight_[kMostActive][kPixels];
  alignas(kAlignment) S rest_[kMostActive][kPixels];  // R
  alignas(kAlignment) S through_[kPixels];            // T, negative where the pixel is finished
  alignas(kAlignment) S x_[kPixels], y_[kPixels];     // from the tile's corner
};

}  // namespace

template <class S>
void add_tile_curvature(const CurvatureScene<S>& all, const CurvatureTile<S>& tile, CurvatureWorkspace<S>& workspace,
                        double* sum) {
  workspace.slot_of.resize(static_cast<std::size_t>(all.movers), -1);
  const auto room = static_cast<std::size_t>(all.movers * (all.images.channels() + 1) * kTwist * kPixels);
  if (workspace.rates.size() < room) workspace.rates.resize(room);
  workspace.mover_of.reserve(static_cast<std::size_t>(all.movers));
  CurvatureBlock<S> block(all, tile, workspace);
  const Index blocks = (tile.side / kBlockSide) * (tile.side / kBlockSide);
  on_best_isa_for<S>([&] {
    for (Index b = 0; b < blocks; ++b) block.run(b, sum);
  });
}

template void add_tile_curvature(const CurvatureScene<float>&, const CurvatureTile<float>&, CurvatureWorkspace<float>&,
                                 double*);
template void add_tile_curvature(const CurvatureScene<double>&, const CurvatureTile<double>&,
                                 CurvatureWorkspace<double>&, double*);

}  // namespace hsi4d::detail
