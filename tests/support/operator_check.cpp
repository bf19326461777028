#include "tests/support/operator_check.h"

#include <cmath>
#include <cstring>
#include <limits>

#include "core/parallel.h"
#include "tests/support/isa.h"
#include "tests/support/measures.h"
#include "tests/support/seeds.h"

namespace hsi4d::test {

namespace {

using detail::gradients;
using detail::numbers;
using detail::Recorded;
template <class S>
using Vectors = std::vector<std::vector<S>>;

template <class S>
bool same_bits(const std::vector<S>& a, const std::vector<S>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(S)) == 0);
}

template <class S>
bool same_bits(const Vectors<S>& a, const Vectors<S>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const auto& x, const auto& y) { return same_bits(x, y); });
}

std::vector<double> wide(const std::vector<double>& numbers) { return numbers; }
std::vector<double> wide(const std::vector<float>& numbers) { return {numbers.begin(), numbers.end()}; }

/// Adjoints of a node add to what is there, and add again when called again.
template <class S>
void check_accumulation(Recorded<S>& r, const std::vector<S>& cotangent, std::mt19937_64& random) {
  const double rounding = 450 * static_cast<double>(std::numeric_limits<S>::epsilon());  // 1e-13 in double
  TapeInspector<S> inspect(r.tape);
  for (const std::uint32_t n : inspect.nodes_of(r.out)) {
    r.tape.forward(r.out);
    r.tape.backward(r.out, cotangent);  // gives the output adjoints that the node sees
    INFO("node " << inspect.operator_name(n) << " of " << inspect.source(n));
    std::vector<std::uint32_t> inputs;
    for (const std::uint32_t id : inspect.inputs(n)) {
      if (inspect.adjoint(id) && std::find(inputs.begin(), inputs.end(), id) == inputs.end()) inputs.push_back(id);
    }
    bool has_output_adjoint = false;
    for (const std::uint32_t id : inspect.outputs(n)) has_output_adjoint |= static_cast<bool>(inspect.adjoint(id));
    if (!has_output_adjoint) continue;
    Vectors<S> once, noise, on_noise, twice;
    const auto set_all = [&](const auto& value) {
      for (const std::uint32_t id : inputs) {
        const Array<S> d = inspect.adjoint(id);
        for (Index i = 0; i < d.shape.count(); ++i) d.row(i / d.shape.cols)[i % d.shape.cols] = value();
      }
    };
    const auto read_all = [&] {
      Vectors<S> all;
      for (const std::uint32_t id : inputs) all.push_back(numbers<S>(inspect.adjoint(id)));
      return all;
    };
    set_all([] { return S(0); });
    inspect.backward(n);
    once = read_all();
    inspect.backward(n);
    twice = read_all();
    std::uniform_real_distribution<S> uniform(-1, 1);
    set_all([&] { return uniform(random); });
    noise = read_all();
    inspect.backward(n);
    on_noise = read_all();
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      double worst_twice = 0, worst_noise = 0, size = 0;
      for (std::size_t k = 0; k < once[i].size(); ++k) {
        const auto first = static_cast<double>(once[i][k]), before = static_cast<double>(noise[i][k]);
        size = std::max(size, std::fabs(first));
        worst_twice = larger(worst_twice, std::fabs(static_cast<double>(twice[i][k]) - 2 * first));
        worst_noise = larger(worst_noise, std::fabs(static_cast<double>(on_noise[i][k]) - before - first));
      }
      INFO("input " << inspect.array_name(inputs[i]));
      CHECK(worst_twice <= rounding * size);
      CHECK(worst_noise <= rounding * (1 + size));
    }
  }
  r.tape.drop_state();
}

/// backward clears or assigns every adjoint: nothing of what lay in their memory survives.
template <class S>
void check_no_leftovers(Recorded<S>& r, const std::vector<S>& cotangent) {
  const Vectors<S> clean = gradients(r, cotangent);
  TapeInspector<S> inspect(r.tape);
  for (std::uint32_t id = 0; id < inspect.arrays(); ++id) {
    const Array<S> d = inspect.adjoint(id);
    if (!d) continue;
    for (Index row = 0; row < d.total_rows(); ++row) {
      std::fill_n(d.row(row), d.shape.cols, std::numeric_limits<S>::quiet_NaN());
    }
  }
  CHECK(same_bits(gradients(r, cotangent), clean));
}

