#include "splat/render/composite.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <type_traits>
#include <utility>
#include <vector>

#include "autodiff/curvature_weights.h"
#include "core/parallel.h"
#include "core/simd.h"
#include "core/stopwatch.h"
#include "core/workspaces.h"
#include "splat/render/block_kernel.h"
#include "splat/render/composite_curvature.h"
#include "splat/render/composite_io.h"
#include "splat/render/composite_kernel.h"
#include "splat/render/pixel_step.h"
#include "splat/render/slot_sums.h"
#include "splat/render/tile_checkpoints.h"
#include "splat/render/tile_image.h"
#include "splat/render/tile_plans.h"

namespace hsi4d {

namespace {

using detail::background_input;
using detail::channels_of;
using detail::CompositeRules;
using detail::CompositeScene;
using detail::cotangents_of;
using detail::DepthKeyed;
using detail::gradients_of;
using detail::has_background;
using detail::has_still;
using detail::images_of;
using detail::kMoments;
using detail::kSegment;
using detail::rows_of;
using detail::SplatRecord;
using detail::still_rows;
using detail::TileAdjoint;
using detail::TileEntry;
using detail::TileGrid;
using detail::TileJob;
using detail::wants_features;
using detail::wants_gradient;
using detail::wants_shape;
using detail::Workspaces;
using enum detail::CompositeInput;
using enum detail::CompositeOutput;

constexpr Index kGrain = 512;
constexpr Index kUntouched = -1;  // fragments of a tile whose outputs stayed as they were

/// Of a tile: fragments, and the list position after the last Gaussian composited in any pixel.
struct TileCounts {
  Index fragments, end;
};

template <class S>
struct Composite {
  static constexpr const char* kName = "composite";
  static constexpr bool kAssigns = true;
  static constexpr bool kPersistentOutputs = true;  // blocks that nothing touches which moves are not written again
  SplatView view;
  std::shared_ptr<RenderCounters> counters;

  Buffer<SplatRecord<S>> records = {};  ///< of all rows, those that stand still first
  detail::TilePlans planned = {};
  // What the backward pass needs of every tile.
  Buffer<DepthKeyed> tile_last = {};     ///< the last Gaussian composited in any pixel; index −1: none
  Buffer<DepthKeyed> adjoint_last = {};  ///< the same, of tiles with an adjoint; of the last backward run
  detail::TileCheckpoints<S> kept = {};
  Buffer<TileCounts> tile_counts = {};
  Buffer<std::uint32_t> clean = {};  ///< of each tile: blocks whose outputs hold what stands still, and nothing else
  const S* written = nullptr;        ///< the output that `clean` tells of
  std::uint64_t written_over = 0;    ///< version of the background that it lies over
  TileMask changed = {}, read = {};  ///< see NodeIo::set_dirty_tiles
  double still_s = 0;                ///< seconds of the state built for the next forward run

  TileGrid grid() const {
    return detail::tile_grid(view.camera.width, view.camera.height, static_cast<Index>(view.settings.tile));
  }

  // --- Gaussians -----------------------------------------------------------------------------------------------------

  /// True: those that stand still are listed by themselves, and kept.
  bool keeps_still(const NodeIo<S>& io) const {
    if (!has_still(io) || !view.skip.static_tiles) return false;
    for (int i = kStill; i < 2 * kStill; ++i) {
      if (io.wants(i)) return false;
    }
    return true;
  }
  /// The state is what is made of Gaussians that stand still.
  std::uint64_t state_key(NodeIo<S>& io) const {
    if (!keeps_still(io)) return 0;
    Signature key;
    for (int i = kStill; i < 2 * kStill; ++i) key.add(io.version(i));
    return key.value();
  }
  void build_state(NodeIo<S>& io) {
    const TileGrid tiles = grid();
    Stopwatch watch;
    records.resize(rows_of(io).count());
    clean.resize(tiles.count());
    std::fill_n(clean.data(), tiles.count(), 0u);
    planned.reset(tiles.count());
    RenderTimes times;
    if (keeps_still(io)) list(io, 0, still_rows(io), planned.still, times);
    still_s = watch.lap();
  }

