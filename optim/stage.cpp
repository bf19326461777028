#include "optim/stage.h"

#include <algorithm>

#include "core/suggest.h"
#include "core/text.h"
#include "optim/stage_loss.h"
#include "optim/stage_run.h"

namespace hsi4d {

void check_groups(const StageSettings& settings, const std::vector<std::string>& names, const std::string& where) {
  std::string problems;
  for (const auto& [name, group] : settings.optimize) {
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    problems += (problems.empty() ? "" : "\n") + where + ": there is no parameter group \"" + name + "\"" +
                did_you_mean(name, names) + " (known: " + joined(names) + ")";
  }
  if (settings.optimize.empty()) problems = where + ": no parameter group is named (known: " + joined(names) + ")";
  if (!problems.empty()) throw UserError(problems);
}

template <class S>
StageResult run_stage(Tape<S>& tape, const StageSettings& settings, std::span<const LossTerm> terms,
                      const LossInputs<S>& inputs, const std::vector<ParameterGroup<S>>& available,
                      const StageCallback& callback, const StageOptions& options) {
  StageRun<S> run(tape, settings, terms, inputs, available, options);
  while (!run.is_done()) run.step(callback);
  return run.finish();
}

template StageResult run_stage(Tape<float>&, const StageSettings&, std::span<const LossTerm>, const LossInputs<float>&,
                               const std::vector<ParameterGroup<float>>&, const StageCallback&, const StageOptions&);
template StageResult run_stage(Tape<double>&, const StageSettings&, std::span<const LossTerm>,
                               const LossInputs<double>&, const std::vector<ParameterGroup<double>>&,
                               const StageCallback&, const StageOptions&);

}  // namespace hsi4d
