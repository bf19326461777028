// The checks that every taped operator passes, in one call.
//
//   check_operator("matmul", {{"a", shape_of(3, 4)}, {"b", shape_of(4, 2)}},
//                  [](const auto& in) { return matmul(in[0], in[1]); });
//
// The callable is generic: it records the operator on a Tape<double> or a Tape<float>. See check_operator for the list.
#pragma once

#include <functional>
#include <random>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "autodiff/gradcheck.h"
#include "autodiff/inspect.h"
#include "autodiff/tape.h"
#include "tests/support/gradient_record.h"

namespace hsi4d::test {

/// One input of the operator under test: random numbers in [low, high], or those given.
struct OperatorInput {
  std::string name;
  Shape shape;
  double low = -1, high = 1;
  std::vector<double> values = {};
};

struct OperatorCheck {
  /// Largest error of an adjoint entry in double, relative (see GradcheckOptions).
  double tolerance = 1e-7;
  /// Largest relative L2 error of float values and gradients against double.
  double float_tolerance = 1e-5;
  /// Freezing one input may change the other gradients by this much, relatively (0: not one bit). Above 0 only for
  /// operators that declare a specialised path.
  double freeze_tolerance = 0;
  /// Share of entries that may lie at kinks.
  double kink_share = 0.1;
  /// Relative step of the differences (see GradcheckOptions); smaller where kinks lie close.
  double step = GradcheckOptions{}.step;
  /// Entries of each input that are tried (see GradcheckOptions); fewer for an operator that is slow.
  Index entries = 64;
};

/// Seeds of every run: two fixed ones, and a fresh one that is printed; HSI4D_TEST_SEED=n repeats it. One where the
/// instruction set is held.
std::vector<std::uint64_t> operator_seeds();

namespace detail {

template <class S>
struct Recorded {
  Tape<S> tape;
  std::vector<Var<S>> in;
  Var<S> out;
};

/// Numbers of an array, without padding.
template <class S>
std::vector<S> numbers(const ConstArray<S>& array) {
  std::vector<S> result;
  for (Index r = 0; r < array.total_rows(); ++r)
    result.insert(result.end(), array.row(r), array.row(r) + array.shape.cols);
  return result;
}

std::vector<double> random_numbers(const OperatorInput& input, std::mt19937_64& random);

using Values = std::vector<std::vector<double>>;

/// Checks that do not depend on how the operator is recorded, in double.
void check_recorded(const std::string& name, Recorded<double>& r, const std::vector<double>& cotangent,
                    const OperatorCheck& options, std::uint64_t seed);
/// Those of them that are no differences, in float.
void check_recorded_in_float(Recorded<float>& r, const std::vector<double>& cotangent, const OperatorCheck& options,
                             std::uint64_t seed);
/// Gradients of all inputs; empty for a frozen one.
template <class S>
std::vector<std::vector<S>> gradients(Recorded<S>& r, const std::vector<S>& cotangent);
/// Relative L2 difference.
double relative_difference(const std::vector<double>& a, const std::vector<double>& b);

template <class S, class F>
void record(Recorded<S>& r, const std::vector<OperatorInput>& inputs, const Values& values, const F& f) {
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    r.in.push_back(r.tape.parameter(inputs[i].name, inputs[i].shape));
    r.tape.set(r.in.back(), std::vector<S>(values[i].begin(), values[i].end()));
  }
  r.out = f(r.in);
}

/// Values and gradients in float against double.
void check_float(const std::string& name, Recorded<double>& exact, Recorded<float>& fast,
                 const std::vector<double>& cotangent, double tolerance);

}  // namespace detail

/// Checks operator f (a generic callable: vector of input Vars → result Var) for several seeds:
/// 1. every adjoint entry against central differences in double, random cotangent, each node by itself and the whole;
/// 2. adjoints add: noise put in before survives; called twice they double; where they assign instead (kAssigns),
///    nothing of the memory's old content survives;
/// 3. a zero cotangent gives zero gradients;
/// 4. freezing any input leaves the gradients of the others bitwise unchanged, and the frozen one has none;
/// 5. 1, 2, 3 and 8 threads give the same bits, values and gradients;
/// 6. every number of the outputs is written (they are filled with NaN first), and the inputs are not;
/// 7. x0 → x1 → x0 gives the same bits, also when state that nodes keep is dropped in between;
/// 8. float agrees with double, and 2 to 7 hold in float too.
/// What 1 and 8 find goes into the audit of gradients where one is made (gradient_record.h).
template <class F>
void check_operator(const std::string& name, const std::vector<OperatorInput>& inputs, const F& f,
                    const OperatorCheck& options = {}) {
  for (const std::uint64_t seed : operator_seeds()) {
    INFO("operator " << name << ", seed " << seed);
    std::mt19937_64 random(seed);
    detail::Values values;
    for (const OperatorInput& input : inputs) values.push_back(detail::random_numbers(input, random));
    detail::Recorded<double> exact;
    detail::record(exact, inputs, values, f);
    const std::vector<double> cotangent = detail::random_numbers({"cotangent", exact.out.shape()}, random);
    detail::check_recorded(name, exact, cotangent, options, seed);
    detail::Recorded<float> fast;
    detail::record(fast, inputs, values, f);
    detail::check_float(name, exact, fast, cotangent, options.float_tolerance);
    detail::check_recorded_in_float(fast, cotangent, options, seed);
    record_float_errors(name, exact.tape, exact.out, fast.tape, fast.out);
  }
}

}  // namespace hsi4d::test
