// L = mean over the pixels of (m̂ − m)², of the human and of each object: m̂ the rendered opacity Σ T α, occluders
// included, m the mask of the frame; the sum over them is divided by their number.
#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "optim/losses/list.h"

namespace hsi4d {

namespace {

struct MaskSettings {
  bool human = true, objects = true;
};

void describe(ConfigFields& fields, MaskSettings& settings) {
  fields.boolean("human", settings.human, "The human's silhouette counts");
  fields.boolean("objects", settings.objects, "The objects' silhouettes count");
}

}  // namespace

LossTerm mask_loss() {
  LossTerm term = reading(
      make_loss_term<MaskSettings>("mask", "Difference of the rendered silhouettes and the frame's masks",
                                   [](const auto& in, const MaskSettings& settings) {
                                     decltype(in.human_mask) human, objects;
                                     if (settings.human && in.given(in.human_opacity) && in.given(in.human_mask))
                                       human = l2(in.human_opacity, in.human_mask);
                                     if (settings.objects && in.given(in.object_opacity) && in.given(in.object_masks))
                                       objects = l2(in.object_opacity, in.object_masks);
                                     if (human.tape == nullptr) return objects;
                                     if (objects.tape == nullptr) return human;
                                     const auto count = static_cast<double>(in.object_masks.shape().planes);
                                     return human * (1 / (1 + count)) + objects * (count / (1 + count));
                                   }),
      {kReadsHumanOpacity});
  term.description.needs = LossNeeds::kBodyInImage;
  return term;
}

}  // namespace hsi4d
