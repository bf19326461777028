#include "optim/stage_gradcheck.h"

#include <algorithm>
#include <cmath>

#include "autodiff/elementwise.h"
#include "autodiff/inspect.h"
#include "core/random.h"
#include "core/text.h"
#include "optim/stage_loss.h"

namespace hsi4d {

namespace {

void disturb(Tape<double>& tape, const std::vector<OptimizerGroup<double>>& groups,
             const StageGradcheckOptions& options) {
  const Random random(options.differences.seed, random_stream("stage_gradcheck.disturbance"));
  std::uint64_t at = 0;
  for (const OptimizerGroup<double>& group : groups) {
    for (std::size_t b = 0; b < group.parameters.blocks.size(); ++b) {
      const Var<double> block = group.parameters.blocks[b];
      const Array<double> numbers = tape.write(block);
      for (Index row = 0; row < numbers.total_rows(); ++row) {
        for (Index col = 0; col < numbers.shape.cols; ++col)
          numbers.row(row)[col] += options.disturbance * random.uniform(at++, -1, 1);
      }
      if (const auto range = group.parameters.range_of(b)) hold_in_range(block, *range);
    }
  }
}

Index count_numbers(const ParameterGroup<double>& group) {
  Index count = 0;
  for (const Var<double> block : group.blocks) count += block.shape().count();
  return count;
}

/// While it lives, what a result that has been computed reads through stop_gradient stays as it is.
class HeldStops {
 public:
  HeldStops(Tape<double>& tape, Var<double> result) : tape_(tape) {
    TapeInspector<double> inspector(tape);
    for (const auto node : inspector.nodes_of(result)) {
      if (!is_stop_gradient(inspector.operator_name(node))) continue;
      const Var<double> output = inspector.handle(inspector.outputs(node).front());
      if (!tape.held(output)) held_.push_back(output);
    }
    for (const Var<double> var : held_) tape_.hold(var);
  }
  ~HeldStops() {
    for (const Var<double> var : held_) tape_.release(var);
  }
  HeldStops(const HeldStops&) = delete;
  HeldStops& operator=(const HeldStops&) = delete;

 private:
  Tape<double>& tape_;
  std::vector<Var<double>> held_;
};

StageGradcheck check_recorded(Tape<double>& tape, const std::vector<OptimizerGroup<double>>& groups,
                              RecordedLoss<double>& loss, const std::string& stage, const GradcheckOptions& options) {
  StageGradcheck result;
  result.off = loss.off;
  tape.forward(loss.total);
  loss.read_values();
  result.loss = tape.value(loss.total).scalar();
  result.terms = loss.values;
  if (!std::isfinite(result.loss)) throw UserError(stage_message(stage, "the loss is " + rounded(result.loss, 6)));
  const HeldStops stops(tape, loss.total);
  for (const OptimizerGroup<double>& group : groups) {
    const ParameterGroup<double>& parameters = group.parameters;
    GroupGradcheck& found = result.groups.emplace_back(GroupGradcheck{parameters.name, count_numbers(parameters), {}});
    if (found.numbers == 0) continue;
    set_frozen(tape, parameters, false);
    found.report = gradcheck(tape, loss.total, options);
    set_frozen(tape, parameters, true);
    if (found.report.entries == 0) throw no_term_depends_on(parameters.name, loss.values, stage);
  }
  return result;
}

}  // namespace

bool StageGradcheck::ok() const {
  const auto has_passed = [](const GroupGradcheck& group) { return group.numbers == 0 || group.report.ok(); };
  return std::any_of(groups.begin(), groups.end(), [](const auto& group) { return group.report.entries > 0; }) &&
         std::all_of(groups.begin(), groups.end(), has_passed);
}

StageGradcheck check_stage_gradient(Tape<double>& tape, const StageSettings& settings, std::span<const LossTerm> terms,
                                    const LossInputs<double>& inputs,
                                    const std::vector<ParameterGroup<double>>& available, const std::string& stage,
                                    const StageGradcheckOptions& options) {
  check_groups(settings, names_of(available), "stage '" + stage + "'");
  const TapeGuard<double> guard(tape, available);
  try {
    const std::vector<OptimizerGroup<double>> groups = named_groups(settings, available, stage);
    RecordedLoss<double> loss = record_loss(settings, terms, inputs, stage);
    for (const ParameterGroup<double>& group : available) set_frozen(tape, group, true);
    disturb(tape, groups, options);
    StageGradcheck result = check_recorded(tape, groups, loss, stage, options.differences);
    guard.restore();
    return result;
  } catch (...) {
    guard.restore();
    throw;
  }
}

}  // namespace hsi4d
