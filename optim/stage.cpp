#include "optim/stage.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>

#include "autodiff/inspect.h"
#include "core/stopwatch.h"
#include "core/suggest.h"
#include "core/text.h"
#include "optim/optimizer.h"
#include "optim/stage_loss.h"

namespace hsi4d {

namespace {

using Clock = std::chrono::steady_clock;

/// Groups of more numbers than this have no part in a curvature that is measured: nets, features of Gaussians.
constexpr Index kMostNumbers = 512;

template <class S>
void release(Tape<S>& tape, const std::vector<HeldOutput>& outputs) {
  for (const HeldOutput& held : outputs) tape.release(TapeInspector<S>(tape).handle(held.id));
}

/// A stage in the course of its iterations.
template <class S>
class StageRun {
 public:
  StageRun(Tape<S>& tape, const StageSettings& settings, std::span<const LossTerm> terms, const LossInputs<S>& inputs,
           const std::vector<ParameterGroup<S>>& available, const StageOptions& options)
      : tape_(tape),
        settings_(settings),
        options_(options),
        groups_(named_groups(settings, available, options.name)),
        loss_(record_loss(settings, terms, inputs, options.name)),
        optimizer_(tape, groups_, settings.optimizer) {
    for (const ParameterGroup<S>& group : available) set_frozen(tape, group, true);
    for (const OptimizerGroup<S>& group : groups_) {
      hold(group.parameters);
    }
    held_ = reached_outputs(options.held);
    for (const LeftOut& asked : loss_.left_out) left_out_.emplace_back(static_cast<std::size_t>(asked.objects), 0);
    if (options.curvature != nullptr) optimizer_.set_curvature(*options.curvature);
    if (options.kept == nullptr || optimizer_.adam() == nullptr) return;
    for (const OptimizerGroup<S>& group : groups_) {
      const auto kept = options.kept->find(group.parameters.name);
      if (kept != options.kept->end() && !kept->second.blocks.empty())
        optimizer_.adam()->set_moments(group.parameters.name, kept->second);
    }
  }

  StageResult run(const StageCallback& callback) {
    const auto start = Clock::now();
    Index iterations = 0;
    while (iterations < settings_.iterations && !optimizer_.is_done()) iterate(iterations++, callback);
    evaluate_the_end();
    keep_moments();
    keep_curvature();
    std::vector<NodeStatistics> nodes = options_.profile ? tape_.statistics() : std::vector<NodeStatistics>();
    return {iterations,
            evaluated_loss(),
            loss_.values,
            std::move(loss_.off),
            optimizer_.rollbacks() + undone_at_end_,
            seconds_since(start),
            times_,
            left_out_objects(),
            loss_.notes,
            std::move(nodes),
            options_.time_curvature ? curvature_cost() : std::nullopt};
  }

 private:
  void iterate(Index i, const StageCallback& callback) {
    const auto start = Clock::now();
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
    }
    times_.step += seconds_since(differentiated);
    if (!callback) return;
    callback({i, settings_.iterations, loss, loss_.values, step.groups, step.rolled_back, step.rollbacks, offender_,
              seconds_since(start), counters, shares_});
  }

  /// Held outputs that the loss depends on; what it does not is never computed.
  std::vector<HeldOutput> reached_outputs(const std::vector<HeldOutput>& asked) {
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

  bool is_moved(const HeldOutput& held, Index iteration) const {
    return std::any_of(groups_.begin(), groups_.end(), [&](const OptimizerGroup<S>& group) {
      return moves_in(group.settings, iteration) &&
             std::find(held.groups.begin(), held.groups.end(), group.parameters.name) != held.groups.end();
    });
  }

  /// Follows its inputs where a group moves that it waits for. Made anew and held at the first iteration, after each
  /// such step (a bad one has to show), and after a bad evaluation, whose numbers it may hold.
  void hold_values(Index iteration) {
    for (const HeldOutput& held : held_) {
      const Var<S> value = TapeInspector<S>(tape_).handle(held.id);
      if (is_moved(held, iteration)) {
        tape_.release(value);
      } else if (iteration == 0 || is_moved(held, iteration - 1) || !offender_.empty()) {
        make_and_hold(value);
      }
    }
  }
  void make_and_hold(Var<S> value) {
    tape_.release(value);
    tape_.forward(value);
    tape_.hold(value);
  }

  std::vector<GradientShare> shares_of_terms(Index iteration) {
    std::vector<WeightedTerm<S>> terms;
    for (std::size_t k = 0; k < loss_.terms.size(); ++k)
      terms.push_back({loss_.values[k].name, loss_.terms[k], loss_.values[k].weight});
    return gradient_shares<S>(tape_, terms, groups_, iteration);
  }

  /// Row D9: beyond a whole turn the derivative of an axis-angle vanishes, so none gets that far. The mean
  /// gradient belongs to the numbers that a row had; squares are alike on both sides of half a turn.
  void wrap_rotations(const StepReport& step) {
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      if (!groups_[g].parameters.are_axis_angles || !step.groups[g].moved) continue;
      for (const Var<S> block : groups_[g].parameters.blocks) {
        for (const Index row : wrap_axis_angles(block)) optimizer_.adam()->clear_mean(block, row);
      }
    }
  }

