#include "optim/stage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "core/parallel.h"
#include "tests/support/allocation_counter.h"

namespace stage_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

/// A small picture: rendered = 0.1·(base + tint), to become like the target.
template <class S>
struct Picture {
  Tape<S> tape;
  Var<S> base, tint, unused;
  LossInputs<S> inputs;

  Picture() {
    const Shape image = image_shape<S>(3, 12, 13);
    base = tape.parameter("base", image);
    tint = tape.parameter("tint", kScalarShape);
    unused = tape.parameter("unused", kScalarShape);
    inputs.rendered = (base + tint) * 0.1;
    inputs.target = tape.constant("target", image);
    const Array<S> target = tape.write(inputs.target);
    for (Index r = 0; r < target.total_rows(); ++r) {
      for (Index c = 0; c < 13; ++c)
        target.row(r)[c] = static_cast<S>(0.5 + 0.3 * std::sin(0.9 * static_cast<double>(r + 2 * c)));
    }
  }
  std::vector<ParameterGroup<S>> groups() const {
    return {{"base", {base}}, {"tint", {tint}}, {"unused", {unused}}, {"objects", {}}};
  }
};

ParameterGroupSettings moving(double lr) {
  ParameterGroupSettings settings;
  settings.lr = lr;
  return settings;
}

LossSettings weighted(double weight) {
  LossSettings settings;
  settings.weight = weight;
  return settings;
}

StageSettings usual_stage() {
  StageSettings settings;
  settings.iterations = 200;
  settings.optimize = {{"base", moving(0.1)}, {"tint", moving(0.1)}};
  settings.losses = {{"photometric", weighted(1)}, {"masked_l2", weighted(0.5)}};
  return settings;
}

template <class S>
StageResult run(Picture<S>& picture, const StageSettings& settings, const StageCallback& callback = {},
                const StageOptions& options = {}, std::span<const LossTerm> terms = loss_terms()) {
  return run_stage(picture.tape, settings, terms, picture.inputs, picture.groups(), callback, options);
}

/// A term that is `value` once in the middle of a run, else the mean of the rendered image.
struct Fault {
  static inline int evaluations = 0;
  static inline int at = 0, until = 0;
  static inline double value = 0;
};

/// y = x, or Fault::value in the evaluations of the fault.
template <class S>
struct FaultOp {
  static constexpr const char* kName = "fault";
  void forward(NodeIo<S>& io) {
    const int now = Fault::evaluations++;
    io.out().scalar() = now >= Fault::at && now < Fault::until ? static_cast<S>(Fault::value) : io.in(0).scalar();
  }
  void backward(NodeIo<S>& io) { io.d_in(0).scalar() += io.d_out().scalar(); }
};

template <class S>
Var<S> with_fault(Var<S> x) {
  return x.owner().record(FaultOp<S>{}, {x}, kScalarShape, Source::current());
}

std::vector<LossTerm> fault_terms() {
  return {make_loss_term("fault", "Has a fault",
                         [](const auto& in) { return with_fault(mean(square(in.rendered - in.target))); })};
}

/// log of the mean: NaN where a step went below zero.
std::vector<LossTerm> cliff_terms() {
  return {make_loss_term("cliff", "Falls off at 0", [](const auto& in) { return log(mean(in.rendered)); })};
}

}  // namespace

