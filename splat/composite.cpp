#include "splat/composite.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <ctime>
#include <limits>
#include <type_traits>
#include <utility>

#include "core/parallel.h"
#include "core/simd.h"
#include "splat/block_kernel.h"
#include "splat/composite_kernel.h"
#include "splat/splat_records.h"
#include "splat/workspaces.h"

namespace hsi4d {

namespace {

using detail::CompositeRules;
using detail::CompositeScene;
using detail::DepthKeyed;
using detail::Extent;
using detail::kMoments;
using detail::kSegment;
using detail::SplatRecord;
using detail::TileAdjoint;
using detail::TileEntry;
using detail::TileGrid;
using detail::TileJob;
using detail::TileLists;
using detail::Workspaces;

constexpr Index kGrain = 512;

/// Copies a row of a tile; nearly all are 16 pixels, and known lengths copy faster.
template <class S>
void copy_row(const S* from, Index n, S* to) {
  if (n == 16) {
    std::memcpy(to, from, 16 * sizeof(S));
  } else {
    std::copy_n(from, n, to);
  }
}

/// Writes the blocks that a job composited.
void store_blocks(Index side, const detail::BlockJob& job, const Array<float>& channels,
                  const Array<float>& transmittance) {
  constexpr Index kSide = detail::kBlockSide;
  const Index across = side / kSide, planes = channels.shape.planes;
  const auto store = [&](const float* from, Index x, Index y, Index plane, const Array<float>& image) {
    const Index width = std::min(kSide, job.width - x), height = std::min(kSide, job.height - y);
    for (Index r = 0; r < height; ++r) {
      float* const to = &image(plane, job.top + y + r, job.left + x);
      if (width == kSide) {
        std::memcpy(to, from + r * kSide, kSide * sizeof(float));
      } else {
        std::copy_n(from + r * kSide, width, to);
      }
    }
  };
  for (Index b = 0; b < across * across; ++b) {
    const Index x = b % across * kSide, y = b / across * kSide;
    if ((job.blocks >> b & 1u) == 0 || x >= job.width || y >= job.height) continue;
    const float* const state = job.state + b * (1 + planes) * detail::kBlockPixels;
    float t[detail::kBlockPixels];
    for (Index i = 0; i < detail::kBlockPixels; ++i) t[i] = std::abs(state[i]);
    store(t, x, y, 0, transmittance);
    for (Index k = 0; k < planes; ++k) store(state + (k + 1) * detail::kBlockPixels, x, y, k, channels);
  }
}

/// Of a tile: fragments, and the list position after the last Gaussian composited in any pixel.
struct TileCounts {
  Index fragments, end;
};

/// Seconds since it was made or last asked; on one thread those that the processor gave, so that other programs of the
/// machine do not count.
class Stopwatch {
 public:
  double lap() {
    const double now = seconds();
    return now - std::exchange(last_, now);
  }

 private:
  static double seconds() {
    timespec time{};
    clock_gettime(thread_count() == 1 ? CLOCK_THREAD_CPUTIME_ID : CLOCK_MONOTONIC, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  }
  double last_ = seconds();
};

template <class S>
struct Composite {
  static constexpr const char* kName = "composite";
  static constexpr bool kPersistentOutputs = true;  // tiles that stay empty are not written again
  SplatView view;
  std::shared_ptr<RenderCounters> counters;

  enum Input { kMeans, kFactors, kDepths, kRest, kMeansRest, kOpacities, kFeatures };
  enum Output { kChannels, kTransmittance };

