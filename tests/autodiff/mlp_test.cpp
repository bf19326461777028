#include "autodiff/mlp.h"

#include <cmath>
#include <complex>
#include <limits>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "core/parallel.h"
#include "core/random.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/isa.h"
#include "tests/support/operator_check.h"

namespace mlp_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace {

using Numbers = std::vector<double>;

/// Widths of a network, and which inputs it has.
struct Net {
  Index rows = 5, features = 4, more = 0, code = 0;
  bool offset = false;
  std::vector<Index> outputs = {3};
  MlpOutput output = MlpOutput::kSigmoid;
  double size = 0.6;  ///< of weights and biases

  /// Inputs of the test, in a fixed order: rows, more, code, offset, then weights and biases.
  std::vector<OperatorInput> inputs() const {
    std::vector<OperatorInput> all = {{"rows", shape_of(rows, features)}};
    if (more > 0) all.push_back({"more", shape_of(rows, more)});
    if (code > 0) all.push_back({"code", shape_of(1, code)});
    if (offset) all.push_back({"offset", shape_of(rows, outputs.back()), -2, 2});
    Index width = features + more + code;
    for (std::size_t l = 0; l < outputs.size(); ++l) {
      all.push_back({"weights " + std::to_string(l), shape_of(width, outputs[l]), -size, size});
      all.push_back({"bias " + std::to_string(l), shape_of(1, outputs[l]), -size, size});
      width = outputs[l];
    }
    return all;
  }

  template <class S>
  Var<S> record(const std::vector<Var<S>>& in) const {
    std::size_t next = 0;
    MlpInputs<S> inputs;
    inputs.rows = in[next++];
    if (more > 0) inputs.more = in[next++];
    if (code > 0) inputs.code = in[next++];
    if (offset) inputs.offset = in[next++];
    std::vector<MlpLayer<S>> layers;
    for (; next < in.size(); next += 2) layers.push_back({in[next], in[next + 1]});
    return mlp<S>(inputs, layers, output);
  }

  /// The network row by row, in plain loops over T.
  template <class T>
  std::vector<T> plain(const std::vector<std::vector<T>>& values) const {
    std::vector<T> result;
    for (Index n = 0; n < rows; ++n) {
      std::size_t next = 0;
      std::vector<T> x;
      const auto append = [&x](const std::vector<T>& from, Index row, Index cols) {
        x.insert(x.end(), from.begin() + row * cols, from.begin() + (row + 1) * cols);
      };
      append(values[next++], n, features);
      if (more > 0) append(values[next++], n, more);
      if (code > 0) append(values[next++], 0, code);
      std::vector<T> added(static_cast<std::size_t>(outputs.back()), T(0));
      if (offset) {
        const std::vector<T>& all = values[next++];
        std::copy_n(all.begin() + n * outputs.back(), outputs.back(), added.begin());
      }
      for (std::size_t l = 0; l < outputs.size(); ++l, next += 2) {
        std::vector<T> y = values[next + 1];
        for (std::size_t t = 0; t < y.size(); ++t) {
          for (std::size_t k = 0; k < x.size(); ++k) y[t] += values[next][k * y.size() + t] * x[k];
        }
        const bool is_last = l + 1 == outputs.size();
        for (std::size_t t = 0; t < y.size(); ++t) {
          if (!is_last) y[t] = y[t] * 0.5 * (1.0 + y[t] / std::sqrt(1.0 + y[t] * y[t]));
          if (is_last) y[t] += added[t];
          if (is_last && output == MlpOutput::kSigmoid) y[t] = 1.0 / (1.0 + std::exp(-y[t]));
        }
        x = y;
      }
      result.insert(result.end(), x.begin(), x.end());
    }
    return result;
  }
};

Numbers random_numbers(const OperatorInput& input, RandomSequence& random) {
  Numbers numbers(static_cast<std::size_t>(input.shape.count()));
  for (double& x : numbers) x = static_cast<float>(random.uniform(input.low, input.high));
  return numbers;
}

/// A network on a tape with random numbers.
template <class S>
struct Recorded {
  Tape<S> tape;
  std::vector<Var<S>> in;
  Var<S> out;
  std::vector<Numbers> values;
  Numbers cotangent;

