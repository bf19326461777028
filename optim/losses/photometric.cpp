// L = (1 − λ) L1 + λ (1 − SSIM), the difference of the rendered image and the frame.
// [3DGS, eq. 7; λ: method, stage 2]
#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/ssim.h"
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

}  // namespace

LossTerm photometric_loss() {
  return make_loss_term<PhotometricSettings>(
      "photometric", "L1 and structural difference of the rendered image and the frame",
      [](const auto& in, const PhotometricSettings& settings) {
        if (!in.given(in.rendered) || !in.given(in.target)) return decltype(in.rendered){};
        const double share = settings.ssim_share;
        if (share == 0) return l1(in.rendered, in.target);
        if (share == 1) return d_ssim(in.rendered, in.target);
        return l1(in.rendered, in.target) * (1 - share) + d_ssim(in.rendered, in.target) * share;
      });
}

}  // namespace hsi4d