  // In the order of the inputs.
  Buffer<SplatRecord<S>> records = {};
  Buffer<Extent> extents = {};
  Buffer<DepthKeyed> keys = {}, room = {};
  TileLists lists = {};
  // What the backward pass needs of every tile.
  Buffer<DepthKeyed> tile_last = {};    ///< the last Gaussian composited in any pixel; index −1: none
  Buffer<Index> checkpoint_begin = {};  ///< pieces of a tile's, or a block's, pixels
  Buffer<S> checkpoints = {};
  Buffer<detail::ListPosition<S>> last = {};  ///< plain kernel
  Buffer<Index> run_begin = {};               ///< block kernel
  Buffer<detail::BlockRun> runs = {};         ///< block kernel
  Buffer<TileCounts> tile_counts = {};
  Buffer<std::uint8_t> blank = {};  ///< of each tile: the outputs hold what an empty one has
  const S* written = nullptr;       ///< the output that `blank` tells of

  TileGrid grid() const {
    return detail::tile_grid(view.camera.width, view.camera.height, static_cast<Index>(view.settings.tile));
  }
  bool wants_shape(const NodeIo<S>& io) const {
    return io.wants(kMeans) || io.wants(kMeansRest) || io.wants(kFactors) || io.wants(kOpacities);
  }
  bool wants_gradient(const NodeIo<S>& io) const { return wants_shape(io) || io.wants(kFeatures); }

  // --- Gaussians -----------------------------------------------------------------------------------------------------

  static detail::SplatArrays<S> splats_of(const NodeIo<S>& io) {
    return {io.in(kMeans),     io.in(kFactors),   io.in(kDepths),  io.in(kRest),
            io.in(kMeansRest), io.in(kOpacities), io.in(kFeatures)};
  }

  /// Records and extents of what is drawn, and the tiles' lists.
  void prepare(const NodeIo<S>& io) {
    Stopwatch watch;
    const TileGrid tiles = grid();
    const detail::SplatArrays<S> splats = splats_of(io);
    const Index rows = splats.rows();
    records.resize(rows);
    extents.resize(rows);
    keys.resize(rows);
    room.resize(rows);
    parallel_for(rows, kGrain, [&](Index begin, Index end) {
      on_best_isa([&] {
        for (Index n = begin; n < end; ++n) {
          const bool drawn = detail::make_record(splats, view.settings, tiles, n, records[n], extents[n]);
          keys[n].index = drawn ? static_cast<std::int32_t>(n) : -1;
          if (drawn) keys[n].key = detail::depth_key(splats, view.settings, n);
        }
      });
    });
    Index drawn = 0;
    for (Index n = 0; n < rows; ++n) {
      if (keys[n].index >= 0) keys[drawn++] = keys[n];
    }
    counters->times.records_s = watch.lap();
    const auto count = static_cast<std::size_t>(drawn);
    const std::span<const DepthKeyed> order = detail::sort_by_depth(keys.span().first(count), room.span().first(count));
    counters->times.sort_s = watch.lap();
    const Index limit = detail::pair_memory_limit();
    const Index most = static_cast<Index>(static_cast<double>(limit) / bytes_of_pairs(io, 1));
    const Index pairs = lists.find(order, extents.span(), tiles, most);
    detail::check_pair_memory(pairs, bytes_of_pairs(io, pairs), limit);
    lists.fill(order, tiles);
    counters->times.bin_s = watch.lap();
  }

  /// Numbers in the slot of a pair.
  Index stride_of(const NodeIo<S>& io) const {
    if (in_blocks(io))
      return wants_gradient(io) ? detail::block_slot(io.wants(kFeatures) ? io.in(kFeatures).shape.cols : 0) : 0;
    return (wants_shape(io) ? kMoments : 0) + (io.wants(kFeatures) ? io.in(kFeatures).shape.cols : 0);
  }

  /// Memory for the pairs of a forward and a backward run: entries, checkpoints, slots.
  double bytes_of_pairs(const NodeIo<S>& io, Index pairs) const {
    const double pixels = static_cast<double>(view.settings.tile) * view.settings.tile, number = sizeof(S);
    const double checkpoint = wants_gradient(io) ? pixels * number / static_cast<double>(kSegment) : 0;
    const double slot = static_cast<double>(stride_of(io)) * number;
    constexpr std::size_t kListBytes = sizeof(TileEntry) + sizeof(detail::FoundPair) + sizeof(std::uint32_t);
    return static_cast<double>(pairs) * (static_cast<double>(kListBytes) + checkpoint + slot);
  }

