// Prints bits that the pixel loops make, to be compared between builds of this program at several levels of
// optimisation (rows B13 and F10). Built from the loops' own sources; ends with 1 where forward and backward differ.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "core/buffer.h"
#include "core/random.h"
#include "splat/render/block_kernel.h"

using namespace hsi4d;
using namespace hsi4d::detail;

namespace {

constexpr Index kGaussians = 300, kSide = 16, kPixels = kSide * kSide, kChannels = 8;

template <class S>
Buffer<S> cleared(Index n) {
  Buffer<S> buffer;
  buffer.resize(n);
  std::fill_n(buffer.data(), n, S(0));
  return buffer;
}

/// FNV-1a over the bits of numbers.
template <class S>
std::uint64_t hash_of(const Buffer<S>& numbers) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const S x : numbers.span()) {
    const auto bits = std::bit_cast<std::conditional_t<sizeof(S) == 4, std::uint32_t, std::uint64_t>>(x);
    hash = (hash ^ bits) * 0x100000001b3u;
  }
  return hash;
}

template <class S>
struct Scene {
  std::vector<SplatRecord<S>> records;
  std::vector<TileEntry> entries;
  std::vector<S> features;

  explicit Scene(Index named) : features(static_cast<std::size_t>(kGaussians * kChannels)) {
    RandomSequence random(51, 1);
    for (Index i = 0; i < kGaussians; ++i) {
      SplatRecord<S> r{};
      r.x = random.uniform(-4, 20), r.y = random.uniform(-4, 20);
      r.l11 = static_cast<S>(random.uniform(0.1, 1)), r.l22 = static_cast<S>(random.uniform(0.1, 1));
      r.l21 = static_cast<S>(random.uniform(-0.5, 0.5));
      const int level = static_cast<int>(random.uniform(1, 64));  // opacities whose logarithms are the same everywhere
      r.opacity = std::ldexp(S(1), -level / 8);
      r.log2_opacity = static_cast<S>(-level / 8);
      r.row_end = kSide;
      records.push_back(r);
      entries.push_back({static_cast<std::int32_t>(i), static_cast<std::uint32_t>(i), all_blocks(kSide)});
      for (Index k = 0; k < kChannels; ++k) {
        const S feature = named < 0 ? static_cast<S>(random.uniform(0, 1)) : S(i == named + k ? 1 : 0);
        features[static_cast<std::size_t>(i * kChannels + k)] = feature;
      }
      records.back().features.set(features.data() + i * kChannels, kChannels);
    }
  }
};

/// What a tile of some size makes: T and channels, and the sums of its Gaussians where the cotangent is 1.
template <class S>
struct Made {
  Buffer<S> state, sums;
  Index stride = 0;
};

Made<float> in_blocks(const Scene<float>& from, const CompositeRules<float>& rules, Index size) {
  const CompositeScene<float> scene{
      from.records, {from.features.data(), from.features.data()}, kGaussians, kChannels, rules};
  Made<float> made{cleared<float>(block_state(kSide, kChannels)), {}, block_slot(kChannels)};
  made.sums = cleared<float>(made.stride * kGaussians);
  Buffer<float> workspace = cleared<float>(block_workspace(kChannels));
  Buffer<float> kept = cleared<float>(16 * checkpoints_of(kSide, kGaussians, 16 * kGaussians));
  std::vector<BlockRun> runs(static_cast<std::size_t>(16 * block_chunks(kGaussians)));
  begin_blocks(kSide, size, size, kChannels, made.state.data());
  const BlockJob job{from.entries, nullptr,           0,       0,           size,        size,
                     0xFFFF,       made.state.data(), nullptr, runs.data(), kept.data(), workspace.data()};
  composite_blocks(kSide, scene, job);
  Buffer<float> ones = cleared<float>(kChannels * kPixels), behind = cleared<float>(kPixels);
  for (Index p = 0; p < kChannels * kPixels; ++p) ones[p] = p % kSide < size && p / kSide % kSide < size ? 1.0f : 0.0f;
  composite_blocks_adjoint(kSide, scene, job, {ones.data(), behind.data(), made.sums.data(), made.stride, true, true});
  return made;
}

