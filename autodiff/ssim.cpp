#include "autodiff/ssim.h"

#include <algorithm>
#include <array>
#include <atomic>

#include "autodiff/curvature_weights.h"
#include "autodiff/elementwise.h"
#include "autodiff/ssim_kernel.h"
#include "autodiff/ssim_weights.h"
#include "core/buffer.h"
#include "core/parallel.h"
#include "core/simd.h"

namespace hsi4d {

namespace {

using detail::SsimRect;
using detail::SsimSweep;
static_assert(detail::kSsimTile == kMaskSquare);

constexpr Index kStripTiles = 64;   // widest sweep: its rows have to stay in the second-level cache
constexpr Index kMinBandTiles = 8;  // a band repeats 10 rows of its neighbours
constexpr Index kWantedUnits = 12;  // so that a few threads are busy
constexpr Index kMostWorkspaces = 256;

/// What one sweep computes, in every plane.
struct Unit {
  SsimRect sums, gradient;
};

/// Tiles [row_begin, row_end) × [col_begin, col_end).
using TileRect = SsimRect;

/// Bounding box of the tiles for which `touched(row, col)` holds, among rows [row_begin, row_end).
template <class Touched>
TileRect bounds(const Touched& touched, Index row_begin, Index row_end, Index cols) {
  TileRect box{row_end, row_begin, cols, 0};
  for (Index r = row_begin; r < row_end; ++r) {
    for (Index c = 0; c < cols; ++c) {
      if (!touched(r, c)) continue;
      box = {std::min(box.row_begin, r), r + 1, std::min(box.col_begin, c), std::max(box.col_end, c + 1)};
    }
  }
  return box;
}

SsimRect pixels_of(const TileRect& tiles, const Shape& image) {
  return {tiles.row_begin * kMaskSquare, std::min(tiles.row_end * kMaskSquare, image.rows),
          tiles.col_begin * kMaskSquare, std::min(tiles.col_end * kMaskSquare, image.cols)};
}

/// Cuts the tiles that the touched ones change into bands and strips. A function of the shapes and `touched` alone.
template <class Touched>
void plan_units(const Shape& image, const Touched& touched, Buffer<Unit>& units) {
  const Index rows = mask_squares(image.rows), cols = mask_squares(image.cols);
  units.resize(rows * ((cols + kStripTiles - 1) / kStripTiles));
  Index count = 0;
  const TileRect all = bounds(touched, 0, rows, cols);
  if (!all.empty()) {
    const Index begin = std::max(all.row_begin - 1, Index(0)), end = std::min(all.row_end + 1, rows);
    const Index most_bands = std::max((end - begin) / kMinBandTiles, Index(1));
    const Index bands = std::clamp((kWantedUnits + image.planes - 1) / image.planes, Index(1), most_bands);
    const Index height = (end - begin + bands - 1) / bands;
    for (Index r = begin; r < end; r += height) {
      const Index r_end = std::min(r + height, end);
      // The map changes up to 5 pixels, hence in the neighbouring tiles.
      const TileRect around = bounds(touched, std::max(r - 1, Index(0)), std::min(r_end + 1, rows), cols);
      if (around.empty()) continue;
      const TileRect inside = bounds(touched, r, r_end, cols);
      const Index c_begin = std::max(around.col_begin - 1, Index(0)), c_end = std::min(around.col_end + 1, cols);
      const Index strips = (c_end - c_begin + kStripTiles - 1) / kStripTiles;
      const Index width = (c_end - c_begin + strips - 1) / strips;
      for (Index c = c_begin; c < c_end; c += width) {
        const TileRect sums{r, r_end, c, std::min(c + width, c_end)};
        TileRect gradient = inside;
        gradient.col_begin = std::max(gradient.col_begin, sums.col_begin);
        gradient.col_end = std::min(gradient.col_end, sums.col_end);
        units[count++] = {pixels_of(sums, image), gradient.empty() ? SsimRect{} : pixels_of(gradient, image)};
      }
    }
  }
  units.resize(count);
}

/// Workspaces that chunks running at the same time share; at most as many chunks run as there are threads.
class Slots {
 public:
  explicit Slots(Index count) : count_(count) {}
  Index take() {
    for (Index i = 0;; i = (i + 1) % count_) {
      if (!busy_[static_cast<std::size_t>(i)].exchange(true, std::memory_order_acquire)) return i;
    }
  }
  void give_back(Index slot) { busy_[static_cast<std::size_t>(slot)].store(false, std::memory_order_release); }