  explicit Recorded(const Net& net, std::uint64_t seed = 3) {
    RandomSequence random(seed);
    for (const OperatorInput& input : net.inputs()) {
      values.push_back(random_numbers(input, random));
      in.push_back(tape.parameter(input.name, input.shape));
      tape.set(in.back(), std::vector<S>(values.back().begin(), values.back().end()));
    }
    out = net.record(in);
    cotangent = random_numbers({"cotangent", out.shape()}, random);
  }
  void run() {
    tape.forward(out);
    tape.backward(out, std::vector<S>(cotangent.begin(), cotangent.end()));
  }
  Numbers value() const { return of(tape.value(out)); }
  Numbers gradient(std::size_t i) const { return of(tape.gradient(in[i])); }
  static Numbers of(const ConstArray<S>& array) { return {array.data, array.data + array.shape.count()}; }
};

const Net kColors = {450, 16, 3, 20, true, {32, 32, 3}, MlpOutput::kSigmoid, 0.3};

/// Against the plain network: values, and for every input a directional derivative by a complex step along a random
/// direction, and along single entries.
template <class S>
void check_against_plain(const Net& net, double tolerance) {
  Recorded<S> r(net);
  r.run();
  CHECK(test::detail::relative_difference(r.value(), net.plain(r.values)) < tolerance);
  RandomSequence random(8);
  constexpr double kStep = 1e-100;
  for (std::size_t i = 0; i < r.in.size(); ++i) {
    INFO("input " << net.inputs()[i].name);
    const Numbers gradient = r.gradient(i);
    double size = 0;
    for (const double g : gradient) size += g * g;
    size = std::sqrt(size);
    for (int attempt = 0; attempt < 4; ++attempt) {
      Numbers direction(gradient.size(), 0);
      if (attempt == 0) {
        for (double& x : direction) x = random.uniform(-1, 1);
      } else {
        direction[random.below(direction.size())] = 1;
      }
      std::vector<std::vector<std::complex<double>>> moved;
      for (const Numbers& numbers : r.values) moved.emplace_back(numbers.begin(), numbers.end());
      double computed = 0, length = 0, expected = 0;
      for (std::size_t k = 0; k < direction.size(); ++k) {
        moved[i][k] += std::complex<double>(0, kStep * direction[k]);
        computed += gradient[k] * direction[k];
        length += direction[k] * direction[k];
      }
      const auto result = net.plain(moved);
      for (std::size_t k = 0; k < result.size(); ++k) expected += r.cotangent[k] * result[k].imag() / kStep;
      CHECK(std::fabs(computed - expected) < tolerance * size * std::sqrt(length));
    }
  }
}

}  // namespace

TEST_CASE("mlp passes the operator checks", "[parallel]") {
  const std::vector<Net> nets = {
      {5, 4, 0, 0, false, {3}, MlpOutput::kLinear},             // one layer alone
      {7, 3, 2, 5, true, {6, 5, 3}, MlpOutput::kSigmoid},       // everything, no width fits a tile
      {200, 16, 3, 9, true, {16, 3}, MlpOutput::kSigmoid},      // more than a block
      {3, 1, 0, 2, false, {1, 1, 1, 1}, MlpOutput::kLinear},    // narrow and deep
      {3300, 4, 0, 3, false, {8, 3}, MlpOutput::kSigmoid},      // more than a chunk
      {6, 5, 3, 0, true, {33, 9, 7, 2}, MlpOutput::kSigmoid}};  // tiles of all sizes
  for (const Net& net : nets) {
    OperatorCheck options;
    options.entries = net.rows > 1000 ? 6 : 24;
    std::vector<OperatorInput> inputs = net.inputs();
    // Of layers of one unit, numbers that are the same for every seed: others make a sum before it cancel in float.
    for (std::size_t i = 0; net.rows == 3 && i < inputs.size(); ++i) {
      for (Index k = 0; k < inputs[i].shape.count(); ++k)
        inputs[i].values.push_back(0.4 + 0.1 * static_cast<double>((i + 2 * static_cast<std::size_t>(k)) % 5));
    }
    check_operator(
        "mlp of " + std::to_string(net.rows) + " rows", inputs, [&net](const auto& in) { return net.record(in); },
        options);
  }
}

TEST_CASE("mlp equals the network in plain loops, values and all gradients") {
  check_against_plain<double>(kColors, 1e-12);
  check_against_plain<double>({193, 7, 0, 0, false, {64, 5}, MlpOutput::kLinear, 0.4}, 1e-12);
  on_every_target([] {
    check_against_plain<float>(kColors, 3e-6);
    check_against_plain<float>({193, 7, 2, 4, true, {13, 64, 5}, MlpOutput::kLinear, 0.4}, 3e-6);
    check_against_plain<double>({193, 7, 2, 4, true, {13, 64, 5}, MlpOutput::kLinear, 0.4}, 1e-12);
  });
}