template <class S>
Made<S> in_rows(const Scene<S>& from, const CompositeRules<S>& rules, Index size) {
  const CompositeScene<S> scene{
      from.records, {from.features.data(), from.features.data()}, kGaussians, kChannels, rules};
  Made<S> made{cleared<S>((1 + kChannels) * kPixels), {}, kMoments + kChannels};
  made.sums = cleared<S>(made.stride * kGaussians);
  Buffer<ListPosition<S>> last = cleared<ListPosition<S>>(kPixels);
  Buffer<S> kept = cleared<S>((kGaussians / kSegment + 1) * kPixels);
  const TileJob<S> job{from.entries, 0, 0, size, size, made.state.data(), last.data(), made.state.data() + kPixels,
                       kept.data()};
  composite_tile(kSide, scene, job);
  Buffer<S> ones = cleared<S>(kChannels * kPixels), behind = cleared<S>(kPixels);
  for (Index p = 0; p < kChannels * kPixels; ++p) ones[p] = p % kSide < size && p / kSide % kSide < size ? S(1) : S(0);
  Buffer<S> segment = cleared<S>(2 * kSegment * kPixels), feature_sums = cleared<S>(kChannels * kSide);
  composite_tile_adjoint(kSide, scene, job,
                         TileAdjoint<S>{ones.data(), behind.data(), segment.data(), feature_sums.data(),
                                        made.sums.data(), made.stride, true, true});
  return made;
}

/// Weights of the Gaussians in one pixel, as forward makes them of features that name eight at a time, against the
/// gradients of these features. Returns how many are drawn, or −1 where one differs.
template <class S, class F>
int weights_of_both_passes(const F& make, const CompositeRules<S>& rules, Index plane) {
  int drawn = 0;
  for (Index named = 0; named < kGaussians; named += kChannels) {
    const Made<S> made = make(Scene<S>(named), rules, 1);
    for (Index k = 0; k < kChannels && named + k < kGaussians; ++k) {
      const S weight = made.state[(1 + k) * plane];
      if (weight != made.sums[(named + k) * made.stride + kMoments + k]) return -1;
      drawn += weight != 0 ? 1 : 0;
    }
  }
  return drawn;
}

template <class S, class F>
bool report(const char* name, const F& make, const CompositeRules<S>& rules, Index plane) {
  const Made<S> made = make(Scene<S>(-1), rules, kSide);
  const int drawn = weights_of_both_passes<S>(make, rules, plane);
  std::printf("%s: forward %016llx, backward %016llx, %d weights of a pixel %s\n", name,
              static_cast<unsigned long long>(hash_of(made.state)), static_cast<unsigned long long>(hash_of(made.sums)),
              drawn, drawn > 3 ? "equal in both" : "WRONG");
  return drawn > 3;
}

}  // namespace

int main() {
  const auto rules = [](auto one, double alpha_min, double stop) {
    using S = decltype(one);
    return CompositeRules<S>{static_cast<S>(1 - 0x1p-12), static_cast<S>(alpha_min), static_cast<S>(stop), false, false,
                             static_cast<S>(0.3)};
  };
  bool good = report<float>("blocks", in_blocks, rules(1.0f, 1.0 / 255, 1e-4), kBlockPixels);
  good &= report<float>("blocks, exact", in_blocks, rules(1.0f, 1e-5, 1e-7), kBlockPixels);
  good &= report<float>("rows in float", in_rows<float>, rules(1.0f, 1.0 / 255, 1e-4), kPixels);
  good &= report<double>("rows in double", in_rows<double>, rules(1.0, 1.0 / 255, 1e-4), kPixels);
  return good ? 0 : 1;
}
