#include "optim/gradient_shares.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "optim/stage.h"

namespace gradient_shares_test {

using namespace hsi4d;

namespace {

/// Three terms of a point and a scale: (3, 0)·p, (0, 4)·p + s, and one that depends on neither.
struct Pulls {
  Tape<double> tape;
  Var<double> p, s, other;
  LossInputs<double> inputs;

  Pulls() {
    p = tape.parameter("p", shape_of(1, 2));
    s = tape.parameter("s", kScalarShape);
    other = tape.parameter("other", kScalarShape);
    inputs.rendered = p;
    inputs.target = tape.constant("target", shape_of(1, 2));
    inputs.weight = s;
  }
  std::vector<ParameterGroup<double>> groups() const { return {{"point", {p}}, {"scale", {s}}, {"nothing", {}}}; }

  static std::vector<LossTerm> terms() {
    return {make_loss_term("along", "3 x", [](const auto& in) { return sum(in.rendered * row(in, 3, 0)); }),
            make_loss_term("across", "4 y + s",
                           [](const auto& in) { return sum(in.rendered * row(in, 0, 4)) + sum(in.weight); }),
            make_loss_term("bowl", "a square, for a run",
                           [](const auto& in) { return sum(square(in.rendered - 1.0)) + sum(square(in.weight)); })};
  }
  template <class S>
  static Var<S> row(const LossInputs<S>& in, int x, int y) {
    const Var<S> constant = in.rendered.owner().constant("row", shape_of(1, 2));
    in.rendered.owner().set(constant, {static_cast<S>(x), static_cast<S>(y)});
    return constant;
  }
};

ParameterGroupSettings moving(double lr, int every = 1) {
  ParameterGroupSettings settings;
  settings.lr = lr;
  settings.every = every;
  return settings;
}

LossSettings weighted(double weight) {
  LossSettings settings;
  settings.weight = weight;
  return settings;
}

StageSettings stage(int shares_every) {
  StageSettings settings;
  settings.iterations = 20;
  settings.optimize = {{"point", moving(0.1)}, {"scale", moving(0.1, 2)}, {"nothing", moving(0.1)}};
  settings.losses = {{"along", weighted(1)}, {"across", weighted(2)}, {"bowl", weighted(0.5)}};
  settings.gradient_shares = shares_every;
  return settings;
}

struct Run {
  std::vector<double> numbers, losses;
  std::vector<std::vector<GradientShare>> shares;  // by iteration
  Index forward_runs = 0, backward_runs = 0;
};

Run run(const StageSettings& settings) {
  Pulls pulls;
  Run result;
  const auto note = [&](const IterationReport& report) {
    result.losses.push_back(report.loss);
    result.shares.emplace_back(report.gradient_shares.begin(), report.gradient_shares.end());
    if (report.iteration + 1 < settings.iterations) return;
    for (const NodeStatistics& node : pulls.tape.statistics()) {
      result.forward_runs += node.forward_runs;
      result.backward_runs += node.backward_runs;
    }
  };
  const std::vector<LossTerm> terms = Pulls::terms();
  run_stage<double>(pulls.tape, settings, terms, pulls.inputs, pulls.groups(), note);
  for (const Var<double> var : {pulls.p, pulls.s}) {
    for (Index c = 0; c < var.shape().cols; ++c) result.numbers.push_back(pulls.tape.value(var)(0, c));
  }
  return result;
}

}  // namespace

TEST_CASE("shares of the gradient are those of norms, with the cosine to the sum") {
  StageSettings settings = stage(1);
  settings.iterations = 2;
  settings.losses.resize(2);
  const Run result = run(settings);
  const std::vector<GradientShare>& first = result.shares[0];
  REQUIRE(first.size() == 4);  // two groups that have parameters, two terms
  // The point: (3, 0) and twice (0, 4); their sum has the length sqrt(73).
  CHECK(first[0].group == "point");
  CHECK(first[0].term == "along");
  CHECK(first[0].norm == Approx(3));
  CHECK(first[0].share == Approx(3.0 / 11));
  CHECK(first[0].cosine == Approx(3 / std::sqrt(73.0)));
  CHECK(first[1].term == "across");
  CHECK(first[1].norm == Approx(8));
  CHECK(first[1].share == Approx(8.0 / 11));
  CHECK(first[1].cosine == Approx(8 / std::sqrt(73.0)));
  // The scale: the first term does not know it.
  CHECK(first[2].group == "scale");
  CHECK(first[2].norm == 0);
  CHECK(first[2].share == 0);
  CHECK(first[2].cosine == 0);
  CHECK(first[3].share == Approx(1));
  CHECK(first[3].cosine == Approx(1));
  REQUIRE(result.shares[1].size() == 2);  // in every second iteration the scale stands
  CHECK(result.shares[1][0].group == "point");
}

TEST_CASE("terms that pull against each other have cosines of both signs") {
  StageSettings settings = stage(1);
  settings.losses = {{"along", weighted(1)}, {"bowl", weighted(4)}};  // (3, 0) and (-8, -8)
  const Run result = run(settings);
  CHECK(result.shares[0][0].cosine == Approx(-5 / std::hypot(5, 8)));
  CHECK(result.shares[0][1].cosine > 0.9);
}

TEST_CASE("shares are measured where they are asked for, change no bit and evaluate no node again") {
  const Run off = run(stage(0)), on = run(stage(5));
  CHECK(on.numbers == off.numbers);
  CHECK(on.losses == off.losses);
  CHECK(on.forward_runs == off.forward_runs);
  CHECK(on.backward_runs > off.backward_runs);
  for (std::size_t i = 0; i < 20; ++i) {
    CHECK(off.shares[i].empty());
    CHECK(on.shares[i].empty() == (i % 5 != 0));
  }
}

TEST_CASE("an evaluation that is not finite has no shares") {
  StageSettings settings = stage(1);
  settings.optimize = {{"point", moving(0.1)}};
  settings.losses = {{"along", weighted(1)}, {"steep", weighted(1)}};
  std::vector<LossTerm> terms = Pulls::terms();
  terms.push_back(make_loss_term("steep", "log of 0", [](const auto& in) { return sum(log(in.rendered)); }));
  Pulls pulls;
  settings.optimizer.max_rollbacks = 0;
  bool is_empty = false;
  try {
    run_stage<double>(pulls.tape, settings, terms, pulls.inputs, pulls.groups(),
                      [&](const IterationReport& report) { is_empty = report.gradient_shares.empty(); });
  } catch (const StageDivergedError&) {
    is_empty = true;
  }
  CHECK(is_empty);
}

}  // namespace gradient_shares_test
