// Config section `body`: which body model is used.
#pragma once

#include <array>
#include <filesystem>
#include <vector>

#include "body/smplx_file.h"
#include "core/config.h"

namespace hsi4d {

/// Where the body comes from.
enum class BodyKind { kProcedural, kSmplx };

inline constexpr std::array<ConfigChoice<BodyKind>, 2> kBodyKinds = {
    {{BodyKind::kProcedural, "procedural"}, {BodyKind::kSmplx, "smplx"}}};

/// The body model.
struct BodySettings {
  BodyKind kind = BodyKind::kProcedural;
  std::filesystem::path path;  ///< of kind smplx
  Index betas = 10;
  std::vector<double> shape;  ///< the betas of the rest pose; those beyond its end are 0
};

/// Describes the section: every setting with its range.
void describe(ConfigFields& fields, BodySettings& settings);

/// The model that the settings name, in the layout of SMPL-X, without expressions; weights that were repaired are told
/// in the log. Throws as read_smplx; DataError when it has fewer betas than are asked for.
SmplxModel body_model_of(const BodySettings& settings);

/// The body in its rest pose and its shape, whatever its kind. Throws as body_model_of.
BodyModel rest_body(const BodySettings& settings);

}  // namespace hsi4d
