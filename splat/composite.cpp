#include "splat/composite.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "core/parallel.h"
#include "core/simd.h"
#include "splat/composite_kernel.h"
#include "splat/tiles.h"
#include "splat/workspaces.h"

namespace hsi4d {

namespace {

using detail::CompositeRules;
using detail::CompositeScene;
using detail::Conic;
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

template <class S>
CompositeRules<S> rules_of(const RenderSettings& settings) {
  S stop = static_cast<S>(settings.transmittance_stop);
  if (stop > S(0) && settings.stop_when == StopWhen::kAtOrBelow) {
    stop = std::nextafter(stop, std::numeric_limits<S>::infinity());
  }
  return {static_cast<S>(settings.alpha_cap), static_cast<S>(settings.alpha_min), stop,
          settings.stop_rule == StopRule::kExclusive, settings.cap_gradient == CapGradient::kPass};
}

template <class S>
bool all_finite(const S* x, Index n) {
  return std::all_of(x, x + n, [](S v) { return std::isfinite(v); });
}

/// Copies a row of a tile; nearly all are 16 pixels, and known lengths copy faster.
template <class S>
void copy_row(const S* from, Index n, S* to) {
  n == 16 ? std::copy_n(from, 16, to) : std::copy_n(from, n, to);
}

template <class S>
struct Composite {
  static constexpr const char* kName = "composite";
  SplatView view;
  std::shared_ptr<RenderCounters> counters;

  enum Input { kMeans, kFactors, kDepths, kRest, kMeansRest, kOpacities, kFeatures };
  enum Output { kChannels, kTransmittance };

  // In the order of the inputs, kept for their memory alone.
  Buffer<SplatRecord<S>> all_records = {};
  Buffer<Extent> all_extents = {};
  Buffer<DepthKeyed> keys = {}, room = {};
  Buffer<Index> counts = {};
  // In depth order.
  Buffer<SplatRecord<S>> records = {};
  Buffer<Extent> extents = {};
  TileLists lists = {};
  // What the backward pass needs of every tile.
  Buffer<detail::ListPosition<S>> last = {};
  Buffer<Index> checkpoint_begin = {};
  Buffer<S> checkpoints = {};
  Buffer<Index> fragments = {};
  Buffer<Index> tile_end = {};  ///< list position after the last Gaussian composited in any pixel

  TileGrid grid() const {
    return detail::tile_grid(view.camera.width, view.camera.height, static_cast<Index>(view.settings.tile));
  }
  bool wants_shape(const NodeIo<S>& io) const {
    return io.wants(kMeans) || io.wants(kMeansRest) || io.wants(kFactors) || io.wants(kOpacities);
  }
  bool wants_gradient(const NodeIo<S>& io) const { return wants_shape(io) || io.wants(kFeatures); }

  // --- Gaussians -----------------------------------------------------------------------------------------------------

  static void read_factor(const NodeIo<S>& io, Index n, double* factor) {
    const S* v = io.in(kFactors).row(n);
    for (int i = 0; i < 6; ++i) factor[i] = static_cast<double>(v[i]);
  }

  std::uint64_t depth_key(S depth, S rest) const {
    constexpr DepthKey kOwn = std::is_same_v<S, float> ? DepthKey::kFloat : DepthKey::kDouble;
    if (view.settings.depth_key.value_or(kOwn) == DepthKey::kFloat)
      return detail::depth_bits(static_cast<float>(depth));
    return detail::depth_bits(static_cast<double>(depth) + static_cast<double>(rest));
  }

