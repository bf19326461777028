// The optimiser of a stage, whichever its settings name.
#pragma once

#include <variant>

#include "optim/quasi_newton.h"

namespace hsi4d {

/// Adam or QuasiNewton; see there.
template <class S>
class Optimizer {
 public:
  Optimizer(Tape<S>& tape, const std::vector<AdamGroup<S>>& groups, const OptimizerSettings& settings)
      : method_(settings.kind == OptimizerKind::kBfgs ? Method(std::in_place_type<QuasiNewton<S>>, tape, groups)
                                                      : Method(std::in_place_type<Adam<S>>, tape, groups, settings)) {}

  StepReport step(Index iteration, Index iterations, double loss) {
    return std::visit([&](auto& method) { return method.step(iteration, iterations, loss); }, method_);
  }
  Index rollbacks() const {
    return std::visit([](const auto& method) { return method.rollbacks(); }, method_);
  }
  /// No further step is wanted, whatever the settings say.
  bool is_done() const {
    const auto* newton = std::get_if<QuasiNewton<S>>(&method_);
    return newton != nullptr && newton->is_done();
  }
  /// What takes back steps and keeps moments; null: this method does neither.
  Adam<S>* adam() { return std::get_if<Adam<S>>(&method_); }
  const Adam<S>* adam() const { return std::get_if<Adam<S>>(&method_); }
  /// What learns a curvature that may be kept; null: this method does not.
  QuasiNewton<S>* newton() { return std::get_if<QuasiNewton<S>>(&method_); }
  const QuasiNewton<S>* newton() const { return std::get_if<QuasiNewton<S>>(&method_); }

 private:
  using Method = std::variant<Adam<S>, QuasiNewton<S>>;
  Method method_;
};

/// How far one number of a group can get in a stage, whatever the gradients are.
inline double longest_way(const ParameterGroupSettings& group, Index iterations, const OptimizerSettings& settings) {
  return settings.kind == OptimizerKind::kBfgs ? longest_quasi_newton_way(group, iterations)
                                               : longest_adam_way(group, iterations, settings);
}

}  // namespace hsi4d
