// Inputs and outputs of the operator of composite.h, by number. Used by composite.cpp.
#pragma once

#include <algorithm>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <vector>

#include "autodiff/tape.h"
#include "splat/render/composite.h"
#include "splat/render/slot_sums.h"
#include "splat/render/splat_lists.h"
#include "splat/render/tile_image.h"

namespace hsi4d::detail {

/// Of what moves; those of what stands still follow, if there is any, then the background, if there is one.
enum CompositeInput { kMeans, kFactors, kDepths, kRest, kMeansRest, kOpacities, kFeatures, kStill };
/// The last only where a background lies behind some of the channels.
enum CompositeOutput { kChannels, kTransmittance, kMoreChannels };

/// Rows of a set whose shapes fit.
template <class S>
Index check_set(const SplatSet<S>& set, Index channels) {
  const Index rows = set.opacities.shape().rows;
  HSI4D_CHECK_EQ(set.projected.means_px.shape(), shape_of(rows, 2));
  HSI4D_CHECK_EQ(set.projected.factors.shape(), shape_of(rows, 6));
  HSI4D_CHECK_EQ(set.projected.depths.shape(), shape_of(rows, 1));
  HSI4D_CHECK_EQ(set.projected.depth_low.shape(), shape_of(rows, 1));
  HSI4D_CHECK_EQ(set.projected.means_low.shape(), shape_of(rows, 2));
  HSI4D_CHECK_EQ(set.opacities.shape(), shape_of(rows, 1));
  HSI4D_CHECK_EQ(set.features.shape(), shape_of(rows, channels));
  return rows;
}

/// The inputs that sets make, in order. Throws InternalError when their shapes do not fit, or rows are too many to be
/// counted.
template <class S>
std::vector<Var<S>> inputs_of(std::initializer_list<SplatSet<S>> sets, Index channels) {
  std::vector<Var<S>> inputs;
  Index rows = 0;
  for (const SplatSet<S>& set : sets) {
    rows += check_set(set, channels);
    const Projected<S>& p = set.projected;
    inputs.insert(inputs.end(),
                  {p.means_px, p.factors, p.depths, p.depth_low, p.means_low, set.opacities, set.features});
  }
  HSI4D_CHECK(rows <= std::numeric_limits<std::int32_t>::max(), std::to_string(rows) + " Gaussians");
  return inputs;
}

/// Whether there is a set that stands still.
template <class S>
bool has_still(const NodeIo<S>& io) {
  return io.inputs() >= 2 * kStill;
}
/// Its rows, which come first.
template <class S>
Index still_rows(const NodeIo<S>& io) {
  return has_still(io) ? io.in(kStill + kMeans).shape.rows : 0;
}

/// Whether a gradient is wanted in one of the inputs of either set.
template <class S>
bool wants_any(const NodeIo<S>& io, std::initializer_list<int> inputs) {
  return std::any_of(inputs.begin(), inputs.end(),
                     [&](int i) { return io.wants(i) || (has_still(io) && io.wants(kStill + i)); });
}
template <class S>
bool wants_shape(const NodeIo<S>& io) {
  return wants_any(io, {kMeans, kMeansRest, kFactors, kOpacities});
}
template <class S>
bool wants_features(const NodeIo<S>& io) {
  return wants_any(io, {kFeatures});
}
template <class S>
bool wants_gradient(const NodeIo<S>& io) {
  return wants_shape(io) || wants_features(io);
}

template <class S>
bool has_background(const NodeIo<S>& io) {
  return io.inputs() % kStill != 0;
}
template <class S>
int background_input(const NodeIo<S>& io) {
  return io.inputs() - 1;
}

/// Features that are composited.
template <class S>
Index channels_of(const NodeIo<S>& io) {
  return io.in(kFeatures).shape.cols;
}
template <class S>
OutputImages<S> images_of(const NodeIo<S>& io) {
  const Array<S> over = io.out(kChannels);
  return {over, over.shape.planes < channels_of(io) ? io.out(kMoreChannels) : Array<S>{}, io.out(kTransmittance),
          has_background(io) ? io.in(background_input(io)).data : nullptr};
}
template <class S>
OutputCotangents<S> cotangents_of(const NodeIo<S>& io) {
  const bool split = io.out(kChannels).shape.planes < channels_of(io);
  return {io.d_out(kChannels), split ? io.d_out(kMoreChannels) : ConstArray<S>{}, io.d_out(kTransmittance)};
}

/// @param first  number of the first input of a set
template <class S>
SplatArrays<S> splats_of(const NodeIo<S>& io, int first) {
  return {io.in(first + kMeans),     io.in(first + kFactors),   io.in(first + kDepths),  io.in(first + kRest),
          io.in(first + kMeansRest), io.in(first + kOpacities), io.in(first + kFeatures)};
}
template <class S>
SplatRows<S> rows_of(const NodeIo<S>& io) {
  return {has_still(io) ? splats_of(io, kStill) : SplatArrays<S>{}, splats_of(io, 0), still_rows(io)};
}
/// @param first  likewise
template <class S>
SplatGradients<S> gradients_of(const NodeIo<S>& io, int first) {
  const auto d = [&](int input) { return io.wants(first + input) ? io.d_in(first + input) : Array<S>{}; };
  return {d(kMeans), d(kMeansRest), d(kFactors), d(kOpacities), d(kFeatures)};
}

}  // namespace hsi4d::detail
