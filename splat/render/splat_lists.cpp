#include "splat/render/splat_lists.h"

#include <algorithm>
#include <atomic>

#include "core/parallel.h"
#include "core/simd.h"
#include "core/stopwatch.h"

namespace hsi4d::detail {

namespace {

/// make_records of rows of both sets.
template <Index kCount, class S>
void make_records(const SplatRows<S>& rows, Index begin, Index end, const RenderSettings& settings,
                  const TileGrid& tiles, SplatRecord<S>* records, Extent* extents) {
  const Index middle = std::clamp(rows.second, begin, end);
  make_records<kCount>(rows.still, settings, tiles, begin, middle, records, extents);
  make_records<kCount>(rows.moving, settings, tiles, middle - rows.second, end - rows.second,
                       records + (middle - begin), extents + (middle - begin));
}

}  // namespace

template <class S>
void list_splats(const SplatRows<S>& rows, Index first, Index count, const RenderSettings& settings,
                 const TileGrid& tiles, std::span<SplatRecord<S>> records, double bytes_per_pair, SplatLists& result,
                 RenderTimes& times) {
  constexpr Index kGrain = 512;
  Stopwatch watch;
  result.first = first;
  result.count = count;
  result.extents.resize(count);
  result.keys.resize(count);
  result.room.resize(count);
  DepthKeyed* const keys = result.keys.data();
  std::atomic<Index> bound = 0;  // of pairs
  parallel_for(count, kGrain, [&](Index begin, Index end) {
    with_best_lanes([&](auto lanes) {
      make_records<lanes()>(rows, first + begin, first + end, settings, tiles,
                            &records[static_cast<std::size_t>(first + begin)], &result.extents[begin]);
      Index around = 0;
      for (Index i = begin; i < end; ++i) {
        around += tiles_around(result.extents[i], tiles);
        const bool drawn = result.extents[i].row_begin < result.extents[i].row_end;
        keys[i].index = drawn ? static_cast<std::int32_t>(i) : -1;
        if (drawn) keys[i].key = rows.key(settings, first + i);
      }
      bound += around;
    });
  });
  std::size_t drawn = 0;
  for (Index i = 0; i < count; ++i) {
    if (keys[i].index >= 0) keys[drawn++] = keys[i];
  }
  times.records_s = watch.lap();
  const std::span<const DepthKeyed> order =
      sort_by_depth(result.keys.span().first(drawn), result.room.span().first(drawn));
  times.sort_s = watch.lap();
  const Index limit = pair_memory_limit();
  const Index most = static_cast<Index>(static_cast<double>(limit) / bytes_per_pair);
  const Index pairs = result.lists.find(result.extents.span(), tiles, most, bound);
  check_pair_memory(pairs, bytes_per_pair * static_cast<double>(pairs), limit);
  const std::span<const TileLists::Slots> slots = result.lists.slots.span();
  result.visible = std::count_if(slots.begin(), slots.end(), [](const auto& of) { return of.end > of.begin; });
  result.lists.deal(order, tiles, static_cast<std::int32_t>(first));
  times.bin_s = watch.lap();
}

template void list_splats(const SplatRows<float>&, Index, Index, const RenderSettings&, const TileGrid&,
                          std::span<SplatRecord<float>>, double, SplatLists&, RenderTimes&);
template void list_splats(const SplatRows<double>&, Index, Index, const RenderSettings&, const TileGrid&,
                          std::span<SplatRecord<double>>, double, SplatLists&, RenderTimes&);

}  // namespace hsi4d::detail
