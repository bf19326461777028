// All frames of a clip on a tape, without an image: from the parameters of the body to the inputs of the losses that
// look at its motion. Objects and cameras stand as they are.
//
// Of each person:
//
//   latents z_t → prior → rotations ─┐
//   transl, global_orient            ├─ kinematic_chain ─ joints, places of hands and feet    [method.md, stage 3]
//   hands, jaw, eyes: constants     ─┘
#pragma once

#include <string>
#include <vector>

#include "body/pose_prior.h"
#include "optim/loss_term.h"
#include "optim/parameters.h"
#include "pipelines/config/parameter_groups.h"
#include "pipelines/config/run_config.h"
#include "pipelines/graph/motion_inputs.h"
#include "pipelines/input/clip.h"
#include "pipelines/input/state.h"

namespace hsi4d {

/// The graph. Frame 0 is given and stands still; frames 1 to T move. The tape and the clip must outlive it.
template <class S>
class SequenceGraph {
 public:
  /// Records the graph.
  /// @param states  by frame, T + 1 of them, two at least
  /// @param prior   whose latents are the body's poses: they start as the encoded ones. Null: joints stay as they are
  SequenceGraph(Tape<S>& tape, const Clip& clip, const std::vector<SceneState>& states, const PosePrior* prior,
                RotationParameters rotations);

  /// Tells how sure the places of joints are, for terms that need kSigmas. Once.
  /// @param states, sigmas  by frame
  void give_sigmas(const std::vector<SceneState>& states, const std::vector<PlaceSigmas>& sigmas);

  const LossInputs<S>& loss_inputs() const { return inputs_; }
  /// Everything that may move, all of it frozen.
  const std::vector<ParameterGroup<S>>& groups() const { return groups_; }
  /// Reads the leaves of the groups named in `moved` back into frames 1 to T of `states`; the rest keeps its bits.
  void read_states(const ConfigMap<ParameterGroupSettings>& moved, std::vector<SceneState>& states) const;

 private:
  struct Human {
    Var<S> transl, orient;
    Var<S> body_rotations;  // [21T,9]; empty without a prior
  };
  ParameterGroup<S>& group_of(const std::string& name);
  Var<S> leaf(const std::string& group, Index cols);
  MovingFrames<S> record_human(const Avatar& avatar, const std::vector<BodyPose>& poses, const PosePrior* prior);
  Var<S> record_rotations(const std::vector<BodyPose>& poses, const PosePrior* prior, Human& human);
  Var<S> record_body(const std::vector<BodyPose>& poses, const PosePrior* prior, Human& human);
  Var<S> constant_rotations(const char* name, const std::vector<double>& axis_angle);

  Tape<S>& tape_;
  RotationParameters rotation_parameters_;
  Index frames_;  // that move
  std::vector<ParameterGroup<S>> groups_;
  std::vector<Human> humans_;
  LossInputs<S> inputs_;
};

}  // namespace hsi4d
