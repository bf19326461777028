// The optimiser of a stage, whichever its settings name.
#pragma once

#include <variant>

#include "optim/quasi_newton.h"

namespace hsi4d {

/// Adam or QuasiNewton; see there.
template <class S>
class Optimizer {
 public:
  Optimizer(Tape<S>& tape, const std::vector<OptimizerGroup<S>>& groups, const OptimizerSettings& settings)
      : method_(made(tape, groups, settings)) {}

  StepReport step(Index iteration, Index iterations, double loss) {
    return std::visit([&](auto& method) { return method.step(iteration, iterations, loss); }, method_);
  }
  Index rollbacks() const {
    return std::visit([](const auto& method) { return method.rollbacks(); }, method_);
  }
  /// No further step is wanted, whatever the settings say.
  bool is_done() const {
    const auto* const method = std::get_if<QuasiNewton<S>>(&method_);
    return method != nullptr && method->is_done();
  }
  /// What takes back steps and keeps moments; null: this method does neither.
  Adam<S>* adam() { return std::get_if<Adam<S>>(&method_); }
  const Adam<S>* adam() const { return std::get_if<Adam<S>>(&method_); }

  /// Begins with a curvature that was learnt before; nothing where this method learns none.
  void set_curvature(const std::vector<double>& learnt) {
    if (auto* method = std::get_if<QuasiNewton<S>>(&method_)) method->set_curvature(learnt);
  }
  /// What it has learnt; empty: nothing.
  std::vector<double> curvature() const {
    const auto* const method = std::get_if<QuasiNewton<S>>(&method_);
    return method != nullptr ? method->curvature() : std::vector<double>();
  }

 private:
  using Method = std::variant<Adam<S>, QuasiNewton<S>>;

  static Method made(Tape<S>& tape, const std::vector<OptimizerGroup<S>>& groups, const OptimizerSettings& settings) {
    if (settings.kind == OptimizerKind::kBfgs) return Method(std::in_place_type<QuasiNewton<S>>, tape, groups);
    return Method(std::in_place_type<Adam<S>>, tape, groups, settings);
  }

  Method method_;
};

/// How far one number of a group can get in a stage, whatever the gradients are.
inline double longest_way(const ParameterGroupSettings& group, Index iterations, const OptimizerSettings& settings) {
  return settings.kind == OptimizerKind::kBfgs ? longest_quasi_newton_way(group, iterations)
                                               : longest_adam_way(group, iterations, settings);
}

}  // namespace hsi4d