  void list(const NodeIo<S>& io, Index first, Index count, detail::SplatLists& lists, RenderTimes& times) {
    detail::list_splats(rows_of(io), first, count, view.settings, grid(), records.span(), bytes_per_pair(io), lists,
                        times);
  }

  /// Numbers in the slot of a pair.
  static Index stride_of(const NodeIo<S>& io) {
    const Index features = wants_features(io) ? io.in(kFeatures).shape.cols : 0;
    if (in_blocks(io)) return wants_gradient(io) ? detail::block_slot(features) : 0;
    return (wants_shape(io) ? kMoments : 0) + features;
  }

  /// Memory for a pair of a forward and a backward run: entries, checkpoints, slots.
  double bytes_per_pair(const NodeIo<S>& io) const {
    const double pixels = static_cast<double>(view.settings.tile) * view.settings.tile, number = sizeof(S);
    const double checkpoint = wants_gradient(io) ? pixels * number / static_cast<double>(kSegment) : 0;
    const double slot = static_cast<double>(stride_of(io)) * number;
    constexpr std::size_t kListBytes = sizeof(TileEntry) + 2 * sizeof(detail::FoundPair);
    return static_cast<double>(kListBytes) + checkpoint + slot;
  }

  CompositeScene<S> scene_of(const NodeIo<S>& io) const {
    const detail::SplatRows<S> rows = rows_of(io);
    return {records.span(),
            {rows.still.features.data, rows.moving.features.data},
            rows.second,
            rows.moving.features.shape.cols,
            detail::composite_rules<S>(view.settings)};
  }

  // --- tiles ---------------------------------------------------------------------------------------------------------

  detail::PlanRules plan_rules(const NodeIo<S>& io) const {
    return {in_blocks(io), in_blocks(io) && view.skip.static_layer};
  }
  /// True: the block kernel; else the plain one.
  static bool in_blocks(const NodeIo<S>& io) { return detail::composites_in_blocks<S>(channels_of(io)); }

  template <class Job>
  static void place_job(const TileGrid& tiles, Index tile, Job& job) {
    job.left = tile % tiles.cols * tiles.tile;
    job.top = tile / tiles.cols * tiles.tile;
    job.width = std::min(tiles.tile, tiles.width - job.left);
    job.height = std::min(tiles.tile, tiles.height - job.top);
  }

  /// The job of a tile, without `transmittance` and `channels`.
  TileJob<S> job_of(const TileGrid& tiles, Index tile) {
    TileJob<S> job{};
    place_job(tiles, tile, job);
    job.entries = planned.plans[tile].entries;
    kept.give(tiles, tile, job);
    return job;
  }

  /// The same for the block kernel, without `state` and `workspace`.
  detail::BlockJob block_job_of(const TileGrid& tiles, Index tile) requires(std::is_same_v<S, float>) {
    detail::BlockJob job{};
    place_job(tiles, tile, job);
    job.entries = planned.plans[tile].entries;
    job.blocks = planned.plans[tile].blocks;
    const detail::TileLayer& layer = planned.layer(tile);
    job.start = layer.made && layer.first > 0 ? layer.front.data() : nullptr;
    kept.give(tile, job);
    return job;
  }

  /// Memory of a worker: pixels of a tile twice, workspace.
  static Index forward_memory(const NodeIo<S>& io, Index side) {
    const Index channels = io.in(kFeatures).shape.cols;
    return 2 * detail::block_state(side, channels) + (in_blocks(io) ? detail::block_workspace(channels) : 0);
  }

  /// Blocks that show what moved there before, or nothing yet, and have to show what stands still.
  std::uint32_t dirty_blocks(const TileGrid& tiles, Index tile) const {
    return detail::all_blocks(tiles.tile) & ~planned.plans[tile].blocks & ~clean[tile];
  }

  /// Whether somebody reads the outputs of a tile.
  static bool is_needed(const NodeIo<S>& io, const TileGrid& tiles, Index tile) {
    const Index across = kMaskSquare / tiles.tile;  // tiles in a square
    return io.needed() == nullptr || io.needed()->has(tile / tiles.cols / across, tile % tiles.cols / across);
  }

