// L = (1 − λ) L1 + λ (1 − SSIM), the difference of the rendered image and the frame; where pixels have weights B, of
// the two images times B: what does not count is black in both. [3DGS, eq. 7; λ: method, stage 2]
#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/ssim.h"
#include "autodiff/weighted_image.h"
#include "optim/losses/list.h"

namespace hsi4d {

namespace {

struct PhotometricSettings {
  double ssim_share = 0.1;  // λ
};

void describe(ConfigFields& fields, PhotometricSettings& settings) {
  fields.number("ssim_share", settings.ssim_share, {.min = 0, .max = 1},
                "Share of the structural term: (1 - share) L1 + share (1 - SSIM)");
}

template <class S>
Var<S> difference(Var<S> a, Var<S> b, double ssim_share) {
  if (ssim_share == 1) return d_ssim(a, b);
  const Var<S> distance = l1(a, b);
  if (ssim_share == 0) return distance;
  return distance * (1 - ssim_share) + d_ssim(a, b) * ssim_share;
}

}  // namespace

LossTerm photometric_loss() {
  return needing(
      {LossInput::kImage},
      make_loss_term<PhotometricSettings>(
          "photometric", "L1 and structural difference of the rendered image and the frame where the weight says so",
          [](const auto& in, const PhotometricSettings& settings) {
            if (!in.given(in.weight)) return difference(in.rendered, in.target, settings.ssim_share);
            return difference(weighted_image(in.rendered, in.weight), weighted_image(in.target, in.weight),
                              settings.ssim_share);
          }));
}

}  // namespace hsi4d
