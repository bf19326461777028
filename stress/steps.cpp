// Rows G about optimisers over many steps: wraps, bad evaluations, norms that grow, runs that start a little apart.
#include <algorithm>
#include <cmath>
#include <limits>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "autodiff/rotations.h"
#include "body/color_net.h"
#include "core/angles.h"
#include "optim/stage.h"
#include "stress/measures.h"
#include "stress/plain_adam.h"
#include "stress/pulled_turn.h"
#include "stress/rows.h"
#include "stress/splat_scene.h"
#include "stress/tape_numbers.h"

namespace hsi4d::stress {

// --- G3: after a wrap ------------------------------------------------------------------------------------------------

namespace {

/// Steps of an axis-angle, in units of the rate.
struct StepsAfterWrap {
  double longest = 0;  ///< of all
  double lost = 0;     ///< how much shorter than the rate those after the wrap are, in all
};

constexpr double kTurnRate = 1e-3;
constexpr int kAfterWrap = 60;

/// A stage that turns a joint at a constant pull, and passes half a turn in step `wrap`.
StepsAfterWrap steps_of_stage(int wrap) {
  StepsAfterWrap steps;
  double last = kPi - kTurnRate * (wrap - 0.5);
  pull_turn({.start = last, .rate = kTurnRate, .iterations = wrap + kAfterWrap}, [&](Index iteration, const double* w) {
    const double step = std::remainder(w[0] - last, 2 * kPi) / kTurnRate;
    steps.longest = larger(steps.longest, std::abs(step));
    if (iteration >= wrap) steps.lost += 1 - step;
    last = w[0];
  });
  return steps;
}

/// The same with both moments cleared and t kept.
StepsAfterWrap steps_without_moments(int wrap) {
  PlainAdam<double> number{.lr = kTurnRate};
  StepsAfterWrap steps;
  for (int i = 0; i < wrap + kAfterWrap; ++i) {
    if (i == wrap) number.m = number.v = 0;
    const double before = number.x;
    number.step(-1);
    const double step = (number.x - before) / kTurnRate;
    steps.longest = larger(steps.longest, std::abs(step));
    if (i >= wrap) steps.lost += 1 - step;
  }
  return steps;
}

}  // namespace

/// G3
std::vector<StressFigure> steps_after_wrap(Remedy remedy) {
  double longest = 0, lost = 0;
  for (const int wrap : {63, 300, 1000}) {
    const StepsAfterWrap steps = remedy == Remedy::kOn ? steps_of_stage(wrap) : steps_without_moments(wrap);
    longest = larger(longest, steps.longest);
    lost = larger(lost, std::abs(steps.lost));
  }
  // Of the mean gradient that was forgotten, 0.9 + 0.9² + … steps are lost.
  return {{"longest step after a wrap, of the rate", longest, 1 + 1e-6}, {"way lost after it, steps", lost, 12}};
}

// --- G4: bad evaluations ---------------------------------------------------------------------------------------------

namespace {

/// Two numbers that are found together: x, whose loss has a root and is bad below 0, and y, whose loss is (y − 1)².
struct BesideRoot {
  double bad = 0;
  double kept = 0;  ///< bad evaluations after which the next one is at an x below 0
  double x = 0, y = 0;
};

constexpr int kRootIterations = 300;
constexpr double kRootGoal = 1, kRootRate = 0.05;

/// The loss of x.
enum class Pull {
  kBack,  ///< x − 0.2 √x is least at 0.01; momentum carries x over the edge
  kOver   ///< √x pulls x over the edge
};

BesideRoot stage_beside_root(OptimizerKind kind, Pull pull) {
  Tape<double> tape;
  const Var<double> x = leaf(tape, "x", shape_of(1, 1), {1.0}), y = leaf(tape, "y", shape_of(1, 1), {0.0});
  LossInputs<double> inputs;
  inputs.rendered = (pull == Pull::kBack ? x - sqrt(x) * 0.2 : sqrt(x)) + square(y - kRootGoal);
  const std::vector<LossTerm> terms = {
      make_loss_term("root", "A root beside a square", [](const auto& in) { return sum(in.rendered); })};
  StageSettings settings;
  settings.iterations = kRootIterations;
  settings.optimizer.kind = kind;
  settings.optimize = {{"x", {}}, {"y", {}}};
  for (auto& [name, group] : settings.optimize) group.lr = kRootRate;
  settings.losses = {{"root", {}}};
  BesideRoot found;
  run_stage<double>(tape, settings, terms, inputs, {{"x", {x}}, {"y", {y}}}, [&](const IterationReport& report) {
    if (!report.rolled_back) return;
    ++found.bad;
    found.kept += tape.value(x).scalar() >= 0 ? 0 : 1;
  });
  found.x = tape.value(x).scalar();
  found.y = tape.value(y).scalar();
  return found;
}

/// A bad step is evaluated once more before it is undone, and each costs a quarter of the rate for good.
BesideRoot adam_with_second_look(Pull pull) {
  PlainAdam<double> x{.lr = kRootRate}, y{.lr = kRootRate};
  x.x = 1;
  PlainAdam<double> x_before = x, y_before = y;
  BesideRoot found;
  bool has_looked = false;
  for (int i = 0; i < kRootIterations; ++i) {
    if (x.x >= 0) {
      x_before = x, y_before = y;
      x.step(pull == Pull::kBack ? 1 - 0.1 / std::sqrt(x.x) : 0.5 / std::sqrt(x.x));
      y.step(2 * (y.x - kRootGoal));
      continue;
    }
    ++found.bad;
    found.kept += has_looked ? 0 : 1;
    if (has_looked) {
      x = x_before, y = y_before;
      x.lr = y.lr = 0.75 * x.lr;
    }
    has_looked = !has_looked;
  }
  found.x = x.x, found.y = y.x;
  return found;
}

}  // namespace

/// G4
std::vector<StressFigure> bad_evaluations(Remedy remedy) {
  const bool on = remedy == Remedy::kOn;
  const BesideRoot adam =
      on ? stage_beside_root(OptimizerKind::kAdam, Pull::kBack) : adam_with_second_look(Pull::kBack);
  const BesideRoot bfgs = on ? stage_beside_root(OptimizerKind::kBfgs, Pull::kBack) : adam;
  const BesideRoot pulled =
      on ? stage_beside_root(OptimizerKind::kAdam, Pull::kOver) : adam_with_second_look(Pull::kOver);
  return {{"Adam: bad evaluations that are not undone at once", adam.kept, 0},
          {"Adam: evaluations lost, of 300", adam.bad, 10},
          {"Adam: x and y off their goals", larger(std::abs(adam.x - 0.01), std::abs(adam.y - kRootGoal)), 2e-6},
          {"BFGS: bad evaluations after which a shorter step is bad too", bfgs.kept, 3},
          {"BFGS: evaluations lost", bfgs.bad, 6},
          {"BFGS: x and y off their goals", larger(std::abs(bfgs.x - 0.01), std::abs(bfgs.y - kRootGoal)), 2e-3},
          {"Adam: evaluations lost where the loss pulls over the edge", pulled.bad, 150}};
}

// --- G9: norms that grow, colours that saturate ----------------------------------------------------------------------

namespace {

constexpr int kGrowthSteps = 3000;

/// A rotation that is pulled on and on about one axis.
struct TurnedColumns {
  double norm = 0;     ///< of a column, at the end
  double slowing = 0;  ///< angle of a step at the beginning over that at the end
};

/// d_R of −tr(Gᵀ R), G a quarter of a turn ahead of R.
std::vector<double> pull_ahead(const double* r) {
  std::vector<double> d(9);
  for (std::size_t c = 0; c < 3; ++c) d[c] = r[3 + c], d[3 + c] = -r[c], d[6 + c] = -r[6 + c];
  return d;
}

TurnedColumns turned_columns(double rate) {
  Tape<double> tape;
  const Var<double> columns = leaf(tape, "columns", shape_of(1, 6), {1, 0, 0, 1, 0, 0});
  const Var<double> rotation = rotations_from_6d(columns);
  Adam<double> adam(tape, {moving_at<double>({columns}, rate)}, {});
  TurnedColumns found;
  double last = 0, early = 0, late = 0;
  for (int i = 0; i < kGrowthSteps; ++i) {
    tape.forward(rotation);
    const double* r = tape.value(rotation).data;
    const double angle = std::atan2(r[3], r[0]), turned = std::abs(std::remainder(angle - last, 2 * kPi));
    if (i > 100 && i <= 200) early += turned;
    if (i >= kGrowthSteps - 100) late += turned;
    last = angle;
    tape.backward(rotation, pull_ahead(r));
    adam.step(i, kGrowthSteps, 0);
  }
  const double* c = tape.value(columns).data;
  found.norm = larger(std::hypot(c[0], c[2], c[4]), std::hypot(c[1], c[3], c[5]));
  found.slowing = early / late;
  return found;
}

/// Steps that a color net takes to come back to grey after thousands of steps towards black and white.
double steps_back_to_grey() {
  constexpr Index kColored = 6, kPosed = 22;
  const std::vector<float> means = {0, 0, 0, 0.1F, 0.2F, 0, 0.3F, 0, 0.1F, 0, 0.5F, 0, 0.2F, 0.2F, 0.2F, 0.4F, 0, 0.3F};
  const ColorNet net = new_color_net(means, kPosed, {.features = 4, .hidden_width = 8, .hidden_layers = 1});
  Tape<double> tape;
  const ColorNetVars<double> vars = color_net_leaves(tape, net);
  const Var<double> base = tape.constant("base", shape_of(kColored, 3)),
                    target = tape.constant("t", shape_of(kColored, 3));
  const Var<double> code = tape.constant("code", shape_of(1, net.code_size()));
  tape.set(base, std::vector<double>(3 * kColored, 0.5));
  const Var<double> colors = color_net(vars, base, code, {}), loss = mean(square(colors - target));
  std::vector<Var<double>> leaves = {vars.features};
  for (const MlpLayer<double>& layer : vars.layers) leaves.insert(leaves.end(), {layer.weights, layer.bias});
  Adam<double> adam(tape, {moving_at<double>(leaves, 1e-2)}, {});
  const auto step = [&](int i) {
    tape.forward(loss);
    tape.backward(loss);
    adam.step(i, 2 * kGrowthSteps, tape.value(loss).scalar());
    return tape.value(loss).scalar();
  };
  for (Index r = 0; r < kColored; ++r) {
    for (Index c = 0; c < 3; ++c) tape.write(target)(r, c) = r % 2 == 0 ? 1 : 0;
  }
  for (int i = 0; i < kGrowthSteps; ++i) step(i);
  tape.set(target, std::vector<double>(3 * kColored, 0.5));
  for (int i = 0; i < kGrowthSteps; ++i) {
    if (step(kGrowthSteps + i) < 1e-4) return i;  // within 0.01 of grey
  }
  return std::numeric_limits<double>::infinity();
}

}  // namespace

/// G9: what steps lose by themselves at the rates of a run; without: at a rate of the columns' own length.
std::vector<StressFigure> growing_norms(Remedy remedy) {
  const TurnedColumns columns = turned_columns(remedy == Remedy::kOn ? 0.01 : 0.3);
  return {{"norm of 6D columns after 3000 steps of 0.01", columns.norm, 4},
          {"angle of a step at first, over that in the end", columns.slowing, 6},
          {"steps of a saturated color net back to grey", steps_back_to_grey(), 250}};
}

// --- G10: runs that start a little apart -----------------------------------------------------------------------------

namespace {

/// Means of Gaussians fitted by L1 to the image of others.
/// @param off  of the start of one number
std::vector<double> fitted_by_l1(double off, double final_share) {
  constexpr int kSteps = 400;
  TapedScene<double> taped(small_scene(16, 32, 24, 90));
  taped.tape.write(taped.means).data[0] += off;
  const Var<double> image = taped.rendered.image, target = taped.tape.constant("target", image.shape());
  set_numbers(taped.tape, target, exact_image(small_scene(16, 32, 24, 91)));
  const Var<double> loss = l1(image, target);
  OptimizerGroup<double> group = moving_at<double>(taped.leaves(), 0.01);
  group.settings.lr_final_share = final_share;
  Adam<double> adam(taped.tape, {group}, {});
  for (int step = 0; step < kSteps; ++step) {
    taped.tape.forward(loss);
    taped.tape.backward(loss);
    adam.step(step, kSteps, taped.tape.value(loss).scalar());
  }
  return taped.value(taped.means);
}

}  // namespace

/// G10: |x| has the same slope however near its kink is, so that rounding noise grows; a rate that falls ends that.
std::vector<StressFigure> nearly_equal_starts(Remedy remedy) {
  const double share = remedy == Remedy::kOn ? 0.01 : 1;
  const std::vector<double> here = fitted_by_l1(0, share), there = fitted_by_l1(1e-7, share);
  return {{"places of two runs from starts 1e-7 m apart, m", largest_difference(here, there), 1e-2}};
}

}  // namespace hsi4d::stress
