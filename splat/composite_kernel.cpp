#include "splat/composite_kernel.h"

#include "core/check.h"
#include "core/simd.h"

namespace hsi4d::detail {

namespace {

/// Calls f with the tile's side and the number of channels as compile-time numbers (0: any number).
template <class F>
void with_sizes(Index side, Index channels, F&& f) {
  HSI4D_CHECK(side == 8 || side == 16, "tile = " + std::to_string(side) + "; allowed: 8, 16");
  using std::integral_constant;
  if (side == 16) {
    if (channels == 3) return f(integral_constant<int, 16>(), integral_constant<int, 3>());
    return f(integral_constant<int, 16>(), integral_constant<int, 0>());
  }
  if (channels == 3) return f(integral_constant<int, 8>(), integral_constant<int, 3>());
  f(integral_constant<int, 8>(), integral_constant<int, 0>());
}

}  // namespace

template <class S>
Index composite_tile(Index side, const CompositeScene<S>& scene, const TileJob<S>& job) {
  Index fragments = 0;
  with_sizes(side, scene.channels, [&](auto width, auto channels) {
    constexpr int kWidth = decltype(width)::value, kChannels = decltype(channels)::value;
    if (scene.rules.exclusive) {
      on_best_isa([&] { fragments = composite_tile<kWidth, kChannels, true>(scene, job); });
    } else {
      on_best_isa([&] { fragments = composite_tile<kWidth, kChannels, false>(scene, job); });
    }
  });
  return fragments;
}

template <class S>
void composite_tile_adjoint(Index side, const CompositeScene<S>& scene, const TileJob<S>& job,
                            const TileAdjoint<S>& adjoint, S* feature_sums) {
  with_sizes(side, scene.channels, [&](auto width, auto channels) {
    constexpr int kWidth = decltype(width)::value, kChannels = decltype(channels)::value;
    on_best_isa([&] { composite_tile_adjoint<kWidth, kChannels>(scene, job, adjoint, feature_sums); });
  });
}

#define HSI4D_INSTANTIATE(S)                                                             \
  template Index composite_tile(Index, const CompositeScene<S>&, const TileJob<S>&);     \
  template void composite_tile_adjoint(Index, const CompositeScene<S>&, const TileJob<S>&, \
                                       const TileAdjoint<S>&, S*);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d::detail