  /// Culls: numbers that are not finite, then near, then the footprint, each before its numbers are used (rows A4-A6).
  bool prepare_gaussian(const NodeIo<S>& io, const TileGrid& tiles, Index n, SplatRecord<S>& record,
                        Extent& extent) const {
    const S *mean = io.in(kMeans).row(n), *mean_rest = io.in(kMeansRest).row(n);
    const S depth = io.in(kDepths).data[n], rest = io.in(kRest).data[n], opacity = io.in(kOpacities).data[n];
    const ConstArray<S> features = io.in(kFeatures);
    if (!all_finite(mean, 2) || !all_finite(mean_rest, 2) || !std::isfinite(depth) || !std::isfinite(rest) ||
        !std::isfinite(opacity))
      return false;
    if (!(static_cast<double>(depth) + static_cast<double>(rest) > view.settings.near)) return false;
    double factor[6];
    read_factor(io, n, factor);
    if (!is_drawn(factor)) return false;
    Conic conic;
    if (!detail::conic_of(factor, view.settings.blur, conic)) return false;
    const double scaled =
        static_cast<double>(opacity) * (view.settings.antialias ? detail::blur_compensation(conic) : 1.0);
    const double x = static_cast<double>(mean[0]) + static_cast<double>(mean_rest[0]);
    const double y = static_cast<double>(mean[1]) + static_cast<double>(mean_rest[1]);
    extent = detail::extent_of(conic, x, y, scaled, tiles, view.settings,
                               static_cast<double>(std::numeric_limits<S>::epsilon()));
    if (extent.row_begin >= extent.row_end || !all_finite(features.row(n), features.shape.cols)) return false;
    record = {x,
              y,
              static_cast<S>(conic.l11),
              static_cast<S>(conic.l21),
              static_cast<S>(conic.l22),
              static_cast<S>(scaled),
              static_cast<std::int32_t>(extent.row_begin),
              static_cast<std::int32_t>(extent.row_end),
              static_cast<std::int32_t>(n)};
    return all_finite(&record.l11, 4);
  }

  /// Records and extents of what is drawn, in depth order, and the tiles' lists.
  void prepare(const NodeIo<S>& io) {
    const TileGrid tiles = grid();
    const Index rows = io.in(kMeans).shape.rows;
    all_records.resize(rows);
    all_extents.resize(rows);
    keys.resize(rows);
    room.resize(rows);
    parallel_for(rows, kGrain, [&](Index begin, Index end) {
      on_best_isa([&] {
        for (Index n = begin; n < end; ++n) {
          const bool drawn = prepare_gaussian(io, tiles, n, all_records[n], all_extents[n]);
          keys[n].index = drawn ? static_cast<std::int32_t>(n) : -1;
          if (drawn) keys[n].key = depth_key(io.in(kDepths).data[n], io.in(kRest).data[n]);
        }
      });
    });
    Index drawn = 0;
    for (Index n = 0; n < rows; ++n) {
      if (keys[n].index >= 0) keys[drawn++] = keys[n];
    }
    const auto count = static_cast<std::size_t>(drawn);
    const std::span<const DepthKeyed> order = detail::sort_by_depth(keys.span().first(count), room.span().first(count));
    records.resize(drawn);
    extents.resize(drawn);
    parallel_for(drawn, kGrain, [&](Index begin, Index end) {
      for (Index rank = begin; rank < end; ++rank) {
        const Index n = order[static_cast<std::size_t>(rank)].index;
        records[rank] = all_records[n];
        extents[rank] = all_extents[n];
      }
    });
    lists.count(extents.span(), tiles, counts);
    const Index pairs = lists.slot_begin[drawn];
    detail::check_pair_memory(pairs, bytes_of_pairs(io, pairs), detail::pair_memory_limit());
    lists.fill(extents.span(), tiles, counts);
  }

  /// Numbers in the slot of a pair.
  Index stride_of(const NodeIo<S>& io) const {
    return (wants_shape(io) ? kMoments : 0) + (io.wants(kFeatures) ? io.in(kFeatures).shape.cols : 0);
  }

  /// Memory for the pairs of a forward and a backward run: entries, checkpoints, slots.
  double bytes_of_pairs(const NodeIo<S>& io, Index pairs) const {
    const double pixels = static_cast<double>(view.settings.tile) * view.settings.tile, number = sizeof(S);
    const double checkpoint = wants_gradient(io) ? pixels * number / static_cast<double>(kSegment) : 0;
    const double slot = static_cast<double>(stride_of(io)) * number;
    return static_cast<double>(pairs) * (static_cast<double>(sizeof(TileEntry)) + checkpoint + slot);
  }

