// L = (1 − λ) mean ρ(d) + λ (1 − SSIM), d the differences of the rendered image and the frame, a colour of a pixel
// each; where pixels have weights B, of the two images times B: what does not count is black in both. [3DGS, eq. 7; λ:
// method, stage 2]   ρ: absolute |d|; huber d²/(2 s) up to the scale s, then |d| − s/2; geman_mcclure s d²/(s² + d²).
// The structural part of a pixel is at most 2 whatever it shows, and has no kernel.
#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "autodiff/ssim.h"
#include "autodiff/weighted_image.h"
#include "optim/losses/list.h"
#include "optim/losses/robust.h"

namespace hsi4d {

namespace {

constexpr std::array<ConfigChoice<RobustKernel>, 3> kKernels = {{{RobustKernel::kNone, "absolute"},
                                                                 {RobustKernel::kHuber, "huber"},
                                                                 {RobustKernel::kGemanMcClure, "geman_mcclure"}}};

struct PhotometricSettings {
  double ssim_share = 0.1;  // λ
  RobustKernel kernel = RobustKernel::kNone;
  double scale = 0.1;
};

void describe(ConfigFields& fields, PhotometricSettings& settings) {
  fields.number("ssim_share", settings.ssim_share, {.min = 0, .max = 1},
                "Share of the structural term: (1 - share) L1 + share (1 - SSIM)");
  fields.choice("kernel", settings.kernel, kKernels,
                "Of a colour's difference in place of L1: absolute, which is L1; huber, L1 beyond scale; "
                "geman_mcclure, by which one far beyond scale no longer pulls");
  fields.number("scale", settings.scale, {.above = 0, .max = 10},
                "Difference up to which a kernel is nearly the square; 0.1 is 25 grey levels of 255");
  fields.rule({"scale", "kernel"}, [&settings] {
    return idle_scale_text(settings.kernel, settings.scale, PhotometricSettings().scale, "absolute");
  });
  fields.rule({"kernel", "ssim_share"}, [&settings]() -> std::string {
    if (settings.kernel == RobustKernel::kNone || settings.ssim_share < 1) return "";
    return "there is nothing that a kernel counts: ssim_share is 1; allowed: less, or \"absolute\"";
  });
}

/// Mean ρ of the differences.
template <class S>
Var<S> distance(Var<S> a, Var<S> b, const PhotometricSettings& settings) {
  if (settings.kernel == RobustKernel::kNone) return l1(a, b);
  const float scale = static_cast<float>(settings.scale);
  const double count = static_cast<double>(a.shape().count());
  if (settings.kernel == RobustKernel::kHuber)
    return sum_over({a, b}, [scale](auto x, auto y) { return huber(square(x - y), scale); }) *
           (0.5 / settings.scale / count);
  return sum_over({a, b}, [limit = scale * scale](auto x, auto y) { return geman_mcclure(square(x - y), limit); }) *
         (1 / settings.scale / count);
}

template <class S>
Var<S> difference(Var<S> a, Var<S> b, const PhotometricSettings& settings) {
  const double ssim_share = settings.ssim_share;
  if (ssim_share == 1) return d_ssim(a, b);
  const Var<S> apart = distance(a, b, settings);
  if (ssim_share == 0) return apart;
  return apart * (1 - ssim_share) + d_ssim(a, b) * ssim_share;
}

}  // namespace

LossTerm photometric_loss() {
  return needing(
      {LossInput::kImage},
      make_loss_term<PhotometricSettings>(
          "photometric", "L1 and structural difference of the rendered image and the frame where the weight says so",
          [](const auto& in, const PhotometricSettings& settings) {
            if (!in.given(in.weight)) return difference(in.rendered, in.target, settings);
            return difference(weighted_image(in.rendered, in.weight), weighted_image(in.target, in.weight), settings);
          }));
}

}  // namespace hsi4d
