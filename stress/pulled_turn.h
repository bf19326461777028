// A stage that turns an axis-angle on and on: rows D9 and G3.
#pragma once

#include <utility>
#include <vector>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "optim/stage.h"
#include "stress/tape_numbers.h"

namespace hsi4d::stress {

/// How a pulled rotation moves.
struct PulledTurn {
  double start;  ///< rad, about the first axis
  double rate;
  int iterations;
  bool wraps = true;  ///< held to half a turn
};

/// Pulls w = (start, 0, 0) along the first axis with slope 1, by a stage.
/// @param look  is called after each iteration with its number and w [3]
template <class F>
void pull_turn(const PulledTurn& turn, const F& look) {
  Tape<double> tape;
  const Var<double> w = leaf(tape, "w", shape_of(1, 3), {turn.start, 0, 0});
  const Var<double> pull = tape.constant("pull", shape_of(1, 3));
  tape.set(pull, {-1, 0, 0});
  LossInputs<double> inputs;
  inputs.rendered = w * pull;
  const std::vector<LossTerm> terms = {
      make_loss_term("pull", "Turns about the first axis", [](const auto& in) { return sum(in.rendered); })};
  StageSettings settings;
  settings.iterations = turn.iterations;
  settings.optimize = {{"w", {}}};
  settings.optimize[0].second.lr = turn.rate;
  settings.losses = {{"pull", {}}};
  run_stage<double>(tape, settings, terms, inputs, {{"w", {w}, turn.wraps}},
                    [&](const IterationReport& report) { look(report.iteration, tape.value(w).data); });
}

}  // namespace hsi4d::stress
