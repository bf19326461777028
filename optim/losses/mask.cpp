// L = Σ over the people and the O objects of v · mean over the pixels of ρ((m̂ − m)²), / (1 + O): m̂ the rendered opacity
// Σ T α, occluders included, m the mask of the frame, v 1, or 0 where that shows nothing: a mask that is missing, or of
// something out of sight, says nothing about the place.   ρ: squared d²; huber and geman_mcclure of robust.h.
#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/map.h"
#include "optim/losses/list.h"
#include "optim/losses/robust.h"

namespace hsi4d {

namespace {

struct MaskSettings {
  bool human = true, objects = true;
  RobustKernel kernel = RobustKernel::kNone;
  double scale = 0.5;
};

void describe(ConfigFields& fields, MaskSettings& settings) {
  fields.boolean("human", settings.human, "The human's silhouette counts");
  fields.boolean("objects", settings.objects, "The objects' silhouettes count");
  fields.choice("kernel", settings.kernel, kSquareKernels,
                "Of a pixel's difference: its square; huber, constant pull beyond scale; geman_mcclure, by which one "
                "far beyond scale no longer pulls");
  fields.number("scale", settings.scale, {.above = 0, .max = 10},
                "Difference of opacity and mask up to which a kernel is nearly the square");
  fields.rule({"scale", "kernel"}, [&settings] {
    return idle_scale_text(settings.kernel, settings.scale, MaskSettings().scale, "squared");
  });
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

/// Mean over planes and pixels, planes that are not seen being 0, whatever is in them.
template <class S>
Var<S> difference(Var<S> opacity, Var<S> masks, Var<S> seen, const MaskSettings& settings) {
  if (settings.kernel == RobustKernel::kNone) return l2(opacity, masks, seen);
  const auto mean_of = [&](auto kernel) {
    const auto term = [kernel](auto rendered, auto mask, auto v) {
      const auto each = kernel(square(rendered - mask));
      const bool counts = (value_of(v) != 0) | (value_of(each) - value_of(each) == 0);
      return v * select(counts, each, S(0));
    };
    return sum_over({opacity, masks, seen}, term) * (1 / static_cast<double>(opacity.shape().count()));
  };
  const float scale = static_cast<float>(settings.scale);
  if (settings.kernel == RobustKernel::kHuber) return mean_of([scale](auto squared) { return huber(squared, scale); });
  return mean_of([limit = scale * scale](auto squared) { return geman_mcclure(squared, limit); });
}

template <class S>
Var<S> silhouettes(const LossInputs<S>& in, Var<S> opacity, Var<S> masks, Var<S> seen, bool of_human,
                   const MaskSettings& settings) {
  if (in.left_out != nullptr) in.left_out->push_back(unseen(seen, of_human));
  return difference(opacity, masks, seen, settings);
}

}  // namespace

LossTerm mask_loss() {
  return needing<MaskSettings>(
      opacities_of, make_loss_term<MaskSettings>(
                        "mask", "Difference of the rendered silhouettes and the frame's masks",
                        [](const auto& in, const MaskSettings& settings) {
                          decltype(in.human_mask) human, objects;
                          if (settings.human && in.gives(LossInput::kHumanOpacity))
                            human = silhouettes(in, in.human_opacity, in.human_mask, in.human_seen, true, settings);
                          if (settings.objects && in.gives(LossInput::kObjectOpacity))
                            objects =
                                silhouettes(in, in.object_opacity, in.object_masks, in.object_seen, false, settings);
                          if (human.tape == nullptr) return objects;
                          if (!settings.objects || !in.given(in.object_masks)) return human;
                          const auto count = static_cast<double>(in.object_masks.shape().planes);
                          human = human * (1 / (1 + count));
                          return objects.tape == nullptr ? human : human + objects * (count / (1 + count));
                        }));
}

}  // namespace hsi4d
