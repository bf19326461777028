// Weights as files have them: checked, pruned and normalised in double.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "body/skinning.h"
#include "core/text.h"

namespace hsi4d {

namespace {

[[noreturn]] void fail(std::string_view source, Index vertex, const std::string& what) {
  throw DataError(std::string(source) + ": vertex " + std::to_string(vertex) + ": " + what);
}

/// Checks the weights of one vertex and returns their sum.
double checked_sum(const double* weights, Index count, std::string_view source, Index vertex) {
  double sum = 0;
  for (Index k = 0; k < count; ++k) {
    if (!std::isfinite(weights[k]) || weights[k] < 0) {
      fail(source, vertex, "weight " + std::to_string(k) + " is " + number_text(weights[k]) + "; allowed: 0 to 1");
    }
    sum += weights[k];
  }
  if (!(std::abs(sum - 1) <= kWeightSumTolerance)) {
    fail(source, vertex,
         "the weights sum to " + number_text(sum) + "; allowed: 1 within " + number_text(kWeightSumTolerance));
  }
  return sum;
}

/// Drops tiny weights and divides the others by their sum.
void normalize(double* weights, Index count) {
  double sum = 0;
  for (Index k = 0; k < count; ++k) {
    if (weights[k] < kTinyWeight) weights[k] = 0;
    sum += weights[k];
  }
  for (Index k = 0; k < count; ++k) weights[k] /= sum;
}

void check_joint(std::int32_t joint, Index joints, std::string_view source, Index vertex) {
  if (joint >= 0 && joint < joints) return;
  fail(source, vertex,
       "joint " + std::to_string(joint) + " does not exist; allowed: 0 to " + std::to_string(joints - 1));
}

}  // namespace

SparseWeights normalized_weights(SparseWeights raw, std::string_view source) {
  const Index count = raw.per_vertex;
  HSI4D_CHECK(count >= 1 && count <= kMaxWeightsPerVertex,
              std::to_string(count) + " weights per vertex; allowed: 1 to 8");
  HSI4D_CHECK_EQ(static_cast<Index>(raw.indices.size()), raw.vertices * count);
  HSI4D_CHECK_EQ(static_cast<Index>(raw.weights.size()), raw.vertices * count);
  for (Index v = 0; v < raw.vertices; ++v) {
    std::int32_t* joints = raw.indices.data() + v * count;
    double* weights = raw.weights.data() + v * count;
    for (Index k = 0; k < count; ++k) check_joint(joints[k], raw.joints, source, v);
    checked_sum(weights, count, source, v);
    normalize(weights, count);
    // An unused place repeats a used joint, so that a NaN of a joint reaches only the vertices that hang on it.
    const std::int32_t used = joints[std::max_element(weights, weights + count) - weights];
    for (Index k = 0; k < count; ++k) joints[k] = weights[k] == 0 ? used : joints[k];
  }
  return raw;
}

DenseWeights normalized_weights(DenseWeights raw, std::string_view source) {
  HSI4D_CHECK_EQ(static_cast<Index>(raw.weights.size()), raw.vertices * raw.joints);
  for (Index v = 0; v < raw.vertices; ++v) {
    double* weights = raw.weights.data() + v * raw.joints;
    checked_sum(weights, raw.joints, source, v);
    normalize(weights, raw.joints);
  }
  return raw;
}

Index repair_weights(DenseWeights& weights, std::string_view source) {
  HSI4D_CHECK_EQ(static_cast<Index>(weights.weights.size()), weights.vertices * weights.joints);
  Index repaired = 0;
  for (Index v = 0; v < weights.vertices; ++v) {
    double* of_vertex = weights.weights.data() + v * weights.joints;
    const double sum = checked_sum(of_vertex, weights.joints, source, v);
    if (std::abs(sum - 1) <= kWeightRounding) continue;
    normalize(of_vertex, weights.joints);
    ++repaired;
  }
  return repaired;
}

std::optional<SparseWeights> sparse_weights(const DenseWeights& dense) {
  HSI4D_CHECK_EQ(static_cast<Index>(dense.weights.size()), dense.vertices * dense.joints);
  SparseWeights sparse{dense.vertices, dense.joints, 1, {}, {}};
  for (Index v = 0; v < dense.vertices; ++v) {
    const double* of_vertex = dense.weights.data() + v * dense.joints;
    const Index used = dense.joints - std::count(of_vertex, of_vertex + dense.joints, 0.0);
    sparse.per_vertex = std::max(sparse.per_vertex, used);
  }
  if (sparse.per_vertex > kMaxWeightsPerVertex) return std::nullopt;
  for (Index v = 0; v < dense.vertices; ++v) {
    const double* of_vertex = dense.weights.data() + v * dense.joints;
    const auto largest = static_cast<std::int32_t>(std::max_element(of_vertex, of_vertex + dense.joints) - of_vertex);
    const std::size_t end = sparse.weights.size() + static_cast<std::size_t>(sparse.per_vertex);
    for (Index j = 0; j < dense.joints; ++j) {
      if (of_vertex[j] == 0) continue;
      sparse.indices.push_back(static_cast<std::int32_t>(j));
      sparse.weights.push_back(of_vertex[j]);
    }
    sparse.indices.resize(end, largest);
    sparse.weights.resize(end, 0.0);
  }
  return sparse;
}

SparseWeights largest_weights(const DenseWeights& dense, Index per_vertex, std::string_view source) {
  HSI4D_CHECK_EQ(static_cast<Index>(dense.weights.size()), dense.vertices * dense.joints);
  const Index kept = std::min(per_vertex, dense.joints);
  SparseWeights sparse{dense.vertices, dense.joints, per_vertex, {}, {}};
  std::vector<std::int32_t> order(static_cast<std::size_t>(dense.joints));
  for (Index v = 0; v < dense.vertices; ++v) {
    const double* weights = dense.weights.data() + v * dense.joints;
    checked_sum(weights, dense.joints, source, v);
    std::iota(order.begin(), order.end(), 0);
    std::partial_sort(order.begin(), order.begin() + kept, order.end(), [&](std::int32_t a, std::int32_t b) {
      return weights[a] != weights[b] ? weights[a] > weights[b] : a < b;
    });
    for (Index k = 0; k < per_vertex; ++k) {
      const std::int32_t joint = k < kept ? order[static_cast<std::size_t>(k)] : order[0];
      sparse.indices.push_back(joint);
      sparse.weights.push_back(k < kept ? weights[joint] : 0.0);
    }
  }
  return normalized_weights(std::move(sparse), source);
}

}  // namespace hsi4d