TEST_CASE("a stage keeps axis-angles within half a turn, and forgets the direction of the old numbers") {
  // Pulled along one axis, past half a turn: the loss is linear in the angle that was added up, so it goes on falling
  // while the row jumps from pi to -pi.
  struct Result {
    double w = 0;
    GroupMoments moments;
  };
  const auto turn = [](bool are_axis_angles, int iterations) {
    Tape<double> tape;
    const Var<double> w = tape.parameter("w", shape_of(2, 3));
    tape.set(w, {3.0, 0, 0, 0.5, 0, 0});
    const Var<double> pull = tape.constant("pull", shape_of(2, 3));
    tape.set(pull, {-1, 0, 0, -1, 0, 0});
    LossInputs<double> inputs;
    inputs.rendered = w * pull;
    const std::vector<LossTerm> terms = {
        make_loss_term("pull", "Turns", [](const auto& in) { return sum(in.rendered); })};
    StageSettings settings;
    settings.iterations = iterations;
    settings.optimize = {{"w", moving(0.05)}};
    settings.losses = {{"pull", weighted(1)}};
    AdamState kept = {{"w", {}}};
    std::vector<ParameterGroup<double>> groups = {{"w", {w}, are_axis_angles}};
    run_stage<double>(tape, settings, terms, inputs, groups, {}, {.kept = &kept});
    CHECK(tape.value(w)(1, 0) == Approx(0.5 + 0.05 * iterations));  // the other row goes its way
    return Result{tape.value(w)(0, 0), kept.at("w")};
  };
  // 3.0 + 3 * 0.05 = 3.15 is beyond pi by 0.0084.
  CHECK(turn(false, 3).w == Approx(3.15));
  const Result wrapped = turn(true, 3);
  CHECK(wrapped.w == Approx(3.15 - 2 * std::numbers::pi));
  CHECK(wrapped.moments.blocks[0].mean[0] == 0);
  CHECK(wrapped.moments.blocks[0].square[0] != 0);
  CHECK(wrapped.moments.blocks[0].mean[3] != 0);
  CHECK(turn(false, 3).moments.blocks[0].mean[0] != 0);
  CHECK(turn(true, 5).w > wrapped.w);  // and on from there
  CHECK(turn(true, 5).w < 0);
}

TEMPLATE_TEST_CASE("a stage keeps parameters in their range, from where they come back", "", float, double) {
  using S = TestType;
  // What is rendered is clamped to the range, as an operator does that is defined on it alone: beyond it there is no
  // gradient. The target is first above what can be shown, later in the middle.
  const auto last = [](S start) {
    Tape<S> tape;
    const Var<S> x = tape.parameter("x", shape_of(2, 3));
    tape.set(x, std::vector<S>(6, start));
    LossInputs<S> inputs;
    inputs.rendered = clamp(x, 0.1, 0.9);
    inputs.target = tape.constant("target", shape_of(2, 3));
    tape.set(inputs.target, std::vector<S>(6, S(2)));
    std::vector<ParameterGroup<S>> groups = {{"x", {x}}};
    groups[0].range = ParameterRange{0.1, 0.9};
    const std::vector<LossTerm> terms = {make_loss_term(
        "distance", "To the target", [](const auto& in) { return sum(square(in.rendered - in.target)); })};
    StageSettings settings;
    settings.iterations = 150;
    settings.optimize = {{"x", moving(0.05)}};
    settings.losses = {{"distance", weighted(1)}};
    run_stage(tape, settings, terms, inputs, groups, [&](const IterationReport& report) {
      const ConstArray<S> now = tape.value(x);
      CHECK(std::all_of(now.data, now.data + 6, [](S v) { return v >= S(0.1) && v <= S(0.9); }));
      if (report.iteration == 20) tape.set(inputs.target, std::vector<S>(6, S(0.5)));
    });
    return static_cast<double>(tape.value(x)(0, 0));
  };
  CHECK(last(S(0.5)) == Approx(0.5).margin(0.01));
  CHECK(last(S(-4)) == Approx(0.5).margin(0.01));
  CHECK(last(S(1.5)) == Approx(0.5).margin(0.01));
}

