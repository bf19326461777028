// What becomes of numbers that are none, or that are extreme, in one row of an operator's inputs. [brush: the list of
// numbers]
//
// Every array of an operator is cut into units that have nothing to do with each other (a row each, or the rows of a
// frame, of a joint): poison in one unit may make that unit's outputs and gradients into anything, but those of all
// others have to keep their bits. Arrays that all units share may become anything, but for operators which say that
// they draw nothing of a bad row: their gradients stay finite then.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <exception>
#include <functional>
#include <limits>
#include <set>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "autodiff/elementwise.h"
#include "autodiff/inspect.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "core/check.h"
#include "core/random.h"
#include "stress/small_scene.h"
#include "stress/stress.h"

namespace hsi4d::stress {

/// The numbers that are tried.
template <class S>
inline constexpr S kPoison[] = {std::numeric_limits<S>::quiet_NaN(),
                                std::numeric_limits<S>::infinity(),
                                -std::numeric_limits<S>::infinity(),
                                std::numeric_limits<S>::denorm_min(),
                                S(0),
                                std::is_same_v<S, float> ? S(3e38) : S(1e300),
                                std::is_same_v<S, float> ? S(-3e38) : S(-1e300)};

/// Unit of a row, rows counted through all planes. Empty: each row is one.
using UnitOf = std::function<Index(Index row)>;
inline constexpr Index kSharedUnit = -1;  ///< of all units
inline Index shared(Index) { return kSharedUnit; }
/// `rows` rows a unit.
inline UnitOf units_of(Index rows) {
  return [rows](Index row) { return row / rows; };
}

/// An input.
struct PoisonInput {
  Shape shape;
  UnitOf unit = {};
  double low = -1, high = 1;         ///< of its good numbers
  std::vector<double> numbers = {};  ///< instead of random ones
};

template <class S>
using Vars = std::vector<Var<S>>;

/// An operator and how its arrays hang together.
template <class S>
struct PoisonedOperator {
  std::vector<PoisonInput> inputs;
  std::function<Vars<S>(const Vars<S>&)> record;
  std::vector<UnitOf> outputs = {};  ///< units; fewer than outputs: each row is one
  bool contains = false;             ///< nothing that is not finite gets from a row to what is shared
  Index reach = 0;                   ///< units as near as this do have to do with each other
};

/// Operators by the names that they have on tapes.
using OperatorNames = std::set<std::string>;

/// Adds the operators between poisoned arrays and outputs each of whose inputs depends on a poisoned one.
template <class S>
void add_poisoned_operators(Tape<S>& tape, const Vars<S>& poisoned, const Vars<S>& outputs, OperatorNames& names) {
  TapeInspector<S> inspect(tape);
  std::set<std::uint32_t> bad;
  for (const Var<S> var : poisoned) bad.insert(var.id);
  for (const Var<S> output : outputs) {
    for (const std::uint32_t node : inspect.nodes_of(output)) {
      const std::vector<std::uint32_t> inputs = inspect.inputs(node), results = inspect.outputs(node);
      const auto count =
          std::count_if(inputs.begin(), inputs.end(), [&bad](std::uint32_t id) { return bad.contains(id); });
      if (count > 0) bad.insert(results.begin(), results.end());
      if (count > 0 && count == std::ssize(inputs)) names.insert(inspect.operator_name(node));
    }
  }
}

/// What leaked.
struct Leaks {
  double tried = 0;
  double values = 0, gradients = 0;  ///< numbers of other units that changed
  double shared = 0;                 ///< gradients of what is shared that are not finite, where they have to be
  double errors = 0;                 ///< internal errors

  void operator+=(const Leaks& other) {
    tried += other.tried, values += other.values, gradients += other.gradients;
    shared += other.shared, errors += other.errors;
  }
};

inline bool same_bits(double a, double b) { return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b); }

