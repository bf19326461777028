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
            "Prepare what stands still once; render only blocks that something moving touches");
  f.boolean("static_layer", s.static_layer,
            "Composite what is static before all that moves once; the backward pass skips it and what is behind");
  f.boolean("unchanged_pixels", s.unchanged_pixels, "Losses skip pixels that are as in the iteration before");
  f.boolean("unseen_gaussians", s.unseen_gaussians,
            "Leave out Gaussians of the scene that the camera cannot see, however far the stage may move it");
  f.boolean("zero_cotangent", s.zero_cotangent, "The backward pass skips tiles in which the loss sees nothing");
}

void describe(ConfigFields& f, RenderSettings& s) {
  f.choice("quality", s.quality, kQualities, "Preset of alpha_cap, alpha_min, transmittance_stop and depth_key");
  f.choice("compatibility", s.compatibility, kCompatibilities,
           "Preset that matches another renderer; quality then stays default");
  f.rule({"quality", "compatibility"}, [&s]() -> std::string {
    const bool both = s.quality != Quality::kDefault && s.compatibility != Compatibility::kNone;
    return both ? "quality and compatibility set the same keys; write one of the two" : "";
  });
  f.then([&s] {
    if (s.quality != Quality::kDefault) apply_quality(s, s.quality);
    apply_compatibility(s, s.compatibility);
  });
  f.number("alpha_cap", s.alpha_cap, {.above = 0, .max = 1}, "Upper limit of alpha; 1: none");
  f.number("alpha_min", s.alpha_min, {.min = 0, .below = 1},
           "A Gaussian fainter than this at a pixel is skipped there; 0: none");
  f.number("transmittance_stop", s.transmittance_stop, {.min = 0, .below = 1},
           "A pixel is finished when its transmittance falls below this; 0: after the last Gaussian");
  f.choice("stop_rule", s.stop_rule, kStopRules,
           "Whether the Gaussian that crosses transmittance_stop is added (inclusive) or not");
  f.choice("stop_when", s.stop_when, kStopWhens, "Whether a transmittance equal to transmittance_stop stops");
  f.choice("cap_gradient", s.cap_gradient, kCapGradients,
           "Gradient of opacity and shape where alpha_cap holds: zero, or as without a cap");
  f.choice("footprint", s.footprint, kFootprints,
           "Pixels that a Gaussian may touch: those of alpha_min, or a square of 3 standard deviations");
  f.number("blur", s.blur, {.min = 0, .max = 100}, "Variance of the pixel filter, pixels squared");
  f.boolean("antialias", s.antialias,
            "Lower opacity by what the blur widens, so that thin Gaussians keep their weight");
  f.number("near", s.near, {.above = 0, .max = 1000}, "Gaussians at or nearer than this depth are culled, metres");
  f.number("frustum_clamp", s.frustum_clamp, {.min = 1, .max = 100},
           "Limit of x/z and y/z in the projection's Jacobian, in half-widths of the view");
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