  /// Brings the outputs of a tile up to date.
  TileCounts composite_tile(const NodeIo<S>& io, const TileGrid& tiles, Index tile, S* memory) {
    const std::uint32_t all = detail::all_blocks(tiles.tile);
    const detail::TilePlan& plan = planned.plans[tile];
    if constexpr (std::is_same_v<S, float>) {
      if (in_blocks(io)) {
        TileCounts counts{0, 0};
        const std::uint32_t left = dirty_blocks(tiles, tile);
        if (left != 0) counts.fragments += composite_still(io, tiles, tile, left, memory);
        if (plan.blocks != 0) {
          const TileCounts moved = composite_moving(io, tiles, tile, memory);
          counts = {counts.fragments + moved.fragments, moved.end};
        }
        clean[tile] = all & ~plan.blocks;
        return counts;
      }
    }
    clean[tile] = plan.entries.empty() ? all : 0;
    return composite_plain(io, tiles, tile, memory);
  }

  /// Composites what stands still, in some blocks.
  Index composite_still(const NodeIo<S>& io, const TileGrid& tiles, Index tile, std::uint32_t blocks,
                        float* memory) requires(std::is_same_v<S, float>) {
    const CompositeScene<float> scene = scene_of(io);
    detail::BlockJob job{};
    place_job(tiles, tile, job);
    job.entries = planned.still.of_tile(tile);
    job.blocks = blocks;
    job.state = memory;
    job.workspace = memory + 2 * detail::block_state(tiles.tile, scene.channels);
    detail::begin_blocks(tiles.tile, job.width, job.height, scene.channels, job.state);
    const Index fragments = detail::composite_blocks(tiles.tile, scene, job).fragments;
    detail::store_blocks(tiles.tile, job, images_of(io));
    return fragments;
  }

  /// Composites what moves, over what stands still in front of it, and what stands still behind.
  TileCounts composite_moving(const NodeIo<S>& io, const TileGrid& tiles, Index tile,
                              float* memory) requires(std::is_same_v<S, float>) {
    const CompositeScene<float> scene = scene_of(io);
    const Index numbers = detail::block_state(tiles.tile, scene.channels);
    const detail::TilePlan& plan = planned.plans[tile];
    detail::TileLayer& layer = planned.layer(tile);
    const std::span<const TileEntry> still = planned.still.of_tile(tile);
    const bool layered = plan_rules(io).in_layers && !still.empty();
    detail::BlockJob job = block_job_of(tiles, tile);
    job.state = memory;
    job.workspace = memory + 2 * numbers;
    Index fragments = 0;
    if (layered && !layer.made) {
      fragments += detail::make_layer(tiles.tile, scene, job, still, layer);
      job.start = layer.first > 0 ? layer.front.data() : nullptr;
    }
    if (job.start != nullptr) {
      std::copy_n(job.start, numbers, job.state);
    } else {
      detail::begin_blocks(tiles.tile, job.width, job.height, scene.channels, job.state);
    }
    fetch_blocks(job, images_of(io));
    const detail::BlockCounts counts = detail::composite_blocks(tiles.tile, scene, job);
    fragments += counts.fragments;
    if (!plan.behind.empty()) {
      fragments += detail::composite_behind(tiles.tile, scene, job, plan.behind, memory + numbers, layer);
    }
    detail::store_blocks(tiles.tile, job, images_of(io));
    return {fragments, counts.end};
  }

  TileCounts composite_plain(const NodeIo<S>& io, const TileGrid& tiles, Index tile, S* memory) {
    const CompositeScene<S> scene = scene_of(io);
    const Index pixels = tiles.tile * tiles.tile;
    TileJob<S> job = job_of(tiles, tile);
    const bool moves = !job.entries.empty();
    if (!moves) {
      job.entries = planned.still.of_tile(tile);
      job.checkpoints = nullptr;
    }
    job.transmittance = memory;
    job.channels = memory + pixels;
    const Index fragments = detail::composite_tile(tiles.tile, scene, job);
    detail::store_tile(tiles.tile, job, images_of(io));
    return {fragments, moves ? static_cast<Index>(*std::max_element(job.last, job.last + pixels)) : 0};
  }

