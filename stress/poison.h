// What becomes of numbers that are none, or that are extreme, in one row of an operator's inputs. [brush: the list of
// numbers]
//
// Every array of an operator is cut into units that have nothing to do with each other (a row each, or the rows of a
// frame, of a joint): poison in one unit may make that unit's outputs and gradients into anything, but those of all
// others have to keep their bits; operators which say that they draw nothing of a bad row keep the gradients of what
// all units share finite. What all units share reaches everything, so that other rules hold of it, and of every input:
// - a number that is not finite is never swallowed: whatever depends on it is not finite either, or is the limit that
//   an infinity has, or an error says so. Which results depend on a number is measured, by other good ones in its
//   place. kGates names the operators that take out what is bad, and why;
// - where 0 or a denormal stands in what all units share, values and gradients are finite, but at the poles of kPoles;
// - a run after a bad number has gone has the bits of the runs before it: nothing of it is kept.
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
#include "core/rotation.h"
#include "stress/measures.h"
#include "stress/rows.h"
#include "stress/splat_scene.h"
#include "stress/tape_numbers.h"

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

/// Records an operator: a function of its inputs that returns its result, or its results.
template <class S>
class PoisonRecord {
 public:
  template <class F>
  PoisonRecord(F f)
      : record_([f](const Vars<S>& in) {
          if constexpr (std::is_same_v<decltype(f(in)), Var<S>>)
            return Vars<S>{f(in)};
          else
            return f(in);
        }) {}
  Vars<S> operator()(const Vars<S>& in) const { return record_(in); }

 private:
  std::function<Vars<S>(const Vars<S>&)> record_;
};

/// An operator and how its arrays hang together.
template <class S>
struct PoisonedOperator {
  std::vector<PoisonInput> inputs;
  PoisonRecord<S> record;
  std::vector<UnitOf> outputs = {};  ///< units; fewer than outputs: each row is one
  bool contains = false;             ///< nothing that is not finite gets from a row to what is shared
  Index reach = 0;                   ///< units as near as this do have to do with each other
};

/// Rotations by rows, [rows,9].
inline std::vector<double> some_rotations(Index rows) {
  std::vector<double> numbers;
  RandomSequence random(78);
  for (Index n = 0; n < rows; ++n) {
    const Matrix3<double> r =
        so3_exp(Vector3<double>(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)));
    for (int i = 0; i < 9; ++i) numbers.push_back(r(i / 3, i % 3));
  }
  return numbers;
}

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

/// An operator that may do what is a fault of others.
struct PoisonException {
  const char* op;
  const char* why;
};
/// Finite results may depend on what is not finite.
inline constexpr PoisonException kGates[] = {
    {"canonical_directions",
     "(0, 0, 1) where a direction is not finite; the point or the camera is not, which draws nothing"},
    {"gaussian_axes", "nine zeros, which are not drawn"},
    {"project",
     "six zeros, which are not drawn (row A4): nothing of a camera that is not finite; steps keep it finite (D4)"},
    {"rotations_from_6d", "a rotation in every case: a column that is not finite is replaced (row C9)"},
};
/// No finite result at 0.
inline constexpr PoisonException kPoles[] = {{"divide", "a / 0"}};

inline bool is_excepted(std::span<const PoisonException> exceptions, const OperatorNames& names) {
  return std::any_of(exceptions.begin(), exceptions.end(),
                     [&names](const PoisonException& exception) { return names.contains(exception.op); });
}

/// What leaked.
struct Leaks {
  double tried = 0;
  double values = 0, gradients = 0;  ///< numbers of other units that changed
  double shared = 0;                 ///< gradients of what is shared that are not finite, where they have to be
  double errors = 0;                 ///< internal errors
  double swallowed = 0;              ///< finite results of what is not finite, that are no limit
  double gated = 0;                  ///< the same, of operators that are in kGates
  double lost = 0;                   ///< results that are not finite, of a 0 or a denormal in what is shared
  double kept = 0;                   ///< results that are others after a bad number has gone

