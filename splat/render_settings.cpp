#include "splat/render_settings.h"

namespace hsi4d {

void apply_quality(RenderSettings& settings, Quality quality) {
  settings.quality = quality;
  settings.alpha_cap = kAlphaCap;
  settings.alpha_min = kAlphaMin;
  settings.transmittance_stop = kTransmittanceStop;
  settings.depth_key.reset();
  switch (quality) {
    case Quality::kDefault:
      break;
    case Quality::kFast:
      settings.transmittance_stop = kTransmittanceStopFast;
      break;
    case Quality::kAccurate:
      settings.alpha_cap = kNoAlphaCap;
      settings.alpha_min = kAlphaMinAccurate;
      settings.transmittance_stop = kTransmittanceStopAccurate;
      break;
    case Quality::kReference:
      settings.alpha_cap = kNoAlphaCap;
      settings.alpha_min = 0;
      settings.transmittance_stop = 0;
      settings.depth_key = DepthKey::kDouble;
      break;
  }
}

void apply_compatibility(RenderSettings& settings, Compatibility compatibility) {
  settings.compatibility = compatibility;
  if (compatibility == Compatibility::kNone) return;
  const bool inria = compatibility == Compatibility::kInria;
  settings.alpha_cap = kAlphaCapCompatible;
  settings.alpha_min = kAlphaMin;
  settings.transmittance_stop = kTransmittanceStopCompatible;
  settings.stop_rule = StopRule::kExclusive;
  settings.stop_when = inria ? StopWhen::kBelow : StopWhen::kAtOrBelow;
  settings.cap_gradient = inria ? CapGradient::kPass : CapGradient::kZero;
  settings.footprint = inria ? Footprint::kSquare3Sigma : Footprint::kExact;
  settings.blur = kBlur;
  settings.near = inria ? kNearInria : kNear;
  settings.frustum_clamp = kFrustumClamp;
}

void describe(ConfigFields& f, RenderSkips& s) {
  f.boolean("static_tiles", s.static_tiles,
            "Prepare what stands still once, and render only blocks that something touches which moves");
  f.boolean("static_layer", s.static_layer,
            "Composite what stands in front of all that moves once, and leave it and what stands behind out of the "
            "backward pass");
  f.boolean("unchanged_pixels", s.unchanged_pixels,
            "Leave pixels out of the losses that are as they were in the iteration before");
  f.boolean("unseen_gaussians", s.unseen_gaussians,
            "Leave Gaussians of the scene out that the camera cannot see in a stage, however far it moves there");
  f.boolean("zero_cotangent", s.zero_cotangent, "Leave tiles out of the backward pass where the loss sees nothing");
}

void describe(ConfigFields& f, RenderSettings& s) {
  f.choice("quality", s.quality, kQualities, "Preset of alpha_cap, alpha_min, transmittance_stop and depth_key");
  f.choice("compatibility", s.compatibility, kCompatibilities,
           "Preset that makes the numbers of another renderer; quality then stays default");
  f.rule({"quality", "compatibility"}, [&s]() -> std::string {
    const bool both = s.quality != Quality::kDefault && s.compatibility != Compatibility::kNone;
    return both ? "quality and compatibility set the same keys; write one of the two" : "";
  });
  f.then([&s] {
    if (s.quality != Quality::kDefault) apply_quality(s, s.quality);
    apply_compatibility(s, s.compatibility);
  });
  f.number("alpha_cap", s.alpha_cap, {.above = 0, .max = 1}, "Alpha is held at or below this; 1: no cap");
  f.number("alpha_min", s.alpha_min, {.min = 0, .below = 1},
           "A Gaussian fainter than this at a pixel is skipped there; 0: none is");
  f.number("transmittance_stop", s.transmittance_stop, {.min = 0, .below = 1},
           "A pixel is finished when its transmittance falls below this; 0: when no Gaussian is left");
  f.choice("stop_rule", s.stop_rule, kStopRules,
           "inclusive adds the Gaussian that crosses transmittance_stop and then stops; exclusive does not add it");
  f.choice("stop_when", s.stop_when, kStopWhens, "Whether a transmittance equal to transmittance_stop stops");
  f.choice("cap_gradient", s.cap_gradient, kCapGradients,
           "Gradient of opacity and shape where alpha_cap holds: zero, or passed as if there were no cap");
  f.choice("footprint", s.footprint, kFootprints,
           "Pixels that a Gaussian may touch: exactly those of alpha_min, or a square of 3 standard deviations");
  f.number("blur", s.blur, {.min = 0, .max = 100}, "Variance of the pixel filter, pixels squared");
  f.boolean("antialias", s.antialias,
            "Scale opacity down by what the blur widens, so that thin Gaussians keep their weight");
  f.number("near", s.near, {.above = 0, .max = 1000}, "Gaussians at or nearer than this depth are culled, metres");
  f.number("frustum_clamp", s.frustum_clamp, {.min = 1, .max = 100},
           "x/z and y/z of the projection's Jacobian are held within this many half-widths of the view");
  f.integer("sh_degree", s.sh_degree, {.min = 0, .max = kHighestShDegree},
            "Highest degree of spherical harmonics used");
  f.optional(s.depth_key, [](ConfigFields& inner, DepthKey& key) {
    inner.choice("depth_key", key, kDepthKeys, "Type in which depths are compared; null: that of the render");
  });
  f.integer("tile", s.tile, {.min = 8, .max = 16, .multiple_of = 8}, "Side of a tile, pixels");
  f.rule({"alpha_min", "alpha_cap", "quality", "compatibility"}, [&s]() -> std::string {
    return s.alpha_min < s.alpha_cap ? "" : "alpha_min must be below alpha_cap, or nothing is drawn";
  });
}

}  // namespace hsi4d
