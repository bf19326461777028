// The pixel loops called by themselves, on lists that leave out nothing: every Gaussian in every block of every tile.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include <catch2/catch.hpp>

#include "core/parallel.h"
#include "splat/render/block_kernel.h"
#include "splat/render/splat_records.h"
#include "tests/support/flat_splats.h"
#include "tests/support/isa.h"

namespace unculled_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

/// An image in the order of Flat's, and the sums of every tile's list.
template <class S>
struct Unculled {
  std::vector<double> channels, transmittance;
  std::vector<float> sums;  ///< only float
};

template <class S>
class Everything {
 public:
  Everything(const FlatRender<S>& flat, const SplatView& view)
      : width_(view.camera.width), height_(view.camera.height), channels_(flat.features.shape().cols) {
    const hsi4d::detail::SplatArrays<S> splats = flat.arrays();
    const Index n = splats.rows();
    records_.resize(static_cast<std::size_t>(n));
    std::vector<hsi4d::detail::Extent> extents(records_.size());
    const auto grid = hsi4d::detail::tile_grid(width_, height_, kSide);
    hsi4d::detail::make_records(splats, view.settings, grid, 0, n, records_.data(), extents.data());
    for (auto& record : records_) record.row_begin = 0, record.row_end = static_cast<std::int32_t>(height_);
    std::vector<std::int32_t> order(records_.size());
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](std::int32_t a, std::int32_t b) { return splats.depths.data[a] < splats.depths.data[b]; });
    for (const std::int32_t index : order) {
      entries_.push_back({index, static_cast<std::uint32_t>(entries_.size()), hsi4d::detail::all_blocks(kSide)});
    }
    const S* const features = splats.features.data;
    scene_ = {records_, {features, features}, n, channels_, hsi4d::detail::composite_rules<S>(view.settings)};
  }

  Unculled<S> run() {
    Unculled<S> out;
    const auto pixels = static_cast<std::size_t>(width_ * height_);
    out.channels.resize(pixels * static_cast<std::size_t>(channels_));
    out.transmittance.resize(pixels);
    for (Index top = 0; top < height_; top += kSide) {
      for (Index left = 0; left < width_; left += kSide) tile(left, top, out);
    }
    return out;
  }

 private:
  static constexpr Index kSide = 16, kPixels = kSide * kSide;

  void put(Index left, Index top, Index row, Index col, Index channel, S value, Unculled<S>& out) const {
    if (top + row >= height_ || left + col >= width_) return;
    auto& to = channel < 0 ? out.transmittance : out.channels;
    const Index place = (std::max<Index>(channel, 0) * height_ + top + row) * width_ + left + col;
    to[static_cast<std::size_t>(place)] = static_cast<double>(value);
  }

  void tile(Index left, Index top, Unculled<S>& out) {
    const Index width = std::min(kSide, width_ - left), height = std::min(kSide, height_ - top);
    if constexpr (std::is_same_v<S, float>) {
      const Index blocks = 16, size = (1 + channels_) * 16, count = static_cast<Index>(entries_.size());
      const auto buffer = [](Index numbers) {
        Buffer<float> memory;
        memory.resize(numbers);
        std::fill_n(memory.data(), numbers, 0.0f);
        return memory;
      };
      Buffer<float> state = buffer(hsi4d::detail::block_state(kSide, channels_));
      Buffer<float> workspace = buffer(hsi4d::detail::block_workspace(channels_));
      Buffer<float> kept = buffer(16 * hsi4d::detail::checkpoints_of(kSide, count, blocks * count));
      std::vector<hsi4d::detail::BlockRun> runs(static_cast<std::size_t>(blocks * hsi4d::detail::block_chunks(count)));
      hsi4d::detail::begin_blocks(kSide, width, height, channels_, state.data());
      const hsi4d::detail::BlockJob job{entries_, nullptr,      left,    top,         width,       height,
                                        0xFFFF,   state.data(), nullptr, runs.data(), kept.data(), workspace.data()};
      hsi4d::detail::composite_blocks(kSide, scene_, job);
      for (Index b = 0; b < blocks; ++b) {
        for (Index i = 0; i < 16; ++i) {
          const Index row = b / 4 * 4 + i / 4, col = b % 4 * 4 + i % 4;
          const float* const of = state.data() + b * size;
          put(left, top, row, col, -1, std::abs(of[i]), out);  // negative: finished
          for (Index k = 0; k < channels_; ++k) put(left, top, row, col, k, of[16 * (1 + k) + i], out);
        }
      }
      // The cotangent is 1 in every channel, 0 in T.
      Buffer<float> ones = buffer(channels_ * kPixels), behind = buffer(kPixels);
      for (Index p = 0; p < channels_ * kPixels; ++p) {
        ones[p] = p % kSide < width && p / kSide % kSide < height ? 1.0f : 0.0f;
      }
      const Index stride = hsi4d::detail::block_slot(channels_);
      Buffer<float> sums = buffer(stride * count);
      hsi4d::detail::composite_blocks_adjoint(kSide, scene_, job,
                                              {ones.data(), behind.data(), sums.data(), stride, true, true});
      out.sums.insert(out.sums.end(), sums.span().begin(), sums.span().end());
    } else {
      std::vector<S> t(kPixels), channels(static_cast<std::size_t>(channels_ * kPixels));
      std::vector<hsi4d::detail::ListPosition<S>> last(kPixels);
      Buffer<S> aligned;
      aligned.resize((1 + channels_) * kPixels);
      Buffer<hsi4d::detail::ListPosition<S>> ends;
      ends.resize(kPixels);
      hsi4d::detail::composite_tile<S>(
          kSide, scene_,
          {entries_, left, top, width, height, aligned.data(), ends.data(), aligned.data() + kPixels, nullptr});
      for (Index p = 0; p < kPixels; ++p) {
        for (Index k = -1; k < channels_; ++k) {
          put(left, top, p / kSide, p % kSide, k, aligned[(1 + k) * kPixels + p], out);
        }
      }
    }
  }

  Index width_, height_, channels_;
  std::vector<hsi4d::detail::SplatRecord<S>> records_;
  std::vector<hsi4d::detail::TileEntry> entries_;
  hsi4d::detail::CompositeScene<S> scene_;
};

}  // namespace