  void operator+=(const Leaks& other) {
    tried += other.tried, values += other.values, gradients += other.gradients;
    shared += other.shared, errors += other.errors;
    swallowed += other.swallowed, gated += other.gated, lost += other.lost, kept += other.kept;
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

/// x as its sign, which is x / |x|, times |x|: not a number at 0.
template <class S>
Var<S> from_its_sign(Var<S> x) {
  return x / abs(x) * abs(x);
}

/// The results of an operator, an array each.
using PoisonResults = std::vector<std::vector<double>>;

/// Which numbers of results have other bits than those of others.
inline std::vector<std::vector<bool>> changed_numbers(const PoisonResults& now, const PoisonResults& before) {
  std::vector<std::vector<bool>> changed(now.size());
  for (std::size_t o = 0; o < now.size(); ++o)
    for (std::size_t i = 0; i < now[o].size(); ++i) changed[o].push_back(!same_bits(now[o][i], before[o][i]));
  return changed;
}

/// Finite results of a number that is not finite which are not what results tend to.
///
/// @param depends  which depend on that number
/// @param near     results of large finite numbers of an infinity's sign; none for NaN, which has no limit
inline double swallowed_numbers(const PoisonResults& results, const std::vector<std::vector<bool>>& depends,
                                const std::vector<PoisonResults>& near) {
  double count = 0;
  for (std::size_t o = 0; o < results.size(); ++o) {
    for (std::size_t i = 0; i < results[o].size(); ++i) {
      const double x = results[o][i];
      if (!depends[o][i] || !std::isfinite(x)) continue;
      const bool is_limit = std::any_of(near.begin(), near.end(), [&](const PoisonResults& close) {
        return std::abs(close[o][i] - x) <= 1e-3 * (1 + std::abs(x));
      });
      count += is_limit ? 0 : 1;
    }
  }
  return count;
}

/// An operator on a tape, with Σ weight · output as its loss.
template <class S>
class PoisonTrial {
 public:
  PoisonTrial(const PoisonedOperator<S>& op, Remedy remedy) : op_(op), remedy_(remedy) {
    RandomSequence random(77);
    Vars<S> taken;
    for (const PoisonInput& input : op.inputs) {
      const Var<S> var = tape_.parameter("input", input.shape);
      std::vector<double> numbers = input.numbers;
      for (Index i = std::ssize(numbers); i < input.shape.count(); ++i)
        numbers.push_back(random.uniform(input.low, input.high));
      set_numbers(tape_, var, numbers);
      inputs_.push_back(var);
      taken.push_back(remedy == Remedy::kOn ? var : is_shared(input) ? from_its_sign(var) : selected_by_product(var));
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
    is_gated_ = remedy == Remedy::kOn && is_excepted(kGates, operators_);
    has_pole_ = remedy == Remedy::kOn && is_excepted(kPoles, operators_);
  }

  /// Each number in some rows of each input.
  Leaks leaks() {
    Leaks found;
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      const Array<S> array = tape_.write(inputs_[i]);
      const Index rows = array.total_rows(), cols = array.shape.cols;
      for (const Index row : {Index(0), rows / 2, rows - 1}) found += leaks_at({i, row, (row + 1) % cols});
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
  PoisonResults all_values() const {
    PoisonResults all;
    for (const Var<S> output : outputs_) all.push_back(numbers_of<S>(tape_.value(output)));
    return all;
  }
  PoisonResults all_gradients() const {
    PoisonResults all;
    for (const Var<S> input : inputs_) {
      all.push_back(tape_.has_gradient(input) ? numbers_of<S>(tape_.gradient(input)) : std::vector<double>());
    }
    return all;
  }

  /// A number of the inputs.
  struct Place {
    std::size_t input;
    Index row, col;
  };
  S& at(Place place) { return tape_.write(inputs_[place.input]).row(place.row)[place.col]; }

  Leaks leaks_at(Place place) {
    const std::vector<std::vector<bool>> depends = depends_on(place);
    Leaks found;
    for (const S poison : kPoison<S>) found += leaks_of(place, poison, depends);
    return found;
  }

  /// The values with another good number there; none where it is refused.
  std::vector<PoisonResults> values_with(Place place, std::initializer_list<double> numbers) {
    std::vector<PoisonResults> all;
    const S good = at(place);
    for (const double number : numbers) {
      at(place) = static_cast<S>(number);
      try {
        tape_.forward(loss_);
        all.push_back(all_values());
      } catch (const UserError&) {
      }
      at(place) = good;
    }
    return all;
  }

  /// Which values depend on a number: those that others in its place change.
  std::vector<std::vector<bool>> depends_on(Place place) {
    const auto good = static_cast<double>(at(place));
    std::vector<std::vector<bool>> depends = changed_numbers(values_, values_);
    for (const PoisonResults& values : values_with(place, {good * 1.01 + 1e-3, good * 0.99 - 1e-3})) {
      const std::vector<std::vector<bool>> changed = changed_numbers(values, values_);
      for (std::size_t o = 0; o < depends.size(); ++o)
        for (std::size_t i = 0; i < depends[o].size(); ++i) depends[o][i] = depends[o][i] || changed[o][i];
    }
    return depends;
  }

  Leaks leaks_of(Place place, S poison, const std::vector<std::vector<bool>>& depends) {
    Leaks found;
    found.tried = 1;
    const PoisonInput& input = op_.inputs[place.input];
    const S good = at(place);
    const Index bad = input.unit ? input.unit(place.row) : place.row;
    PoisonResults poisoned;
    at(place) = poison;
    try {
      run();
      poisoned = all_values();
      if (bad != kSharedUnit) {
        compare(bad, !std::isfinite(poison), found);
      } else if (std::abs(poison) < 1 && !has_pole_) {
        found.lost += not_finite(poisoned) + not_finite(all_gradients());
      }
    } catch (const UserError&) {  // a camera that makes no sense: told
    } catch (const std::exception&) {
      found.errors += 1;
    }
    at(place) = good;
    if (!poisoned.empty() && !std::isfinite(poison)) {
      const double sign = poison > 0 ? 1 : -1;
      const double swallowed = swallowed_numbers(
          remedy_ == Remedy::kOn ? poisoned : finite_ones(poisoned), depends,
          std::isnan(poison) ? std::vector<PoisonResults>{} : values_with(place, {1e6 * sign, 1e12 * sign}));
      (is_gated_ ? found.gated : found.swallowed) += swallowed;
    }
    run();
    found.kept += kept_of(all_values(), poisoned, values_) + kept_of(all_gradients(), {}, gradients_);
    return found;
  }

  /// Results of a clean run that are not those before a bad one. Without the remedy a result holds what was, and takes
  /// it away again, as a sum that goes on does.
  double kept_of(PoisonResults now, const PoisonResults& poisoned, const PoisonResults& before) const {
    for (std::size_t o = 0; remedy_ == Remedy::kOff && o < poisoned.size(); ++o)
      for (std::size_t i = 0; i < now[o].size(); ++i) now[o][i] = (now[o][i] + poisoned[o][i]) - poisoned[o][i];
    double count = 0;
    for (const std::vector<bool>& changed : changed_numbers(now, before))
      count += static_cast<double>(std::count(changed.begin(), changed.end(), true));
    return count;
  }

  /// With 0 in place of what is not finite, which is how it is often "mended".
  static PoisonResults finite_ones(PoisonResults results) {
    for (std::vector<double>& numbers : results)
      for (double& x : numbers) x = std::isfinite(x) ? x : 0;
    return results;
  }

  static double not_finite(const PoisonResults& results) {
    double count = 0;
    for (const std::vector<double>& numbers : results) count += stress::not_finite(numbers);
    return count;
  }

  void compare(Index bad, bool is_not_finite, Leaks& found) const {
    const PoisonResults values = all_values(), gradients = all_gradients();
    for (std::size_t o = 0; o < values.size(); ++o) {
      const UnitOf unit = o < op_.outputs.size() ? op_.outputs[o] : UnitOf();
      found.values += changed(values[o], values_[o], outputs_[o].shape().cols, unit, bad);
    }
    for (std::size_t i = 0; i < gradients.size(); ++i) {
      const UnitOf& unit = op_.inputs[i].unit;
      found.gradients += changed(gradients[i], gradients_[i], inputs_[i].shape().cols, unit, bad);
      if (!op_.contains || !is_not_finite || !is_shared(op_.inputs[i])) continue;
      found.shared += stress::not_finite(gradients[i]);
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
  Remedy remedy_;
  Tape<S> tape_;
  Vars<S> inputs_, outputs_;
  OperatorNames operators_;
  Var<S> loss_;
  PoisonResults values_, gradients_;
  bool is_gated_ = false, has_pole_ = false;
};

/// @param idle  gates that took out nothing so far; those of these operators are added, or removed
template <class S>
Leaks leaks_of(const std::vector<PoisonedOperator<S>>& operators, Remedy remedy, OperatorNames& idle) {
  Leaks all;
  OperatorNames gates, busy;
  for (const PoisonedOperator<S>& op : operators) {
    PoisonTrial<S> trial(op, remedy);
    const Leaks leaks = trial.leaks();
    for (const PoisonException& gate : kGates) {
      if (!trial.operators().contains(gate.op)) continue;
      gates.insert(gate.op);
      if (leaks.gated > 0) busy.insert(gate.op);
    }
    all += leaks;
  }
  for (const std::string& gate : gates) busy.contains(gate) ? idle.erase(gate) : idle.insert(gate).second;
  return all;
}

/// The figures of a family of operators in float and double.
/// @param make  make.operator()<S>() gives them
template <class F>
std::vector<StressFigure> family_leaks(const F& make, Remedy remedy) {
  OperatorNames idle;
  Leaks all = leaks_of(make.template operator()<float>(), remedy, idle);
  all += leaks_of(make.template operator()<double>(), remedy, idle);
  return {{"values of other rows that change", all.values, 0},
          {"gradients of other rows that change", all.gradients, 0},
          {"shared gradients that are lost with a bad row", all.shared, 0},
          {"finite results of what is not, and no limit", all.swallowed, 0},
          {"operators that are to take it out, and do not", static_cast<double>(idle.size()), 0},
          {"results lost by a 0 that all rows share", all.lost, 0},
          {"results that differ when the number is good again", all.kept, 0},
          {"internal errors", all.errors, 0}};
}

/// Adds the operators of a family.
template <class F>
void add_family_operators(const F& make, OperatorNames& names) {
  for (const PoisonedOperator<double>& op : make.template operator()<double>())
    names.merge(OperatorNames(PoisonTrial<double>(op, Remedy::kOn).operators()));
}

/// The operators of a family, beside the row that it is.
using FamilyOperators = void(OperatorNames&);
FamilyOperators add_autodiff_operators, add_splat_operators, add_render_operators, add_body_operators,
    add_optim_operators;

/// Those of all families, whose every input is poisoned.
inline OperatorNames poisoned_operators() {
  OperatorNames names;
  for (const auto add :
       {add_autodiff_operators, add_splat_operators, add_render_operators, add_body_operators, add_optim_operators})
    add(names);
  return names;
}

}  // namespace hsi4d::stress
