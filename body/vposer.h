// VPoser v2: body poses as 32 numbers that are normally distributed over natural poses. [Pavlakos et al. 2019, section
// 3.2; the second version's network]
//
//   decoder   z → 512 → LeakyReLU → 512 → LeakyReLU → 126 = 21 × (3 × 2), columns a, b → rotations (rotations_from_6d)
//   encoder   (w − μ₁)/√(σ₁² + ε) γ₁ + β₁ → 512 → LeakyReLU → the same with μ₂ … → 512 → 512 → 32, the mean of z
//
// w are the axis-angle vectors of the 21 joints, slope 0.01, ε 1e-5. What follows the encoder's LeakyReLU has no bend
// in it and is one map; the first normalisation goes into the first map. The encoder's spread and dropout are of
// training.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "autodiff/frozen_linear.h"
#include "body/pose_layout.h"

namespace hsi4d {

/// Joints of a body pose: SMPL-X's 1 to 21.
inline constexpr Index kBodyPoseJoints = kBodyJoints - 1;

/// An affine map, by rows as PyTorch has it.
struct LinearWeights {
  std::vector<double> weight;  ///< [out,in]
  std::vector<double> bias;    ///< [out]
};

/// The numbers of a VPoser network, D its latent size.
struct VposerWeights {
  std::string source;                    ///< the file, for messages
  Index latents = 0;                     ///< D
  std::array<LinearWeights, 3> decoder;  ///< D → H → H → 126; the 126 are by joint (a, b): a = x[0..2], b = x[3..5]
  std::array<LinearWeights, 2> encoder;  ///< 63 → H → D
};

/// Reads the weights (.npz or .safetensors): the arrays of the public checkpoint by their names, with or without
/// `vp_model.` before them: `decoder_net.{0,3,5}.{weight,bias}`, `encoder_net.{2,6,7,8.mu}.{weight,bias}`, and
/// `encoder_net.{1,4}.{weight,bias,running_mean,running_var}`. tools/export_vposer.py makes such a file. Others are
/// passed over.
///
/// Throws UserError when the file cannot be read; DataError naming file and array: an array missing, a shape that does
/// not fit the others, a number that is not finite, a negative variance.
VposerWeights read_vposer(const std::string& path);
/// As read_vposer, of a file in memory. @param name  what messages call it
VposerWeights decode_vposer(std::span<const std::uint8_t> file, const std::string& name);

/// The network prepared for a tape in precision S. Immutable; copies share the numbers.
template <class S>
struct Vposer {
  Vposer() = default;
  explicit Vposer(const VposerWeights& weights);
  std::array<FrozenLinear<S>, 3> decoder;
  std::array<FrozenLinear<S>, 2> encoder;
};

/// Poses of latents.
///
/// @param latents  [T,D]
/// @return         [21T,9] rotation matrices by rows, relative to the parents; joint j of frame t is row 21 t + j − 1
/// Adjoint: latents.
template <class S>
Var<S> vposer_decode(const Vposer<S>& vposer, Var<S> latents, Source where = Source::current());

/// Mean latents of poses.
///
/// @param axis_angle  [21T,3] radians, |w| ≤ π as the network was trained
/// @return            [T,D]
/// Adjoint: axis_angle.
template <class S>
Var<S> vposer_encode(const Vposer<S>& vposer, Var<S> axis_angle, Source where = Source::current());

}  // namespace hsi4d
