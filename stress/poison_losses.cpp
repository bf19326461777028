// Rows P9 to P11: loss terms and the operators of optim. What does not count is not looked at; what makes a loss into
// no number moves nothing.
#include <algorithm>
#include <cmath>
#include <memory>

#include "optim/solid/distance_grid.h"
#include "stress/loss_inputs.h"
#include "stress/measures.h"
#include "stress/plain_adam.h"
#include "stress/poison.h"

namespace hsi4d::stress {

namespace {

const LossTerm& term_named(const std::string& name) {
  return *std::find_if(loss_terms().begin(), loss_terms().end(),
                       [&](const LossTerm& term) { return term.description.name == name; });
}

/// A term and all that it may read.
template <class S>
struct TermOnTape {
  Tape<S> tape;
  LossLeaves<S> made = loss_leaves(tape);
  Var<S> loss;

  explicit TermOnTape(const LossTerm& term) : loss(term.record(made.inputs)) {}
  void run() {
    tape.forward(loss);
    tape.backward(loss);
  }
  /// The loss, and the gradients of all that may move.
  std::vector<double> results() const {
    std::vector<double> all = numbers_of<S>(tape.value(loss));
    for (const Var<S> leaf : made.leaves) {
      if (!tape.has_gradient(leaf)) continue;
      const std::vector<double> d = numbers_of<S>(tape.gradient(leaf));
      all.insert(all.end(), d.begin(), d.end());
    }
    return all;
  }
};

/// Sum of w |a − b| over pixels, plainly.
template <class S>
std::vector<double> plainly_weighted(const TermOnTape<S>& term) {
  const ConstArray<S> a = term.tape.value(term.made.inputs.rendered), b = term.tape.value(term.made.inputs.target),
                      w = term.tape.value(term.made.inputs.weight);
  double sum = 0;
  for (Index r = 0; r < a.total_rows(); ++r) {
    for (Index c = 0; c < a.shape.cols; ++c)
      sum += static_cast<double>(w.row(r % kLossHeight)[c]) * std::abs(static_cast<double>(a.row(r)[c] - b.row(r)[c]));
  }
  return {sum};
}

/// Results that poison changes in pixels which do not count.
struct Unheard {
  double pixels = 0, objects = 0;
};

/// Poison in some images of a term at a pixel of plane 1 that does not count.
///
/// @param results  of the term
template <class S, class F>
double changed_at_pixel(Tape<S>& tape, const std::vector<Var<S>>& images, const F& results) {
  const std::vector<double> before = results();
  double changed = 0;
  for (const Var<S> image : images) {
    for (const S poison : kPoison<S>) {
      const S good = std::exchange(tape.write(image)(1, 6, 3), poison);
      const std::vector<double> after = results();
      for (std::size_t i = 0; i < after.size(); ++i) changed += after[i] == before[i] ? 0 : 1;
      tape.write(image)(1, 6, 3) = good;
    }
  }
  return changed;
}

template <class S>
double changed_by_pixels(const char* name, Remedy remedy) {
  TermOnTape<S> term(term_named(name));
  const LossInputs<S>& in = term.made.inputs;
  term.tape.freeze(in.weight);
  const Array<S> weight = term.tape.write(in.weight);
  for (Index r = 0; r < kLossHeight; ++r) std::fill_n(weight.row(r), 8, S(0));
  return changed_at_pixel<S>(term.tape, {in.rendered, in.target}, [&] {
    term.run();
    return remedy == Remedy::kOn ? term.results() : plainly_weighted(term);
  });
}

/// The second object's mask shows nothing of it.
template <class S>
double changed_by_masks(Remedy remedy) {
  TermOnTape<S> term(term_named("mask"));
  const LossInputs<S>& in = term.made.inputs;
  term.tape.freeze(in.object_seen);
  term.tape.write(in.object_seen)(1, 0, 0) = 0;
  return changed_at_pixel<S>(term.tape, {in.object_opacity, in.object_masks}, [&]() -> std::vector<double> {
    term.run();
    if (remedy == Remedy::kOn) return term.results();
    double sum = 0;
    for (const Var<S> image : {in.object_opacity, in.object_masks}) {
      const ConstArray<S> numbers = term.tape.value(image);
      for (Index r = 0; r < kLossObjects * kLossHeight; ++r) {
        const double seen = r < kLossHeight ? 1 : 0;
        for (Index c = 0; c < kLossWidth; ++c) sum += seen * static_cast<double>(numbers.row(r)[c]);
      }
    }
    return {sum};
  });
}

/// The second object is not in the frame.
template <class S>
double changed_by_objects(Remedy remedy) {
  TermOnTape<S> term(term_named("center"));
  Tape<S>& tape = term.tape;
  const LossInputs<S>& in = term.made.inputs;
  const Var<S> opacity = in.object_opacity, target = in.object_center_target;
  tape.write(target)(1, 2) = 0;
  const auto results = [&]() -> std::vector<double> {
    term.run();
    if (remedy == Remedy::kOn) {  // the gradients of the first object
      std::vector<double> d = numbers_of<S>(tape.gradient(opacity));
      d.resize(static_cast<std::size_t>(kLossHeight * kLossWidth));
      d.push_back(static_cast<double>(tape.value(term.loss).scalar()));
      return d;
    }
    double mass[kLossObjects] = {};
    for (Index r = 0; r < kLossObjects * kLossHeight; ++r) {
      for (Index c = 0; c < kLossWidth; ++c)
        mass[r / kLossHeight] += static_cast<double>(tape.value(opacity).row(r)[c]) * static_cast<double>(c);
    }
    return {1 * mass[0] + 0 * mass[1]};
  };
  const std::vector<double> before = results();
  double changed = 0;
  for (const S poison : kPoison<S>) {
    const S good = std::exchange(tape.write(opacity)(1, 6, 3), poison);
    const std::vector<double> after = results();
    for (std::size_t i = 0; i < after.size(); ++i) changed += after[i] == before[i] ? 0 : 1;
    tape.write(opacity)(1, 6, 3) = good;
  }
  return changed;
}

/// What steps with one poisoned number do.
struct Steps {
  double tried = 0, bad = 0;
  double unheard = 0;  ///< NaN that results depend on, all of which are finite
  double lost = 0;     ///< other parameters that are no numbers after it
  double moved = 0;    ///< bad evaluations that moved something
  double errors = 0;   ///< of the program
};

template <class S>
std::vector<double> all_numbers(const TermOnTape<S>& term) {
  std::vector<double> all;
  for (const Var<S> leaf : term.made.leaves) {
    const std::vector<double> numbers = numbers_of<S>(term.tape.value(leaf));
    all.insert(all.end(), numbers.begin(), numbers.end());
  }
  return all;
}

bool all_finite_numbers(const std::vector<double>& numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); });
}

