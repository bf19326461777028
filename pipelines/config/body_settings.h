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

}  // namespace hsi4d