  void forward(NodeIo<S>& io) {
    const TileGrid tiles = grid();
    const Index second = keeps_still(io) ? still_rows(io) : 0, rows = rows_of(io).count();
    list(io, second, rows - second, planned.moving, counters->times);
    Stopwatch watch;
    planned.plan(rows_of(io), view.settings, tiles, plan_rules(io));
    kept.place(planned, tiles, in_blocks(io), wants_gradient(io));
    tile_counts.resize(tiles.count());
    tile_last.resize(tiles.count());
    const std::uint64_t over = has_background(io) ? io.version(background_input(io)) : 0;
    if (written != io.out(kChannels).data || written_over != over) {
      std::fill_n(clean.data(), tiles.count(), 0u);
      written = io.out(kChannels).data;
      written_over = over;
    }
    *counters = counters_before(io, tiles);
    counters->gaussians = rows;
    counters->times.still_s = std::exchange(still_s, 0.0);
    Workspaces workspaces(tiles.count());
    const Index size = forward_memory(io, tiles.tile);
    const std::span<S> memory = io.scratch(size * workspaces.count());
    run_chunks(tiles.count(), [&](Index tile) {
      tile_counts[tile] = {kUntouched, 0};
      tile_last[tile] = {0, -1};
      if (!is_needed(io, tiles, tile)) return;
      if (planned.plans[tile].entries.empty() && clean[tile] == detail::all_blocks(tiles.tile)) return;
      const Workspaces::Held held(workspaces);
      planned.merge(rows_of(io), view.settings, plan_rules(io), tile);
      tile_counts[tile] = composite_tile(io, tiles, tile, memory.data() + held.number() * size);
      const Index end = tile_counts[tile].end;
      if (end == 0) return;
      const std::int32_t index = planned.plans[tile].entries[static_cast<std::size_t>(end - 1)].index;
      tile_last[tile] = {rows_of(io).key(view.settings, index), index};
    });
    set_dirty_tiles(io, tiles);
    counters->times.forward_s = watch.lap();
    for (const TileCounts& counts : tile_counts.span()) {
      counters->fragments += std::max(counts.fragments, Index(0));
      counters->reached += counts.end;
    }
  }

  /// Losses need to look again only where a tile was written, and to differentiate only where the backward run reads.
  void set_dirty_tiles(const NodeIo<S>& io, const TileGrid& tiles) {
    const Index across = kMaskSquare / tiles.tile;  // tiles in a square
    changed.clear(tiles.height, tiles.width);
    read.clear(tiles.height, tiles.width);
    for (Index tile = 0; tile < tiles.count(); ++tile) {
      const Index row = tile / tiles.cols / across, col = tile % tiles.cols / across;
      if (tile_counts[tile].fragments != kUntouched) changed.add(row, col);
      if (tile_counts[tile].end > 0) read.add(row, col);
    }
    const bool is_read_everywhere = has_background(io) && io.wants(background_input(io));
    if (!view.skip.unchanged_pixels) return;
    const int outputs = images_of(io).rest ? 3 : 2;
    for (int output = 0; output < outputs; ++output)
      io.set_dirty_tiles(output, &changed, is_read_everywhere ? nullptr : &read);
    counters->dirty_tiles = changed.count();
  }

