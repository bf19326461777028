#include "optim/stage_run.h"

#include <algorithm>
#include <cmath>

#include "autodiff/inspect.h"
#include "core/stopwatch.h"
#include "core/text.h"

namespace hsi4d {

namespace {

using Clock = std::chrono::steady_clock;

/// Groups of more numbers than this have no part in a curvature that is measured: nets, features of Gaussians.
constexpr Index kMostNumbers = 512;

template <class S>
void hold(const ParameterGroup<S>& group) {
  for (std::size_t b = 0; b < group.blocks.size(); ++b) {
    if (const auto range = group.range_of(b)) hold_in_range(group.blocks[b], *range);
  }
}

/// What run_stage wants to be right before anything is recorded.
template <class S>
std::vector<OptimizerGroup<S>> checked_groups(const StageSettings& settings,
                                              const std::vector<ParameterGroup<S>>& available,
                                              const std::string& stage) {
  check_groups(settings, names_of(available), "stage '" + stage + "'");
  return named_groups(settings, available, stage);
}

}  // namespace

template <class S>
StageRun<S>::Restored::~Restored() {
  guard.restore();
  for (const HeldOutput& output : held) tape.release(TapeInspector<S>(tape).handle(output.id));
}

template <class S>
StageRun<S>::StageRun(Tape<S>& tape, const StageSettings& settings, std::span<const LossTerm> terms,
                      const LossInputs<S>& inputs, const std::vector<ParameterGroup<S>>& available,
                      const StageOptions& options)
    : tape_(tape),
      settings_(settings),
      options_(options),
      restored_{{tape, available}, tape, options.held},
      groups_(checked_groups(settings, available, options.name)),
      loss_(record_loss(settings, terms, inputs, options.name)),
      optimizer_(tape, loss_.total, groups_, settings.optimizer) {
  if (options.profile) tape.clear_statistics();
  tape.set_profiling(options.profile);
  for (const ParameterGroup<S>& group : available) set_frozen(tape, group, true);
  for (const OptimizerGroup<S>& group : groups_) hold(group.parameters);
  held_ = reached_outputs(options.held);
  for (const LeftOut& asked : loss_.left_out) left_out_.emplace_back(static_cast<std::size_t>(asked.objects), 0);
  if (options.curvature != nullptr) optimizer_.set_curvature(*options.curvature);
  if (options.kept == nullptr) return;
  for (const OptimizerGroup<S>& group : groups_) {
    const auto kept = options.kept->find(group.parameters.name);
    Adam<S>* const adam = optimizer_.adam_of(group.parameters.name);
    if (adam != nullptr && kept != options.kept->end() && !kept->second.blocks.empty())
      adam->set_moments(group.parameters.name, kept->second);
  }
}

template <class S>
bool StageRun<S>::is_done() const {
  return is_finished_ || iteration_ >= settings_.iterations || optimizer_.is_done();
}

template <class S>
void StageRun<S>::step(const StageCallback& callback) {
  HSI4D_CHECK(!is_done(), "a stage that is done goes no further");
  const auto start = Clock::now();
  iterate(iteration_++, callback, start);
  seconds_ += seconds_since(start);
}

template <class S>
double StageRun<S>::evaluate() {
  for (const OptimizerGroup<S>& group : groups_) set_frozen(tape_, group.parameters, false);
  if (holds_old_values_) hold_all();
  tape_.forward(loss_.total);
  tape_.backward(loss_.total);
  loss_.read_values();
  return evaluated_loss();
}

template <class S>
void StageRun<S>::parameters_were_written() {
  if (iteration_ > 0 && !optimizer_.takes_other_numbers()) {
    throw UserError(stage_message(
        options_.name, "its optimiser has begun, and " +
                           std::string(choice_name<OptimizerKind>(kOptimizerKinds, settings_.optimizer.kind)) +
                           " remembers where its steps led; parameters can be written before the first step"));
  }
  holds_old_values_ = true;
}

template <class S>
StageResult StageRun<S>::finish() {
  HSI4D_CHECK(!is_finished_, "a stage is finished once");
  const auto start = Clock::now();
  evaluate_the_end();
  keep_moments();
  keep_curvature();
  is_finished_ = true;
  std::vector<NodeStatistics> nodes = options_.profile ? tape_.statistics() : std::vector<NodeStatistics>();
  seconds_ += seconds_since(start);
  return {iteration_,
          evaluated_loss(),
          loss_.values,
          loss_.off,
          optimizer_.rollbacks() + undone_at_end_,
          seconds_,
          times_,
          left_out_objects(),
          loss_.notes,
          std::move(nodes),
          options_.time_curvature ? curvature_cost() : std::nullopt};
}

template <class S>
void StageRun<S>::iterate(Index i, const StageCallback& callback, Clock::time_point start) {
  for (const OptimizerGroup<S>& group : groups_) set_frozen(tape_, group.parameters, !moves_in(group.settings, i));
  hold_values(i);
  tape_.forward(loss_.total);
  const Index forward_nodes = tape_.counters().forward_nodes;  // before others run, for shares
  times_.forward += seconds_since(start);
  const auto evaluated = Clock::now();
  shares_.clear();
  if (settings_.gradient_shares > 0 && i % settings_.gradient_shares == 0) shares_ = shares_of_terms(i);
  tape_.backward(loss_.total);
  times_.backward += seconds_since(evaluated);
  TapeCounters counters = tape_.counters();
  counters.forward_nodes = forward_nodes;
  check_reached(i);
  read_terms();
  const auto differentiated = Clock::now();
  const double loss = evaluated_loss();
  const StepReport step = optimizer_.step(i, settings_.iterations, loss);
  if (step.rolled_back) note_rollback(*step.bad, i);
  if (!step.rolled_back) {
    offender_.clear();
    wrap_rotations(step);
    hold_ranges(step);
    holds_old_values_ = step.undone;
  }
  times_.step += seconds_since(differentiated);
  if (!callback) return;
  callback({i, settings_.iterations, loss, loss_.values, step.groups, step.rolled_back, step.rollbacks, offender_,
            seconds_since(start), counters, shares_, step.matrix});
}

/// Held outputs that the loss depends on; what it does not is never computed.
template <class S>
std::vector<HeldOutput> StageRun<S>::reached_outputs(const std::vector<HeldOutput>& asked) {
  TapeInspector<S> inspector(tape_);
  std::vector<std::uint32_t> reached;
  for (const auto node : inspector.nodes_of(loss_.total)) {
    for (const auto output : inspector.outputs(node)) reached.push_back(output);
  }
  std::vector<HeldOutput> held = asked;
  std::erase_if(held, [&](const HeldOutput& output) {
    return std::find(reached.begin(), reached.end(), output.id) == reached.end();
  });
  return held;
}

template <class S>
bool StageRun<S>::is_moved(const HeldOutput& held, Index iteration) const {
  return std::any_of(groups_.begin(), groups_.end(), [&](const OptimizerGroup<S>& group) {
    return moves_in(group.settings, iteration) &&
           std::find(held.groups.begin(), held.groups.end(), group.parameters.name) != held.groups.end();
  });
}

/// Follows its inputs where a group moves that it waits for. Made anew and held at the first iteration, after each
/// such step (a bad one has to show), and after a bad evaluation, whose numbers it may hold.
template <class S>
void StageRun<S>::hold_values(Index iteration) {
  for (const HeldOutput& held : held_) {
    const Var<S> value = TapeInspector<S>(tape_).handle(held.id);
    if (is_moved(held, iteration)) {
      tape_.release(value);
    } else if (iteration == 0 || is_moved(held, iteration - 1) || !offender_.empty() || holds_old_values_) {
      make_and_hold(value);
    }
  }
  holds_old_values_ = false;
}

template <class S>
void StageRun<S>::hold_all() {
  for (const HeldOutput& held : held_) {
    const Var<S> value = TapeInspector<S>(tape_).handle(held.id);
    if (tape_.held(value)) make_and_hold(value);
  }
  holds_old_values_ = false;
}

template <class S>
void StageRun<S>::make_and_hold(Var<S> value) {
  tape_.release(value);
  tape_.forward(value);
  tape_.hold(value);
}

template <class S>
std::vector<GradientShare> StageRun<S>::shares_of_terms(Index iteration) {
  std::vector<WeightedTerm<S>> terms;
  for (std::size_t k = 0; k < loss_.terms.size(); ++k)
    terms.push_back({loss_.values[k].name, loss_.terms[k], loss_.values[k].weight});
  return gradient_shares<S>(tape_, terms, groups_, iteration);
}

/// Row D9: beyond a whole turn the derivative of an axis-angle vanishes, so none gets that far. The mean
/// gradient belongs to the numbers that a row had; squares are alike on both sides of half a turn.
template <class S>
void StageRun<S>::wrap_rotations(const StepReport& step) {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    if (!groups_[g].parameters.are_axis_angles || !step.groups[g].moved) continue;
    for (const Var<S> block : groups_[g].parameters.blocks) {
      for (const Index row : wrap_axis_angles(block))
        optimizer_.adam_of(groups_[g].parameters.name)->clear_mean(block, row);
    }
  }
}