TEST_CASE("blocks of a group may have ranges of their own, or none") {
  Tape<double> tape;
  const Var<double> x = tape.parameter("x", kScalarShape), y = tape.parameter("y", kScalarShape),
                    z = tape.parameter("z", kScalarShape);
  LossInputs<double> inputs;
  inputs.rendered = concat_cols<double>(std::array{x, y, z});
  inputs.target = tape.constant("target", shape_of(1, 3));
  tape.set(inputs.target, {2.0, 2.0, 2.0});
  ParameterGroup<double> group{"x", {x, y, z}};
  CHECK_FALSE(group.has_range());
  constexpr double kAny = std::numeric_limits<double>::infinity();
  const std::array ranges = {ParameterRange{0, 0.5}, ParameterRange{-kAny, kAny}, ParameterRange{-1, 0.25}};
  group.block_ranges = ranges;
  CHECK(group.has_range());
  CHECK(group.range_of(2)->high == 0.25);
  group.block_ranges = std::span(ranges).subspan(1, 1);
  CHECK_FALSE(group.has_range());
  group.block_ranges = ranges;
  const std::vector<LossTerm> terms = {
      make_loss_term("distance", "To the target", [](const auto& in) { return sum(square(in.rendered - in.target)); })};
  StageSettings settings;
  settings.iterations = 200;
  settings.optimize = {{"x", moving(0.05)}};
  settings.losses = {{"distance", weighted(1)}};
  for (const OptimizerKind kind : {OptimizerKind::kAdam, OptimizerKind::kLm}) {
    for (const Var<double> block : group.blocks) tape.set(block, {0.0});
    settings.optimizer.kind = kind;
    run_stage<double>(tape, settings, terms, inputs, {group});
    CHECK(tape.value(x).scalar() == Approx(0.5).epsilon(1e-9));
    CHECK(tape.value(y).scalar() == Approx(2).margin(0.02));
    CHECK(tape.value(z).scalar() == Approx(0.25).epsilon(1e-9));
  }
}

TEMPLATE_TEST_CASE("a stage makes its loss small and leaves the tape as it was", "", float, double) {
  Picture<TestType> picture;
  picture.tape.freeze(picture.tint);
  const auto mark = picture.tape.mark();
  double first = 0, last = 0;
  Index calls = 0;
  const StageResult result = run(picture, usual_stage(), [&](const IterationReport& report) {
    CHECK(report.iteration == calls++);
    CHECK(report.iterations == 200);
    CHECK_FALSE(report.rolled_back);
    REQUIRE(report.terms.size() == 2);
    CHECK(report.terms[0].name == "photometric");
    CHECK(report.loss == Approx(report.terms[0].value + 0.5 * report.terms[1].value).epsilon(1e-5));
    CHECK(report.groups[1].name == "tint");
    CHECK(report.groups[1].gradient_norm > 0);
    (report.iteration == 0 ? first : last) = report.loss;
  });
  CHECK(calls == 200);
  CHECK(result.iterations == 200);
  CHECK(last < 0.1 * first);
  CHECK(result.loss <= last);
  CHECK(result.rollbacks == 0);
  CHECK(result.off.empty());
  CHECK(result.seconds > 0);
  CHECK(picture.tape.mark().arrays == mark.arrays);
  CHECK(picture.tape.mark().nodes == mark.nodes);
  CHECK(picture.tape.frozen(picture.tint));
  CHECK_FALSE(picture.tape.frozen(picture.base));
  CHECK_FALSE(picture.tape.frozen(picture.unused));
  // What was rendered last is of the final parameters.
  const double rendered = static_cast<double>(picture.tape.value(picture.inputs.rendered)(0, 0));
  const double expected = 0.1 * (static_cast<double>(picture.tape.value(picture.base)(0, 0)) +
                                 static_cast<double>(picture.tape.value(picture.tint).scalar()));
  CHECK(rendered == Approx(expected).epsilon(1e-6));
}

TEST_CASE("only groups that are on have a gradient") {
  Picture<double> picture;
  StageSettings settings = usual_stage();
  settings.iterations = 6;
  settings.optimize[0].second.from = 2;
  settings.optimize[1].second.until = 4;
  settings.optimize[1].second.every = 2;
  std::vector<double> tints;
  run(picture, settings, [&](const IterationReport& report) {
    const Index i = report.iteration;
    INFO("iteration " << i);
    CHECK(picture.tape.has_gradient(picture.base) == (i >= 2));
    CHECK(picture.tape.has_gradient(picture.tint) == (i == 0 || i == 2));
    CHECK_FALSE(picture.tape.has_gradient(picture.unused));
    CHECK(report.groups[0].moved == (i >= 2));
    CHECK((picture.tape.value(picture.base)(0, 0) == 0) == (i < 2));
    tints.push_back(picture.tape.value(picture.tint).scalar());
  });
  CHECK(tints[0] == tints[1]);
  CHECK(tints[1] != tints[2]);
  CHECK(tints[2] == tints[5]);
}