template <class S>
void check_freezing(Recorded<S>& r, const std::vector<S>& cotangent, double tolerance) {
  const Vectors<S> all = gradients(r, cotangent);
  for (std::size_t frozen = 0; frozen < r.in.size(); ++frozen) {
    if (r.in.size() == 1) break;
    r.tape.freeze(r.in[frozen]);
    const Vectors<S> rest = gradients(r, cotangent);
    INFO("frozen input " << frozen);
    for (std::size_t i = 0; i < r.in.size(); ++i) {
      INFO("gradient of input " << i);
      if (i == frozen) {
        CHECK(rest[i].empty());
      } else if (tolerance == 0) {
        CHECK(same_bits(rest[i], all[i]));
      } else {
        CHECK(detail::relative_difference(wide(rest[i]), wide(all[i])) <= tolerance);
      }
    }
    r.tape.unfreeze(r.in[frozen]);
  }
  for (const Var<S>& input : r.in) r.tape.freeze(input);
  r.tape.forward(r.out);
  r.tape.backward(r.out, cotangent);
  for (const Var<S>& input : r.in) {
    CHECK_FALSE(r.tape.has_gradient(input));
    r.tape.unfreeze(input);
  }
}

/// Marks every leaf as written, so that forward runs every node.
template <class S>
void touch(Recorded<S>& r) {
  for (const Var<S>& input : r.in) r.tape.write(input);
}

template <class S>
void check_threads(Recorded<S>& r, const std::vector<S>& cotangent) {
  std::vector<S> value;
  Vectors<S> gradient;
  for (const int threads : {1, 2, 3, 8}) {
    INFO(threads << " threads");
    with_threads(threads, [&] {
      touch(r);
      r.tape.drop_state();
      const Vectors<S> now = gradients(r, cotangent);
      if (threads == 1) {
        value = numbers<S>(r.tape.value(r.out));
        gradient = now;
      }
      CHECK(same_bits(numbers<S>(r.tape.value(r.out)), value));
      CHECK(same_bits(now, gradient));
    });
  }
}

template <class S>
void check_every_output_written(Recorded<S>& r) {
  TapeInspector<S> inspect(r.tape);
  touch(r);
  r.tape.forward(r.out);
  for (const std::uint32_t n : inspect.nodes_of(r.out)) {
    if (inspect.persistent_outputs(n)) continue;
    INFO("node " << inspect.operator_name(n) << " of " << inspect.source(n));
    Vectors<S> inputs, before;
    for (const std::uint32_t id : inspect.inputs(n)) inputs.push_back(numbers<S>(inspect.value(id)));
    for (const std::uint32_t id : inspect.outputs(n)) {
      const Array<S> y = inspect.value(id);
      before.push_back(numbers<S>(y));
      for (Index i = 0; i < y.shape.count(); ++i) {
        y.row(i / y.shape.cols)[i % y.shape.cols] = std::numeric_limits<S>::quiet_NaN();
      }
    }
    inspect.forward(n);
    Vectors<S> after, inputs_after;
    for (const std::uint32_t id : inspect.outputs(n)) after.push_back(numbers<S>(inspect.value(id)));
    for (const std::uint32_t id : inspect.inputs(n)) inputs_after.push_back(numbers<S>(inspect.value(id)));
    CHECK(same_bits(before, after));
    CHECK(same_bits(inputs, inputs_after));
  }
}

/// The result is a function of the values alone, not of the path that led to them.
template <class S>
void check_path_independence(Recorded<S>& r, const std::vector<S>& cotangent) {
  const auto scale_inputs = [&](const Vectors<S>& values, S factor) {
    for (std::size_t i = 0; i < r.in.size(); ++i) {
      std::vector<S> scaled = values[i];
      for (S& x : scaled) x *= factor;
      r.tape.set(r.in[i], scaled);
    }
  };
  Vectors<S> start;
  for (const Var<S>& input : r.in) start.push_back(numbers<S>(r.tape.value(input)));
  const Vectors<S> first = gradients(r, cotangent);
  const std::vector<S> value = numbers<S>(r.tape.value(r.out));
  scale_inputs(start, S(0.75));
  gradients(r, cotangent);
  scale_inputs(start, S(1));
  CHECK(same_bits(gradients(r, cotangent), first));
  CHECK(same_bits(numbers<S>(r.tape.value(r.out)), value));
  r.tape.drop_state();
  CHECK(same_bits(gradients(r, cotangent), first));
}

/// The checks that hold in any precision.
template <class S>
void check_bookkeeping(Recorded<S>& r, const std::vector<S>& cotangent, double freeze_tolerance, std::uint64_t seed) {
  std::mt19937_64 random(seed + 1);
  check_accumulation(r, cotangent, random);
  for (const auto& gradient : gradients(r, std::vector<S>(cotangent.size(), S(0)))) {
    CHECK(std::all_of(gradient.begin(), gradient.end(), [](S g) { return g == 0; }));
  }
  check_no_leftovers(r, cotangent);
  check_freezing(r, cotangent, freeze_tolerance);
  check_threads(r, cotangent);
  check_every_output_written(r);
  check_path_independence(r, cotangent);
}

}  // namespace