TEST_CASE("mlp gives the same bits on any number of threads", "[parallel]") {
  Net net = kColors;
  net.rows = 10000;
  Numbers value;
  std::vector<Numbers> gradients;
  for (const int threads : {1, 2, 3, 7}) {
    with_threads(threads, [&] {
      Recorded<float> r(net);
      r.run();
      std::vector<Numbers> now;
      for (std::size_t i = 0; i < r.in.size(); ++i) now.push_back(r.gradient(i));
      if (threads == 1) {
        value = r.value();
        gradients = now;
      }
      CHECK(r.value() == value);
      CHECK(now == gradients);
    });
  }
}

TEST_CASE("the sum over many rows stays accurate in float") {
  Net net = {200000, 2, 0, 0, false, {2, 3}, MlpOutput::kLinear, 0.5};
  Recorded<float> fast(net);
  Recorded<double> exact(net);
  for (double& g : fast.cotangent) g = 1;  // all of one sign: nothing cancels but what rounding does
  exact.cotangent = fast.cotangent;
  fast.run();
  exact.run();
  for (std::size_t i = 1; i < fast.in.size(); ++i) {
    CHECK(test::detail::relative_difference(fast.gradient(i), exact.gradient(i)) < 1e-6);
  }
}

TEST_CASE("the activation of mlp follows its formula, and its slope, over all sizes") {
  const auto check = []<class S>(S, double tolerance) {
    Tape<S> tape;
    std::vector<S> z = {0};
    for (double size = 1e-6; size < 1e8; size *= 1.3) {
      z.push_back(static_cast<S>(size));
      z.push_back(static_cast<S>(-size));
    }
    const auto rows = static_cast<Index>(z.size());
    MlpInputs<S> in;
    in.rows = tape.parameter("z", shape_of(rows, 1));
    tape.set(in.rows, z);
    std::vector<MlpLayer<S>> layers;
    for (int l = 0; l < 2; ++l) {
      layers.push_back({tape.constant("w", shape_of(1, 1)), tape.constant("b", shape_of(1, 1))});
      tape.set(layers.back().weights, {S(1)});
    }
    const Var<S> y = mlp<S>(in, layers, MlpOutput::kLinear);
    tape.forward(y);
    tape.backward(y, std::vector<S>(z.size(), S(1)));
    for (Index i = 0; i < rows; ++i) {
      const double x = static_cast<double>(z[static_cast<std::size_t>(i)]), root = std::hypot(1.0, x), t = x / root;
      INFO("z = " << x);
      // 1 + t is rounded where t is near -1, which leaves an error in proportion to z.
      CHECK(std::fabs(static_cast<double>(tape.value(y)(i, 0)) - x * (1 + t) / 2) <= tolerance * std::fabs(x));
      CHECK(std::fabs(static_cast<double>(tape.gradient(in.rows)(i, 0)) - 0.5 * (1 + t + t / (root * root))) <=
            tolerance);
    }
  };
  check(0.0, 1e-15);
  on_every_target([&] { check(0.0F, 1e-6); });
}

TEST_CASE("the gradient of mlp's sigmoid is right far into saturation") {
  const auto check = []<class S>(S, double tolerance) {
    const std::vector<S> logits = {-80, -40, -17, 0, 15, 17, 20, 40, 80};
    Tape<S> tape;
    MlpInputs<S> in;
    in.rows = tape.constant("rows", shape_of(std::ssize(logits), 1));
    in.offset = tape.parameter("offset", shape_of(std::ssize(logits), 1));
    tape.set(in.offset, logits);
    const std::vector<MlpLayer<S>> layers = {{tape.constant("w", shape_of(1, 1)), tape.constant("b", shape_of(1, 1))}};
    const Var<S> y = mlp<S>(in, layers, MlpOutput::kSigmoid);
    tape.forward(y);
    tape.backward(y, std::vector<S>(logits.size(), S(1)));
    for (std::size_t i = 0; i < logits.size(); ++i) {
      const double e = std::exp(-std::fabs(static_cast<double>(logits[i])));
      INFO("logit " << static_cast<double>(logits[i]));
      const double slope = e / ((1 + e) * (1 + e));
      CHECK(std::fabs(static_cast<double>(tape.gradient(in.offset).data[i]) - slope) <= tolerance * slope);
    }
  };
  check(0.0F, 1e-6);
  check(0.0, 1e-14);
}