template <class S>
void StageRun<S>::hold_ranges(const StepReport& step) {
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    if (step.groups[g].moved) hold(groups_[g].parameters);
  }
}

template <class S>
double StageRun<S>::evaluated_loss() const {
  return static_cast<double>(tape_.value(loss_.total).scalar());
}

template <class S>
void StageRun<S>::read_terms() {
  loss_.read_values();
  for (std::size_t k = 0; k < loss_.left_out.size(); ++k) {
    for (Index o = 0; o < loss_.left_out[k].objects; ++o) {
      if (loss_.left_out[k].is_left_out(o)) ++left_out_[k][static_cast<std::size_t>(o)];
    }
  }
}

template <class S>
std::vector<LeftOutObject> StageRun<S>::left_out_objects() const {
  std::vector<LeftOutObject> objects;
  for (std::size_t k = 0; k < left_out_.size(); ++k) {
    for (std::size_t o = 0; o < left_out_[k].size(); ++o) {
      if (left_out_[k][o] == 0) continue;
      const LeftOut& asked = loss_.left_out[k];
      objects.push_back({asked.term, asked.reason, static_cast<Index>(o), left_out_[k][o], asked.of_human});
    }
  }
  return objects;
}

/// A group that is on and that no term depends on would silently stay.
template <class S>
void StageRun<S>::check_reached(Index iteration) const {
  for (const OptimizerGroup<S>& group : groups_) {
    const auto& blocks = group.parameters.blocks;
    if (blocks.empty() || !moves_in(group.settings, iteration)) continue;
    if (std::any_of(blocks.begin(), blocks.end(), [&](Var<S> block) { return tape_.has_gradient(block); })) continue;
    throw no_term_depends_on(group.parameters.name, loss_.values, options_.name);
  }
}

