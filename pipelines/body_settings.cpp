#include "pipelines/body_settings.h"

#include "body/procedural_body.h"

namespace hsi4d {

void describe(ConfigFields& f, BodySettings& s) {
  f.choice("kind", s.kind, kBodyKinds, "The body that comes with the program, or a model in a SMPL-X file");
  f.path("path", s.path, {.must_exist = true}, "The SMPL-X file (.npz), of kind smplx");
  f.integer("betas", s.betas, {.min = 0, .max = 300}, "Numbers of its shape, of kind smplx");
  f.integer("expressions", s.expressions, {.min = 0, .max = 100}, "Numbers of its expression, of kind smplx");
  f.choice("hands", s.hands, kHandParameters,
           "Numbers of a hand, of kind smplx: all joints, or coefficients of the file's hand components");
  f.integer("hand_components", s.hand_components, {.min = 1, .max = 45}, "How many of them, of hands pca");
  f.boolean("flat_hand_mean", s.flat_hand_mean,
            "Where a hand's numbers are 0 it is flat, and not in the file's mean pose; of kind smplx");
  f.rule({"path", "kind"}, [&s]() -> std::string {
    if (s.kind == BodyKind::kSmplx && s.path.empty()) return "kind smplx needs the file of a body model";
    if (s.kind == BodyKind::kProcedural && !s.path.empty()) return "kind procedural reads no file; kind smplx does";
    return "";
  });
}

SmplxModel read_smplx_body(const BodySettings& settings) {
  HSI4D_CHECK(settings.kind == BodyKind::kSmplx, "the body is not of kind smplx");
  SmplxModel model = read_smplx(settings.path.string(), {settings.betas, settings.expressions});
  for (const SmplxHand& hand : model.hands) {
    if (settings.hands != HandParameters::kPca || hand.component_count() >= settings.hand_components) continue;
    throw DataError(model.source + ": has " + std::to_string(hand.component_count()) + " components of a hand; " +
                    std::to_string(settings.hand_components) + " were asked for (body.hand_components)");
  }
  return model;
}

SmplxBodyOptions smplx_body_options(const BodySettings& settings) {
  SmplxBodyOptions options;
  options.flat_hand_mean = settings.flat_hand_mean;
  return options;
}

BodyModel rest_body(const BodySettings& settings) {
  return settings.kind == BodyKind::kSmplx ? rest_body(read_smplx_body(settings)) : procedural_body();
}

}  // namespace hsi4d