  CompositeScene<S> scene_of(const NodeIo<S>& io) const {
    const ConstArray<S> features = io.in(kFeatures);
    return {records.span(),
            {features.data, nullptr},
            records.size(),
            features.shape.cols,
            detail::composite_rules<S>(view.settings)};
  }

  // --- tiles ---------------------------------------------------------------------------------------------------------

  /// True: the block kernel; else the plain one.
  static bool in_blocks(const NodeIo<S>& io) {
    return std::is_same_v<S, float> && io.in(kFeatures).shape.cols <= detail::kMostBlockChannels;
  }

  template <class Job>
  void place_job(const TileGrid& tiles, Index tile, Job& job) const {
    const Index begin = lists.tile_begin[tile], size = lists.tile_begin[tile + 1] - begin;
    job.entries = {lists.entries.data() + begin, static_cast<std::size_t>(size)};
    job.left = tile % tiles.cols * tiles.tile;
    job.top = tile / tiles.cols * tiles.tile;
    job.width = std::min(tiles.tile, tiles.width - job.left);
    job.height = std::min(tiles.tile, tiles.height - job.top);
  }

  /// The job of a tile, without `transmittance` and `channels`.
  TileJob<S> job_of(const TileGrid& tiles, Index tile) {
    const Index pixels = tiles.tile * tiles.tile;
    TileJob<S> job{};
    place_job(tiles, tile, job);
    job.last = last.data() + tile * pixels;
    job.checkpoints = checkpoints.size() > 0 ? checkpoints.data() + checkpoint_begin[tile] * pixels : nullptr;
    return job;
  }

  /// The same for the block kernel, without `workspace` too.
  detail::BlockJob block_job_of(const TileGrid& tiles, Index tile) requires(std::is_same_v<S, float>) {
    detail::BlockJob job{};
    place_job(tiles, tile, job);
    if (runs.size() == 0) return job;
    job.runs = runs.data() + run_begin[tile];
    job.checkpoints = checkpoints.data() + checkpoint_begin[tile] * detail::kBlockPixels;
    return job;
  }

  /// Room for what the forward pass keeps for the backward pass.
  void place_kept(const NodeIo<S>& io, const TileGrid& tiles) {
    const bool blocks = in_blocks(io), wanted = wants_gradient(io);
    const Index side = tiles.tile, across = side / detail::kBlockSide;
    checkpoint_begin.resize(tiles.count() + 1);
    run_begin.resize(tiles.count() + 1);
    Index place = 0, run = 0;
    for (Index tile = 0; tile < tiles.count(); ++tile) {
      checkpoint_begin[tile] = place;
      run_begin[tile] = run;
      const Index size = lists.tile_begin[tile + 1] - lists.tile_begin[tile];
      if (!wanted || size == 0) continue;
      place += blocks ? detail::checkpoints_of(side, size, lists.tile_groups[tile]) : (size - 1) / kSegment;
      run += detail::block_chunks(size) * across * across;
    }
    checkpoint_begin[tiles.count()] = place;
    run_begin[tiles.count()] = run;
    checkpoints.resize(place * (blocks ? detail::kBlockPixels : side * side));
    runs.resize(blocks ? run : 0);
    last.resize(blocks ? 0 : tiles.count() * side * side);
  }

