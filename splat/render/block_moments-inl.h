// Moments of the block kernel's adjoint: sums over the pixels of a block, of a batch of Gaussians at a time. Compiled
// once for each instruction set.
#if defined(HSI4D_SPLAT_BLOCK_MOMENTS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef HSI4D_SPLAT_BLOCK_MOMENTS_INL_H
#undef HSI4D_SPLAT_BLOCK_MOMENTS_INL_H
#else
#define HSI4D_SPLAT_BLOCK_MOMENTS_INL_H
#endif

#include "splat/render/block_chunk-inl.h"
#include "splat/render/block_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace hsi4d::detail::HWY_NAMESPACE {

/// Sums of a batch over the pixels of each row, by quads: lanes of rows and Gaussians.
struct BatchSums {
  V moments[kMoments][kQuads][kParts];
  V features[kMostBlockChannels][kQuads][kParts];
};

/// Moments of pixels −1.5, −0.5, 0.5, 1.5 from the centre: 1, x, x².
struct LineMoments {
  V one, x, xx;
};
HWY_INLINE LineMoments line_moments(V a, V b, V c, V e) {
  const D d;
  const V outer = hn::Add(a, e), inner = hn::Add(b, c);
  const V outer_difference = hn::Sub(e, a), inner_difference = hn::Sub(c, b);
  return {hn::Add(outer, inner),
          hn::MulAdd(hn::Set(d, 1.5f), outer_difference, hn::Mul(hn::Set(d, 0.5f), inner_difference)),
          hn::MulAdd(hn::Set(d, 2.25f), outer, hn::Mul(hn::Set(d, 0.25f), inner))};
}

/// Moments of v over the pixels of each row, 1, x, x²: numbers 0, 1 and 3 of `sums`.
HWY_INLINE void quad_moments(V (&v)[4][kParts], int q, BatchSums& sums) {
  transpose4(v);
  for (int j = 0; j < kParts; ++j) {
    const LineMoments m = line_moments(v[0][j], v[1][j], v[2][j], v[3][j]);
    sums.moments[0][q][j] = m.one;
    sums.moments[1][q][j] = m.x;
    sums.moments[3][q][j] = m.xx;
  }
}

/// Moments of a batch from those of its rows: 1, x, y, x², x y, y².
HWY_INLINE void block_moments([[maybe_unused]] const Block& b, BatchSums& sums, OfBatch* moments) {
#if HWY_CAP_GE512 && HWY_ARCH_X86
  V(&one)[kQuads][kParts] = sums.moments[0], (&x)[kQuads][kParts] = sums.moments[1];
  transpose_blocks(one[0][0], one[1][0], one[2][0], one[3][0]);
  transpose_blocks(x[0][0], x[1][0], x[2][0], x[3][0]);
  const LineMoments of_one = line_moments(one[0][0], one[1][0], one[2][0], one[3][0]);
  const LineMoments of_x = line_moments(x[0][0], x[1][0], x[2][0], x[3][0]);
  sum_over_rows(sums.moments[3], moments[3]);
  moments[0].v[0] = of_one.one;
  moments[1].v[0] = of_x.one;
  moments[2].v[0] = of_one.x;
  moments[4].v[0] = of_x.x;
  moments[5].v[0] = of_one.xx;
#else
  for (int q = 0; q < kQuads; ++q) {
    for (int j = 0; j < kParts; ++j) {
      sums.moments[2][q][j] = hn::Mul(sums.moments[0][q][j], b.row[j]);
      sums.moments[4][q][j] = hn::Mul(sums.moments[1][q][j], b.row[j]);
      sums.moments[5][q][j] = hn::Mul(sums.moments[2][q][j], b.row[j]);
    }
  }
  for (int m = 0; m < kMoments; ++m) sum_over_rows(sums.moments[m], moments[m]);
#endif
}

/// Moments in u and w, formed in each pixel: for Gaussians so thin that those in x and y cancel.
HWY_INLINE void quad_moments_exact(const BlockWorkspace& space, const Block& b, Index at, const V (&v)[4][kParts],
                                   int q, BatchSums& sums) {
  V of[kMoments][4][kParts];
  for (int i = 0; i < 4; ++i) {
    const PackedSplat& g = space.packed[space.list[at + i]];
    for (int j = 0; j < kParts; ++j) {
      const UW uw = uw_at(g, space.centers + 2 * (at + i), b.col[j], b.row[j]);
      const V vu = hn::Mul(v[i][j], uw.u), vw = hn::Mul(v[i][j], uw.w);
      const V moments[kMoments] = {v[i][j], vu, vw, hn::Mul(vu, uw.u), hn::Mul(vu, uw.w), hn::Mul(vw, uw.w)};
      for (int m = 0; m < kMoments; ++m) of[m][i][j] = moments[m];
    }
  }
  for (int m = 0; m < kMoments; ++m) {
    transpose4(of[m]);
    for (int j = 0; j < kParts; ++j) {
      sums.moments[m][q][j] = hn::Add(hn::Add(of[m][0][j], of[m][1][j]), hn::Add(of[m][2][j], of[m][3][j]));
    }
  }
}

/// Moments in x and y about the block's centre to moments in u and w.
HWY_INLINE void to_uw(const float* const (&splats)[kBatch], const Block& b, OfBatch* m) {
  const D d;
  OfBatch low[4], high[4];
  const float* upper[kBatch];
  for (int i = 0; i < kBatch; ++i) upper[i] = splats[i] + 4;
  load_fours(splats, low);
  load_fours(upper, high);
  const V bx = hn::Set(d, b.center_x), by = hn::Set(d, b.center_y);
  for (int j = 0; j < kBatch / kLanes; ++j) {
    const V l11 = low[0].v[j], l21 = low[1].v[j], l22 = low[2].v[j];
    const V u = hn::MulAdd(l11, bx, hn::MulAdd(l21, by, high[0].v[j])), w = hn::MulAdd(l22, by, high[1].v[j]);
    const V one = m[0].v[j], x = m[1].v[j], y = m[2].v[j], xx = m[3].v[j], xy = m[4].v[j], yy = m[5].v[j];
    const V a = hn::MulAdd(l11, x, hn::Mul(l21, y)), c = hn::Mul(l22, y);
    const V axy = hn::MulAdd(l11, xy, hn::Mul(l21, yy));
    const V aa = hn::MulAdd(l11, hn::MulAdd(l11, xx, hn::Mul(l21, xy)), hn::Mul(l21, axy));
    const V of_u = hn::MulAdd(u, one, a), of_w = hn::MulAdd(w, one, c);
    m[1].v[j] = of_u;
    m[2].v[j] = of_w;
    m[3].v[j] = hn::MulAdd(u, hn::Add(a, of_u), aa);
    m[4].v[j] = hn::MulAdd(u, of_w, hn::MulAdd(w, a, hn::Mul(l22, axy)));
    m[5].v[j] = hn::MulAdd(w, hn::Add(c, of_w), hn::Mul(l22, hn::Mul(l22, yy)));
  }
}

}  // namespace hsi4d::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // HSI4D_SPLAT_BLOCK_MOMENTS_INL_H
