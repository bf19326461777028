// What poses of the body are likely: latents z that are normally distributed over natural poses, and the poses that
// they stand for. Either VPoser, where its weights are at hand, or natural poses by anatomy (natural_pose.h), for every
// machine; both are used alike.
//
//   const PosePrior prior = read_pose_prior("vposer.npz");          // or natural_pose_prior()
//   const Var<S> latents = tape.parameter("z", shape_of(frames, prior.latents()));
//   const Var<S> rotations = prior.decode(latents);                  // [21T,9]
//   p.body_pose = slice_rows(rotations, 21 * t, 21);                 // of a frame, for pose_smplx
#pragma once

#include <memory>
#include <string>

#include "body/vposer.h"

namespace hsi4d {

/// A prior of body poses. Immutable; copies share the numbers.
class PosePrior {
 public:
  /// "vposer" or "natural".
  const std::string& name() const { return name_; }
  /// D, numbers of a pose: 32 of the public VPoser, 63 of natural poses.
  Index latents() const { return latents_; }

  /// Poses of latents.
  ///
  /// @param latents  [T,D]
  /// @return         [21T,9] rotation matrices by rows, relative to the parents; joint j of frame t is row 21 t + j − 1
  /// Adjoint: latents.
  /// Throws InternalError when the shape is another.
  template <class S>
  Var<S> decode(Var<S> latents, Source where = Source::current()) const;

  /// Latents of poses: of VPoser the encoder's mean, of natural poses exactly those that decode to the pose.
  ///
  /// @param rotations  [21T,9] as decode gives them
  /// @return           [T,D]
  /// Adjoint: rotations, as functions of nine free numbers each; see axis_angle_from_rotations.
  /// Throws InternalError when the shape is another.
  template <class S>
  Var<S> encode(Var<S> rotations, Source where = Source::current()) const;

  /// Latents of poses given as axis-angle vectors.
  ///
  /// @param axis_angle  [21T,3] radians, any angle
  /// @return            [T,D]
  /// Throws InternalError when the count is no multiple of 63.
  std::vector<double> encode(std::span<const double> axis_angle) const;

  /// Mean over frames of ‖z_t‖²: up to a constant twice the negative logarithm of their density.
  ///
  /// @param latents  [T,D]
  /// @return         a scalar
  /// Adjoint: latents.
  template <class S>
  Var<S> energy(Var<S> latents, Source where = Source::current()) const;

 private:
  friend PosePrior natural_pose_prior();
  friend PosePrior vposer_prior(const VposerWeights& weights);

  struct Networks {
    Vposer<float> single;
    Vposer<double> full;
  };
  template <class S>
  const Vposer<S>& network() const;

  std::string name_;
  Index latents_ = 0;
  std::shared_ptr<const Networks> networks_;  // null: natural poses
};

/// Natural poses by anatomy; needs no file.
PosePrior natural_pose_prior();

/// VPoser.
PosePrior vposer_prior(const VposerWeights& weights);

/// VPoser with the weights of a file, or natural poses where `path` is empty. Throws as read_vposer.
PosePrior read_pose_prior(const std::string& path);

/// Mean over frames of how far the body's joints are beyond their ranges, Σ_j joint_limit_excess.
///
/// @param rotations  [21T,9] as PosePrior::decode gives them
/// @return           a scalar, radians²
/// Adjoint: rotations, see joint_limit_excess.
template <class S>
Var<S> joint_limit_energy(Var<S> rotations, Source where = Source::current());

}  // namespace hsi4d