/// Rows taken by a product with ones and zeros in place of an index: the zeros let NaN and infinities through.
template <class S>
Var<S> selected_by_product(Var<S> x) {
  const Shape shape = x.shape();  // a copy: recording moves shapes
  if (shape.planes != 1 || !shape.dense() || shape.rows < 2) return x;
  Tape<S>& tape = x.owner();
  const Var<S> identity = tape.constant("identity", shape_of(shape.rows, shape.rows));
  const Array<S> ones = tape.write(identity);
  for (Index i = 0; i < shape.rows; ++i) ones(i, i) = 1;
  return matmul(identity, x);
}

/// An operator on a tape, with Σ weight · output as its loss.
template <class S>
class PoisonTrial {
 public:
  PoisonTrial(const PoisonedOperator<S>& op, Remedy remedy) : op_(op) {
    RandomSequence random(77);
    Vars<S> taken;
    for (const PoisonInput& input : op.inputs) {
      const Var<S> var = tape_.parameter("input", input.shape);
      std::vector<double> numbers = input.numbers;
      for (Index i = std::ssize(numbers); i < input.shape.count(); ++i)
        numbers.push_back(random.uniform(input.low, input.high));
      set_numbers(tape_, var, numbers);
      inputs_.push_back(var);
      taken.push_back(remedy == Remedy::kOff && !is_shared(input) ? selected_by_product(var) : var);
    }
    outputs_ = op.record(taken);
    add_poisoned_operators(tape_, inputs_, outputs_, operators_);
    for (Var<S>& output : outputs_) {
      if (remedy == Remedy::kOff) output = selected_by_product(output);
      const Var<S> weight = tape_.constant("weight", output.shape());
      std::vector<double> numbers;
      for (Index i = 0; i < output.shape().count(); ++i) numbers.push_back(random.uniform(0.5, 1.5));
      set_numbers(tape_, weight, numbers);
      const Var<S> term = sum(output * weight);
      loss_ = loss_.tape == nullptr ? term : loss_ + term;
    }
    run();
    values_ = all_values();
    gradients_ = all_gradients();
  }

  /// Each number in some rows of each input.
  Leaks leaks() {
    Leaks found;
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      const Array<S> array = tape_.write(inputs_[i]);
      const Index rows = array.total_rows(), cols = array.shape.cols;
      for (const Index row : {Index(0), rows / 2, rows - 1}) {
        for (const S poison : kPoison<S>) found += leaks_of(i, row, (row + 1) % cols, poison);
      }
    }
    return found;
  }

  const OperatorNames& operators() const { return operators_; }

 private:
  bool is_shared(const PoisonInput& input) const { return input.unit && input.unit(0) == kSharedUnit; }
  void run() {
    tape_.forward(loss_);
    tape_.backward(loss_);
  }
  std::vector<std::vector<double>> all_values() const {
    std::vector<std::vector<double>> all;
    for (const Var<S> output : outputs_) all.push_back(numbers_of<S>(tape_.value(output)));
    return all;
  }
  std::vector<std::vector<double>> all_gradients() const {
    std::vector<std::vector<double>> all;
    for (const Var<S> input : inputs_) {
      all.push_back(tape_.has_gradient(input) ? numbers_of<S>(tape_.gradient(input)) : std::vector<double>());
    }
    return all;
  }
  Leaks leaks_of(std::size_t input, Index row, Index col, S poison) {
    Leaks found;
    found.tried = 1;
    const S good = tape_.value(inputs_[input]).row(row)[col];
    const UnitOf& unit = op_.inputs[input].unit;
    const Index bad = unit ? unit(row) : row;
    tape_.write(inputs_[input]).row(row)[col] = poison;
    try {
      run();
      if (bad != kSharedUnit) compare(bad, !std::isfinite(poison), found);
    } catch (const UserError&) {  // a camera that makes no sense: told
    } catch (const std::exception&) {
      found.errors += 1;
    }
    tape_.write(inputs_[input]).row(row)[col] = good;
    return found;
  }
  void compare(Index bad, bool is_not_finite, Leaks& found) const {
    const auto values = all_values(), gradients = all_gradients();
    for (std::size_t o = 0; o < values.size(); ++o) {
      const UnitOf unit = o < op_.outputs.size() ? op_.outputs[o] : UnitOf();
      found.values += changed(values[o], values_[o], outputs_[o].shape().cols, unit, bad);
    }
    for (std::size_t i = 0; i < gradients.size(); ++i) {
      const UnitOf& unit = op_.inputs[i].unit;
      found.gradients += changed(gradients[i], gradients_[i], inputs_[i].shape().cols, unit, bad);
      if (!op_.contains || !is_not_finite || !is_shared(op_.inputs[i])) continue;
      for (const double x : gradients[i]) found.shared += std::isfinite(x) ? 0 : 1;
    }
  }
  double changed(const std::vector<double>& now, const std::vector<double>& before, Index cols, const UnitOf& unit,
                 Index bad) const {
    double count = 0;
    for (std::size_t i = 0; i < now.size(); ++i) {
      const Index row = static_cast<Index>(i) / cols, own = unit ? unit(row) : row;
      if (own != kSharedUnit && std::abs(own - bad) > op_.reach) count += same_bits(now[i], before[i]) ? 0 : 1;
    }
    return count;
  }

  const PoisonedOperator<S>& op_;
  Tape<S> tape_;
  Vars<S> inputs_, outputs_;
  OperatorNames operators_;
  Var<S> loss_;
  std::vector<std::vector<double>> values_, gradients_;
};