TEST_CASE("a parameter that no group of the stage names does not move") {
  Picture<double> picture;
  StageSettings settings = usual_stage();
  settings.optimize.pop_back();
  run(picture, settings);
  CHECK(picture.tape.value(picture.tint).scalar() == 0);
  CHECK(picture.tape.value(picture.base)(0, 0) != 0);
}

TEST_CASE("terms that lack an input or weigh nothing are off, and told") {
  Picture<double> picture;
  StageSettings settings = usual_stage();
  settings.losses = {{"center", weighted(1)}, {"photometric", weighted(0)}, {"masked_l2", weighted(2)}};
  const StageResult result = run(picture, settings, [](const IterationReport& report) {
    REQUIRE(report.terms.size() == 1);
    CHECK(report.loss == 2 * report.terms[0].value);
  });
  CHECK(result.off == std::vector<std::string>{"center", "photometric"});
}

TEST_CASE("stages that can not run say why") {
  Picture<double> picture;
  const auto problem = [&](const StageSettings& settings) -> std::string {
    try {
      run(picture, settings, {}, {.name = "camera"});
    } catch (const UserError& error) {
      return error.what();
    }
    return "";
  };
  StageSettings settings = usual_stage();
  settings.optimize[0].first = "bass";
  CHECK(problem(settings) ==
        "stage 'camera': there is no parameter group \"bass\"; did you mean \"base\"? (known: base, tint, unused, "
        "objects)");
  settings.optimize.clear();
  CHECK(problem(settings) == "stage 'camera': no parameter group is named (known: base, tint, unused, objects)");
  settings = usual_stage();
  settings.losses = {{"center", weighted(1)}, {"photometric", weighted(0)}};
  CHECK(problem(settings) ==
        "stage 'camera': no loss term gives anything: center lacks an input, photometric has weight 0");
  settings.losses = {{"photometrik", weighted(1)}};
  CHECK_THAT(problem(settings),
             Contains("stage 'camera': there is no loss term \"photometrik\"; did you mean \"photometric\"?"));
  settings = usual_stage();
  settings.optimize.push_back({"unused", moving(1)});
  CHECK(problem(settings) ==
        "stage 'camera': no loss term depends on the group \"unused\" (terms: photometric, masked_l2)");
  settings = usual_stage();
  settings.optimize.push_back({"objects", moving(1)});  // known, and empty
  CHECK(problem(settings).empty());
  auto groups = picture.groups();
  groups[3].blocks = {picture.base};
  CHECK_THROWS_WITH(run_stage(picture.tape, settings, std::span<const LossTerm>(loss_terms()), picture.inputs, groups),
                    Contains("groups \"base\" and \"objects\" share the parameter 'base'"));
}

// Row D4: a NaN in iteration 7 leaves the numbers of iteration 5, and the report names the operator.
TEST_CASE("a fault that passes costs two iterations") {
  Picture<double> picture;
  StageSettings settings = usual_stage();
  settings.losses = {{"fault", weighted(1)}};
  settings.iterations = 40;
  Fault::evaluations = 0;
  Fault::at = 7;
  Fault::until = 9;  // the evaluation, and that which looks for the reason
  Fault::value = std::numeric_limits<double>::quiet_NaN();
  std::vector<std::vector<double>> states;
  const auto terms = fault_terms();
  const StageResult result = run(
      picture, settings,
      [&](const IterationReport& report) {
        CHECK(report.rolled_back == (report.iteration == 7));
        if (report.rolled_back) CHECK_THAT(std::string(report.offender), Contains("the loss is nan; first: nan"));
        if (report.rolled_back) CHECK_THAT(std::string(report.offender), Contains("'fault'"));
        const auto base = picture.tape.value(picture.base);
        states.emplace_back(base.row(0), base.row(0) + 13);
      },
      {}, terms);
  CHECK(result.rollbacks == 1);
  CHECK(states[7] == states[5]);
  CHECK(states[7] != states[6]);
  CHECK(states[8] != states[7]);
  CHECK(std::isfinite(result.loss));
}

