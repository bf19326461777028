#include "tests/support/operator_check.h"

#include <cmath>
#include <cstring>
#include <limits>

#include "core/parallel.h"
#include "tests/support/seeds.h"

namespace hsi4d::test {

namespace {

using detail::gradients;
using detail::numbers;
using detail::Recorded;
using Vectors = std::vector<std::vector<double>>;

bool same_bits(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0);
}

bool same_bits(const Vectors& a, const Vectors& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const auto& x, const auto& y) { return same_bits(x, y); });
}

/// The larger; NaN when one of them is.
double larger(double a, double b) { return !(b <= a) ? b : a; }

/// Adjoints of a node add to what is there, and add again when called again.
void check_accumulation(Recorded<double>& r, const std::vector<double>& cotangent, std::mt19937_64& random) {
  TapeInspector<double> inspect(r.tape);
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
    Vectors once, noise, on_noise, twice;
    const auto set_all = [&](const auto& value) {
      for (const std::uint32_t id : inputs) {
        const Array<double> d = inspect.adjoint(id);
        for (Index i = 0; i < d.shape.count(); ++i) d.row(i / d.shape.cols)[i % d.shape.cols] = value();
      }
    };
    const auto read_all = [&] {
      Vectors all;
      for (const std::uint32_t id : inputs) all.push_back(numbers<double>(inspect.adjoint(id)));
      return all;
    };
    set_all([] { return 0.0; });
    inspect.backward(n);
    once = read_all();
    inspect.backward(n);
    twice = read_all();
    std::uniform_real_distribution<double> uniform(-1, 1);
    set_all([&] { return uniform(random); });
    noise = read_all();
    inspect.backward(n);
    on_noise = read_all();
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      double worst_twice = 0, worst_noise = 0, size = 0;
      for (std::size_t k = 0; k < once[i].size(); ++k) {
        size = std::max(size, std::fabs(once[i][k]));
        worst_twice = larger(worst_twice, std::fabs(twice[i][k] - 2 * once[i][k]));
        worst_noise = larger(worst_noise, std::fabs(on_noise[i][k] - noise[i][k] - once[i][k]));
      }
      INFO("input " << inspect.array_name(inputs[i]));
      CHECK(worst_twice <= 1e-13 * size);
      CHECK(worst_noise <= 1e-13 * (1 + size));
    }
  }
  r.tape.drop_state();
}

/// backward clears or assigns every adjoint: nothing of what lay in their memory survives.
void check_no_leftovers(Recorded<double>& r, const std::vector<double>& cotangent) {
  const Vectors clean = gradients(r, cotangent);
  TapeInspector<double> inspect(r.tape);
  for (std::uint32_t id = 0; id < inspect.arrays(); ++id) {
    const Array<double> d = inspect.adjoint(id);
    if (!d) continue;
    for (Index row = 0; row < d.total_rows(); ++row) {
      std::fill_n(d.row(row), d.shape.cols, std::numeric_limits<double>::quiet_NaN());
    }
  }
  CHECK(same_bits(gradients(r, cotangent), clean));
}

void check_freezing(Recorded<double>& r, const std::vector<double>& cotangent, double tolerance) {
  const Vectors all = gradients(r, cotangent);
  for (std::size_t frozen = 0; frozen < r.in.size(); ++frozen) {
    if (r.in.size() == 1) break;
    r.tape.freeze(r.in[frozen]);
    const Vectors rest = gradients(r, cotangent);
    INFO("frozen input " << frozen);
    for (std::size_t i = 0; i < r.in.size(); ++i) {
      INFO("gradient of input " << i);
      if (i == frozen) {
        CHECK(rest[i].empty());
      } else if (tolerance == 0) {
        CHECK(same_bits(rest[i], all[i]));
      } else {
        CHECK(detail::relative_difference(rest[i], all[i]) <= tolerance);
      }
    }
    r.tape.unfreeze(r.in[frozen]);
  }
  for (const Var<double>& input : r.in) r.tape.freeze(input);
  r.tape.forward(r.out);
  r.tape.backward(r.out, cotangent);
  for (const Var<double>& input : r.in) {
    CHECK_FALSE(r.tape.has_gradient(input));
    r.tape.unfreeze(input);
  }
}