 private:
  Index count_;
  std::array<std::atomic<bool>, kMostWorkspaces> busy_{};
};

/// One way of evaluating two images: its memory, kept between calls.
template <class S>
struct Evaluation {
  Buffer<Unit> units;
  Buffer<double> tile_sums;  // [planes][tile rows][tile cols]: Σ (1 − ssim)/2

  void prepare(const Shape& image) {
    tile_sums.resize(image.planes * mask_squares(image.rows) * mask_squares(image.cols));
  }

  double d_ssim(const Shape& image) const {
    return 2 * pairwise_sum(tile_sums.data(), tile_sums.size()) / static_cast<double>(image.count());
  }

  /// Sums of the planned tiles, and d (1 − mean ssim)/dx into d_x (laid out like x) and ssim into `map`, if they are
  /// given.
  void run(const ConstArray<S>& x, const ConstArray<S>& y, const SsimSettings& settings, S* d_x, const Array<S>& map,
           FunctionRef<S*(Index)> allocate) {
    const Shape& shape = x.shape;
    Index widest = 0;
    for (const Unit& unit : units.span()) widest = std::max(widest, unit.sums.col_end - unit.sums.col_begin);
    const Index workspace_size = detail::ssim_workspace_size<S>(widest);
    const Index chunks = shape.planes * units.size();
    const Index workspaces = std::min({static_cast<Index>(thread_count()), chunks, kMostWorkspaces});
    S* const workspace = allocate(workspaces * workspace_size);
    Slots slots(workspaces);
    const Index tile_cols = mask_squares(shape.cols), tiles = mask_squares(shape.rows) * tile_cols;
    const double range2 = settings.data_range * settings.data_range;
    run_chunks(chunks, [&](Index chunk) {
      const Index plane = chunk / units.size();
      const Unit& unit = units[chunk % units.size()];
      SsimSweep<S> job;
      job.x = x.row(plane * shape.rows);
      job.y = y.row(plane * shape.rows);
      job.rows = shape.rows;
      job.cols = shape.cols;
      job.x_stride = shape.stride;
      job.y_stride = y.shape.stride;
      job.c1 = static_cast<S>(detail::kSsimC1 * range2);
      job.c2 = static_cast<S>(detail::kSsimC2 * range2);
      job.sums = unit.sums;
      job.tile_sums = tile_sums.data() + plane * tiles;
      job.tile_stride = tile_cols;
      if (map) {
        job.map = map.row(plane * shape.rows);
        job.map_stride = map.shape.stride;
      }
      if (d_x != nullptr) {
        job.gradient = unit.gradient;
        job.d_x = d_x + plane * shape.rows * shape.stride;
        job.d_stride = shape.stride;
        job.scale = static_cast<S>(1 / static_cast<double>(shape.count()));
      }
      const Index slot = slots.take();
      detail::ssim_sweep(job, workspace + slot * workspace_size);
      slots.give_back(slot);
    });
  }

  /// d_in += cotangent · d_x over the planned pixels; with `assign`, d_in = cotangent · d_x.
  void add_gradient(S cotangent, const Buffer<S>& d_x, const Array<S>& d_in, bool assign) const {
    const Shape& shape = d_in.shape;
    run_chunks(shape.planes * units.size(), [&](Index chunk) {
      const SsimRect& area = units[chunk % units.size()].gradient;
      const Index first = chunk / units.size() * shape.rows;
      on_best_isa([&] {
        for (Index r = first + area.row_begin; r < first + area.row_end; ++r) {
          const S* from = d_x.data() + r * shape.stride;
          S* to = d_in.row(r);
          if (assign) {
            for (Index c = area.col_begin; c < area.col_end; ++c) to[c] = cotangent * from[c];
          } else {
            for (Index c = area.col_begin; c < area.col_end; ++c) to[c] += cotangent * from[c];
          }
        }
      });
    });
  }
};

constexpr auto kAllTouched = [](Index, Index) { return true; };

template <class S>
struct DSsimOp {
  static constexpr const char* kName = "d_ssim";
  static constexpr bool kAssigns = true;
  SsimSettings settings;
  Evaluation<S> evaluation = {};  // keeps the sums of tiles that do not change
  std::array<Buffer<S>, 2> gradients = {};

  /// Tiles whose sums may have changed, or in which the gradient is read.
  void plan(const NodeIo<S>& io, const Shape& shape) {
    const TileMask *const changed = io.changed(0), *const read = io.read(0);
    const bool in_squares =
        changed != nullptr && !io.is_changed(1) && !io.wants(1) && (read != nullptr || !io.wants(0));
    if (!in_squares) return plan_units(shape, kAllTouched, evaluation.units);
    plan_units(
        shape, [&](Index row, Index col) { return changed->has(row, col) || (io.wants(0) && read->has(row, col)); },
        evaluation.units);
  }

