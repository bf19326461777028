// Cameras of a world that `hsi4d align` has put on the ground, in metres.
#pragma once

#include <string>

#include "core/camera.h"
#include "splat/files/transform.h"

namespace hsi4d {

/// The camera that sees the moved world as it saw the other: its depths are `scale` times as large.
Camera moved_camera(const Camera& camera, const Similarity& similarity);

/// The similarity of alignment.json, which `hsi4d align` writes: `matrix` has rows [s R, t].
/// @param name  what messages call it
/// Throws UserError naming file, place, value and what is allowed: no such JSON; as similarity_from_matrix.
Similarity decode_alignment(const std::string& text, const std::string& name);

}  // namespace hsi4d