TEMPLATE_TEST_CASE("without culling the image has the same bits [B7]", "[isa]", float, double) {
  using S = TestType;
  FlatSplats splats = random_flat(150, 45, 30, 3, 12);
  for (std::size_t n = 0; n < splats.opacities.size(); n += 3)
    splats.opacities[n] = 0.006 + 1e-4 * static_cast<double>(n);
  for (const SettingsVariant& variant : settings_variants()) {
    SplatView view = front_view(45, 30);
    variant.apply(view.settings);
    // The square of 3σ is part of the result there, not a way to it; and this harness has tiles of one size.
    if (view.settings.footprint == hsi4d::Footprint::kSquare3Sigma || view.settings.tile != 16) continue;
    INFO(variant.name);
    FlatRender<S> flat(splats, view);
    flat.tape.forward(flat.out.transmittance);
    const FlushDenormals flush;  // as in the renderer
    const Unculled<S> all = Everything<S>(flat, view).run();
    const bool same_channels = flat.value(flat.out.channels) == all.channels;
    const bool same_transmittance = flat.value(flat.out.transmittance) == all.transmittance;
    CHECK(same_channels);
    CHECK(same_transmittance);
    CHECK(flat.out.counters->groups < 9 * 16 * splats.count());  // something was culled
  }
}

TEST_CASE("flushing denormals changes nothing above 1e-30 [F4]", "[isa]") {
  // Gaussians whose rims fade to nothing, and stacks down to a T far below float's least normal number.
  FlatSplats splats = random_flat(60, 16, 16, 3, 13);
  for (int i = 0; i < 300; ++i) splats.add(8, 8, 6 + i, 3, 0.4, {0.5, 1, 0.25});
  SplatView view = front_view(16, 16, uncut_settings());
  FlatRender<float> flat(splats, view);
  const auto run = [&](bool flush) {
    Everything<float> all(flat, view);
    if (!flush) return all.run();
    const FlushDenormals flushed;
    return all.run();
  };
  const Unculled<float> flushed = run(true), kept = run(false);
  const auto is_denormal = [](double x) { return x != 0 && std::abs(x) < 0x1p-126; };
  CHECK(std::any_of(kept.transmittance.begin(), kept.transmittance.end(), is_denormal));  // that there is something
  CHECK(std::none_of(flushed.transmittance.begin(), flushed.transmittance.end(), is_denormal));
  CHECK(largest_difference(kept.channels, flushed.channels) <= 1e-30);
  CHECK(largest_difference(kept.transmittance, flushed.transmittance) <= 1e-30);
  CHECK(largest_difference({kept.sums.begin(), kept.sums.end()}, {flushed.sums.begin(), flushed.sums.end()}) <= 1e-30);
  CHECK(std::any_of(flushed.sums.begin(), flushed.sums.end(), [](float x) { return x > 1; }));
}

}  // namespace unculled_test