TEST_CASE("frozen inputs of mlp are not worked for") {
  Net net = kColors;
  net.rows = 6 * 3072;
  Recorded<float> r(net);
  r.run();
  const Index with_all = r.tape.memory_bytes();
  Recorded<float> frozen(net);
  for (std::size_t i = 4; i < frozen.in.size(); ++i) frozen.tape.freeze(frozen.in[i]);  // weights and biases
  frozen.tape.freeze(frozen.in[0]);
  frozen.run();
  CHECK_FALSE(frozen.tape.has_gradient(frozen.in[0]));
  CHECK_FALSE(frozen.tape.has_gradient(frozen.in[4]));
  CHECK(frozen.gradient(2) == r.gradient(2));
  // What they would take at least: an adjoint for the features, and half of the partial sums of weights in each chunk
  // (the rest is rounding of memory).
  const Index features = 16 * net.rows * static_cast<Index>(sizeof(float));
  const Index sums = 3 * (19 * 32 + 32 * 32 + 32 * 3) * static_cast<Index>(sizeof(double));
  CHECK(frozen.tape.memory_bytes() <= with_all - features - sums);
}

TEST_CASE("numbers that are not finite stay in their rows") {
  Net net = kColors;
  Recorded<float> clean(net), r(net);
  clean.run();
  r.tape.write(r.in[0])(200, 3) = std::numeric_limits<float>::quiet_NaN();
  r.run();
  const Numbers expected = clean.value(), found = r.value();
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (i / 3 == 200) {
      CHECK(std::isnan(found[i]));
    } else {
      CHECK(found[i] == expected[i]);
    }
  }
  CHECK(std::isnan(r.gradient(4)[0]));  // a step would be rolled back
}

TEST_CASE("a steady iteration of mlp allocates nothing") {
  if (!allocations_are_counted()) {
    WARN("skipped: sanitizers bring their own malloc");
    return;
  }
  Net net = kColors;
  net.rows = 7000;
  for (const int threads : {1, 2}) {
    with_threads(threads, [&] {
      Recorded<float> r(net);
      const Var<float> loss = sum(square(r.out));
      CHECK(steady_allocations([&] {
              for (int i = 0; i < 20; ++i) {
                r.tape.write(r.in[2]).data[0] += 0.01F;
                i % 5 == 0 ? r.tape.unfreeze(r.in[4]) : r.tape.freeze(r.in[4]);
                r.tape.forward(loss);
                r.tape.backward(loss);
              }
            }) == 0);
    });
  }
}

TEST_CASE("mlp without rows, and with shapes that do not fit") {
  Net empty = kColors;
  empty.rows = 0;
  Recorded<float> r(empty);
  r.run();
  for (std::size_t i = 4; i < r.in.size(); ++i) {
    for (const double g : r.gradient(i)) CHECK(g == 0);
  }

  Tape<float> tape;
  const auto leaf = [&tape](Index rows, Index cols) { return tape.parameter("x", shape_of(rows, cols)); };
  const std::vector<MlpLayer<float>> layers = {{leaf(4, 8), leaf(1, 8)}, {leaf(8, 3), leaf(1, 3)}};
  const auto record = [&](const MlpInputs<float>& in, std::span<const MlpLayer<float>> of) {
    return mlp<float>(in, of, MlpOutput::kLinear);
  };
  CHECK_NOTHROW(record({leaf(9, 4), {}, {}, {}}, layers));
  CHECK_NOTHROW(record({leaf(9, 1), leaf(9, 1), leaf(1, 2), leaf(9, 3)}, layers));
  CHECK_THROWS_AS(record({leaf(9, 5), {}, {}, {}}, layers), InternalError);          // not 4 inputs
  CHECK_THROWS_AS(record({leaf(9, 2), leaf(8, 2), {}, {}}, layers), InternalError);  // rows differ
  CHECK_THROWS_AS(record({leaf(9, 2), {}, leaf(2, 2), {}}, layers), InternalError);  // a code of two rows
  CHECK_THROWS_AS(record({leaf(9, 4), {}, {}, leaf(9, 2)}, layers), InternalError);  // offset is not the output's
  CHECK_THROWS_AS(record({leaf(9, 4), {}, {}, {}}, {}), InternalError);              // no layer
  const std::vector<MlpLayer<float>> torn = {{leaf(4, 8), leaf(1, 7)}};
  CHECK_THROWS_AS(record({leaf(9, 4), {}, {}, {}}, torn), InternalError);
  const std::vector<MlpLayer<float>> many(9, {leaf(4, 4), leaf(1, 4)});
  CHECK_THROWS_AS(record({leaf(9, 4), {}, {}, {}}, many), InternalError);
}

}  // namespace mlp_test
