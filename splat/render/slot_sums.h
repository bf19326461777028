// The reduction of compositing's adjoint: from the sums of (tile, Gaussian) pairs to the gradients of Gaussians. Used
// by composite.cpp.
#pragma once

#include <algorithm>
#include <span>

#include "core/lanes.h"
#include "splat/render/composite_kernel.h"
#include "splat/render/splat_records.h"
#include "splat/render/tiles.h"

namespace hsi4d::detail {

/// Numbers of a slot that are read together, and beyond its end: the sums have as much room behind them.
inline constexpr Index kSlotNumbers = 2 * kLanes;

/// Sums of pairs, a slot each: moments, then features.
template <class S>
struct SlotSums {
  const S* sums;
  Index stride;
  Index first_feature;               ///< numbers of moments; 0: there are none
  bool of_blocks;                    ///< the moments are those of block_kernel.h, else of composite_kernel.h
  const TileLists& lists;            ///< slots of the rows
  std::span<const DepthKeyed> ends;  ///< of each tile, the last Gaussian that has sums; index −1: none
};

/// Rows of one set: the first one's number in the set, in all sets, and in the lists.
struct RowNumbers {
  Index in_set, of_all, in_lists;
  RowNumbers after(Index rows) const { return {in_set + rows, of_all + rows, in_lists + rows}; }
};

/// Adds numbers from `first` on of all slots of a row to totals, in the order of the slots, in double: kParts times
/// kCount of them. Pairs past the end of their tile have no sums (row B12: crowded pixel). False if there are none.
template <Index kCount, Index kParts, class S>
bool sum_slots(const SlotSums<S>& from, TileLists::Slots slots, std::uint64_t key, Index n, Index first,
               DoubleLanes<kCount>* totals) {
  DoubleLanes<kCount> sums[kParts];
  for (auto& sum : sums) sum = DoubleLanes<kCount>{};  // one by one: GCC 12 clears arrays by a slow instruction
  bool any = false;
  for (Index slot = slots.begin; slot < static_cast<Index>(slots.end); ++slot) {
    const DepthKeyed& end = from.ends[static_cast<std::size_t>(from.lists.tile_of(slot))];
    if (end.index < 0 || key > end.key || (key == end.key && n > end.index)) continue;
    any = true;
    const S* const of_slot = from.sums + slot * from.stride + first;
    for (Index part = 0; part < kParts; ++part)
      sums[part] = sums[part] + load_wide<kCount>(of_slot + part * kCount, 1, kCount);
  }
  for (Index part = 0; part < kParts; ++part) totals[part] = sums[part];
  return any;
}

/// The same of as many parts as the slots have from there on, kMostParts at most.
template <Index kCount, Index kMostParts, class S>
bool sum_slots_of(const SlotSums<S>& from, TileLists::Slots slots, std::uint64_t key, Index n, Index first,
                  DoubleLanes<kCount>* totals) {
  if constexpr (kMostParts > 1) {
    if (from.stride - first <= (kMostParts - 1) * kCount)
      return sum_slots_of<kCount, kMostParts - 1>(from, slots, key, n, first, totals);
  }
  return sum_slots<kCount, kMostParts>(from, slots, key, n, first, totals);
}

/// Moments as add_record_gradients takes them, from a slot's; returns Σ ∂/∂o.
template <class V, class S>
V record_moments(bool of_blocks, const SplatRecord<S>* records, Index count, V* moments) {
  V opacity{};
  for (Index i = 0; i < count; ++i) opacity[i] = static_cast<double>(records[i].opacity);
  if (of_blocks) {  // u and w are scaled
    constexpr double kInverse = 1 / kLog2Scale;
    for (int i = 1; i < 3; ++i) moments[i] = moments[i] * kInverse;
    for (int i = 3; i < 6; ++i) moments[i] = moments[i] * (kInverse * kInverse);
    return moments[0] / lane_max(opacity, kLeastOpacity);
  }
  const V d_opacity = moments[0];  // of g = v/o
  for (Index i = 0; i < kMoments; ++i) moments[i] = moments[i] * opacity;
  return d_opacity;
}

/// Adds the gradients of kCount rows at most.
///
/// @param records  of the first row, and so on
template <Index kCount, class S>
void add_gradients(const SlotSums<S>& from, const SplatArrays<S>& set, const RenderSettings& settings, RowNumbers row,
                   Index count, const SplatRecord<S>* records, const SplatGradients<S>& d) {
  const Index features = d.features ? d.features.shape.cols : 0, numbers = from.first_feature + features;
  using V = DoubleLanes<kCount>;
  LaneMask<V> rows{};
  for (Index first = 0; first < numbers; first += kSlotNumbers) {
    V totals[kCount][kSlotNumbers / kCount];
    const auto total = [&](Index i, Index k) { return totals[i][k / kCount][k % kCount]; };
    for (Index i = 0; i < count; ++i) {
      const std::uint64_t key = depth_key(set, settings, row.in_set + i);
      const TileLists::Slots slots = from.lists.slots[row.in_lists + i];
      rows[i] =
          sum_slots_of<kCount, kSlotNumbers / kCount>(from, slots, key, row.of_all + i, first, totals[i]) ? -1 : 0;
    }
    if (!any_lane(rows)) return;
    if (first == 0 && from.first_feature > 0 && d.of_shape()) {
      static_assert(kMoments <= kSlotNumbers);
      V moments[kMoments];
      for (Index k = 0; k < kMoments; ++k) {
        for (Index i = 0; i < kCount; ++i) moments[k][i] = total(std::min(i, count - 1), k);
      }
      const V d_opacity = record_moments(from.of_blocks, records, count, moments);
      add_record_gradients(set, settings, row.in_set, count, records, rows, d_opacity, moments, d);
    }
    for (Index i = 0; i < count; ++i) {
      if (!rows[i]) continue;
      for (Index j = std::max(first, from.first_feature); j < std::min(first + kSlotNumbers, numbers); ++j) {
        d.features.row(row.in_set + i)[j - from.first_feature] += static_cast<S>(total(i, j - first));
      }
    }
  }
}

/// Adds the gradients of some rows of one set, kCount at a time. Call it in with_best_lanes.
template <Index kCount, class S>
void reduce_slots(const SlotSums<S>& from, const SplatArrays<S>& set, const RenderSettings& settings, RowNumbers row,
                  Index count, const SplatRecord<S>* records, const SplatGradients<S>& d) {
  if (!d.features && !d.of_shape()) return;  // a set may be frozen
  for (Index i = 0; i < count; i += kCount) {
    add_gradients<kCount>(from, set, settings, row.after(i), std::min(kCount, count - i), records + i, d);
  }
}

}  // namespace hsi4d::detail