/// One step of a term's inputs; without the remedy, of Adam's first step as it is without a look at the gradient.
template <class S>
bool step(TermOnTape<S>& term, Remedy remedy, Steps& steps) {
  const std::vector<double> before = all_numbers(term);
  term.run();
  const bool is_bad = !all_finite_numbers(term.results());
  steps.bad += is_bad ? 1 : 0;
  constexpr double kRate = 1e-6;
  if (remedy == Remedy::kOn) {
    Adam<S> adam(term.tape, {moving_at(term.made.leaves, kRate)}, {});
    adam.step(0, 1, static_cast<double>(term.tape.value(term.loss).scalar()));
  } else {
    for (const Var<S> leaf : term.made.leaves) {
      if (!term.tape.has_gradient(leaf)) continue;
      std::vector<double> x = numbers_of<S>(term.tape.value(leaf)), d = numbers_of<S>(term.tape.gradient(leaf));
      for (std::size_t i = 0; i < x.size(); ++i) x[i] -= kRate * d[i] / (std::sqrt(d[i] * d[i]) + 1e-8);
      set_numbers(term.tape, leaf, x);
    }
  }
  const std::vector<double> after = all_numbers(term);
  steps.lost += std::max(0.0, not_finite(after) - not_finite(before));
  double moved = 0;
  for (std::size_t i = 0; i < after.size(); ++i) moved += same_bits(after[i], before[i]) ? 0 : 1;
  steps.moved += is_bad && moved > 0 ? 1 : 0;
  return is_bad;
}