  /// Composites a tile into the image; `memory` is its pixels and workspace.
  TileCounts composite_tile(const NodeIo<S>& io, const TileGrid& tiles, Index tile, S* memory) {
    const CompositeScene<S> scene = scene_of(io);
    const Array<S> image = io.out(kChannels), transmittance = io.out(kTransmittance);
    if constexpr (std::is_same_v<S, float>) {
      if (in_blocks(io)) {
        detail::BlockJob job = block_job_of(tiles, tile);
        job.blocks = detail::all_blocks(tiles.tile);
        job.state = memory;
        job.workspace = memory + detail::block_state(tiles.tile, scene.channels);
        detail::begin_blocks(tiles.tile, job.width, job.height, scene.channels, job.state);
        const detail::BlockCounts counts = detail::composite_blocks(tiles.tile, scene, job);
        store_blocks(tiles.tile, job, image, transmittance);
        return {counts.fragments, counts.end};
      }
    }
    const Index pixels = tiles.tile * tiles.tile;
    TileJob<S> job = job_of(tiles, tile);
    job.transmittance = memory;
    job.channels = memory + pixels;
    const Index fragments = detail::composite_tile(tiles.tile, scene, job);
    for (Index r = 0; r < job.height; ++r) {
      copy_row(job.transmittance + r * tiles.tile, job.width, &transmittance(job.top + r, job.left));
      for (Index k = 0; k < scene.channels; ++k) {
        copy_row(job.channels + k * pixels + r * tiles.tile, job.width, &image(k, job.top + r, job.left));
      }
    }
    return {fragments, static_cast<Index>(*std::max_element(job.last, job.last + pixels))};
  }

  Index forward_memory(const NodeIo<S>& io, Index side) const {
    const Index channels = io.in(kFeatures).shape.cols;
    return detail::block_state(side, channels) + (in_blocks(io) ? detail::block_workspace(channels) : 0);
  }

  void forward(NodeIo<S>& io) {
    prepare(io);
    Stopwatch watch;
    const TileGrid tiles = grid();
    const detail::SplatArrays<S> splats = splats_of(io);
    place_kept(io, tiles);
    tile_counts.resize(tiles.count());
    tile_last.resize(tiles.count());
    Workspaces workspaces(tiles.count());
    const Index size = forward_memory(io, tiles.tile);
    const std::span<S> memory = io.scratch(size * workspaces.count());
    const Array<S> image = io.out(kChannels);
    if (written != image.data || blank.size() != tiles.count()) {
      blank.resize(tiles.count());
      std::fill_n(blank.data(), tiles.count(), std::uint8_t(0));
      written = image.data;
    }
    run_chunks(tiles.count(), [&](Index tile) {
      const bool empty = lists.tile_begin[tile] == lists.tile_begin[tile + 1];
      tile_counts[tile] = {0, 0};
      tile_last[tile] = {0, -1};
      if (empty && blank[tile] != 0) return;
      blank[tile] = empty ? 1 : 0;
      const Workspaces::Held held(workspaces);
      tile_counts[tile] = composite_tile(io, tiles, tile, memory.data() + held.number() * size);
      const Index end = tile_counts[tile].end;
      tile_last[tile] = {0, end > 0 ? lists.entries[lists.tile_begin[tile] + end - 1].index : -1};
      if (end > 0) tile_last[tile].key = detail::depth_key(splats, view.settings, tile_last[tile].index);
    });
    counters->times.forward_s = watch.lap();
    count(tiles);
  }

  void count(const TileGrid& tiles) {
    const RenderTimes times = counters->times;
    *counters = {};
    counters->times = times;
    counters->pairs = lists.pairs();
    for (const TileLists::Slots& s : lists.slots.span()) counters->visible += s.end > s.begin ? 1 : 0;
    for (Index tile = 0; tile < tiles.count(); ++tile) {
      counters->tiles += lists.tile_begin[tile + 1] > lists.tile_begin[tile] ? 1 : 0;
      counters->groups += lists.tile_groups[tile];
      counters->fragments += tile_counts[tile].fragments;
      counters->reached += tile_counts[tile].end;
    }
  }

  // --- backward ------------------------------------------------------------------------------------------------------