  CompositeScene<S> scene_of(const NodeIo<S>& io) const {
    const ConstArray<S> features = io.in(kFeatures);
    return {records.span(), features.data, features.shape.cols, rules_of<S>(view.settings)};
  }

  // --- tiles ---------------------------------------------------------------------------------------------------------

  /// The job of a tile, without `transmittance` and `channels`.
  TileJob<S> job_of(const TileGrid& tiles, Index tile) {
    const Index begin = lists.tile_begin[tile], size = lists.tile_begin[tile + 1] - begin;
    const Index left = tile % tiles.cols * tiles.tile, top = tile / tiles.cols * tiles.tile;
    const Index pixels = tiles.tile * tiles.tile;
    TileJob<S> job{};
    job.entries = {lists.entries.data() + begin, static_cast<std::size_t>(size)};
    job.left = left;
    job.top = top;
    job.width = std::min(tiles.tile, tiles.width - left);
    job.height = std::min(tiles.tile, tiles.height - top);
    job.last = last.data() + tile * pixels;
    job.checkpoints = checkpoints.size() > 0 ? checkpoints.data() + checkpoint_begin[tile] * pixels : nullptr;
    return job;
  }

  void place_checkpoints(const TileGrid& tiles, bool wanted) {
    checkpoint_begin.resize(tiles.count() + 1);
    Index place = 0;
    for (Index tile = 0; tile < tiles.count(); ++tile) {
      checkpoint_begin[tile] = place;
      const Index size = lists.tile_begin[tile + 1] - lists.tile_begin[tile];
      if (wanted && size > 0) place += (size - 1) / kSegment;
    }
    checkpoint_begin[tiles.count()] = place;
    checkpoints.resize(place * tiles.tile * tiles.tile);
  }

  void forward(NodeIo<S>& io) {
    prepare(io);
    const TileGrid tiles = grid();
    const Index pixels = tiles.tile * tiles.tile, channels = io.in(kFeatures).shape.cols;
    const CompositeScene<S> scene = scene_of(io);
    last.resize(tiles.count() * pixels);
    fragments.resize(tiles.count());
    tile_end.resize(tiles.count());
    place_checkpoints(tiles, wants_gradient(io));
    Workspaces workspaces(tiles.count());
    const Index size = (channels + 1) * pixels;
    const std::span<S> memory = io.scratch(size * workspaces.count());
    const Array<S> image = io.out(kChannels), transmittance = io.out(kTransmittance);
    run_chunks(tiles.count(), [&](Index tile) {
      const Workspaces::Held held(workspaces);
      TileJob<S> job = job_of(tiles, tile);
      job.transmittance = memory.data() + held.number() * size;
      job.channels = job.transmittance + pixels;
      fragments[tile] = detail::composite_tile(tiles.tile, scene, job);
      tile_end[tile] = static_cast<Index>(*std::max_element(job.last, job.last + pixels));
      for (Index r = 0; r < job.height; ++r) {
        copy_row(job.transmittance + r * tiles.tile, job.width, &transmittance(job.top + r, job.left));
        for (Index k = 0; k < channels; ++k) {
          copy_row(job.channels + k * pixels + r * tiles.tile, job.width, &image(k, job.top + r, job.left));
        }
      }
    });
    count(tiles);
  }

  void count(const TileGrid& tiles) {
    *counters = {};
    counters->pairs = lists.pairs();
    for (Index rank = 0; rank < records.size(); ++rank) {
      counters->visible += lists.slot_begin[rank + 1] > lists.slot_begin[rank] ? 1 : 0;
    }
    for (Index tile = 0; tile < tiles.count(); ++tile) {
      counters->tiles += lists.tile_begin[tile + 1] > lists.tile_begin[tile] ? 1 : 0;
      counters->fragments += fragments[tile];
      counters->reached += tile_end[tile];
    }
  }

  // --- backward ------------------------------------------------------------------------------------------------------

