// The optimiser of a stage, whichever its settings name.
#pragma once

#include <string_view>
#include <variant>

#include "optim/levenberg_marquardt.h"
#include "optim/quasi_newton.h"
#include "optim/whitened_adam.h"

namespace hsi4d {

/// Adam, QuasiNewton, LevenbergMarquardt or WhitenedAdam; see there.
template <class S>
class Optimizer {
 public:
  /// @param loss  of the stage, on the tape
  Optimizer(Tape<S>& tape, Var<S> loss, const std::vector<OptimizerGroup<S>>& groups, const OptimizerSettings& settings)
      : method_(made(tape, loss, groups, settings)) {}

  StepReport step(Index iteration, Index iterations, double loss) {
    return std::visit([&](auto& method) { return method.step(iteration, iterations, loss); }, method_);
  }
  Index rollbacks() const {
    return std::visit([](const auto& method) { return method.rollbacks(); }, method_);
  }
  /// Bad evaluations that count against max_rollbacks: in a row where their steps are taken back, else all.
  Index counted_rollbacks() const {
    return std::visit(
        [](const auto& method) {
          if constexpr (requires { method.bad_in_a_row(); }) return method.bad_in_a_row();
          return method.rollbacks();
        },
        method_);
  }
  /// No further step is wanted, whatever the settings say.
  bool is_done() const {
    return std::visit(
        [](const auto& method) {
          if constexpr (requires { method.is_done(); }) return method.is_done();
          return false;
        },
        method_);
  }
  /// Takes the last step back. False where there is none, or the method ends at the best that it evaluated.
  bool undo() {
    return std::visit(
        [](auto& method) {
          if constexpr (requires { method.undo(); }) return method.undo();
          return false;
        },
        method_);
  }
  /// Whether numbers may be written from outside after a step: what the method remembers is of no certain place.
  bool takes_other_numbers() const { return std::holds_alternative<Adam<S>>(method_); }

  /// What moves a group by Adam, and has its moments; null: another method moves it.
  Adam<S>* adam_of(std::string_view group) {
    return std::visit(
        [group](auto& method) -> Adam<S>* {
          if constexpr (requires { method.beside(); }) return method.is_beside(group) ? &method.beside() : nullptr;
          if constexpr (requires { method.moments(group); }) return &method;
          return nullptr;
        },
        method_);
  }
  const Adam<S>* adam_of(std::string_view group) const { return const_cast<Optimizer*>(this)->adam_of(group); }

  /// Begins with a curvature that was learnt before; nothing where this method keeps none.
  void set_curvature(const std::vector<double>& learnt) {
    std::visit(
        [&](auto& method) {
          if constexpr (requires { method.set_curvature(learnt); }) method.set_curvature(learnt);
        },
        method_);
  }
  /// What it has learnt; empty: nothing.
  std::vector<double> curvature() const {
    return std::visit(
        [](const auto& method) {
          if constexpr (requires { method.curvature(); }) return method.curvature();
          return std::vector<double>();
        },
        method_);
  }

 private:
  using Method = std::variant<Adam<S>, QuasiNewton<S>, LevenbergMarquardt<S>, WhitenedAdam<S>>;

  static Method made(Tape<S>& tape, Var<S> loss, const std::vector<OptimizerGroup<S>>& groups,
                     const OptimizerSettings& settings) {
    switch (settings.kind) {
      case OptimizerKind::kBfgs:
        return Method(std::in_place_type<QuasiNewton<S>>, tape, groups);
      case OptimizerKind::kLm:
        return Method(std::in_place_type<LevenbergMarquardt<S>>, tape, loss, groups, settings);
      case OptimizerKind::kWhitenedAdam:
        return Method(std::in_place_type<WhitenedAdam<S>>, tape, loss, groups, settings);
      case OptimizerKind::kAdam:
        break;
    }
    return Method(std::in_place_type<Adam<S>>, tape, groups, settings);
  }

  Method method_;
};

/// How far one number of a group can get in a stage, whatever the gradients are.
inline double longest_way(const ParameterGroupSettings& group, Index iterations, const OptimizerSettings& settings) {
  switch (settings.kind) {
    case OptimizerKind::kBfgs:
      return longest_quasi_newton_way(group, iterations);
    case OptimizerKind::kLm:
      return longest_matrix_way(group, iterations);
    case OptimizerKind::kWhitenedAdam:
      return kLongestUnitWay * group.lr;
    case OptimizerKind::kAdam:
      break;
  }
  return longest_adam_way(group, iterations, settings);
}

}  // namespace hsi4d