  void hold_ranges(const StepReport& step) {
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      if (step.groups[g].moved) hold(groups_[g].parameters);
    }
  }
  static void hold(const ParameterGroup<S>& group) {
    if (!group.range) return;
    for (const Var<S> block : group.blocks) hold_in_range(block, *group.range);
  }

  double evaluated_loss() const { return static_cast<double>(tape_.value(loss_.total).scalar()); }

  void read_terms() {
    loss_.read_values();
    for (std::size_t k = 0; k < loss_.left_out.size(); ++k) {
      for (Index o = 0; o < loss_.left_out[k].objects; ++o) {
        if (loss_.left_out[k].is_left_out(o)) ++left_out_[k][static_cast<std::size_t>(o)];
      }
    }
  }

  std::vector<LeftOutObject> left_out_objects() const {
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
  void check_reached(Index iteration) const {
    for (const OptimizerGroup<S>& group : groups_) {
      const auto& blocks = group.parameters.blocks;
      if (blocks.empty() || !moves_in(group.settings, iteration)) continue;
      if (std::any_of(blocks.begin(), blocks.end(), [&](Var<S> block) { return tape_.has_gradient(block); })) continue;
      throw no_term_depends_on(group.parameters.name, loss_.values, options_.name);
    }
  }

  void note_rollback(const BadNumber& bad, Index iteration) {
    if (offender_.empty()) offender_ = bad.text() + first_bad_node();
    const Adam<S>* const adam = optimizer_.adam();
    const Index count = adam != nullptr ? adam->bad_in_a_row() : optimizer_.rollbacks();
    if (count <= settings_.optimizer.max_rollbacks) return;
    throw_diverged("iteration " + std::to_string(iteration));
  }

  [[noreturn]] void throw_diverged(const std::string& when) const {
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
  std::string first_bad_node() {
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
  void evaluate_the_end() {
    const auto start = Clock::now();
    forward_of_all();
    times_.forward += seconds_since(start);
    read_terms();
    if (std::isfinite(evaluated_loss())) return;
    offender_ = "the loss is " + rounded(evaluated_loss(), 6) + first_bad_node();
    if (optimizer_.adam() != nullptr && optimizer_.adam()->undo()) {
      ++undone_at_end_;
      forward_of_all();
      read_terms();
    }
    if (!std::isfinite(evaluated_loss())) throw_diverged("the last iteration");
  }

  /// With held outputs as the parameters now are.
  void forward_of_all() {
    for (const HeldOutput& held : held_) make_and_hold(TapeInspector<S>(tape_).handle(held.id));
    tape_.forward(loss_.total);
  }

  void keep_moments() const {
    if (options_.kept == nullptr || optimizer_.adam() == nullptr) return;
    for (const OptimizerGroup<S>& group : groups_) {
      const auto kept = options_.kept->find(group.parameters.name);
      if (kept != options_.kept->end()) kept->second = optimizer_.adam()->moments(group.parameters.name);
    }
  }

  void keep_curvature() const {
    if (options_.curvature == nullptr) return;
    std::vector<double> learnt = optimizer_.curvature();
    if (!learnt.empty()) *options_.curvature = std::move(learnt);
  }

  /// Made twice: the first meets its memory for the first time.
  std::optional<CurvatureCost> curvature_cost() {
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

  Tape<S>& tape_;
  const StageSettings& settings_;
  const StageOptions& options_;
  std::vector<OptimizerGroup<S>> groups_;
  RecordedLoss<S> loss_;
  Optimizer<S> optimizer_;
  Index undone_at_end_ = 0;
  std::vector<std::vector<Index>> left_out_;  // evaluations, by loss_.left_out and object
  std::vector<GradientShare> shares_;         // of this iteration
  std::vector<HeldOutput> held_;
  StageTimes times_;
  std::string offender_;  // of the last evaluation, if it was bad
};

}  // namespace

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
  check_groups(settings, names_of(available), "stage '" + options.name + "'");
  const TapeGuard<S> guard(tape, available);
  if (options.profile) tape.clear_statistics();
  tape.set_profiling(options.profile);
  try {
    StageResult result = StageRun<S>(tape, settings, terms, inputs, available, options).run(callback);
    guard.restore();
    release(tape, options.held);
    return result;
  } catch (...) {
    guard.restore();
    release(tape, options.held);
    throw;
  }
}

template StageResult run_stage(Tape<float>&, const StageSettings&, std::span<const LossTerm>, const LossInputs<float>&,
                               const std::vector<ParameterGroup<float>>&, const StageCallback&, const StageOptions&);
template StageResult run_stage(Tape<double>&, const StageSettings&, std::span<const LossTerm>,
                               const LossInputs<double>&, const std::vector<ParameterGroup<double>>&,
                               const StageCallback&, const StageOptions&);

}  // namespace hsi4d
