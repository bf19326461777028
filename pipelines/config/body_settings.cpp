#include "pipelines/config/body_settings.h"

#include "body/pose_layout.h"
#include "body/procedural_body.h"

namespace hsi4d {

void describe(ConfigFields& f, BodySettings& s) {
  f.choice("kind", s.kind, kBodyKinds, "The program's own body, or a SMPL-X file");
  f.path("path", s.path, {.must_exist = true}, "SMPL-X file (.npz), for kind smplx");
  f.integer("betas", s.betas, {.min = 0, .max = kMostBetas}, "Number of shape parameters; procedural has 10");
  f.numbers("shape", s.shape, {.min = -kLargestBeta, .max = kLargestBeta},
            "Betas of the avatar that synth makes; those left out are 0");
  f.rule({"path", "kind"}, [&s]() -> std::string {
    if (s.kind == BodyKind::kSmplx && s.path.empty()) return "kind smplx needs the file of a body model";
    if (s.kind == BodyKind::kProcedural && !s.path.empty()) return "kind procedural reads no file; kind smplx does";
    return "";
  });
  f.rule({"betas", "kind"}, [&s]() -> std::string {
    const bool too_many = s.kind == BodyKind::kProcedural && s.betas > kProceduralBetas;
    return too_many ? "the body of kind procedural has " + std::to_string(kProceduralBetas) : "";
  });
  f.rule({"shape", "betas"}, [&s]() -> std::string {
    const Index given = static_cast<Index>(s.shape.size());
    return given > s.betas ? std::to_string(given) + " numbers; body.betas allows " + std::to_string(s.betas) : "";
  });
  f.rule({"shape", "kind"}, [&s]() -> std::string {
    const bool fits = s.kind == BodyKind::kProcedural && std::ssize(s.shape) <= kProceduralBetas;
    return fits ? procedural_shape_fault(s.shape) : "";
  });
}

}  // namespace hsi4d