  /// What is known before the tiles are composited.
  RenderCounters counters_before(const NodeIo<S>& io, const TileGrid& tiles) const {
    const bool layered = plan_rules(io).in_layers;
    RenderCounters result;
    result.times = counters->times;
    result.channels = counters->channels;
    result.kept_bytes = kept.bytes();
    result.visible = planned.still.visible + planned.moving.visible;
    for (Index tile = 0; tile < tiles.count(); ++tile) {
      if (!is_needed(io, tiles, tile)) continue;
      const detail::TilePlan& plan = planned.plans[tile];
      const auto still = static_cast<Index>(planned.still.of_tile(tile).size());
      const bool moves = !plan.entries.empty(), restored = still > 0 && dirty_blocks(tiles, tile) != 0;
      result.tiles += moves || restored ? 1 : 0;
      result.groups += plan.groups;
      result.pairs += static_cast<Index>(plan.entries.size() + plan.behind.size()) + (restored ? still : 0);
      result.layers += layered && moves && still > 0 && !planned.layer(tile).made ? 1 : 0;
    }
    return result;
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
        job.entries =
            job.entries.first(static_cast<std::size_t>(tile_counts[tile].end));  // none follows with an adjoint
        job.workspace = d_transmittance + pixels;
        if (!planned.plans[tile].behind.empty()) {
          detail::see_behind(tiles.tile, scene.channels, job.blocks, planned.layer(tile), d_channels, d_transmittance);
        }
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
    const detail::OutputCotangents<S> cotangents = cotangents_of(io);
    if (has_background(io)) io.begin_rows(background_input(io), 0, 1);
    if (has_background(io) && io.wants(background_input(io))) {
      detail::add_background_gradient(images_of(io), cotangents, io.d_in(background_input(io)).data);
    }
    if (!wants_gradient(io)) return;
    Stopwatch watch;
    const TileGrid tiles = grid();
    const Index pixels = tiles.tile * tiles.tile, channels = io.in(kFeatures).shape.cols;
    TileAdjoint<S> shared{};
    shared.wants_shape = wants_shape(io);
    shared.wants_features = wants_features(io);
    shared.stride = stride_of(io);
    shared.sums = io.scratch(shared.stride * planned.moving.lists.pairs() + detail::kSlotNumbers).data();
    Workspaces workspaces(tiles.count());
    const Index size = backward_memory(io, tiles);
    const std::span<S> memory = io.scratch(size * workspaces.count());
    adjoint_last.resize(tiles.count());
    run_chunks(tiles.count(), [&](Index tile) {
      adjoint_last[tile] = {0, -1};
      if (tile_counts[tile].end == 0) return;
      const Workspaces::Held held(workspaces);
      S* const d_channels = memory.data() + held.number() * size;
      TileJob<S> place{};
      place_job(tiles, tile, place);
      detail::load_cotangent(images_of(io), cotangents, tiles.tile, place, d_channels);
      const auto is_zero = [](S x) { return x == S(0); };
      if (view.skip.zero_cotangent && std::all_of(d_channels, d_channels + (channels + 1) * pixels, is_zero)) return;
      adjoint_last[tile] = tile_last[tile];
      tile_adjoint(io, tiles, tile, shared, d_channels);
    });
    counters->times.backward_s = watch.lap();
    counters->adjoint_tiles = std::count_if(adjoint_last.data(), adjoint_last.data() + tiles.count(),
                                            [](const DepthKeyed& end) { return end.index >= 0; });
    parallel_for(planned.moving.count, kGrain, [&](Index begin, Index end) {
      with_best_lanes([&](auto lanes) { reduce<lanes()>(io, shared, begin, end); });
    });
    counters->times.reduce_s = watch.lap();
  }

  /// Adds what the sums of rows [begin, end) of the lists mean to the gradients of both sets.
  template <Index kCount>
  void reduce(const NodeIo<S>& io, const TileAdjoint<S>& adjoint, Index begin, Index end) const {
    const detail::SplatRows<S> rows = rows_of(io);
    const Index first = planned.moving.first + begin, after = planned.moving.first + end;
    const Index middle = std::clamp(rows.second, first, after);
    for (int input = 0; input < kStill; ++input) {
      if (first < middle) io.begin_rows(kStill + input, first, middle);
      io.begin_rows(input, middle - rows.second, after - rows.second);
    }
    const detail::SlotSums<S> sums{
        adjoint.sums,  adjoint.stride,       adjoint.wants_shape || in_blocks(io) ? kMoments : 0,
        in_blocks(io), planned.moving.lists, {adjoint_last.data(), static_cast<std::size_t>(adjoint_last.size())}};
    if (first < middle) {
      detail::reduce_slots<kCount>(sums, rows.still, view.settings, {first, first, begin}, middle - first,
                                   records.data() + first, gradients_of(io, kStill));
    }
    detail::reduce_slots<kCount>(sums, rows.moving, view.settings,
                                 {middle - rows.second, middle, middle - planned.moving.first}, after - middle,
                                 records.data() + middle, gradients_of(io, 0));
  }