  /// Sums of a tile's pairs; `d_channels` is [1 + C][W][W], channels first, and `workspace` follows it.
  void tile_adjoint(const NodeIo<S>& io, const TileGrid& tiles, Index tile, const TileAdjoint<S>& shared,
                    S* d_channels) {
    const Index pixels = tiles.tile * tiles.tile;
    const CompositeScene<S> scene = scene_of(io);
    S* const d_transmittance = d_channels + scene.channels * pixels;
    if constexpr (std::is_same_v<S, float>) {
      if (in_blocks(io)) {
        detail::BlockJob job = block_job_of(tiles, tile);
        job.workspace = d_transmittance + pixels;
        detail::composite_blocks_adjoint(
            tiles.tile, scene, job,
            {d_channels, d_transmittance, shared.sums, shared.stride, shared.wants_shape, shared.wants_features});
        return;
      }
    }
    TileAdjoint<S> adjoint = shared;
    adjoint.d_channels = d_channels;
    adjoint.behind = d_transmittance;
    adjoint.segment = d_transmittance + pixels;
    adjoint.feature_sums = adjoint.segment + 2 * kSegment * pixels;
    detail::composite_tile_adjoint(tiles.tile, scene, job_of(tiles, tile), adjoint);
  }

  Index backward_memory(const NodeIo<S>& io, const TileGrid& tiles) const {
    const Index pixels = tiles.tile * tiles.tile, channels = io.in(kFeatures).shape.cols;
    const Index work =
        in_blocks(io) ? detail::block_workspace(channels) : 2 * kSegment * pixels + channels * tiles.tile;
    return (channels + 1) * pixels + work;
  }

  void backward(NodeIo<S>& io) {
    if (!wants_gradient(io)) return;
    Stopwatch watch;
    const TileGrid tiles = grid();
    const Index pixels = tiles.tile * tiles.tile, channels = io.in(kFeatures).shape.cols;
    TileAdjoint<S> shared{};
    shared.wants_shape = wants_shape(io);
    shared.wants_features = io.wants(kFeatures);
    shared.stride = stride_of(io);
    shared.sums = io.scratch(shared.stride * lists.pairs()).data();
    const ConstArray<S> d_image = io.d_out(kChannels), d_transmittance = io.d_out(kTransmittance);
    Workspaces workspaces(tiles.count());
    const Index size = backward_memory(io, tiles);
    const std::span<S> memory = io.scratch(size * workspaces.count());
    run_chunks(tiles.count(), [&](Index tile) {
      if (tile_counts[tile].end == 0) return;
      const Workspaces::Held held(workspaces);
      S* const d_channels = memory.data() + held.number() * size;
      TileJob<S> place{};
      place_job(tiles, tile, place);
      std::fill_n(d_channels, (channels + 1) * pixels, S(0));
      for (Index r = 0; r < place.height; ++r) {
        for (Index k = 0; d_image && k < channels; ++k) {
          copy_row(&d_image(k, place.top + r, place.left), place.width, d_channels + k * pixels + r * tiles.tile);
        }
        if (d_transmittance) {
          copy_row(&d_transmittance(place.top + r, place.left), place.width,
                   d_channels + channels * pixels + r * tiles.tile);
        }
      }
      tile_adjoint(io, tiles, tile, shared, d_channels);
    });
    counters->times.backward_s = watch.lap();
    parallel_for(records.size(), kGrain, [&](Index begin, Index end) {
      on_best_isa([&] {
        for (Index n = begin; n < end; ++n) gather_gaussian(io, shared, n);
      });
    });
    counters->times.reduce_s = watch.lap();
  }

  /// True if the Gaussian does not come after the last one of a tile that is composited.
  bool reached(Index tile, std::uint64_t key, Index n) const {
    const DepthKeyed& end = tile_last[tile];
    return end.index >= 0 && (key < end.key || (key == end.key && n <= end.index));
  }