template <class S>
void StageRun<S>::note_rollback(const BadNumber& bad, Index iteration) {
  if (offender_.empty()) offender_ = bad.text() + first_bad_node();
  if (optimizer_.counted_rollbacks() <= settings_.optimizer.max_rollbacks) return;
  throw_diverged("iteration " + std::to_string(iteration));
}

template <class S>
void StageRun<S>::throw_diverged(const std::string& when) const {
  std::vector<std::string> values;
  for (const LossValue& term : loss_.values) values.push_back(term.name + " " + rounded(term.value, 6));
  throw StageDivergedError(stage_message(options_.name, "given up in " + when + " after " +
                                                            std::to_string(optimizer_.rollbacks()) +
                                                            " steps that had to be taken back (max_rollbacks is " +
                                                            std::to_string(settings_.optimizer.max_rollbacks) +
                                                            "): " + offender_ + "; terms: " + joined(values)));
}

/// Runs the tape once more, looking at every number: "; first: nan in forward of 'log' …". Empty where all is finite
/// (a gradient may be finite and too large).
template <class S>
std::string StageRun<S>::first_bad_node() {
  std::string text;
  tape_.set_anomaly(true);
  try {
    tape_.forward(loss_.total);
    tape_.backward(loss_.total);
  } catch (const NonFiniteError& error) {
    text = std::string("; first: ") + error.what();
  } catch (...) {
    tape_.set_anomaly(false);
    throw;
  }
  tape_.set_anomaly(false);
  return text;
}

/// The parameters that are left must not be those of a step into the void.
template <class S>
void StageRun<S>::evaluate_the_end() {
  const auto start = Clock::now();
  forward_of_all();
  times_.forward += seconds_since(start);
  read_terms();
  if (std::isfinite(evaluated_loss())) return;
  offender_ = "the loss is " + rounded(evaluated_loss(), 6) + first_bad_node();
  if (optimizer_.undo()) {
    ++undone_at_end_;
    forward_of_all();
    read_terms();
  }
  if (!std::isfinite(evaluated_loss())) throw_diverged("the last iteration");
}

/// With held outputs as the parameters now are.
template <class S>
void StageRun<S>::forward_of_all() {
  for (const HeldOutput& held : held_) make_and_hold(TapeInspector<S>(tape_).handle(held.id));
  tape_.forward(loss_.total);
}

template <class S>
void StageRun<S>::keep_moments() const {
  if (options_.kept == nullptr) return;
  for (const OptimizerGroup<S>& group : groups_) {
    const auto kept = options_.kept->find(group.parameters.name);
    const Adam<S>* const adam = optimizer_.adam_of(group.parameters.name);
    if (adam != nullptr && kept != options_.kept->end()) kept->second = adam->moments(group.parameters.name);
  }
}

template <class S>
void StageRun<S>::keep_curvature() const {
  if (options_.curvature == nullptr) return;
  std::vector<double> learnt = optimizer_.curvature();
  if (!learnt.empty()) *options_.curvature = std::move(learnt);
}

/// Made twice: the first meets its memory for the first time.
template <class S>
std::optional<CurvatureCost> StageRun<S>::curvature_cost() {
  std::vector<Var<S>> leaves;
  Index numbers = 0;
  for (const OptimizerGroup<S>& group : groups_) {
    Index count = 0;
    for (const Var<S> block : group.parameters.blocks) count += tape_.shape(block).count();
    set_frozen(tape_, group.parameters, count > kMostNumbers);
    if (count > kMostNumbers) continue;
    leaves.insert(leaves.end(), group.parameters.blocks.begin(), group.parameters.blocks.end());
    numbers += count;
  }
  if (leaves.empty()) return std::nullopt;
  try {
    Curvature<S> curvature(tape_, loss_.total, leaves);
    for (int i = 0; i < 2; ++i) {
      tape_.forward(loss_.total);
      tape_.backward(loss_.total);
      curvature.compute();
    }
    return CurvatureCost{curvature.times(), numbers, curvature.movers()};
  } catch (const InternalError&) {
    return std::nullopt;
  }
}

template class StageRun<float>;
template class StageRun<double>;

}  // namespace hsi4d