  // --- curvature -----------------------------------------------------------------------------------------------------

  /// By shares of the tiles that the number of threads does not change; every kShares-th is of one share, so that all
  /// have as much of what is dense. Of a sample of tiles each counts for those beside it.
  void collect(NodeIo<S>& io, const CurvatureWeights<S>& weights, const Movers<S>& movers, double* sum) {
    constexpr Index kShares = 16;
    const TileGrid tiles = grid();
    const Index size = kTwist * movers.count(), numbers = size * size;
    const detail::CurvatureScene<S> scene = curvature_scene(io, weights, movers);
    const std::span<double> shares = io.template scratch<double>(kShares * numbers);
    run_chunks(kShares, [&](Index share) {
      detail::CurvatureWorkspace<S> workspace;
      double* const mine = shares.data() + share * numbers;
      std::fill_n(mine, numbers, 0.0);
      for (Index tile = share; tile < tiles.count(); tile += kShares) {
        if (tile_counts[tile].end > 0 && is_sampled(tiles, tile, weights.rule))
          detail::add_tile_curvature(scene, curvature_tile(tiles, tile), workspace, mine);
      }
    });
    parallel_for(numbers, kGrain, [&](Index begin, Index end) {
      for (Index share = 0; share < kShares; ++share) {
        const double* const from = shares.data() + share * numbers;
        for (Index i = begin; i < end; ++i) sum[i] += static_cast<double>(weights.rule.tiles) * from[i];
      }
    });
  }

  /// Tiles of a sample are no column: rows of tiles begin elsewhere.
  static bool is_sampled(const TileGrid& tiles, Index tile, const CurvatureRule& rule) {
    const Index step = (rule.tiles / 2) | 1, row = tile / tiles.cols, col = tile % tiles.cols;
    return (col + step * row + rule.turn) % rule.tiles == 0;
  }

  detail::CurvatureScene<S> curvature_scene(const NodeIo<S>& io, const CurvatureWeights<S>& weights,
                                            const Movers<S>& movers) const {
    HSI4D_CHECK(channels_of(io) <= detail::kMostBlockChannels,
                "a curvature of " + std::to_string(channels_of(io)) + " channels");
    const bool split = static_cast<bool>(images_of(io).rest);
    movers.check(io, kMeans);
    if (has_still(io)) movers.check(io, kStill + kMeans);
    return {scene_of(io),
            {has_still(io) ? movers.of_input(io, kStill + kMeans) : nullptr, movers.of_input(io, kMeans)},
            images_of(io),
            {weights.of_output(io, kChannels), split ? weights.of_output(io, kMoreChannels) : ConstArray<S>{},
             weights.of_output(io, kTransmittance)},
            movers.count()};
  }

  detail::CurvatureTile<S> curvature_tile(const TileGrid& tiles, Index tile) const {
    detail::CurvatureTile<S> job{};
    place_job(tiles, tile, job);
    job.side = tiles.tile;
    // None that follows is drawn.
    job.entries = planned.plans[tile].entries.first(static_cast<std::size_t>(tile_counts[tile].end));
    if constexpr (std::is_same_v<S, float>) {
      const detail::TileLayer& layer = planned.layer(tile);
      job.start = layer.made && layer.first > 0 ? layer.front.data() : nullptr;
    }
    return job;
  }

  // --- the rest ------------------------------------------------------------------------------------------------------

