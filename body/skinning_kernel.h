// Vector kernels of linear blend skinning (skinning.h), and the weights as they want them. Not a public header.
//
// A transform is twelve numbers [3,4], row-major; with x1 = (x, y, z, 1),
//
//   B_v = Σ_k w_vk A_jk        y_v = B_v x1_v                               (forward)
//   d_x_v += B_v(:,0:3)ᵀ d_y_v,    d_A_j += Σ_v w_vj d_y_v ⊗ x1_v           (adjoint)
//
// and for frames F_v [3,3], axes that a point carries along, F'_v = B_v(:,0:3) F_v with O_v += d_F'_v F_vᵀ,
//
// so that d_A is the transposed blend of the outer products O_v = d_y_v ⊗ x1_v. Vertices are cut into blocks whose O_v
// stay in the first-level cache; a list of (vertex, weight) by block and joint lets each joint gather its sum, and no
// sum depends on which thread works on which chunk.
#pragma once

#include "core/buffer.h"
#include "core/simd.h"
#include "core/types.h"

namespace hsi4d::detail {

inline constexpr Index kTransformSize = 12;
inline constexpr Index kSparseBlock = 128;  ///< vertices: 12 KB of outer products in double
inline constexpr Index kDenseBlock = 256;   ///< vertices; a multiple of kPanel
inline constexpr Index kPanel = 32;         ///< vertices side by side in a panel of dense weights
inline constexpr Index kSkinGrain = 2048;   ///< vertices of a parallel chunk; a multiple of both blocks
inline constexpr Index kMaxLanes = 16;      ///< of any instruction set, in float
static_assert(kSkinGrain % kSparseBlock == 0 && kSkinGrain % kDenseBlock == 0 && kDenseBlock % kPanel == 0);

/// The entries of one joint in one block: up to `end`, from the end of the segment before. Their number is even, the
/// last one being repeated with weight 0 where needed, so that two sums run side by side without a branch at the end.
struct SkinSegment {
  std::int32_t joint;
  std::int32_t end;
};

/// K weights a vertex, and their transpose by block and joint.
template <class S>
struct SparseTable {
  Index vertices = 0, joints = 0, per_vertex = 0;
  Buffer<std::int32_t> offsets;       ///< [V rounded up to 4, K], 12·joint
  Buffer<S> weights;                  ///< [V rounded up to 4, K]
  Buffer<std::int32_t> block_begin;   ///< [blocks + 1], into segments
  Buffer<SkinSegment> segments;       ///< joints ascending within a block
  Buffer<std::int32_t> entry_offset;  ///< 12·(vertex − first vertex of the block), ascending within a segment
  Buffer<S> entry_weight;
};

/// All J weights of each vertex, in panels [panel, J, kPanel]; zero past the last vertex.
template <class S>
struct DenseTable {
  Index vertices = 0, joints = 0;
  Buffer<S> panels;
};

/// What SkinWeights holds; one of the two tables is used.
template <class S>
struct SkinTables {
  bool is_dense = false;
  SparseTable<S> sparse;
  DenseTable<S> dense;
};

/// Kernels of one instruction set. [begin, end) are vertices; begin is a multiple of kSkinGrain, end too unless it is
/// V. A `partial` is overwritten with the chunk's own sum: [J,12] where sparse, [J,12,kMaxLanes] where dense.
template <class S>
struct SkinKernels {
  using Sparse = const SparseTable<S>&;
  using Dense = const DenseTable<S>&;
  void (*sparse_points)(Sparse, const S* transforms, const S* points, S* result, Index begin, Index end);
  void (*sparse_point_adjoint)(Sparse, const S* transforms, const S* d_result, S* d_points, Index begin, Index end);
  void (*sparse_transform_adjoint)(Sparse, const S* points, const S* d_result, S* partial, Index begin, Index end);
  void (*sparse_blend)(Sparse, const S* transforms, S* blended, Index begin, Index end);
  void (*sparse_blend_adjoint)(Sparse, const S* d_blended, S* partial, Index begin, Index end);
  /// Points and the frames [V,9] that they carry. Of the adjoint, a null `d_posed_points` or `d_posed_frames` is zero.
  void (*sparse_frames)(Sparse, const S* transforms, const S* points, const S* frames, S* posed_points, S* posed_frames,
                        Index begin, Index end);
  void (*sparse_frames_adjoint)(Sparse, const S* points, const S* frames, const S* d_posed_points,
                                const S* d_posed_frames, S* partial, Index begin, Index end);
  /// `saved` [panel, 12, kPanel] receives the blended transforms unless it is null.
  void (*dense_points)(Dense, const S* transforms, const S* points, S* result, S* saved, Index begin, Index end);
  void (*dense_point_adjoint)(const S* saved, const S* d_result, S* d_points, Index begin, Index end);
  void (*dense_transform_adjoint)(Dense, const S* points, const S* d_result, S* partial, Index begin, Index end);
  void (*dense_blend)(Dense, const S* transforms, S* blended, Index begin, Index end);
  void (*dense_blend_adjoint)(Dense, const S* d_blended, S* partial, Index begin, Index end);
  /// d_transforms [J,12] += sums over the chunks and lanes of `partials` [chunks, J, 12, kMaxLanes].
  void (*dense_reduce)(Dense, const S* partials, Index chunks, S* d_transforms);
};

/// The sparse and the dense half of the table, each from its own source file.
template <class S>
void set_sparse_kernels(SkinKernels<S>& kernels, Isa isa);
template <class S>
void set_dense_kernels(SkinKernels<S>& kernels, Isa isa);

template <class S>
SkinKernels<S> skin_kernels(Isa isa) {
  SkinKernels<S> kernels{};
  set_sparse_kernels(kernels, isa);
  set_dense_kernels(kernels, isa);
  return kernels;
}

}  // namespace hsi4d::detail
