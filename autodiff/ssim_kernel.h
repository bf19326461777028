// The vector kernel behind autodiff/ssim.h: one sweep down a window of an image. Not part of the public interface.
#pragma once

#include "core/types.h"

namespace hsi4d::detail {

/// Side of the square tiles whose sums are kept.
inline constexpr Index kSsimTile = 16;
/// The window reaches this many pixels to each side.
inline constexpr Index kSsimRadius = 5;
/// Standard deviation of its Gaussian, pixels.
inline constexpr double kSsimSigma = 1.5;
/// C1 and C2 for values in [0, 1].
inline constexpr double kSsimC1 = 1e-4, kSsimC2 = 9e-4;

/// Pixels [row_begin, row_end) × [col_begin, col_end).
struct SsimRect {
  Index row_begin = 0, row_end = 0, col_begin = 0, col_end = 0;
  bool empty() const { return row_begin >= row_end || col_begin >= col_end; }
};

/// One plane and what a sweep computes of it.
template <class S>
struct SsimSweep {
  const S* x = nullptr;  ///< [rows][stride]
  const S* y = nullptr;  ///< [rows][stride of y]
  Index rows = 0, cols = 0, x_stride = 0, y_stride = 0;
  S c1 = 0, c2 = 0;

  SsimRect sums;                ///< begins at multiples of kSsimTile; ends there or at the image's end
  double* tile_sums = nullptr;  ///< [tile row][tile_stride]: Σ (1 − ssim)/2 of each tile in `sums`, as two numbers of S
  Index tile_stride = 0;
  S* map = nullptr;  ///< [rows][map_stride]: ssim of the pixels of `sums`; may be null
  Index map_stride = 0;

  SsimRect gradient;  ///< within `sums`; may be empty
  S* d_x = nullptr;   ///< [rows][d_stride]: scale · d Σ(1 − ssim) / dx is stored at the pixels of `gradient`
  Index d_stride = 0;
  S scale = 1;
};

/// Elements of S that a sweep whose `sums` are `cols` wide needs as workspace; a multiple of a cache line.
template <class S>
Index ssim_workspace_size(Index cols);

/// Runs the sweep. `workspace` is aligned to kAlignment.
template <class S>
void ssim_sweep(const SsimSweep<S>& job, S* workspace);

}  // namespace hsi4d::detail