std::vector<std::uint64_t> operator_seeds() {
  if (is_held_isa()) return {1};
  return {1, 20240229, fresh_seed()};
}

namespace detail {

std::vector<double> random_numbers(const OperatorInput& input, std::mt19937_64& random) {
  if (!input.values.empty()) return input.values;
  std::vector<double> values(static_cast<std::size_t>(input.shape.count()));
  for (double& x : values) {
    const double unit = static_cast<double>(random() >> 11) * 0x1p-53;
    // Rounded to float, so that float and double runs see the same numbers.
    x = static_cast<float>(input.low + (input.high - input.low) * unit);
  }
  return values;
}

template <class S>
std::vector<std::vector<S>> gradients(Recorded<S>& r, const std::vector<S>& cotangent) {
  r.tape.forward(r.out);
  r.tape.backward(r.out, cotangent);
  std::vector<std::vector<S>> all;
  for (const Var<S>& input : r.in) {
    all.push_back(r.tape.has_gradient(input) ? numbers<S>(r.tape.gradient(input)) : std::vector<S>());
  }
  return all;
}
template std::vector<std::vector<float>> gradients(Recorded<float>&, const std::vector<float>&);
template std::vector<std::vector<double>> gradients(Recorded<double>&, const std::vector<double>&);

double relative_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double difference = 0, size = 0;
  if (a.size() != b.size()) return std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference += (a[i] - b[i]) * (a[i] - b[i]);
    size += b[i] * b[i];
  }
  return difference == 0 ? 0 : std::sqrt(difference / std::max(size, 1e-300));
}

void check_recorded(const std::string& name, Recorded<double>& r, const std::vector<double>& cotangent,
                    const OperatorCheck& options, std::uint64_t seed) {
  GradcheckOptions gradcheck_options;
  gradcheck_options.tolerance = options.tolerance;
  gradcheck_options.kink_share = options.kink_share;
  gradcheck_options.step = options.step;
  gradcheck_options.entries = options.entries;
  gradcheck_options.seed = seed;
  const GradcheckReport report = gradcheck(r.tape, r.out, gradcheck_options);
  INFO(report.text());
  CHECK(report.ok());
  CHECK(report.entries > 0);
  record_differences(name, report);

  check_bookkeeping(r, cotangent, options.freeze_tolerance, seed);
}

void check_recorded_in_float(Recorded<float>& r, const std::vector<double>& cotangent, const OperatorCheck& options,
                             std::uint64_t seed) {
  INFO("in float");
  // Freezing may cost rounding of the precision where it may cost any.
  const double freeze_tolerance = options.freeze_tolerance > 0 ? options.float_tolerance : 0;
  check_bookkeeping(r, std::vector<float>(cotangent.begin(), cotangent.end()), freeze_tolerance, seed);
}

// Gradients of several cotangents are compared as one, for that of a single number may cancel.
void check_float(const std::string& name, Recorded<double>& exact, Recorded<float>& fast,
                 const std::vector<double>& cotangent, double tolerance) {
  constexpr int kCotangents = 4;
  std::vector<std::vector<double>> expected, computed;
  std::mt19937_64 random(cotangent.size());
  std::vector<float> rounded(cotangent.begin(), cotangent.end());
  for (int k = 0; k < kCotangents; ++k) {
    const auto of_double = gradients(exact, std::vector<double>(rounded.begin(), rounded.end()));
    const auto of_float = gradients(fast, rounded);
    expected.resize(of_double.size());
    computed.resize(of_float.size());
    for (std::size_t i = 0; i < of_double.size(); ++i) {
      expected[i].insert(expected[i].end(), of_double[i].begin(), of_double[i].end());
      computed[i].insert(computed[i].end(), of_float[i].begin(), of_float[i].end());
    }
    for (float& x : rounded) x = (random() >> 63) != 0 ? -x : x;
  }
  const std::vector<float> value = numbers<float>(fast.tape.value(fast.out));
  CHECK(relative_difference({value.begin(), value.end()}, numbers<double>(exact.tape.value(exact.out))) <= tolerance);
  for (std::size_t i = 0; i < computed.size(); ++i) {
    INFO("float gradient of input " << i);
    const double error = relative_difference(computed[i], expected[i]);
    CHECK(error <= tolerance);
    const bool is_read = std::any_of(expected[i].begin(), expected[i].end(), [](double d) { return d != 0; });
    if (is_read)
      record_gradient({name, "", -1, TapeInspector<double>(exact.tape).array_name(exact.in[i].id), "double", error,
                       std::ssize(expected[i])});
  }
}

}  // namespace detail
}  // namespace hsi4d::test