  /// Sums the pairs of a Gaussian in the order of its slots, in double, and adds what they mean to the inputs'
  /// gradients. Pairs past the end of their tile have no adjoint, and their slots were not written (row B12).
  void gather_gaussian(NodeIo<S>& io, const TileAdjoint<S>& adjoint, Index n) const {
    constexpr Index kTogether = 16;  // numbers of a slot; with up to ten features it is read once
    static_assert(kMoments <= kTogether);
    const TileLists::Slots slots = lists.slots[n];
    if (slots.begin == slots.end) return;
    const detail::SplatArrays<S> splats = splats_of(io);
    const std::uint64_t key = detail::depth_key(splats, view.settings, n);
    const Index first_feature = adjoint.wants_shape || in_blocks(io) ? kMoments : 0;
    const Index features = adjoint.wants_features ? io.in(kFeatures).shape.cols : 0;
    for (Index k = 0; k < adjoint.stride; k += kTogether) {
      const Index count = std::min(kTogether, adjoint.stride - k);
      double totals[kTogether] = {};
      bool any = false;
      for (Index slot = slots.begin; slot < static_cast<Index>(slots.end); ++slot) {
        if (!reached(lists.tile_of[slot], key, n)) continue;
        any = true;
        const S* const sums = adjoint.sums + slot * adjoint.stride + k;
        for (Index i = 0; i < count; ++i) totals[i] += static_cast<double>(sums[i]);
      }
      if (!any) return;
      if (adjoint.wants_shape && k == 0) {
        if (in_blocks(io)) scale_block_moments(records[n], totals);
        detail::add_record_gradient(splats, view.settings, n, records[n], totals, gradient_of(io, n));
      }
      for (Index i = std::max<Index>(first_feature - k, 0); i < std::min(count, first_feature + features - k); ++i) {
        io.d_in(kFeatures).row(n)[k + i - first_feature] += static_cast<S>(totals[i]);
      }
    }
  }

  /// From sums of ∂/∂ log α with scaled u and w to those of kMoments.
  static void scale_block_moments(const SplatRecord<S>& record, double* moments) {
    const double o = std::max(static_cast<double>(record.opacity), kLeastOpacity);
    const double first = 1 / (o * detail::kLog2Scale), second = first / detail::kLog2Scale;
    moments[0] /= o;
    for (int i = 1; i < 3; ++i) moments[i] *= first;
    for (int i = 3; i < 6; ++i) moments[i] *= second;
  }

  static detail::SplatGradient<S> gradient_of(const NodeIo<S>& io, Index n) {
    const auto row = [&](int input) { return io.wants(input) ? io.d_in(input).row(n) : nullptr; };
    return {row(kMeans), row(kMeansRest), row(kFactors), row(kOpacities)};
  }

  // --- the rest ------------------------------------------------------------------------------------------------------

  /// α of a Gaussian at a pixel of a tile, by the kernel in use.
  detail::PixelAlpha<S> pixel_alpha(const NodeIo<S>& io, const TileJob<S>& place, const SplatRecord<S>& record, Index r,
                                    Index c) const {
    const CompositeRules<S> rules = detail::composite_rules<S>(view.settings);
    if constexpr (std::is_same_v<S, float>) {
      if (in_blocks(io))
        return detail::block_pixel_alpha(view.settings.tile, record, rules, place.left, place.top, r, c);
    }
    return detail::pixel_alpha(record, rules, place, r, c);
  }

  /// T behind a Gaussian, by the kernel in use.
  static S behind(const NodeIo<S>& io, S transmittance, S alpha) {
    if constexpr (std::is_same_v<S, float>) {
      if (in_blocks(io)) return detail::block_transmittance(transmittance, alpha);
    }
    return transmittance * (1 - alpha);
  }