  void backward(NodeIo<S>& io) {
    if (!wants_gradient(io)) return;
    const TileGrid tiles = grid();
    const Index pixels = tiles.tile * tiles.tile, channels = io.in(kFeatures).shape.cols;
    const CompositeScene<S> scene = scene_of(io);
    TileAdjoint<S> shared{};
    shared.wants_shape = wants_shape(io);
    shared.wants_features = io.wants(kFeatures);
    shared.stride = stride_of(io);
    shared.sums = io.scratch(shared.stride * lists.pairs()).data();
    const ConstArray<S> d_image = io.d_out(kChannels), d_transmittance = io.d_out(kTransmittance);
    Workspaces workspaces(tiles.count());
    const Index size = (channels + 1 + 2 * kSegment) * pixels + channels * tiles.tile;
    const std::span<S> memory = io.scratch(size * workspaces.count());
    run_chunks(tiles.count(), [&](Index tile) {
      const TileJob<S> job = job_of(tiles, tile);
      if (job.entries.empty()) return;
      const Workspaces::Held held(workspaces);
      S* const d_channels = memory.data() + held.number() * size;
      TileAdjoint<S> adjoint = shared;
      adjoint.d_channels = d_channels;
      adjoint.behind = d_channels + channels * pixels;
      adjoint.segment = adjoint.behind + pixels;
      std::fill_n(d_channels, (channels + 1) * pixels, S(0));
      for (Index r = 0; r < job.height; ++r) {
        for (Index k = 0; d_image && k < channels; ++k) {
          copy_row(&d_image(k, job.top + r, job.left), job.width, d_channels + k * pixels + r * tiles.tile);
        }
        if (d_transmittance) {
          copy_row(&d_transmittance(job.top + r, job.left), job.width, adjoint.behind + r * tiles.tile);
        }
      }
      adjoint.feature_sums = adjoint.segment + 2 * kSegment * pixels;
      detail::composite_tile_adjoint(tiles.tile, scene, job, adjoint);
    });
    parallel_for(records.size(), kGrain, [&](Index begin, Index end) {
      on_best_isa([&] {
        for (Index rank = begin; rank < end; ++rank) gather_gaussian(io, tiles, shared, rank);
      });
    });
  }

  /// True if the Gaussian comes before a tile's end. Lists are in the order of ranks.
  bool reached(Index tile, Index rank) const {
    const Index end = tile_end[tile];
    return end > 0 && rank <= static_cast<Index>(lists.entries[lists.tile_begin[tile] + end - 1].rank);
  }

  /// Sums the pairs of a Gaussian in the order of its slots, in double, and adds what they mean to the inputs'
  /// gradients. Pairs past the end of their tile have no adjoint, and their slots were not written (row B12).
  void gather_gaussian(NodeIo<S>& io, const TileGrid& tiles, const TileAdjoint<S>& adjoint, Index rank) const {
    constexpr Index kTogether = 16;  // numbers of a slot; with up to ten features it is read once
    static_assert(kMoments <= kTogether);
    const Index n = records[rank].index, first_feature = adjoint.wants_shape ? kMoments : 0;
    for (Index k = 0; k < adjoint.stride; k += kTogether) {
      const Index count = std::min(kTogether, adjoint.stride - k);
      double totals[kTogether] = {};
      bool any = false;
      const S* sums = adjoint.sums + lists.slot_begin[rank] * adjoint.stride + k;
      detail::for_each_tile(extents[rank], tiles, [&](Index tile) {
        if (reached(tile, rank)) {
          any = true;
          for (Index i = 0; i < count; ++i) totals[i] += static_cast<double>(sums[i]);
        }
        sums += adjoint.stride;
      });
      if (!any) return;
      if (adjoint.wants_shape && k == 0) add_shape_gradient(io, records[rank], n, totals);
      for (Index i = std::max<Index>(first_feature - k, 0); i < count; ++i) {
        io.d_in(kFeatures).row(n)[k + i - first_feature] += static_cast<S>(totals[i]);
      }
    }
  }