TEST_CASE("a step over a cliff is taken back and tried again with a smaller rate") {
  Picture<double> picture;
  picture.tape.set(picture.tint, {0.35});  // the mean is 0.035; steps of 0.1 go over the edge after three
  StageSettings settings;
  settings.iterations = 8;
  settings.optimize = {{"tint", moving(0.1)}};
  settings.losses = {{"cliff", weighted(1)}};
  settings.optimizer.max_rollbacks = 20;
  const auto terms = cliff_terms();
  const StageResult result = run(picture, settings, {}, {}, terms);
  CHECK(result.rollbacks >= 2);
  CHECK(std::isfinite(result.loss));
  CHECK(picture.tape.value(picture.tint).scalar() > 0);
  CHECK(picture.tape.value(picture.tint).scalar() < 0.35);
}

TEST_CASE("the last step of a stage is not left over a cliff") {
  Picture<double> picture;
  picture.tape.set(picture.tint, {0.05});
  StageSettings settings;
  settings.iterations = 1;
  settings.optimize = {{"tint", moving(0.1)}};
  settings.losses = {{"cliff", weighted(1)}};
  const auto terms = cliff_terms();
  const StageResult result = run(picture, settings, {}, {}, terms);
  CHECK(result.rollbacks == 1);
  CHECK(picture.tape.value(picture.tint).scalar() == 0.05);
  CHECK(result.loss == Approx(std::log(0.005)));
}

TEST_CASE("a stage without a finite loss is given up") {
  Picture<double> picture;
  picture.tape.freeze(picture.unused);
  StageSettings settings = usual_stage();
  settings.losses = {{"fault", weighted(1)}};
  settings.optimizer.max_rollbacks = 3;
  Fault::evaluations = 0;
  Fault::at = 5;
  Fault::until = 1000000;
  Fault::value = std::numeric_limits<double>::infinity();
  const auto terms = fault_terms();
  CHECK_THROWS_AS(run(picture, settings, {}, {.name = "interaction"}, terms), StageDivergedError);
  Fault::evaluations = 0;
  CHECK_THROWS_WITH(run(picture, settings, {}, {.name = "interaction"}, terms),
                    Contains("stage 'interaction': given up in iteration 8 after 4 steps that had to be taken back "
                             "(max_rollbacks is 3): the loss is inf") &&
                        Contains("terms: fault inf"));
  CHECK(picture.tape.frozen(picture.unused));
  CHECK_FALSE(picture.tape.frozen(picture.base));
}

TEST_CASE("a callback may end a stage") {
  Picture<double> picture;
  const auto mark = picture.tape.mark();
  struct Stop {};
  CHECK_THROWS_AS(run(picture, usual_stage(),
                      [](const IterationReport& r) {
                        if (r.iteration == 3) throw Stop();
                      }),
                  Stop);
  CHECK(picture.tape.mark().arrays == mark.arrays);
  CHECK_FALSE(picture.tape.frozen(picture.unused));
}

TEST_CASE("kept moments go on from stage to stage, others start afresh") {
  AdamState kept = {{"tint", {}}};
  Picture<double> halves, whole;
  StageSettings settings = usual_stage();
  settings.optimize = {{"tint", moving(0.01)}};
  settings.iterations = 5;
  run(halves, settings, {}, {.name = "a", .kept = &kept});
  CHECK(kept.at("tint").steps == 5);
  run(halves, settings, {}, {.name = "b", .kept = &kept});
  CHECK(kept.at("tint").steps == 10);
  settings.iterations = 10;
  run(whole, settings);
  CHECK(halves.tape.value(halves.tint).scalar() == whole.tape.value(whole.tint).scalar());
  Picture<double> afresh;
  settings.iterations = 5;
  run(afresh, settings);
  run(afresh, settings);
  CHECK(afresh.tape.value(afresh.tint).scalar() != whole.tape.value(whole.tint).scalar());
}