template <class S>
Leaks leaks_of(const std::vector<PoisonedOperator<S>>& operators, Remedy remedy) {
  Leaks all;
  for (const PoisonedOperator<S>& op : operators) all += PoisonTrial<S>(op, remedy).leaks();
  return all;
}

/// The figures of a family of operators in float and double.
/// @param make  make.operator()<S>() gives them
template <class F>
std::vector<StressFigure> family_leaks(const F& make, Remedy remedy) {
  Leaks all = leaks_of(make.template operator()<float>(), remedy);
  all += leaks_of(make.template operator()<double>(), remedy);
  return {{"values of other rows that change", all.values, 0},
          {"gradients of other rows that change", all.gradients, 0},
          {"shared gradients that are lost with a bad row", all.shared, 0},
          {"internal errors", all.errors, 0}};
}

/// Adds the operators of a family.
template <class F>
void add_family_operators(const F& make, OperatorNames& names) {
  for (const PoisonedOperator<double>& op : make.template operator()<double>())
    names.merge(OperatorNames(PoisonTrial<double>(op, Remedy::kOn).operators()));
}

// The families, by file.
std::vector<StressFigure> poisoned_elements(Remedy remedy);   ///< poison_autodiff.cpp
std::vector<StressFigure> poisoned_arrays(Remedy remedy);     ///< likewise
std::vector<StressFigure> poisoned_networks(Remedy remedy);   ///< likewise
std::vector<StressFigure> poisoned_splats(Remedy remedy);     ///< poison_splat.cpp
std::vector<StressFigure> poisoned_composite(Remedy remedy);  ///< poison_render.cpp
std::vector<StressFigure> poisoned_render(Remedy remedy);     ///< likewise
std::vector<StressFigure> poisoned_skeletons(Remedy remedy);  ///< poison_body.cpp
std::vector<StressFigure> poisoned_body_nets(Remedy remedy);  ///< likewise
std::vector<StressFigure> poisoned_masks(Remedy remedy);      ///< poison_losses.cpp
std::vector<StressFigure> poisoned_losses(Remedy remedy);     ///< likewise
std::vector<StressFigure> poisoned_distances(Remedy remedy);  ///< poison_optim.cpp

// Adds the operators of a file's families whose every input is poisoned.
void add_autodiff_operators(OperatorNames& names);
void add_splat_operators(OperatorNames& names);
void add_render_operators(OperatorNames& names);
void add_body_operators(OperatorNames& names);
void add_optim_operators(OperatorNames& names);

/// All of them.
OperatorNames poisoned_operators();

}  // namespace hsi4d::stress