  /// With L = [l11 l21; 0 l22] and M the moments (Σ g u², …) as a symmetric matrix, from ds = −(L d)ᵀ L d_mean and
  /// ds = −½ (Lᵀ L d)ᵀ d_cov (Lᵀ L d):
  ///
  ///   d_o = Σ g,   d_mean = o Lᵀ (Σ g u, Σ g w),   d_cov = ½ o Lᵀ M L,   d_V = 2 d_cov V = o Lᵀ M (L V)
  ///
  /// d_cov is that of the full symmetric matrix: its off-diagonal number counts twice (row B21).
  void add_shape_gradient(NodeIo<S>& io, const SplatRecord<S>& record, Index n, const double* moments) const {
    double v[6];
    read_factor(io, n, v);
    Conic conic;
    if (!detail::conic_of(v, view.settings.blur, conic)) return;
    const bool antialias = view.settings.antialias;
    const double o = static_cast<double>(record.opacity);
    if (io.wants(kOpacities)) {
      io.d_in(kOpacities).data[n] +=
          static_cast<S>(antialias ? moments[0] * detail::blur_compensation(conic) : moments[0]);
    }
    for (const int input : {kMeans, kMeansRest}) {
      if (!io.wants(input)) continue;
      S* d_mean = io.d_in(input).row(n);
      d_mean[0] += static_cast<S>(o * (conic.l11 * moments[1]));
      d_mean[1] += static_cast<S>(o * (conic.l21 * moments[1] + conic.l22 * moments[2]));
    }
    if (!io.wants(kFactors)) return;
    double d_v[6];
    const auto lv = detail::whitened_factor(v, view.settings.blur, conic);
    for (int c = 0; c < 3; ++c) {
      const double lu = lv[static_cast<std::size_t>(c)], lw = lv[static_cast<std::size_t>(3 + c)];
      const double mu = moments[3] * lu + moments[4] * lw, mw = moments[4] * lu + moments[5] * lw;
      d_v[c] = o * (conic.l11 * mu);
      d_v[3 + c] = o * (conic.l21 * mu + conic.l22 * mw);
    }
    if (antialias) {
      const double opacity = static_cast<double>(io.in(kOpacities).data[n]);
      detail::blur_compensation_adjoint(v, view.settings.blur, conic, moments[0] * opacity, d_v);
    }
    S* d_factor = io.d_in(kFactors).row(n);
    for (int i = 0; i < 6; ++i) d_factor[i] += static_cast<S>(d_v[i]);
  }

  // --- the rest ------------------------------------------------------------------------------------------------------

  /// Order, lists, stops, and for each (pixel, Gaussian) pair whether it is cut, composited or held by the cap.
  void add_signature(Signature& signature, NodeIo<S>&) {
    const TileGrid tiles = grid();
    const CompositeRules<S> rules = rules_of<S>(view.settings);
    for (const SplatRecord<S>& record : records.span()) signature.add(static_cast<std::uint64_t>(record.index));
    for (Index tile = 0; tile < tiles.count(); ++tile) {
      const TileJob<S> job = job_of(tiles, tile);
      signature.add(job.entries.size());
      for (std::size_t at = 0; at < job.entries.size(); ++at) {
        const SplatRecord<S>& record = records[job.entries[at].rank];
        for (Index p = 0; p < job.width * job.height; ++p) {
          const Index r = p / job.width, c = p % job.width;
          if (job.top + r < record.row_begin || job.top + r >= record.row_end) continue;
          const auto pixel = detail::pixel_alpha(record, rules, job, r, c);
          const bool before_stop = static_cast<Index>(at) < static_cast<Index>(job.last[r * tiles.tile + c]);
          if (before_stop && pixel.drawn) signature.add(at * 2 + (pixel.capped ? 1 : 0));
        }
        signature.add(at);
      }
    }
  }

  Index saved_bytes() const {
    return all_records.capacity_bytes() + all_extents.capacity_bytes() + keys.capacity_bytes() + room.capacity_bytes() +
           counts.capacity_bytes() + records.capacity_bytes() + extents.capacity_bytes() +
           lists.tile_begin.capacity_bytes() + lists.slot_begin.capacity_bytes() + lists.entries.capacity_bytes() +
           last.capacity_bytes() + checkpoint_begin.capacity_bytes() + checkpoints.capacity_bytes() +
           fragments.capacity_bytes() + tile_end.capacity_bytes();
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
