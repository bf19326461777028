// Parameters of an SMPL-X body over time, by the names of the public implementation, and the body in each frame.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "body/smplx_body.h"

namespace hsi4d {

/// One parameter over time: a row of `width` numbers a frame, or one row for all frames.
struct SmplxTrack {
  std::vector<double> numbers;
  Index width = 0;  ///< 0: not given
  Index rows = 0;   ///< 1 or the sequence's frames

  bool is_given() const { return width > 0; }
  std::span<const double> at(Index frame) const {
    return std::span(numbers).subspan(static_cast<std::size_t>((rows == 1 ? 0 : frame) * width),
                                      static_cast<std::size_t>(width));
  }
};

/// How the numbers of a hand are read.
enum class SmplxHands {
  kByWidth,  ///< 45 numbers are rotations of its 15 joints, fewer are coefficients of as many components
  kFull,     ///< rotations
  kPca,      ///< coefficients
};

/// The parameters of a body in T frames. Rotations are axis-angle vectors in radians, lengths metres.
struct SmplxSequence {
  std::string source;  ///< the file, for messages
  Index frames = 0;    ///< T
  SmplxTrack betas, expression, global_orient, body_pose, jaw_pose, leye_pose, reye_pose, left_hand_pose,
      right_hand_pose, transl;
  std::vector<std::string> passed_over;  ///< arrays of the file that are no parameter
};

/// Reads parameters (.npz) by the names that the fields of SmplxSequence have.
///
/// Each is [T,width], or [width] or [1,width] for all frames; rotations may be [T,J,3] or, for all frames, [J,3] too.
/// Widths: `global_orient`, `jaw_pose`, `leye_pose`, `reye_pose`, `transl` 3; `body_pose` 63; `left_hand_pose`,
/// `right_hand_pose` 45, or 1 to 45 coefficients ([15,3] is a hand, unless other parameters have 15 frames); `betas`,
/// `expression` any up to 300 and 100. What is not there is zero.
///
/// Throws UserError when the file cannot be read; DataError naming file and array: none of these arrays, or one whose
/// name is nearly that of one that is missing; a shape that does not fit; frames that differ; no frame; a number that
/// is not finite or beyond 1e6 (of betas kLargestBeta).
SmplxSequence read_smplx_sequence(const std::string& path);
/// The first `width` numbers of each row; the track as it is where it has no more, not given where that is none.
SmplxTrack first_numbers(const SmplxTrack& track, Index width);

/// As read_smplx_sequence, of a file in memory. @param name  what messages call it
SmplxSequence decode_smplx_sequence(std::span<const std::uint8_t> file, const std::string& name);

/// The body in every frame.
template <class S>
struct SmplxFrames {
  std::vector<S> vertices;  ///< [T,V,3] metres, world
  std::vector<S> joints;    ///< [T,55,3] metres, world
};

/// Poses a body by pose_smplx, frame after frame, in precision S.
///
/// @param model           with as many betas and expressions as the sequence has; zero of them where it has none
/// @param flat_hand_mean  see SmplxBodyOptions
/// Throws DataError naming the file of the parameters when a hand has more coefficients than the model has components,
/// or, of kind kFull, not 45 numbers; InternalError when the model has another number of betas or expressions.
template <class S>
SmplxFrames<S> pose_frames(const SmplxModel& model, const SmplxSequence& sequence,
                           SmplxHands hands = SmplxHands::kByWidth, bool flat_hand_mean = false);

}  // namespace hsi4d