TEST_CASE("a stage is the same for any number of threads", "[parallel]") {
  const auto trace = [](int threads) {
    std::vector<double> losses;
    with_threads(threads, [&] {
      Picture<float> picture;
      StageSettings settings = usual_stage();
      settings.iterations = 20;
      run(picture, settings, [&](const IterationReport& report) { losses.push_back(report.loss); });
    });
    return losses;
  };
  const auto one = trace(1);
  for (const int threads : {2, 3, 8}) CHECK(trace(threads) == one);
}

TEST_CASE("a steady iteration of a stage allocates nothing") {
  if (!allocations_are_counted()) {
    WARN("skipped: sanitizers bring their own malloc");
    return;
  }
  Picture<float> picture;
  StageSettings settings = usual_stage();
  settings.optimize[1].second.every = 5;
  std::int64_t at_20 = 0, at_end = 0;
  run(picture, settings, [&](const IterationReport& report) {
    if (report.iteration == 20) at_20 = allocation_count();
    at_end = allocation_count();
  });
  CHECK(at_end == at_20);
}

TEST_CASE("held outputs follow their inputs where a group moves that names them, and in the first iteration") {
  Picture<double> picture;
  StageSettings settings = usual_stage();
  settings.iterations = 7;
  settings.optimize[0].second.every = 3;
  const Var<double> own = picture.base * 2.0;
  picture.inputs.rendered = (own + picture.tint) * 0.1;
  std::vector<double> seen, given;
  const auto note = [&](const IterationReport&) {
    seen.push_back(picture.tape.value(own)(0, 0, 0));
    given.push_back(2 * picture.tape.value(picture.base)(0, 0, 0));  // after the step
  };
  run(picture, settings, note, {.held = {{own.id, {"base"}}}});
  // base moves in iterations 0, 3 and 6; what an iteration sees was evaluated before its step, and the end with all.
  CHECK(seen[0] == 0);
  CHECK(seen[1] == given[0]);
  CHECK(seen[2] == seen[1]);
  CHECK(seen[3] == given[0]);
  CHECK(seen[4] == given[3]);
  CHECK(seen[6] == given[3]);
  CHECK(given[6] != given[3]);
  CHECK(picture.tape.value(own)(0, 0, 0) == given[6]);
  CHECK_FALSE(picture.tape.held(own));
}

TEST_CASE("held outputs that no loss reads are never computed, and a stage with them runs") {
  Picture<double> picture;
  const Var<double> apart = exp(picture.unused);
  StageSettings settings = usual_stage();
  settings.iterations = 3;
  const StageResult result = run(picture, settings, {}, {.held = {{apart.id, {"base"}}}});
  CHECK(result.iterations == 3);
  CHECK(picture.tape.value(apart).scalar() == 0);
}

TEST_CASE("a bad evaluation is not held") {
  Picture<double> picture;
  StageSettings settings = usual_stage();
  settings.iterations = 40;
  settings.optimize[0].second.every = 40;  // it moves once: what it makes is held from then on
  const Var<double> own = picture.base * 2.0 + square(picture.tint);
  picture.inputs.rendered = (own + picture.tint) * 0.1;
  bool is_spoilt = false;
  const auto spoil = [&](const IterationReport& report) {
    if (report.iteration == 0 && !is_spoilt) {
      is_spoilt = true;
      picture.tape.write(picture.tint).scalar() = std::numeric_limits<double>::infinity();
    } else if (report.iteration == 1) {
      CHECK(report.rolled_back);
      picture.tape.write(picture.tint).scalar() = 0.1;
    } else {
      CHECK_FALSE(report.rolled_back);
    }
  };
  const StageResult result = run(picture, settings, spoil, {.held = {{own.id, {"base"}}}});
  CHECK(std::isfinite(result.loss));
}

}  // namespace stage_test
