// Structural similarity of two images, and its gradient.
//
//   ssim(u) = (2 m_x m_y + C1)(2 V_xy + C2) / ((m_x² + m_y² + C1)(V_x + V_y + C2))      [Wang et al. 2004, eq. 13]
//
// m and V are mean and (co)variance under an 11×11 Gaussian window with σ = 1.5 whose weights w sum to 1, C1 = (0.01
// R)² and C2 = (0.03 R)² for values in [0, R]. Samples outside of the image are zeros with their full weight (the
// convention of 3D Gaussian splatting). The mean is over all C·H·W values.
//
// Computed in sum s = x + y and difference d = x − y, which leaves four moments instead of five and no cancellation:
//
//   1 − ssim = L + D − L·D,   L = m_d² / P,   P = (m_s² + m_d²)/2 + C1      (1 − luminance)
//                             D = V_d / Q,    Q = (V_s + V_d)/2 + C2        (1 − contrast·structure)
//
// so that ssim(x, x) = 1 exactly and 1 − ssim has a small *relative* error. Variances are central throughout: the
// filter along the other axis combines means and variances as Var = Σ w (v + (m − k)²) − (Σ w m − k)² with k one of the
// means.
//
// Adjoint. With a = ∂(1−ssim)/∂m and b = 2 ∂(1−ssim)/∂V for s and d at every window centre u:
//
//   d/dz_p = Σ_u w(p−u) [a_u + b_u (z_p − m_u)] = Σ_u w(p−u) [c_u + b_u (z_p − z_u)],   c = a + b (z − m),
//   a_d = (1−D) m_d (2−L)/P   a_s = −(1−D) m_s L/P   b_d = (1−L)(2−D)/Q   b_s = −(1−L) D/Q
//
// which is a separable filter of c and b, in differences for d; for s the terms are small where d is, and
// Σ_u w [c_u + …] is taken as c = a − b m and z_p Σ_u w b. The gradient is d/dd + d/ds for x; y has that of swapped
// roles.
//
// Flat areas of any level keep their accuracy in float: ssim of each pixel within 1e-6, gradient within 3e-5 in
// relative L2 (row E1: variance cancels).
#pragma once

#include "autodiff/tape.h"

namespace hsi4d {

struct SsimSettings {
  double data_range = 1;  ///< R: 1 for values in [0,1], 255 for [0,255]; within [1e-6, 1e6]
};

/// D-SSIM: 1 − mean ssim of two images.
///
/// @param image   [C,H,W]
/// @param target  [C,H,W]
/// @return        scalar in [0, 2]; NaN where an input is not finite
/// Adjoint: image, target. Forward computes the gradients of the inputs that need one in the same sweep. Where `image`
/// tells which squares changed (NodeIo::changed), the others' sums are kept: the same bits.
/// Throws InternalError for different or empty shapes, or a data range outside of its limits.
template <class S>
Var<S> d_ssim(Var<S> image, Var<S> target, const SsimSettings& settings = {}, Source where = Source::current());

/// Mean ssim, 1 − d_ssim. See there.
template <class S>
Var<S> ssim(Var<S> image, Var<S> target, const SsimSettings& settings = {}, Source where = Source::current());

/// Mean ssim of two images [C,H,W], without a tape (a metric). Throws as d_ssim.
template <class S>
double mean_ssim(const ConstArray<S>& image, const ConstArray<S>& target, const SsimSettings& settings = {});

/// ssim of every pixel, into `map` [C,H,W]. A value that is not finite stays within 5 pixels. Returns the mean ssim.
template <class S>
double ssim_map(const ConstArray<S>& image, const ConstArray<S>& target, const Array<S>& map,
                const SsimSettings& settings = {});

}  // namespace hsi4d
