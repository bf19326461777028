// The pieces of a stage that its iterations (optim/stage.cpp) and its gradient check (optim/stage_gradcheck.h) share:
// the loss on the tape, the groups that its settings name, the tape as it was before.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "optim/stage.h"

namespace hsi4d {

/// "stage 'NAME': TEXT"
std::string stage_message(const std::string& stage, const std::string& text);

/// Σ weight · term of the terms that are on, on a tape.
template <class S>
struct RecordedLoss {
  Var<S> total;
  std::vector<Var<S>> terms;
  std::vector<LossValue> values;  ///< of `terms`; read_values brings them up to date
  std::vector<std::string> off;   ///< terms of the settings that lacked an input, or have weight 0
  std::vector<LeftOut> left_out;
  std::vector<LossNote> notes;

  /// The terms' values of the tape's last forward run, without weights.
  void read_values();
};

/// Records the loss at the end of the tape.
/// @param stage  what messages call it
/// Throws UserError: an unknown term, no term that gives anything.
template <class S>
RecordedLoss<S> record_loss(const StageSettings& settings, std::span<const LossTerm> terms, const LossInputs<S>& inputs,
                            const std::string& stage);

/// The groups that the settings name, in the settings' order. Throws UserError where two of them share a parameter.
template <class S>
std::vector<OptimizerGroup<S>> named_groups(const StageSettings& settings,
                                            const std::vector<ParameterGroup<S>>& available, const std::string& stage);

/// The error that no term depends on a group.
UserError no_term_depends_on(const std::string& group, const std::vector<LossValue>& terms, const std::string& stage);

/// Freezes all leaves of a group, or lets gradients flow to them.
template <class S>
void set_frozen(Tape<S>& tape, const ParameterGroup<S>& group, bool frozen);

/// Remembers a tape, to forget what is recorded after: `restore` rewinds it, and freezes or unfreezes the parameters as
/// they were found.
template <class S>
class TapeGuard {
 public:
  TapeGuard(Tape<S>& tape, const std::vector<ParameterGroup<S>>& available);
  void restore() const;

 private:
  Tape<S>& tape_;
  const std::vector<ParameterGroup<S>>& available_;
  typename Tape<S>::Mark mark_;
  std::vector<bool> frozen_;
};

}  // namespace hsi4d
