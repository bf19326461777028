#include "optim/stage_gradcheck.h"

#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "tests/support/measures.h"

namespace stage_gradcheck_test {

using namespace hsi4d;
using Catch::Matchers::Contains;

namespace {

/// rendered = base · (1 + tint), to become like the target; `other` is in no loss, `nothing` has no numbers.
struct Picture {
  Tape<double> tape;
  Var<double> base, tint, other;
  LossInputs<double> inputs;
  std::vector<ParameterGroup<double>> groups;

  Picture() {
    const Shape image = image_shape<double>(3, 12, 13);
    base = tape.parameter("base", image);
    tint = tape.parameter("tint", kScalarShape);
    other = tape.parameter("other", kScalarShape);
    inputs.rendered = base * (tint + 1.0);
    inputs.target = tape.constant("target", image);
    for (const Var<double> var : {base, inputs.target}) {
      const Array<double> x = tape.write(var);
      for (Index i = 0; i < x.shape.count(); ++i)
        x.row(i / 13)[i % 13] = 0.5 + 0.3 * std::sin(0.9 * static_cast<double>(i) + var.id);
    }
    groups = {{"base", {base}}, {"tint", {tint}}, {"other", {other}}, {"nothing", {}}};
  }

  StageGradcheck check(const std::vector<std::string>& names, const std::vector<std::string>& losses,
                       std::span<const LossTerm> terms = loss_terms(), const StageGradcheckOptions& options = {}) {
    StageSettings settings;
    for (const std::string& name : names) settings.optimize.emplace_back(name, ParameterGroupSettings{});
    for (const std::string& loss : losses) {
      LossSettings chosen;
      chosen.weight = 0.5;
      settings.losses.emplace_back(loss, chosen);
    }
    return check_stage_gradient(tape, settings, terms, inputs, groups, "s", options);
  }
};

/// y = x, whose adjoint is a thousandth too large.
template <class S>
struct SlipOp {
  static constexpr const char* kName = "slip";
  void forward(NodeIo<S>& io) { io.out().scalar() = io.in(0).scalar(); }
  void backward(NodeIo<S>& io) { io.d_in(0).scalar() += io.d_out().scalar() * S(1.001); }
};

template <class S>
Var<S> slip(Var<S> x) {
  return x.owner().record(SlipOp<S>{}, {x}, kScalarShape, Source::current());
}

std::vector<LossTerm> terms_with_slip() {
  std::vector<LossTerm> terms = loss_terms();
  terms.push_back(
      make_loss_term("slip", "Is wrong", [](const auto& in) { return slip(mean(square(in.rendered - in.target))); }));
  return terms;
}

}  // namespace

TEST_CASE("the gradient of a stage's loss is checked by each of its groups") {
  Picture picture;
  const StageGradcheck found = picture.check({"tint", "nothing", "base"}, {"photometric", "masked_l2", "center"});
  CHECK(found.ok());
  CHECK(found.off == std::vector<std::string>{"center"});
  REQUIRE(found.terms.size() == 2);
  CHECK(found.loss == Approx(0.5 * (found.terms[0].value + found.terms[1].value)));
  CHECK(found.loss > 0);
  REQUIRE(found.groups.size() == 3);
  CHECK(found.groups[0].group == "tint");
  CHECK(found.groups[0].report.entries == 1);
  CHECK(found.groups[0].report.kinks == 0);
  CHECK(found.groups[0].report.worst_error < 1e-6);
  CHECK(found.groups[1].numbers == 0);
  CHECK(found.groups[2].numbers == 3 * 12 * 13);
  CHECK(found.groups[2].report.entries == 8);
}

TEST_CASE("a gradient that is a little wrong fails the check of a stage") {
  Picture picture;
  const StageGradcheck found = picture.check({"base"}, {"photometric", "slip"}, terms_with_slip());
  CHECK_FALSE(found.ok());
  CHECK_THAT(found.groups[0].report.text(), Contains("whole tape: gradient of 'base' is wrong at "));
}

TEST_CASE("what a term leaves out of its gradient on purpose is no error of a stage") {
  std::vector<LossTerm> terms = loss_terms();
  terms.push_back(make_loss_term("stopped", "The picture times what it was", [](const auto& in) {
    return mean(in.rendered * stop_gradient(square(in.rendered)));
  }));
  Picture picture;
  const StageGradcheck found = picture.check({"tint"}, {"stopped", "masked_l2"}, terms);
  INFO(found.groups[0].report.text());
  CHECK(found.ok());
  CHECK(found.groups[0].report.worst_error < 1e-6);
  Tape<double>& tape = picture.tape;  // and what was recorded before the check follows its inputs after it
  const Var<double> stopped = stop_gradient(picture.tint), twice = stopped * 2.0;
  picture.inputs.rendered = picture.inputs.rendered * twice;
  picture.check({"base"}, {"masked_l2"});
  tape.set(picture.tint, {3});
  tape.forward(twice);
  CHECK(tape.value(twice).scalar() == 6);
}

TEST_CASE("numbers are disturbed within their ranges before a stage is looked at, the same for a seed") {
  const auto disturbed = [](double size, std::uint64_t seed) {
    Picture picture;
    picture.groups[1].range = ParameterRange{-0.002, 0.002};
    StageGradcheckOptions options;
    options.disturbance = size;
    options.differences.seed = seed;
    picture.check({"base", "tint"}, {"masked_l2"}, loss_terms(), options);
    std::vector<double> numbers = {picture.tape.value(picture.tint).scalar()};
    for (Index row = 0; row < 36; ++row) numbers.push_back(picture.tape.value(picture.base).row(row)[5]);
    return numbers;
  };
  const std::vector<double> as_it_was = disturbed(0, 1), moved = disturbed(0.01, 1);
  CHECK(moved == disturbed(0.01, 1));
  CHECK(moved != disturbed(0.01, 2));
  CHECK(std::fabs(moved[0]) <= 0.002);
  double largest = 0;
  for (std::size_t i = 1; i < moved.size(); ++i) largest = test::larger(largest, std::fabs(moved[i] - as_it_was[i]));
  CHECK(largest > 0.005);
  CHECK(largest <= 0.01);
}

TEST_CASE("the tape is as before after the check of a stage, and mistakes are told as a stage tells them") {
  Picture picture;
  picture.tape.freeze(picture.tint);
  const std::size_t nodes = picture.tape.statistics().size();
  picture.check({"tint"}, {"masked_l2"});
  CHECK(picture.tape.statistics().size() == nodes);
  CHECK(picture.tape.frozen(picture.tint));
  CHECK_FALSE(picture.tape.frozen(picture.base));
  CHECK_THROWS_WITH(picture.check({"tind"}, {"masked_l2"}),
                    Contains("stage 's': there is no parameter group \"tind\"; did you mean \"tint\"?"));
  CHECK_THROWS_WITH(picture.check({"tint"}, {"masked_l3"}), Contains("stage 's': there is no loss term \"masked_l3\""));
  CHECK_THROWS_WITH(picture.check({"other"}, {"masked_l2"}),
                    "stage 's': no loss term depends on the group \"other\" (terms: masked_l2)");
  CHECK_THROWS_WITH(picture.check({"tint"}, {"center"}),
                    "stage 's': no loss term gives anything: center lacks an input");
  picture.tape.write(picture.base).data[3] = std::nan("");
  CHECK_THROWS_WITH(picture.check({"tint"}, {"masked_l2"}), "stage 's': the loss is nan");
  CHECK(picture.tape.frozen(picture.tint));
}

}  // namespace stage_gradcheck_test
