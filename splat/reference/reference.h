// The renderer again, brute force: every pixel looks at every Gaussian in depth order. Slow and obvious, in double and
// in long double; it shares no code with the fast one, which is judged by it.
//
// In the order of the computation, with everything that both renderers must do alike:
//
// 1. Gaussian. μ = A m + a, M = A R(q) S: A and a are the Gaussian's transform (none: identity), q = quaternion/|…|,
//    S = exp(log-scale), the log-scale held in [−20, 20]. A Gaussian contributes nothing, and all its gradients are
//    zero, if a number that it uses is NaN or, log-scales and the opacity logit excepted, infinite, or if its
//    quaternion is zero.
// 2. Camera. p = W (μ − c) with W c = −t: W and t are used as given, so c = −W⁻¹ t, which is −Wᵀ t for a rotation.
//    Gaussians with p_z ≤ near are culled. Depth order is by (key, index), the key being double(p_z), or float(p_z)
//    where settings.depth_key says so; without the setting it is double.
// 3. Projection. u = fx p_x/p_z + cx, v = fy p_y/p_z + cy, and the covariance of the image is
//      cov = V Vᵀ + blur I,   V = J W M,   J = [fx/z  0  −fx h_x/z;  0  fy/z  −fy h_y/z]
//    h_x is x/z held in [−cx/fx − m, (W−cx)/fx + m] with m = (frustum_clamp − 1) W/(2 fx); h_y likewise with fy, cy, H.
//    The mean itself is not held. A covariance without area (det = 0, which needs blur = 0) contributes nothing.
// 4. Opacity. o = 1/(1 + exp(−logit)); with antialias, times sqrt(det V Vᵀ / det cov).
// 5. Colour = max(0, ½ + Σ Y_k(r) sh_k), r = normalize(μ − c) or (0,0,1) where μ = c; the degree is the smaller of
//    settings.sh_degree and the scene's. Directions are not turned back by A. Basis and signs as in INRIA's 3DGS.
// 6. Pixel (row i, column j), centre (j + ½, i + ½), front to back from T = 1: α = min(alpha_cap, o G) with
//    G = exp(−½ dᵀ cov⁻¹ d), d from the mean to the centre. α < alpha_min is skipped (after the cap). footprint =
//    square_3sigma skips a Gaussian everywhere but in the 16 × 16 pixel tiles, from the image's corner, that INRIA's
//    square touches: those of index k (column tiles with p = u − ½, row tiles with p = v − ½; its pixel centres are
//    integers) for which
//      floor((p − r)/16) ≤ k < floor((p + r + 15)/16),   r = ceil(3 sqrt(mid + sqrt(max(0.1, mid² − det)))),
//    mid and det being half the trace and the determinant of cov.
//    stop_rule inclusive: w = T α is added, T ← T (1 − α), and the pixel is finished if T is past the threshold;
//    exclusive: if T (1 − α) would be past the threshold the Gaussian is not added and the pixel is finished. Past the
//    threshold is T < transmittance_stop, or ≤ with stop_when at_or_below. A threshold of 0 never stops, whatever
//    stop_when says.
//
// Gradients are those of the function above as it branched: they stop at a log-scale outside [−20, 20], at a colour
// whose sum ½ + Σ Y sh is ≤ 0, at an x/z or y/z that is held (p_z still moves h/z), at o G > alpha_cap for opacity and
// shape unless cap_gradient is pass, at det V Vᵀ = 0 through the factor of antialias, and in the direction where μ = c.
// Nothing flows through the choice of pixels, the stop or the order.
//
// Accuracy: the exponent is evaluated in the axes of the ellipse and the determinant as |v0 × v1|² plus what the blur
// adds, so that needles lose about half as many digits as with the entries of cov⁻¹ (table M3, M4 of the stability
// catalogue).
#pragma once

#include <array>
#include <vector>

#include "core/types.h"
#include "splat/render_settings.h"