  void forward(NodeIo<S>& io) {
    const std::array images = {io.in(0), io.in(1)};
    const Shape& shape = images[0].shape;
    evaluation.prepare(shape);
    plan(io, shape);
    const auto allocate = [&](Index n) { return io.template scratch<S>(n).data(); };
    // ssim is symmetric: the gradient of the target is that of the image with the roles swapped.
    for (const int i : {0, 1}) {
      if (!io.wants(i) && (i == 1 || io.wants(1))) continue;
      Buffer<S>& d = gradients[static_cast<std::size_t>(i)];
      if (io.wants(i)) d.resize(images[static_cast<std::size_t>(i)].shape.memory());
      evaluation.run(images[static_cast<std::size_t>(i)], images[static_cast<std::size_t>(1 - i)], settings,
                     io.wants(i) ? d.data() : nullptr, {}, allocate);
    }
    io.out().scalar() = static_cast<S>(evaluation.d_ssim(shape));
  }

  void backward(NodeIo<S>& io) {
    for (const int i : {0, 1}) {
      if (!io.wants(i)) continue;
      const Buffer<S>& gradient = gradients[static_cast<std::size_t>(i)];
      evaluation.add_gradient(io.d_out().scalar(), gradient, io.d_in(i), io.must_assign(i));
    }
  }

  bool weigh(NodeIo<S>& io, CurvatureWeights<S>& weights) {
    const S g = io.d_out().scalar();
    if (io.wants(0) && g > S(0) && weights.rule.structural) {
      const S scale = g / static_cast<S>(io.in(0).shape.count());
      detail::add_ssim_weights(io.in(0), io.in(1), io.read(0), settings.data_range, scale, weights.of_input(io, 0));
    }
    return true;
  }

  Index saved_bytes() const { return gradients[0].capacity_bytes() + gradients[1].capacity_bytes(); }
};

void check_images(const Shape& image, const Shape& target, const SsimSettings& settings) {
  HSI4D_CHECK(image.same_size(target), detail::both_values(image, target));
  HSI4D_CHECK(image.count() > 0, "ssim of an empty image");
  HSI4D_CHECK(settings.data_range >= 1e-6 && settings.data_range <= 1e6,
              "data_range = " + std::to_string(settings.data_range) + ", allowed are 1e-6 to 1e6");
}

}  // namespace

template <class S>
Var<S> d_ssim(Var<S> image, Var<S> target, const SsimSettings& settings, Source where) {
  check_images(image.shape(), target.shape(), settings);
  return image.owner().record(DSsimOp<S>{settings}, {image, target}, kScalarShape, where);
}

template <class S>
Var<S> ssim(Var<S> image, Var<S> target, const SsimSettings& settings, Source where) {
  return S(1) - d_ssim(image, target, settings, where);
}

template <class S>
double ssim_map(const ConstArray<S>& image, const ConstArray<S>& target, const Array<S>& map,
                const SsimSettings& settings) {
  check_images(image.shape, target.shape, settings);
  HSI4D_CHECK(!map || map.shape.same_size(image.shape), detail::both_values(map.shape, image.shape));
  Evaluation<S> evaluation;
  Buffer<S> workspace;
  evaluation.prepare(image.shape);
  plan_units(image.shape, kAllTouched, evaluation.units);
  evaluation.run(image, target, settings, nullptr, map, [&](Index n) {
    workspace.resize(n);
    return workspace.data();
  });
  return 1 - evaluation.d_ssim(image.shape);
}

template <class S>
double mean_ssim(const ConstArray<S>& image, const ConstArray<S>& target, const SsimSettings& settings) {
  return ssim_map(image, target, Array<S>(), settings);
}

#define HSI4D_SSIM(S)                                                                         \
  template Var<S> d_ssim(Var<S>, Var<S>, const SsimSettings&, Source);                        \
  template Var<S> ssim(Var<S>, Var<S>, const SsimSettings&, Source);                          \
  template double mean_ssim(const ConstArray<S>&, const ConstArray<S>&, const SsimSettings&); \
  template double ssim_map(const ConstArray<S>&, const ConstArray<S>&, const Array<S>&, const SsimSettings&);
HSI4D_SSIM(float)
HSI4D_SSIM(double)
#undef HSI4D_SSIM

}  // namespace hsi4d
