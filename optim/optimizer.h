// The optimiser of a stage, whichever its settings name.
#pragma once

#include <variant>

#include "optim/gauss_newton.h"
#include "optim/quasi_newton.h"

namespace hsi4d {

/// Adam, QuasiNewton or GaussNewton; see there.
template <class S>
class Optimizer {
 public:
  /// @param seams  of the loss's inputs, for GaussNewton; has to outlive this
  Optimizer(Tape<S>& tape, const std::vector<OptimizerGroup<S>>& groups, const OptimizerSettings& settings,
            SeamMode& seams)
      : method_(made(tape, groups, settings, seams)) {}

  StepReport step(Index iteration, Index iterations, double loss) {
    return std::visit([&](auto& method) { return method.step(iteration, iterations, loss); }, method_);
  }
  Index rollbacks() const {
    return std::visit([](const auto& method) { return method.rollbacks(); }, method_);
  }
  /// No further step is wanted, whatever the settings say.
  bool is_done() const {
    bool done = false;
    where_it_learns(method_, [&](const auto& method) { done = method.is_done(); });
    return done;
  }
  /// What takes back steps and keeps moments; null: this method does neither.
  Adam<S>* adam() { return std::get_if<Adam<S>>(&method_); }
  const Adam<S>* adam() const { return std::get_if<Adam<S>>(&method_); }

  /// Begins with a curvature that was learnt before; nothing where this method learns none.
  void set_curvature(const std::vector<double>& learnt) {
    where_it_learns(method_, [&](auto& method) { method.set_curvature(learnt); });
  }
  /// What it has learnt; empty: nothing.
  std::vector<double> curvature() const {
    std::vector<double> learnt;
    where_it_learns(method_, [&](const auto& method) { learnt = method.curvature(); });
    return learnt;
  }

 private:
  using Method = std::variant<Adam<S>, QuasiNewton<S>, GaussNewton<S>>;

  /// Calls use(method) of a method that learns a curvature.
  template <class AnyMethod, class F>
  static void where_it_learns(AnyMethod& any, const F& use) {
    if (auto* quasi_newton = std::get_if<QuasiNewton<S>>(&any)) use(*quasi_newton);
    if (auto* gauss_newton = std::get_if<GaussNewton<S>>(&any)) use(*gauss_newton);
  }

  static Method made(Tape<S>& tape, const std::vector<OptimizerGroup<S>>& groups, const OptimizerSettings& settings,
                     SeamMode& seams) {
    switch (settings.kind) {
      case OptimizerKind::kBfgs:
        return Method(std::in_place_type<QuasiNewton<S>>, tape, groups);
      case OptimizerKind::kGaussNewton:
        return Method(std::in_place_type<GaussNewton<S>>, tape, groups, settings.products, seams);
      default:
        return Method(std::in_place_type<Adam<S>>, tape, groups, settings);
    }
  }

  Method method_;
};

/// How far one number of a group can get in a stage, whatever the gradients are.
inline double longest_way(const ParameterGroupSettings& group, Index iterations, const OptimizerSettings& settings) {
  switch (settings.kind) {
    case OptimizerKind::kBfgs:
      return longest_quasi_newton_way(group, iterations);
    case OptimizerKind::kGaussNewton:
      return longest_gauss_newton_way(group, iterations);
    default:
      return longest_adam_way(group, iterations, settings);
  }
}

}  // namespace hsi4d
