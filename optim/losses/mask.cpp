// L = Σ over the human and the O objects of v · mean over the pixels of (m̂ − m)², / (1 + O): m̂ the rendered opacity
// Σ T α, occluders included, m the mask of the frame, v 1, or 0 where that shows nothing: a mask that is missing, or of
// something out of sight, says nothing about the place.
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

std::vector<LossInput> opacities_of(const MaskSettings& settings) {
  std::vector<LossInput> inputs;
  if (settings.human) inputs.push_back(LossInput::kHumanOpacity);
  if (settings.objects) inputs.push_back(LossInput::kObjectOpacity);
  return inputs;
}

/// What the frame does not show.
/// @param seen  1 or 0 of each plane
template <class S>
LeftOut unseen(Var<S> seen, bool of_human) {
  return {"mask", "", seen.shape().count(),
          [=](Index object) { return !(seen.owner().value(seen).data[object] >= S(0.5)); }, of_human};
}

/// Mean over planes and pixels, planes that are not seen being 0.
template <class S>
Var<S> silhouettes(const LossInputs<S>& in, Var<S> opacity, Var<S> masks, Var<S> seen, bool of_human) {
  if (in.left_out != nullptr) in.left_out->push_back(unseen(seen, of_human));
  return l2(opacity, masks, seen);
}

}  // namespace

LossTerm mask_loss() {
  return needing<MaskSettings>(
      opacities_of, make_loss_term<MaskSettings>(
                        "mask", "Difference of the rendered silhouettes and the frame's masks",
                        [](const auto& in, const MaskSettings& settings) {
                          decltype(in.human_mask) human, objects;
                          if (settings.human && in.gives(LossInput::kHumanOpacity))
                            human = silhouettes(in, in.human_opacity, in.human_mask, in.human_seen, true);
                          if (settings.objects && in.gives(LossInput::kObjectOpacity))
                            objects = silhouettes(in, in.object_opacity, in.object_masks, in.object_seen, false);
                          if (human.tape == nullptr) return objects;
                          if (objects.tape == nullptr) return human;
                          const auto count = static_cast<double>(in.object_masks.shape().planes);
                          return human * (1 / (1 + count)) + objects * (count / (1 + count));
                        }));
}

}  // namespace hsi4d
