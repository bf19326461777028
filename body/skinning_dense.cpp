// Dense kernels of skinning_kernel.h: matrix products [V,J] × [J,12] with vertices in the lanes, so that the transform
// of each vertex, its point and the adjoints are formed in registers without shuffles.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "body/skinning_dense.cpp"
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)
#include <algorithm>

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "body/skinning_kernel.h"

HWY_BEFORE_NAMESPACE();
namespace hsi4d::detail::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

template <class S>
using Tag = hn::CappedTag<S, kMaxLanes>;
template <class S>
inline constexpr Index kLanes = static_cast<Index>(hn::MaxLanes(Tag<S>()));

/// With 32 registers, two vectors of vertices (forward) or two joints (adjoint) share each load of the other operand.
inline constexpr int kTile = HWY_TARGET == HWY_AVX3 || HWY_ARCH_ARM_A64 ? 2 : 1;

/// B [12] of kTile vectors of vertices; `panel` starts at their column of the panel.
template <class S>
HWY_INLINE void blend(const S* HWY_RESTRICT panel, const S* HWY_RESTRICT transforms, Index joints,
                      hn::Vec<Tag<S>> (&b)[12][kTile]) {
  const Tag<S> d;
#pragma GCC unroll 12
  for (int c = 0; c < 12; ++c) {
#pragma GCC unroll 2
    for (int m = 0; m < kTile; ++m) b[c][m] = hn::Zero(d);
  }
  for (Index j = 0; j < joints; ++j) {
    hn::Vec<Tag<S>> w[kTile];
#pragma GCC unroll 2
    for (int m = 0; m < kTile; ++m) w[m] = hn::LoadU(d, panel + j * kPanel + m * kLanes<S>);
#pragma GCC unroll 12
    for (int c = 0; c < 12; ++c) {
      const auto a = hn::Set(d, transforms[j * kTransformSize + c]);
#pragma GCC unroll 2
      for (int m = 0; m < kTile; ++m) b[c][m] = hn::MulAdd(a, w[m], b[c][m]);
    }
  }
}

/// y = B x1 for one whole panel.
template <class S>
HWY_INLINE void panel_points(const S* panel, const S* transforms, Index joints, const S* points, S* result, S* saved) {
  const Tag<S> d;
  for (Index lane = 0; lane < kPanel; lane += kTile * kLanes<S>) {
    hn::Vec<Tag<S>> b[12][kTile];
    blend<S>(panel + lane, transforms, joints, b);
#pragma GCC unroll 2
    for (int m = 0; m < kTile; ++m) {
      const Index at = lane + m * kLanes<S>;
      hn::Vec<Tag<S>> x, y, z, sum[3];
      hn::LoadInterleaved3(d, points + 3 * at, x, y, z);
#pragma GCC unroll 3
      for (int r = 0; r < 3; ++r) {
        sum[r] =
            hn::MulAdd(b[4 * r][m], x, hn::MulAdd(b[4 * r + 1][m], y, hn::MulAdd(b[4 * r + 2][m], z, b[4 * r + 3][m])));
      }
      hn::StoreInterleaved3(sum[0], sum[1], sum[2], d, result + 3 * at);
      if (saved == nullptr) continue;
#pragma GCC unroll 12
      for (int c = 0; c < 12; ++c) hn::StoreU(b[c][m], d, saved + c * kPanel + at);
    }
  }
}

template <class S>
void dense_points(const DenseTable<S>& table, const S* transforms, const S* points, S* result, S* saved, Index begin,
                  Index end) {
  for (Index v = begin; v < end; v += kPanel) {
    const S* panel = table.panels.data() + v * table.joints;
    S* keep = saved == nullptr ? nullptr : saved + v * kTransformSize;
    if (v + kPanel <= end) {
      panel_points(panel, transforms, table.joints, points + 3 * v, result + 3 * v, keep);
      continue;
    }
    S x[3 * kPanel] = {}, y[3 * kPanel];
    std::copy(points + 3 * v, points + 3 * end, x);
    panel_points(panel, transforms, table.joints, x, y, keep);
    std::copy(y, y + 3 * (end - v), result + 3 * v);
  }
}

