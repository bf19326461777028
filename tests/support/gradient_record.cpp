#include "tests/support/gradient_record.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>

#include <nlohmann/json.hpp>

#include "autodiff/inspect.h"
#include "core/random.h"

namespace hsi4d::test {

namespace {

const char* file_of_audit() {
  const char* path = std::getenv("HSI4D_GRADIENT_AUDIT");
  return path != nullptr && *path != '\0' ? path : nullptr;
}

/// Whether a node has a cotangent; nodes of constants have none.
template <class S>
bool has_cotangent(TapeInspector<S>& inspect, std::uint32_t n) {
  for (const std::uint32_t id : inspect.outputs(n)) {
    if (inspect.adjoint(id)) return true;
  }
  return false;
}

template <class F>
void each_number(Index count, Index cols, const F& f) {
  for (Index i = 0; i < count; ++i) f(i / cols, i % cols);
}

/// Gradients of a node's inputs for several cotangents, one after the other; empty where there is none.
template <class S>
std::vector<std::vector<double>> node_gradients(TapeInspector<S>& inspect, std::uint32_t n) {
  constexpr int kCotangents = 4;  // the gradient of one alone may cancel
  const std::vector<std::uint32_t> inputs = inspect.inputs(n);
  std::vector<std::vector<double>> all(inputs.size());
  RandomSequence random(23);
  for (int k = 0; k < kCotangents; ++k) {
    for (const std::uint32_t id : inspect.outputs(n)) {
      const Array<S> d = inspect.adjoint(id);
      each_number(inspect.shape(id).count(), inspect.shape(id).cols, [&](Index row, Index col) {
        const auto u = static_cast<float>(random.uniform(-1, 1));
        if (d) d.row(row)[col] = static_cast<S>(u);
      });
    }
    for (const std::uint32_t id : inputs) {
      if (const Array<S> d = inspect.adjoint(id)) std::fill_n(d.data, d.shape.memory(), S(0));
    }
    inspect.backward(n);
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      const Array<S> d = inspect.adjoint(inputs[i]);
      if (!d) continue;
      each_number(d.shape.count(), d.shape.cols,
                  [&](Index row, Index col) { all[i].push_back(static_cast<double>(d.row(row)[col])); });
    }
  }
  return all;
}

/// Rounds the numbers of an array to float, in both tapes.
void round_both(const Array<double>& exact, const Array<float>& fast) {
  each_number(exact.shape.count(), exact.shape.cols, [&](Index row, Index col) {
    fast.row(row)[col] = static_cast<float>(exact.row(row)[col]);
    exact.row(row)[col] = static_cast<double>(fast.row(row)[col]);
  });
}

double relative_l2(const std::vector<double>& a, const std::vector<double>& b) {
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < b.size(); ++i) {
    difference += (a[i] - b[i]) * (a[i] - b[i]);
    size += b[i] * b[i];
  }
  return difference == 0 ? 0 : std::sqrt(difference / std::max(size, 1e-300));
}

}  // namespace

bool records_gradients() { return file_of_audit() != nullptr; }

void record_gradient(const GradientFigure& figure) {
  if (!records_gradients()) return;
  const nlohmann::ordered_json line = {{"check", figure.check},    {"operator", figure.node},   {"input", figure.input},
                                       {"name", figure.array},     {"against", figure.against}, {"error", figure.error},
                                       {"entries", figure.entries}};
  std::ofstream(file_of_audit(), std::ios::app) << line.dump() + "\n";
}

void record_differences(const std::string& check, const GradcheckReport& report) {
  for (const GradcheckArray& of : report.arrays) {
    const Index entries = of.entries - of.kinks;
    if (entries > 0)
      record_gradient({check, of.input < 0 ? "" : of.node, of.input, of.array, "differences", of.worst_error, entries});
  }
}

void record_float_errors(const std::string& check, Tape<double>& exact, Var<double> exact_result, Tape<float>& fast,
                         Var<float> fast_result) {
  if (!records_gradients()) return;
  TapeInspector<double> in_double(exact);
  TapeInspector<float> in_float(fast);
  const auto double_nodes = in_double.nodes_of(exact_result), float_nodes = in_float.nodes_of(fast_result);
  HSI4D_CHECK_EQ(double_nodes.size(), float_nodes.size());
  for (std::size_t k = 0; k < double_nodes.size(); ++k) {
    const std::uint32_t n = double_nodes[k], m = float_nodes[k];
    if (!has_cotangent(in_double, n) || !has_cotangent(in_float, m)) continue;
    const std::vector<std::uint32_t> inputs = in_double.inputs(n), float_inputs = in_float.inputs(m);
    for (std::size_t i = 0; i < inputs.size(); ++i)
      round_both(in_double.value(inputs[i]), in_float.value(float_inputs[i]));
    in_double.forward(n);
    in_float.forward(m);
    const auto expected = node_gradients(in_double, n), computed = node_gradients(in_float, m);
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      if (expected[i].empty() || expected[i].size() != computed[i].size()) continue;
      record_gradient({check, in_double.operator_name(n), static_cast<int>(i), in_double.array_name(inputs[i]),
                       "double", relative_l2(computed[i], expected[i]), static_cast<Index>(expected[i].size())});
    }
  }
}

}  // namespace hsi4d::test
