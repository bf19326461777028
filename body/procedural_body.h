// A body that needs no licence: made by code, in the SMPL-X layout.
#pragma once

#include <span>
#include <string>

#include "body/body_model.h"
#include "body/smplx_file.h"

namespace hsi4d {

/// An adult of 1.72 m in a T-pose with the 55 joints of SMPL-X, fingers and a closed surface.
///
/// The frame is that of SMPL-X: Y up, x to the body's left, z forward; the pelvis stands 0.35 m below the origin, about
/// where SMPL-X has it, so that a motion made for SMPL-X puts this body in the same place within centimetres.
///
/// @return  the same bits every time; left and right are mirror images. The first call makes it, in a fraction of a
///          second; later ones copy it.
BodyModel procedural_body();

/// Numbers of the program's body's shape.
inline constexpr Index kProceduralBetas = 10;

/// The same body as a model with a shape space and a pose space of its hands, for all that takes a SMPL-X file. It has
/// no expressions and no pose correctives.
///
/// Betas, a unit of each about a standard deviation among adults: height, weight, length of legs, of arms, of the
/// torso, width of shoulders, of hips, belly, size of the head, of hands and feet. Hands are relaxed where their
/// numbers are 0; their components are closing (1: a fist), spreading, and the thumb across the palm.
///
/// Beyond some shapes the surface folds over: see procedural_shape_fault.
///
/// @param betas  how many of them, 0 to kProceduralBetas
SmplxModel procedural_smplx(Index betas = 10);

/// A bone of the procedural body is this many times as long or thick as the mean body's, at least and at most. Thinner
/// ones fold at the seams to their neighbours, and below 0 turn inside out.
inline constexpr double kLeastStretch = 0.5, kLargestStretch = 2;

/// What is wrong with a shape of the procedural body, "makes spine1 -0.6 times as deep as the mean body's; allowed: 0.5
/// to 2"; empty where nothing is. Betas add up, so each being small is not enough.
/// @param betas  at most kProceduralBetas
std::string procedural_shape_fault(std::span<const double> betas);

}  // namespace hsi4d