/// d_x += B(:,0:3)ᵀ d_y for one panel.
template <class S>
HWY_INLINE void panel_point_adjoint(const S* HWY_RESTRICT saved, const S* d_result, S* d_points) {
  const Tag<S> d;
  for (Index lane = 0; lane < kPanel; lane += kLanes<S>) {
    hn::Vec<Tag<S>> g[3], dx[3];
    hn::LoadInterleaved3(d, d_result + 3 * lane, g[0], g[1], g[2]);
    hn::LoadInterleaved3(d, d_points + 3 * lane, dx[0], dx[1], dx[2]);
#pragma GCC unroll 3
    for (int c = 0; c < 3; ++c) {
#pragma GCC unroll 3
      for (int r = 0; r < 3; ++r) dx[c] = hn::MulAdd(hn::LoadU(d, saved + (4 * r + c) * kPanel + lane), g[r], dx[c]);
    }
    hn::StoreInterleaved3(dx[0], dx[1], dx[2], d, d_points + 3 * lane);
  }
}

template <class S>
void dense_point_adjoint(const S* saved, const S* d_result, S* d_points, Index begin, Index end) {
  for (Index v = begin; v < end; v += kPanel) {
    if (v + kPanel <= end) {
      panel_point_adjoint(saved + v * kTransformSize, d_result + 3 * v, d_points + 3 * v);
      continue;
    }
    S d_y[3 * kPanel] = {}, d_x[3 * kPanel] = {};
    std::copy(d_result + 3 * v, d_result + 3 * end, d_y);
    std::copy(d_points + 3 * v, d_points + 3 * end, d_x);
    panel_point_adjoint(saved + v * kTransformSize, d_y, d_x);
    std::copy(d_x, d_x + 3 * (end - v), d_points + 3 * v);
  }
}

/// Outer products [12, kDenseBlock] of `count` vertices (a multiple of the lanes).
template <class S>
HWY_INLINE void outer_products(const S* points, const S* d_result, Index count, S* HWY_RESTRICT outer) {
  const Tag<S> d;
  for (Index lane = 0; lane < count; lane += kLanes<S>) {
    hn::Vec<Tag<S>> x[3], g[3];
    hn::LoadInterleaved3(d, points + 3 * lane, x[0], x[1], x[2]);
    hn::LoadInterleaved3(d, d_result + 3 * lane, g[0], g[1], g[2]);
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) hn::StoreU(hn::Mul(g[r], x[c]), d, outer + (4 * r + c) * kDenseBlock + lane);
      hn::StoreU(g[r], d, outer + (4 * r + 3) * kDenseBlock + lane);
    }
  }
}

/// partial [j … j + T) += Σ over `panels` panels of W O, lane by lane.
template <class S, int T>
HWY_INLINE void add_joints(const DenseTable<S>& table, Index first_panel, Index panels, Index j,
                           const S* HWY_RESTRICT outer, S* HWY_RESTRICT partial) {
  const Tag<S> d;
  hn::Vec<Tag<S>> sum[T][12];
#pragma GCC unroll 2
  for (int t = 0; t < T; ++t) {
#pragma GCC unroll 12
    for (int c = 0; c < 12; ++c) sum[t][c] = hn::Zero(d);
  }
  const S* HWY_RESTRICT weights = table.panels.data() + (first_panel * table.joints + j) * kPanel;
  for (Index p = 0; p < panels; ++p, weights += table.joints * kPanel) {
    for (Index lane = 0; lane < kPanel; lane += kLanes<S>) {
      hn::Vec<Tag<S>> w[T];
#pragma GCC unroll 2
      for (int t = 0; t < T; ++t) w[t] = hn::LoadU(d, weights + t * kPanel + lane);
#pragma GCC unroll 12
      for (int c = 0; c < 12; ++c) {
        const auto o = hn::LoadU(d, outer + c * kDenseBlock + p * kPanel + lane);
#pragma GCC unroll 2
        for (int t = 0; t < T; ++t) sum[t][c] = hn::MulAdd(o, w[t], sum[t][c]);
      }
    }
  }
#pragma GCC unroll 2
  for (int t = 0; t < T; ++t) {
#pragma GCC unroll 12
    for (int c = 0; c < 12; ++c) {
      S* to = partial + ((j + t) * kTransformSize + c) * kMaxLanes;
      hn::StoreU(hn::Add(hn::LoadU(d, to), sum[t][c]), d, to);
    }
  }
}

template <class S>
void add_block(const DenseTable<S>& table, Index first, Index last, const S* outer, S* partial) {
  const Index panels = (last - first + kPanel - 1) / kPanel;
  Index j = 0;
  for (; j + kTile <= table.joints; j += kTile) add_joints<S, kTile>(table, first / kPanel, panels, j, outer, partial);
  if (j < table.joints) add_joints<S, 1>(table, first / kPanel, panels, j, outer, partial);
}

