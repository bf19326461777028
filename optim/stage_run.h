// A stage, one iteration at a time: what run_stage does in one go, for whoever looks at it, or moves something himself,
// in between.
#pragma once

#include <chrono>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "autodiff/curvature.h"
#include "optim/optimizer.h"
#include "optim/stage.h"
#include "optim/stage_loss.h"

namespace hsi4d {

/// A stage in the course of its iterations: step() until is_done(), then finish() gives the bits of run_stage.
///
/// While it lives its loss stands at the end of the tape, what is frozen follows the iterations, and outputs are held.
/// Its end leaves the tape as run_stage leaves it.
template <class S>
class StageRun {
 public:
  /// Arguments and errors as those of run_stage; all have to outlive it.
  StageRun(Tape<S>& tape, const StageSettings& settings, std::span<const LossTerm> terms, const LossInputs<S>& inputs,
           const std::vector<ParameterGroup<S>>& available, const StageOptions& options);
  StageRun(const StageRun&) = delete;
  StageRun& operator=(const StageRun&) = delete;

  /// Iterations that were made.
  Index iteration() const { return iteration_; }
  /// No further iteration is wanted: all were made, the optimiser has nothing left to gain, or the stage is finished.
  bool is_done() const;
  /// One iteration: an evaluation of the groups that are on in it, and a step. Throws as run_stage; InternalError where
  /// is_done().
  void step(const StageCallback& callback = {});

  /// The loss of the parameters as they are, and their gradients: those of all groups of the settings, whichever
  /// iterations they move in, by Tape::gradient. No step; the iterations to come have the same bits.
  double evaluate();
  /// Has to be called after parameters of the groups were written from outside: what is held is made anew. Throws
  /// UserError once an optimiser has begun that remembers where its steps led (all but adam).
  void parameters_were_written();

  /// Evaluates the parameters that are left and hands on what the optimiser has learnt; once.
  StageResult finish();

  /// In the settings' order.
  const std::vector<OptimizerGroup<S>>& groups() const { return groups_; }
  /// The terms as last evaluated, in the settings' order, and those that are off.
  const std::vector<LossValue>& terms() const { return loss_.values; }
  const std::vector<std::string>& off() const { return loss_.off; }

 private:
  /// Puts the tape back at the end, also where the constructor throws.
  struct Restored {
    TapeGuard<S> guard;
    Tape<S>& tape;
    const std::vector<HeldOutput>& held;
    ~Restored();
  };

  void iterate(Index i, const StageCallback& callback, std::chrono::steady_clock::time_point start);
  std::vector<HeldOutput> reached_outputs(const std::vector<HeldOutput>& asked);
  bool is_moved(const HeldOutput& held, Index iteration) const;
  void hold_values(Index iteration);
  void hold_all();
  void make_and_hold(Var<S> value);
  std::vector<GradientShare> shares_of_terms(Index iteration);
  void wrap_rotations(const StepReport& step);
  void hold_ranges(const StepReport& step);
  double evaluated_loss() const;
  void read_terms();
  std::vector<LeftOutObject> left_out_objects() const;
  void check_reached(Index iteration) const;
  void note_rollback(const BadNumber& bad, Index iteration);
  [[noreturn]] void throw_diverged(const std::string& when) const;
  std::string first_bad_node();
  void evaluate_the_end();
  void forward_of_all();
  void keep_moments() const;
  void keep_curvature() const;
  std::optional<CurvatureCost> curvature_cost();

  Tape<S>& tape_;
  const StageSettings& settings_;
  const StageOptions& options_;
  Restored restored_;
  std::vector<OptimizerGroup<S>> groups_;
  RecordedLoss<S> loss_;
  Optimizer<S> optimizer_;
  Index iteration_ = 0;
  Index undone_at_end_ = 0;
  std::vector<std::vector<Index>> left_out_;  // evaluations, by loss_.left_out and object
  std::vector<GradientShare> shares_;         // of this iteration
  std::vector<HeldOutput> held_;
  bool holds_old_values_ = false;  // parameters were written from outside since
  StageTimes times_;
  double seconds_ = 0;    // of iterations
  std::string offender_;  // of the last evaluation, if it was bad
  bool is_finished_ = false;
};

extern template class StageRun<float>;
extern template class StageRun<double>;

}  // namespace hsi4d