/// Whether results depend on a number: others in its place change them.
template <class S>
bool depends_on(TermOnTape<S>& term, Var<S> leaf, Index row) {
  term.run();
  const std::vector<double> before = term.results();
  const S good = term.tape.value(leaf).row(row)[0];
  bool is_other = false;
  for (const double other : {static_cast<double>(good) * 1.01 + 1e-3, static_cast<double>(good) * 0.99 - 1e-3}) {
    term.tape.write(leaf).row(row)[0] = static_cast<S>(other);
    term.run();
    const std::vector<double> after = term.results();
    for (std::size_t i = 0; i < after.size(); ++i) is_other = is_other || !same_bits(after[i], before[i]);
  }
  term.tape.write(leaf).row(row)[0] = good;
  return is_other;
}

template <class S>
void try_term(const LossTerm& of, Remedy remedy, Steps& steps) {
  TermOnTape<S> term(of);
  term.run();
  std::vector<std::vector<double>> good;
  for (const Var<S> leaf : term.made.leaves) good.push_back(numbers_of<S>(term.tape.value(leaf)));
  for (std::size_t i = 0; i < good.size(); ++i) {
    const Var<S> leaf = term.made.leaves[i];
    if (!term.tape.has_gradient(leaf)) continue;  // the term does not read it
    for (const Index row : {Index(0), term.tape.value(leaf).total_rows() - 1}) {
      const bool is_heard = depends_on(term, leaf, row);
      for (const S poison : kPoison<S>) {
        term.tape.write(leaf).row(row)[0] = poison;
        steps.tried += 1;
        try {
          const bool is_bad = step(term, remedy, steps);
          // Without the remedy what is not finite is 0, as it is often "mended": nothing tells it any more.
          steps.unheard += std::isnan(poison) && is_heard && !(is_bad && remedy == Remedy::kOn) ? 1 : 0;
        } catch (const std::exception&) {
          steps.errors += 1;
        }
        for (std::size_t k = 0; k < good.size(); ++k) set_numbers(term.tape, term.made.leaves[k], good[k]);
      }
    }
  }
}

/// Distances from a ball of 0.2 m, negative within.
std::shared_ptr<DistanceGrid> ball() {
  const auto distance = [](const Vector3<double>& place) { return place.norm() - 0.2; };
  return std::make_shared<DistanceGrid>(distance, DistanceGrid::Settings{.cell = 0.05, .reach = 1, .name = "ball"});
}

struct Distances {
  template <class S>
  std::vector<PoisonedOperator<S>> operator()() const {
    const auto grid = ball();
    std::vector<PoisonedOperator<S>> all;
    all.push_back(
        {{{shape_of(40, 3), {}, -0.3, 0.3}}, [grid](const Vars<S>& in) { return sampled_distance(in[0], grid); }});
    return all;
  }
};

}  // namespace

std::vector<StressFigure> poisoned_masks(Remedy remedy) {
  double pixels = 0;
  for (const char* name : {"photometric", "masked_l2"})
    pixels += changed_by_pixels<float>(name, remedy) + changed_by_pixels<double>(name, remedy);
  return {{"results changed by pixels of weight 0", pixels, 0},
          {"results changed by masks that show nothing",
           changed_by_masks<float>(remedy) + changed_by_masks<double>(remedy), 0},
          {"results changed by an object out of sight",
           changed_by_objects<float>(remedy) + changed_by_objects<double>(remedy), 0}};
}

std::vector<StressFigure> poisoned_losses(Remedy remedy) {
  Steps steps;
  for (const LossTerm& term : loss_terms()) {
    try_term<float>(term, remedy, steps);
    try_term<double>(term, remedy, steps);
  }
  return {{"parameters lost by steps with a poisoned input", steps.lost, 0},
          {"bad evaluations that moved something", steps.moved, 0},
          {"errors", steps.errors, 0},
          {"NaN that matters and leaves all finite", steps.unheard, 0},
          {"share of poisoned inputs that leave all finite", 1 - steps.bad / steps.tried, 0.9}};
}

std::vector<StressFigure> poisoned_distances(Remedy remedy) { return family_leaks(Distances(), remedy); }

void add_optim_operators(OperatorNames& names) { add_family_operators(Distances(), names); }

}  // namespace hsi4d::stress