namespace hsi4d::reference {

/// Gaussians as structure of arrays, in the world.
template <class T>
struct Scene {
  Index n = 0;
  int sh_coefficients = 1;        ///< K, one of 1, 4, 9, 16
  std::vector<T> means;           ///< [N,3] metres
  std::vector<T> quats;           ///< [N,4] wxyz, any length but 0
  std::vector<T> log_scales;      ///< [N,3]
  std::vector<T> opacity_logits;  ///< [N]
  std::vector<T> sh;              ///< [N,K,3]
  std::vector<T> transforms;      ///< empty, or [N,3,4]: world_from_rest of each Gaussian, its linear part any matrix
  std::vector<int> groups;        ///< empty, or [N]: group whose opacity the Gaussian counts for; −1: none
};

/// Pinhole camera with OpenCV axes; row-major [W t].
template <class T>
struct Pinhole {
  int width = 0;                          ///< pixels
  int height = 0;                         ///< pixels
  T fx = 0, fy = 0;                       ///< pixels
  T cx = 0, cy = 0;                       ///< pixels, from the image's top left corner
  std::array<T, 12> camera_from_world{};  ///< [3,4]
};

/// What is rendered; as a cotangent, the derivatives of a loss by it, where an empty array stands for zeros.
template <class T>
struct Image {
  std::vector<T> color;          ///< [H,W,3] Σ w c + T background
  std::vector<T> transmittance;  ///< [H,W] T behind the last Gaussian
  std::vector<T> depth_sum;      ///< [H,W] Σ w z, metres
  std::vector<T> group_opacity;  ///< [G,H,W] Σ w over the Gaussians of each group, G = 1 + the highest group
};

/// Derivatives of a loss by everything that a render depends on; shaped as in Scene.
template <class T>
struct Gradients {
  std::vector<T> means, quats, log_scales, opacity_logits, sh;
  std::vector<T> transforms;  ///< empty if the scene has none
  std::array<T, 6> camera{};  ///< at ξ = 0 of T ← Exp(ξ) T, T = camera_from_world, ξ = (translation, rotation)
  std::array<T, 3> background{};
};

/// A Gaussian at a pixel.
template <class T>
struct Fragment {
  Index gaussian = 0;
  T alpha = 0;
  T transmittance = 0;  ///< in front of it
  T uncapped = 0;       ///< o G
  T depth = 0;          ///< p_z, metres
  std::array<T, 3> color{};
};

/// What a pixel is made of.
template <class T>
struct PixelFragments {
  std::vector<Fragment<T>> composited;  ///< front to back; those with α = 0 are left out
  std::vector<Fragment<T>> skipped;     ///< in front of the stop, for an α below alpha_min or 0
  std::vector<Fragment<T>> refused;     ///< the one that the exclusive stop leaves out, if it stops
  bool stopped = false;
  Index behind_stop = 0;  ///< not looked at
  T transmittance = 1;    ///< behind the last
};

/// Image of the scene as described at the top of this file. T is double or long double; single-threaded.
///
/// @param background  colour behind everything
/// Adjoint: gradients. Throws InternalError if sizes contradict each other, sh_coefficients is not 1, 4, 9 or 16, the
/// image has no pixels or a focal length is not positive.
template <class T>
Image<T> render(const Scene<T>& scene, const Pinhole<T>& camera, const std::array<T, 3>& background,
                const RenderSettings& settings);

/// Gradients of the loss whose derivatives by the image are `cotangent`, analytic, without a division by 1 − α:
///
///   v_i = T_i (c_i − S_i),   S_{i−1} = α_i c_i + (1 − α_i) S_i,   S_n = what the background gives
///
/// where c_i is the cotangent times what Gaussian i shows (colour, depth, group) and S_i what is seen behind it [B2,
/// M19].
template <class T>
Gradients<T> gradients(const Scene<T>& scene, const Pinhole<T>& camera, const std::array<T, 3>& background,
                       const RenderSettings& settings, const Image<T>& cotangent);

/// The Gaussians of a pixel.
///
/// Throws as render, and if the pixel is not in the image.
template <class T>
PixelFragments<T> fragments(const Scene<T>& scene, const Pinhole<T>& camera, const RenderSettings& settings, int row,
                            int column);

}  // namespace hsi4d::reference
