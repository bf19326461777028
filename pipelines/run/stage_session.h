// A stage at hand: recorded as a run records it, to be evaluated, moved and looked at from outside.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "optim/stage_run.h"
#include "pipelines/run/recorded_stage.h"
#include "pipelines/run/stage_inputs.h"

namespace hsi4d {

/// Numbers of a parameter group: its arrays one below the other, or, where these differ in their width (color_net), all
/// numbers in one row.
template <class S>
struct GroupNumbers {
  std::string group;
  Index rows = 0, cols = 0;
  std::vector<S> numbers;  ///< [rows,cols]
};

/// Replaces what a stage follows. Throws UserError for another number of states, of objects or of joints than the
/// clip's.
/// @param before  as StageInputs has it; null: as it is
/// @param start   of a stage of a frame; null: as it is
void set_states(StageInputs& inputs, const std::vector<SceneState>* before, const SceneState* start);

/// A stage in its frame, or over the sequence. step() until is_done(), then finish() leave the bits of a run's stage
/// that began in the same state. For one thread at a time.
template <class S>
class StageSession {
 public:
  /// Throws as run_stage.
  explicit StageSession(std::unique_ptr<const StageInputs> inputs);
  StageSession(const StageSession&) = delete;
  StageSession& operator=(const StageSession&) = delete;

  const StageInputs& inputs() const { return *inputs_; }
  StageRun<S>& run() { return *run_; }
  const StageRun<S>& run() const { return *run_; }

  /// Of the groups that the stage names, in its order.
  std::vector<GroupNumbers<S>> parameters() const;
  /// Of the last evaluation; zeros where nothing depends on a number.
  std::vector<GroupNumbers<S>> gradients() const;
  /// Writes the numbers of some groups, of all or of none: throws UserError for a group that the stage does not move,
  /// another shape, a number that is not finite or outside of the group's range; as StageRun::parameters_were_written.
  void set_parameters(const std::vector<GroupNumbers<S>>& groups);

  /// The state with what the stage has moved so far. Throws UserError of a stage over the sequence.
  SceneState state() const;
  /// Likewise all states of the sequence. Throws UserError of a stage of a frame.
  std::vector<SceneState> states() const;
  /// [3,H,W] what is drawn of the parameters as they are. Throws UserError of a stage over the sequence, which draws
  /// nothing.
  Image image();

 private:
  template <class ValueOf>
  std::vector<GroupNumbers<S>> numbers(const ValueOf& value_of) const;
  const ParameterGroup<S>& checked_group(const GroupNumbers<S>& numbers) const;
  UserError refused(const std::string& text) const;

  std::unique_ptr<const StageInputs> inputs_;
  ColorState colors_;
  Tape<S> tape_;
  std::optional<RecordedFrame<S>> frame_;
  std::unique_ptr<SequenceGraph<S>> sequence_;
  LossInputs<S> loss_inputs_;
  StageOptions options_;
  std::optional<StageRun<S>> run_;
};

extern template class StageSession<float>;
extern template class StageSession<double>;

}  // namespace hsi4d