  /// Order, lists, and for each (pixel, Gaussian) pair whether it is composited, stops with it, or is held by the cap.
  void add_signature(Signature& signature, NodeIo<S>& io) {
    const TileGrid tiles = grid();
    const CompositeRules<S> rules = detail::composite_rules<S>(view.settings);
    for (Index tile = 0; tile < tiles.count(); ++tile) {
      TileJob<S> place{};
      place_job(tiles, tile, place);
      signature.add(place.entries.size());
      for (const TileEntry& entry : place.entries) signature.add(static_cast<std::uint64_t>(entry.index));
      for (Index p = 0; p < place.width * place.height; ++p) {
        const Index r = p / place.width, c = p % place.width;
        S t = 1;
        for (std::size_t at = 0; at < place.entries.size() && t >= rules.stop_below; ++at) {
          const SplatRecord<S>& record = records[place.entries[at].index];
          if (place.top + r < record.row_begin || place.top + r >= record.row_end) continue;
          const auto pixel = pixel_alpha(io, place, record, r, c);
          if (!pixel.drawn) continue;
          const S next = behind(io, t, pixel.alpha);
          if (rules.exclusive && next < rules.stop_below) break;
          t = next;
          signature.add(at * 2 + (pixel.capped ? 1 : 0));
        }
      }
    }
  }

  Index saved_bytes() const {
    return records.capacity_bytes() + extents.capacity_bytes() + keys.capacity_bytes() + room.capacity_bytes() +
           lists.capacity_bytes() + tile_last.capacity_bytes() + checkpoint_begin.capacity_bytes() +
           checkpoints.capacity_bytes() + last.capacity_bytes() + run_begin.capacity_bytes() + runs.capacity_bytes() +
           tile_counts.capacity_bytes();
  }
};

}  // namespace

template <class S>
Composited<S> composite(const Projected<S>& projected, Var<S> opacities, Var<S> features, const SplatView& view,
                        Source where) {
  check_camera(view.camera);
  const Index rows = opacities.shape().rows, channels = features.shape().cols;
  HSI4D_CHECK(rows <= std::numeric_limits<std::int32_t>::max(), std::to_string(rows) + " Gaussians");
  HSI4D_CHECK(channels >= 1, "no features");
  HSI4D_CHECK_EQ(projected.means_px.shape(), shape_of(rows, 2));
  HSI4D_CHECK_EQ(projected.factors.shape(), shape_of(rows, 6));
  HSI4D_CHECK_EQ(projected.depths.shape(), shape_of(rows, 1));
  HSI4D_CHECK_EQ(projected.depth_rest.shape(), shape_of(rows, 1));
  HSI4D_CHECK_EQ(projected.means_rest.shape(), shape_of(rows, 2));
  HSI4D_CHECK_EQ(opacities.shape(), shape_of(rows, 1));
  HSI4D_CHECK_EQ(features.shape(), shape_of(rows, channels));
  const int tile = view.settings.tile;
  HSI4D_CHECK(tile == 8 || tile == 16, "tile = " + std::to_string(tile) + "; allowed: 8, 16");
  const std::array inputs = {projected.means_px,   projected.factors, projected.depths, projected.depth_rest,
                             projected.means_rest, opacities,         features};
  const Index width = view.camera.width, height = view.camera.height;
  const std::array outputs = {image_shape<S>(channels, height, width), image_shape<S>(1, height, width)};
  auto counters = std::make_shared<RenderCounters>();
  Tape<S>& tape = opacities.owner();
  const Var<S> first = tape.record(Composite<S>{view, counters}, std::span<const Var<S>>(inputs),
                                   std::span<const Shape>(outputs), where);
  return {first, tape.output(first, 1), counters};
}

template Composited<float> composite(const Projected<float>&, Var<float>, Var<float>, const SplatView&, Source);
template Composited<double> composite(const Projected<double>&, Var<double>, Var<double>, const SplatView&, Source);

}  // namespace hsi4d