  /// Order, lists, and for each (pixel, Gaussian) pair whether it is composited, stops with it, or is held by the cap.
  void add_signature(Signature& signature, NodeIo<S>& io) {
    const TileGrid tiles = grid();
    const CompositeRules<S> rules = detail::composite_rules<S>(view.settings);
    std::vector<TileEntry> entries;
    for (Index tile = 0; tile < tiles.count(); ++tile) {
      const std::span<const TileEntry> still = planned.still.of_tile(tile), moved = planned.moving.of_tile(tile);
      entries.resize(still.size() + moved.size());
      detail::merge_entries(rows_of(io), view.settings, still, moved, entries.data());
      TileJob<S> place{};
      place_job(tiles, tile, place);
      signature.add(entries.size());
      for (const TileEntry& entry : entries) signature.add(static_cast<std::uint64_t>(entry.index));
      for (Index p = 0; p < place.width * place.height; ++p) {
        const Index r = p / place.width, c = p % place.width;
        S t = 1;
        for (std::size_t at = 0; at < entries.size() && t >= rules.stop_below; ++at) {
          const SplatRecord<S>& record = records[entries[at].index];
          if (place.top + r < record.row_begin || place.top + r >= record.row_end) continue;
          const auto [pixel, next] = detail::pixel_of(in_blocks(io), tiles.tile, record, rules, place, r, c, t);
          if (!pixel.drawn) continue;
          if (rules.exclusive && next < rules.stop_below) break;
          t = next;
          signature.add(at * 2 + (pixel.capped ? 1 : 0));
        }
      }
    }
  }

  Index saved_bytes() const {
    return records.capacity_bytes() + planned.capacity_bytes() + tile_last.capacity_bytes() + changed.capacity_bytes() +
           read.capacity_bytes() + adjoint_last.capacity_bytes() + kept.capacity_bytes() +
           tile_counts.capacity_bytes() + clean.capacity_bytes();
  }
};

/// @param sets  what moves, then what stands still, if there is any
template <class S>
Composited<S> record_composite(std::initializer_list<SplatSet<S>> sets, Var<S> background, const SplatView& view,
                               Source where) {
  check_camera(view.camera);
  const Index channels = sets.begin()->features.shape().cols;
  HSI4D_CHECK(channels >= 1, "no features");
  const int tile = view.settings.tile;
  HSI4D_CHECK(tile == 8 || tile == 16, "tile = " + std::to_string(tile) + "; allowed: 8, 16");
  std::vector<Var<S>> inputs = detail::inputs_of(sets, channels);
  const Index width = view.camera.width, height = view.camera.height;
  Index over = channels;
  if (background.tape != nullptr) {
    over = background.shape().cols;
    HSI4D_CHECK_EQ(background.shape(), shape_of(1, over));
    HSI4D_CHECK(over >= 1 && over <= channels,
                "a background of " + std::to_string(over) + " channels of " + std::to_string(channels));
    inputs.push_back(background);
  }
  const std::array outputs = {image_shape<S>(over, height, width), image_shape<S>(1, height, width),
                              image_shape<S>(channels - over, height, width)};
  const bool split = over < channels;
  auto counters = std::make_shared<RenderCounters>();
  counters->channels = channels;
  Tape<S>& tape = inputs.front().owner();
  const Var<S> first = tape.record(Composite<S>{view, counters}, std::span<const Var<S>>(inputs),
                                   std::span<const Shape>(outputs).first(split ? 3 : 2), where);
  return {first, tape.output(first, 1), split ? tape.output(first, 2) : Var<S>{}, counters};
}

}  // namespace

template <class S>
Composited<S> composite(const SplatSet<S>& splats, const SplatView& view, Var<S> background, Source where) {
  return record_composite<S>({splats}, background, view, where);
}

template <class S>
Composited<S> composite(const SplatSet<S>& still, const SplatSet<S>& moving, const SplatView& view, Var<S> background,
                        Source where) {
  return record_composite<S>({moving, still}, background, view, where);
}

#define HSI4D_INSTANTIATE(S)                                                              \
  template Composited<S> composite(const SplatSet<S>&, const SplatView&, Var<S>, Source); \
  template Composited<S> composite(const SplatSet<S>&, const SplatSet<S>&, const SplatView&, Var<S>, Source);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d
