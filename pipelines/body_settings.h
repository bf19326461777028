// Config section `body`: which body model is used, and how its files are read.
#pragma once

#include <array>
#include <filesystem>
#include <vector>

#include "body/smplx_body.h"
#include "core/config.h"

namespace hsi4d {

/// Where the body comes from.
enum class BodyKind { kProcedural, kSmplx };

/// The numbers by which hands are posed.
enum class HandParameters { kFull, kPca };

inline constexpr std::array<ConfigChoice<BodyKind>, 2> kBodyKinds = {
    {{BodyKind::kProcedural, "procedural"}, {BodyKind::kSmplx, "smplx"}}};
inline constexpr std::array<ConfigChoice<HandParameters>, 2> kHandParameters = {
    {{HandParameters::kFull, "full"}, {HandParameters::kPca, "pca"}}};

/// The body model.
struct BodySettings {
  BodyKind kind = BodyKind::kProcedural;
  std::filesystem::path path;  ///< of kind smplx
  Index betas = 10;
  std::vector<double> shape;  ///< the betas of the rest pose; those beyond its end are 0
  Index expressions = 10;
  HandParameters hands = HandParameters::kFull;
  Index hand_components = 12;  ///< of hands pca
  bool flat_hand_mean = false;
};

void describe(ConfigFields& fields, BodySettings& settings);

/// The model that the settings name, in the layout of SMPL-X; weights that were repaired are told in the log. Throws as
/// read_smplx; DataError when it has fewer betas or hand components than are asked for.
SmplxModel body_model_of(const BodySettings& settings);

/// What the settings say of how that model is prepared.
SmplxBodyOptions smplx_body_options(const BodySettings& settings);

/// The body in its rest pose and its shape, whatever its kind. Throws as body_model_of.
BodyModel rest_body(const BodySettings& settings);

}  // namespace hsi4d
