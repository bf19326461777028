// The middle part of a curvature (autodiff/curvature.h) in one tile: Σ w a aᵀ over its pixels and channels, a =
// ∂C/∂twists.
//
//   ∂C_pc/∂twist_b = Σ_i α_i T_i (f_ic − S_ic) (Lᵀ(u, w))ᵀ ∂m_i/∂twist_b,
//
// with the sums and names of composite.h: i the Gaussians of pixel p from front to back, S what is seen behind, m their
// means. The image is there, so S needs no second pass: R_i = C − Σ_{j ≤ i} T_j α_j f_j = T_{i+1} S_i, and α T S =
// R α/(1 − α). The gate of the cap is as in the adjoint. Used by composite.cpp.
#pragma once

#include <span>
#include <vector>

#include "autodiff/twists.h"
#include "splat/render/composite_kernel.h"
#include "splat/render/tile_image.h"

namespace hsi4d::detail {

/// What all tiles share.
template <class S>
struct CurvatureScene {
  CompositeScene<S> scene;
  const Twists<S>* twists[2];  ///< of rows before scene.second, and from there; null: they do not move
  OutputImages<S> images;
  OutputCotangents<S> weights;  ///< w of the images' pixels; empty where there is none
  Index movers;
};

/// One tile.
template <class S>
struct CurvatureTile {
  std::span<const TileEntry> entries;
  Index side, left, top, width, height;  ///< as in TileJob
  const S* start;                        ///< state in front of the entries as in BlockJob; null: that of nothing
};

/// Memory of a worker.
template <class S>
struct CurvatureWorkspace {
  std::vector<S> rates;                         ///< [movers][channels][6][16] a of a block's pixels, by slot
  std::vector<std::int32_t> slot_of, mover_of;  ///< by mover, −1: none; by slot
};

/// Adds the tile's Σ w a aᵀ.
///
/// @param sum  [6 movers, 6 movers] by rows, of which blocks on the diagonal and below are added to
template <class S>
void add_tile_curvature(const CurvatureScene<S>& all, const CurvatureTile<S>& tile, CurvatureWorkspace<S>& workspace,
                        double* sum);

extern template void add_tile_curvature(const CurvatureScene<float>&, const CurvatureTile<float>&,
                                        CurvatureWorkspace<float>&, double*);
extern template void add_tile_curvature(const CurvatureScene<double>&, const CurvatureTile<double>&,
                                        CurvatureWorkspace<double>&, double*);

}  // namespace hsi4d::detail
