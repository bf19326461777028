#include "optim/gradient_shares.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace hsi4d {

namespace {

/// All numbers of a group's gradient, times the weight.
template <class S>
std::vector<double> weighted_gradient(const Tape<S>& tape, const ParameterGroup<S>& group, double weight) {
  std::vector<double> numbers;
  for (const Var<S> block : group.blocks) {
    if (!tape.has_gradient(block)) {
      numbers.resize(numbers.size() + static_cast<std::size_t>(block.shape().count()), 0.0);
      continue;
    }
    const ConstArray<S> d = tape.gradient(block);
    for (Index r = 0; r < d.total_rows(); ++r) {
      for (Index c = 0; c < d.shape.cols; ++c) numbers.push_back(weight * static_cast<double>(d.row(r)[c]));
    }
  }
  return numbers;
}

double product(const std::vector<double>& a, const std::vector<double>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

double ratio(double a, double b) { return b == 0 ? 0 : a / b; }

/// The shares of one group. @param gradients  by term
template <class S>
void add_shares(std::span<const WeightedTerm<S>> terms, const std::string& group,
                const std::vector<std::vector<double>>& gradients, std::vector<GradientShare>& shares) {
  std::vector<double> sum(gradients.front().size(), 0.0);
  double norms = 0;
  for (const std::vector<double>& gradient : gradients) {
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += gradient[i];
    norms += std::sqrt(product(gradient, gradient));
  }
  const double sum_norm = std::sqrt(product(sum, sum));
  for (std::size_t k = 0; k < terms.size(); ++k) {
    const double norm = std::sqrt(product(gradients[k], gradients[k]));
    shares.push_back({group, terms[k].name, norm, ratio(norm, norms),
                      std::clamp(ratio(ratio(product(gradients[k], sum), norm), sum_norm), -1.0, 1.0)});
  }
}

}  // namespace

template <class S>
std::vector<GradientShare> gradient_shares(Tape<S>& tape, std::span<const WeightedTerm<S>> terms,
                                           std::span<const OptimizerGroup<S>> groups, Index iteration) {
  std::vector<const ParameterGroup<S>*> moving;
  for (const OptimizerGroup<S>& group : groups) {
    if (!group.parameters.blocks.empty() && moves_in(group.settings, iteration)) moving.push_back(&group.parameters);
  }
  std::vector<std::vector<std::vector<double>>> gradients(moving.size());  // by group and term
  for (const WeightedTerm<S>& term : terms) {
    tape.forward(term.value);  // runs nothing, but tells the tape that the term is up to date
    tape.backward(term.value);
    for (std::size_t g = 0; g < moving.size(); ++g)
      gradients[g].push_back(weighted_gradient(tape, *moving[g], term.weight));
  }
  std::vector<GradientShare> shares;
  for (std::size_t g = 0; g < moving.size(); ++g) add_shares(terms, moving[g]->name, gradients[g], shares);
  const bool is_finite = std::all_of(shares.begin(), shares.end(), [](const GradientShare& share) {
    return std::isfinite(share.norm + share.share + share.cosine);
  });
  return is_finite ? shares : std::vector<GradientShare>{};
}

template std::vector<GradientShare> gradient_shares(Tape<float>&, std::span<const WeightedTerm<float>>,
                                                    std::span<const OptimizerGroup<float>>, Index);
template std::vector<GradientShare> gradient_shares(Tape<double>&, std::span<const WeightedTerm<double>>,
                                                    std::span<const OptimizerGroup<double>>, Index);

}  // namespace hsi4d
