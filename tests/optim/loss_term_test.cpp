#include "optim/loss_term.h"

#include <algorithm>

#include "autodiff/difference.h"
#include "tests/support/operator_check.h"

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

constexpr Index kHeight = 13, kWidth = 21;

/// A term with its default settings on the arrays of `in`: rendered, target, weight.
template <class S>
Var<S> record_term(const LossTerm& term, const std::vector<Var<S>>& in) {
  LossInputs<S> inputs;
  inputs.rendered = in[0];
  inputs.target = in[1];
  inputs.weight = in[2];
  return term.record(inputs, term.description.defaults);
}

}  // namespace

TEST_CASE("every registered loss term passes the gradient check", "[parallel]") {
  REQUIRE_FALSE(loss_terms().empty());
  for (const LossTerm& term : loss_terms()) {
    // The stride is that of double; float arrays may have the same padding.
    const Shape image = image_shape<double>(3, kHeight, kWidth), mask = image_shape<double>(1, kHeight, kWidth);
    check_operator(term.description.name, {{"rendered", image, 0, 1}, {"target", image, 0, 1}, {"weight", mask, 0, 1}},
                   [&](const auto& in) { return record_term(term, in); }, {.entries = 24});
  }
}

TEST_CASE("registered loss terms have different names and a summary") {
  std::vector<std::string> names;
  for (const LossDescription& loss : descriptions_of(loss_terms())) {
    CHECK(std::find(names.begin(), names.end(), loss.name) == names.end());
    CHECK_FALSE(loss.summary.empty());
    names.push_back(loss.name);
  }
}

namespace {

const LossTerm& term_named(const std::string& name) {
  return *std::find_if(loss_terms().begin(), loss_terms().end(),
                       [&](const LossTerm& term) { return term.description.name == name; });
}

/// Value of a term where the rendered image is `value` everywhere and the target is black.
double value_of_flat(const std::string& name, double value, bool with_weight) {
  Tape<double> tape;
  LossInputs<double> inputs;
  inputs.rendered = tape.parameter("rendered", image_shape<double>(3, kHeight, kWidth));
  inputs.target = tape.constant("target", image_shape<double>(3, kHeight, kWidth));
  const Array<double> image = tape.write(inputs.rendered);
  for (Index r = 0; r < image.total_rows(); ++r) std::fill_n(image.row(r), kWidth, value);
  if (with_weight) {
    inputs.weight = tape.constant("weight", image_shape<double>(1, kHeight, kWidth));
    std::fill_n(tape.write(inputs.weight).row(4), kWidth, 1.0);  // one row counts
  }
  const auto& term = term_named(name);
  const auto loss = term.record(inputs, term.description.defaults);
  tape.forward(loss);
  return tape.value(loss).scalar();
}

}  // namespace

TEST_CASE("masked_l2 is the mean of squares over all pixels, of those that count") {
  CHECK(value_of_flat("masked_l2", 0.5, false) == Approx(0.25).epsilon(1e-14));
  CHECK(value_of_flat("masked_l2", 0.5, true) == Approx(0.25 / kHeight).epsilon(1e-14));
}

TEST_CASE("photometric is zero for equal images and its L1 share is that of the settings") {
  CHECK(value_of_flat("photometric", 0, false) == 0);
  const double loss = value_of_flat("photometric", 0.5, false);
  CHECK(loss > 0.9 * 0.5);
  CHECK(loss < 0.9 * 0.5 + 0.1);
}