/// Marks every leaf as written, so that forward runs every node.
void touch(Recorded<double>& r) {
  for (const Var<double>& input : r.in) r.tape.write(input);
}

void check_threads(Recorded<double>& r, const std::vector<double>& cotangent) {
  std::vector<double> value;
  Vectors gradient;
  for (const int threads : {1, 2, 3, 8}) {
    INFO(threads << " threads");
    with_threads(threads, [&] {
      touch(r);
      r.tape.drop_state();
      const Vectors now = gradients(r, cotangent);
      if (threads == 1) {
        value = numbers<double>(r.tape.value(r.out));
        gradient = now;
      }
      CHECK(same_bits(numbers<double>(r.tape.value(r.out)), value));
      CHECK(same_bits(now, gradient));
    });
  }
}

void check_every_output_written(Recorded<double>& r) {
  TapeInspector<double> inspect(r.tape);
  touch(r);
  r.tape.forward(r.out);
  for (const std::uint32_t n : inspect.nodes_of(r.out)) {
    if (inspect.persistent_outputs(n)) continue;
    INFO("node " << inspect.operator_name(n) << " of " << inspect.source(n));
    Vectors inputs, before;
    for (const std::uint32_t id : inspect.inputs(n)) inputs.push_back(numbers<double>(inspect.value(id)));
    for (const std::uint32_t id : inspect.outputs(n)) {
      const Array<double> y = inspect.value(id);
      before.push_back(numbers<double>(y));
      for (Index i = 0; i < y.shape.count(); ++i) {
        y.row(i / y.shape.cols)[i % y.shape.cols] = std::numeric_limits<double>::quiet_NaN();
      }
    }
    inspect.forward(n);
    Vectors after, inputs_after;
    for (const std::uint32_t id : inspect.outputs(n)) after.push_back(numbers<double>(inspect.value(id)));
    for (const std::uint32_t id : inspect.inputs(n)) inputs_after.push_back(numbers<double>(inspect.value(id)));
    CHECK(same_bits(before, after));
    CHECK(same_bits(inputs, inputs_after));
  }
}

/// The result is a function of the values alone, not of the path that led to them.
void check_path_independence(Recorded<double>& r, const std::vector<double>& cotangent) {
  const auto scale_inputs = [&](const Vectors& values, double factor) {
    for (std::size_t i = 0; i < r.in.size(); ++i) {
      std::vector<double> scaled = values[i];
      for (double& x : scaled) x *= factor;
      r.tape.set(r.in[i], scaled);
    }
  };
  Vectors start;
  for (const Var<double>& input : r.in) start.push_back(numbers<double>(r.tape.value(input)));
  const Vectors first = gradients(r, cotangent);
  const std::vector<double> value = numbers<double>(r.tape.value(r.out));
  scale_inputs(start, 0.75);
  gradients(r, cotangent);
  scale_inputs(start, 1);
  CHECK(same_bits(gradients(r, cotangent), first));
  CHECK(same_bits(numbers<double>(r.tape.value(r.out)), value));
  r.tape.drop_state();
  CHECK(same_bits(gradients(r, cotangent), first));
}

}  // namespace

std::vector<std::uint64_t> operator_seeds() { return {1, 20240229, fresh_seed()}; }

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

void check_recorded(Recorded<double>& r, const std::vector<double>& cotangent, const OperatorCheck& options,
                    std::uint64_t seed) {
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

  std::mt19937_64 random(seed + 1);
  check_accumulation(r, cotangent, random);
  for (const auto& gradient : gradients(r, std::vector<double>(cotangent.size(), 0.0))) {
    CHECK(std::all_of(gradient.begin(), gradient.end(), [](double g) { return g == 0; }));
  }
  check_no_leftovers(r, cotangent);
  check_freezing(r, cotangent, options.freeze_tolerance);
  check_threads(r, cotangent);
  check_every_output_written(r);
  check_path_independence(r, cotangent);
}

// Gradients of several cotangents are compared as one, for that of a single number may cancel.
void check_float(Recorded<double>& exact, Recorded<float>& fast, const std::vector<double>& cotangent,
                 double tolerance) {
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
    CHECK(relative_difference(computed[i], expected[i]) <= tolerance);
  }
}

}  // namespace detail
}  // namespace hsi4d::test
