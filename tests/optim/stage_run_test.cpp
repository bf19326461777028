#include "optim/stage_run.h"

#include <cmath>
#include <functional>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"

namespace stage_run_test {

using namespace hsi4d;
using Catch::Matchers::Contains;

namespace {

/// A picture whose colours, base² tint, are to become those of a target.
struct Picture {
  Tape<float> tape;
  Var<float> base, tint, own;
  LossInputs<float> inputs;
  std::vector<ParameterGroup<float>> groups;

  Picture() {
    const Shape image = image_shape<float>(3, 12, 13);
    base = tape.parameter("base", image);
    tint = tape.parameter("tint", kScalarShape);
    own = square(base + 0.5F);
    inputs.rendered = own * (tint + 1.0F);
    inputs.target = tape.constant("target", image);
    const Array<float> target = tape.write(inputs.target);
    for (Index r = 0; r < target.total_rows(); ++r) {
      for (Index c = 0; c < 13; ++c) target.row(r)[c] = 0.5F + 0.3F * std::sin(0.9F * static_cast<float>(r + 2 * c));
    }
    groups = {{"base", {base}}, {"tint", {tint}}};
  }
  std::vector<float> numbers() const {
    std::vector<float> all = {tape.value(tint).scalar()};
    const ConstArray<float> values = tape.value(base);
    for (Index r = 0; r < values.total_rows(); ++r) all.insert(all.end(), values.row(r), values.row(r) + 13);
    return all;
  }
};

StageSettings settings_of(int iterations) {
  StageSettings settings;
  settings.iterations = iterations;
  ParameterGroupSettings moving;
  moving.lr = 0.05;
  settings.optimize = {{"base", moving}, {"tint", moving}};
  settings.optimize[0].second.every = 3;
  settings.losses = {{"photometric", {}}, {"masked_l2", {}}};
  return settings;
}

/// The numbers after a stage in which `between` is called before each step.
std::vector<float> stepped(const StageSettings& settings, const std::vector<std::string>& held_by,
                           const std::function<void(Picture&, StageRun<float>&)>& between) {
  Picture picture;
  StageOptions options;
  if (!held_by.empty()) options.held = {{picture.own.id, held_by}};
  StageRun<float> run(picture.tape, settings, loss_terms(), picture.inputs, picture.groups, options);
  while (!run.is_done()) {
    between(picture, run);
    run.step();
  }
  run.finish();
  return picture.numbers();
}

}  // namespace

TEST_CASE("steps and an end have the bits of run_stage, whatever is evaluated in between") {
  for (const bool holds : {false, true}) {
    for (const auto& [kind, name] : kOptimizerKinds) {
      CAPTURE(holds, name);
      StageSettings settings = settings_of(20);
      settings.optimizer.kind = kind;
      settings.optimizer.matrix_every = 3;
      const std::vector<std::string> held_by = holds ? std::vector<std::string>{"base"} : std::vector<std::string>();
      Picture picture;
      StageOptions options;
      if (holds) options.held = {{picture.own.id, held_by}};
      const StageResult result =
          run_stage<float>(picture.tape, settings, loss_terms(), picture.inputs, picture.groups, {}, options);
      CHECK(result.iterations > 3);
      CHECK(stepped(settings, held_by, [](Picture&, StageRun<float>&) {}) == picture.numbers());
      CHECK(stepped(settings, held_by, [](Picture& looked_at, StageRun<float>& run) {
              run.evaluate();
              looked_at.tape.forward(looked_at.inputs.rendered);
            }) == picture.numbers());
    }
  }
}

TEST_CASE("an evaluation has the gradients of all groups of the stage") {
  Picture picture;
  const StageSettings settings = settings_of(10);
  const StageOptions options;
  StageRun<float> run(picture.tape, settings, loss_terms(), picture.inputs, picture.groups, options);
  run.step();  // the next moves the tint alone
  const double loss = run.evaluate();
  CHECK(picture.tape.has_gradient(picture.base));
  CHECK(picture.tape.has_gradient(picture.tint));
  REQUIRE(run.terms().size() == 2);
  CHECK(loss == Approx(run.terms()[0].value + run.terms()[1].value));
  // Central difference in the tint; the loss is a float.
  const float gradient = picture.tape.gradient(picture.tint).scalar(), tint = picture.tape.value(picture.tint).scalar();
  double losses[2];
  for (const int side : {0, 1}) {
    picture.tape.set(picture.tint, {tint + (side == 0 ? 0.01F : -0.01F)});
    run.parameters_were_written();
    losses[side] = run.evaluate();
  }
  CHECK(gradient == Approx((losses[0] - losses[1]) / 0.02).epsilon(0.01));
}

TEST_CASE("parameters that are written make anew what is held") {
  Picture picture;
  StageSettings settings = settings_of(10);
  settings.optimize.erase(settings.optimize.begin());  // nothing that moves makes the held output anew
  StageOptions options;
  options.held = {{picture.own.id, {"base"}}};
  StageRun<float> run(picture.tape, settings, loss_terms(), picture.inputs, picture.groups, options);
  run.step();
  const double before = run.evaluate();
  const Array<float> base = picture.tape.write(picture.base);
  for (Index r = 0; r < base.total_rows(); ++r) base.row(r)[0] += 0.5F;
  CHECK(run.evaluate() == before);
  run.parameters_were_written();
  CHECK(run.evaluate() != before);
}

TEST_CASE("bfgs refuses parameters that are written once it has begun") {
  Picture picture;
  StageSettings settings = settings_of(10);
  settings.optimizer.kind = OptimizerKind::kBfgs;
  const StageOptions options;
  StageRun<float> run(picture.tape, settings, loss_terms(), picture.inputs, picture.groups, options);
  run.parameters_were_written();
  run.step();
  CHECK_THROWS_WITH(run.parameters_were_written(), Contains("bfgs remembers where its steps led"));
}

TEST_CASE("a stage that is done goes no further, and its end leaves the tape as it was") {
  Picture picture;
  const StageSettings settings = settings_of(1);
  const StageOptions options;
  const auto before = picture.tape.mark();
  {
    StageRun<float> run(picture.tape, settings, loss_terms(), picture.inputs, picture.groups, options);
    CHECK(picture.tape.mark().nodes > before.nodes);
    run.step();
    CHECK(run.is_done());
    CHECK(run.iteration() == 1);
    CHECK_THROWS_AS(run.step(), InternalError);
    run.finish();
    CHECK_THROWS_AS(run.finish(), InternalError);
  }
  CHECK(picture.tape.mark().nodes == before.nodes);
  CHECK_FALSE(picture.tape.frozen(picture.base));
  StageSettings unknown = settings;
  unknown.optimize[0].first = "bas";
  CHECK_THROWS_WITH((StageRun<float>(picture.tape, unknown, loss_terms(), picture.inputs, picture.groups, options)),
                    Contains("there is no parameter group \"bas\""));
  CHECK(picture.tape.mark().nodes == before.nodes);
}

}  // namespace stage_run_test
