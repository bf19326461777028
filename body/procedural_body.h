// A body that needs no licence: made by code, in the SMPL-X layout.
#pragma once

#include "body/body_model.h"

namespace hsi4d {

/// An adult of 1.72 m in a T-pose with the 55 joints of SMPL-X, fingers and a closed surface.
///
/// The frame is that of SMPL-X: Y up, x to the body's left, z forward; the pelvis stands 0.35 m below the origin, about
/// where SMPL-X has it, so that a motion made for SMPL-X puts this body in the same place within centimetres.
///
/// @return  the same bits every time; left and right are mirror images. Takes a fraction of a second.
BodyModel procedural_body();

}  // namespace hsi4d