template <class S>
void dense_transform_adjoint(const DenseTable<S>& table, const S* points, const S* d_result, S* partial, Index begin,
                             Index end) {
  alignas(64) S outer[kTransformSize * kDenseBlock];
  std::fill(partial, partial + table.joints * kTransformSize * kMaxLanes, S(0));
  for (Index first = begin; first < end; first += kDenseBlock) {
    const Index last = std::min(first + kDenseBlock, end);
    const Index whole = (last - first) / kPanel * kPanel;
    outer_products(points + 3 * first, d_result + 3 * first, whole, outer);
    if (first + whole < last) {
      S x[3 * kPanel] = {}, d_y[3 * kPanel] = {};
      std::copy(points + 3 * (first + whole), points + 3 * last, x);
      std::copy(d_result + 3 * (first + whole), d_result + 3 * last, d_y);
      outer_products(x, d_y, kPanel, outer + whole);
    }
    add_block(table, first, last, outer, partial);
  }
}

template <class S>
void dense_blend(const DenseTable<S>& table, const S* transforms, S* blended, Index begin, Index end) {
  const Tag<S> d;
  alignas(64) S columns[kTransformSize * kPanel];
  for (Index v = begin; v < end; v += kPanel) {
    for (Index lane = 0; lane < kPanel; lane += kTile * kLanes<S>) {
      hn::Vec<Tag<S>> b[12][kTile];
      blend<S>(table.panels.data() + v * table.joints + lane, transforms, table.joints, b);
#pragma GCC unroll 12
      for (int c = 0; c < 12; ++c) {
#pragma GCC unroll 2
        for (int m = 0; m < kTile; ++m) hn::StoreU(b[c][m], d, columns + c * kPanel + lane + m * kLanes<S>);
      }
    }
    for (Index i = 0; i < std::min(kPanel, end - v); ++i) {
      for (Index c = 0; c < kTransformSize; ++c) blended[(v + i) * kTransformSize + c] = columns[c * kPanel + i];
    }
  }
}

template <class S>
void dense_blend_adjoint(const DenseTable<S>& table, const S* d_blended, S* partial, Index begin, Index end) {
  alignas(64) S outer[kTransformSize * kDenseBlock];
  std::fill(partial, partial + table.joints * kTransformSize * kMaxLanes, S(0));
  for (Index first = begin; first < end; first += kDenseBlock) {
    const Index last = std::min(first + kDenseBlock, end);
    for (Index i = 0; i < round_up(last - first, kPanel); ++i) {
      for (Index c = 0; c < kTransformSize; ++c) {
        outer[c * kDenseBlock + i] = first + i < last ? d_blended[(first + i) * kTransformSize + c] : S(0);
      }
    }
    add_block(table, first, last, outer, partial);
  }
}

template <class S>
void dense_reduce(const DenseTable<S>& table, const S* partials, Index chunks, S* d_transforms) {
  const Tag<S> d;
  const Index numbers = table.joints * kTransformSize;
  for (Index e = 0; e < numbers; ++e) {
    auto sum = hn::Zero(d);
    for (Index chunk = 0; chunk < chunks; ++chunk)
      sum = hn::Add(sum, hn::LoadU(d, partials + (chunk * numbers + e) * kMaxLanes));
    d_transforms[e] += hn::GetLane(hn::SumOfLanes(d, sum));
  }
}

}  // namespace

template <class S>
void set_dense(SkinKernels<S>& kernels) {
  kernels.dense_points = dense_points<S>;
  kernels.dense_point_adjoint = dense_point_adjoint<S>;
  kernels.dense_transform_adjoint = dense_transform_adjoint<S>;
  kernels.dense_blend = dense_blend<S>;
  kernels.dense_blend_adjoint = dense_blend_adjoint<S>;
  kernels.dense_reduce = dense_reduce<S>;
}
template void set_dense(SkinKernels<float>&);
template void set_dense(SkinKernels<double>&);

}  // namespace hsi4d::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace hsi4d::detail {

template <class S>
void set_dense_kernels(SkinKernels<S>& kernels, [[maybe_unused]] Isa isa) {
#if (HWY_TARGETS & HWY_AVX3) && HWY_STATIC_TARGET != HWY_AVX3
  if (isa == Isa::kAvx512) return N_AVX3::set_dense(kernels);
#endif
#if (HWY_TARGETS & HWY_AVX2) && HWY_STATIC_TARGET != HWY_AVX2
  if (isa == Isa::kAvx2) return N_AVX2::set_dense(kernels);
#endif
  HWY_STATIC_DISPATCH(set_dense)(kernels);
}
template void set_dense_kernels(SkinKernels<float>&, Isa);
template void set_dense_kernels(SkinKernels<double>&, Isa);

}  // namespace hsi4d::detail
#endif
