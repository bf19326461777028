#include "autodiff/curvature.h"

#include <algorithm>
#include <cmath>

#include "core/parallel.h"
#include "core/stopwatch.h"

namespace hsi4d {

template <class S>
Curvature<S>::Curvature(Tape<S>& tape, Var<S> loss, std::vector<Var<S>> leaves, const CurvatureRule& rule)
    : tape_(tape),
      loss_(loss),
      leaves_(std::move(leaves)),
      seen_(leaves_.size(), 0),
      weights_(tape, rule),
      movers_(tape) {
  Index count = 0;
  for (const Var<S> leaf : leaves_) count += tape.shape(leaf).count();
  matrix_.setZero(count, count);
}

template <class S>
const Eigen::MatrixXd& Curvature<S>::compute() {
  const std::uint32_t id = tape_.checked(loss_);
  const Plan& plan = tape_.plan_for(id);
  tape_.check_leaves(plan);
  if (tape_.active_result_ != id || tape_.active_structure_ != plan.structure)
    throw StaleError("Stale: a curvature without a backward run of the loss before it");
  const FlushDenormals flush;
  std::fill(seen_.begin(), seen_.end(), std::uint8_t(0));
  left_out_.clear();
  matrix_.setZero();
  const auto timed = [](double& seconds, const auto& work) {
    const auto start = std::chrono::steady_clock::now();
    work();
    seconds = seconds_since(start);
  };
  timed(times_.weights, [&] { pass_weights(plan); });
  timed(times_.twists, [&] { push_twists(plan); });
  timed(times_.renders, [&] { collect(); });
  timed(times_.residuals, [&] {
    for (const std::uint32_t array : residuals_) add_residuals(array);
  });
  timed(times_.movers, [&] { add_movers(); });
  ++weights_.rule.turn;
  return matrix_;
}

/// From the loss to pixels and other numbers that it compares.
template <class S>
void Curvature<S>::pass_weights(const Plan& plan) {
  weights_.clear();
  residuals_.clear();
  collectors_.clear();
  for (const std::uint32_t n : plan.backward_nodes) {
    const auto& node = tape_.nodes_[n];
    NodeIo<S> io = tape_.io_of(node);
    const bool handed_on = node.table->weigh != nullptr && node.table->weigh(node.op, io, weights_);
    tape_.scratch_.reset();
    if (handed_on) continue;
    std::vector<std::uint32_t> weighed;
    for (std::uint32_t out = node.first_output; out < node.first_output + node.output_count; ++out) {
      if (weights_.of(out)) weighed.push_back(out);
    }
    if (weighed.empty()) continue;
    if (node.table->collect != nullptr) {
      collectors_.push_back(n);
    } else {
      residuals_.insert(residuals_.end(), weighed.begin(), weighed.end());
    }
  }
  for (const std::uint32_t leaf : plan.leaves) {
    if (weights_.of(leaf)) residuals_.push_back(leaf);
  }
}

/// From movers to renders.
template <class S>
void Curvature<S>::push_twists(const Plan& plan) {
  movers_.clear();
  if (collectors_.empty()) return;
  for (const std::uint32_t n : plan.forward_nodes) {
    const auto& node = tape_.nodes_[n];
    if (node.table->push == nullptr) continue;
    NodeIo<S> io = tape_.io_of(node);
    node.table->push(node.op, io, movers_);
    tape_.scratch_.reset();
  }
}

template <class S>
void Curvature<S>::collect() {
  of_movers_.setZero(kTwist * movers(), kTwist * movers());
  for (const std::uint32_t n : collectors_) {
    const auto& node = tape_.nodes_[n];
    NodeIo<S> io = tape_.io_of(node);
    node.table->collect(node.op, io, weights_, movers_, of_movers_.data());
    tape_.scratch_.reset();
  }
  // Rows of `sum` are columns here.
  of_movers_.template triangularView<Eigen::StrictlyLower>() = of_movers_.transpose();
}

/// Numbers whose weight is not 0, counted without padding.
template <class S>
std::vector<Index> Curvature<S>::weighty(const ConstArray<S>& weights) const {
  std::vector<Index> entries;
  for (Index r = 0; r < weights.total_rows(); ++r) {
    for (Index c = 0; c < weights.shape.cols; ++c) {
      if (weights.row(r)[c] > S(0)) entries.push_back(r * weights.shape.cols + c);
    }
  }
  return entries;
}

template <class S>
void Curvature<S>::leave_out(std::uint32_t id) {
  const auto& array = tape_.arrays_[id];
  const bool is_leaf = array.producer == Tape<S>::kLeaf;
  left_out_.push_back((is_leaf ? array.name : std::string(tape_.nodes_[array.producer].table->name)) + " (" +
                      source_name(is_leaf ? array.where : tape_.nodes_[array.producer].where) + ")");
}

/// Σ w r rᵀ by a backward run for each number.
template <class S>
void Curvature<S>::add_residuals(std::uint32_t array) {
  const ConstArray<S> weights = weights_.of(array);
  const std::vector<Index> entries = weighty(weights);
  if (std::ssize(entries) > kMostResiduals) return leave_out(array);
  if (entries.empty()) return;
  const Var<S> var = tape_.handle(array);
  const Index cols = weights.shape.cols;
  tape_.forward(var);
  cotangent_.assign(static_cast<std::size_t>(weights.shape.count()), S(0));
  rows_.resize(matrix_.rows(), std::ssize(entries));
  for (Index e = 0; e < std::ssize(entries); ++e) {
    const Index number = entries[static_cast<std::size_t>(e)];
    S& one = cotangent_[static_cast<std::size_t>(number)];
    one = 1;
    tape_.backward(var, std::span<const S>(cotangent_));
    one = 0;
    read_row(rows_.col(e));
    rows_.col(e) *= std::sqrt(static_cast<double>(weights.row(number / cols)[number % cols]));
  }
  matrix_.noalias() += rows_ * rows_.transpose();
}

/// Kᵀ H_movers K.
template <class S>
void Curvature<S>::add_movers() {
  if (movers() == 0) return;
  rows_.resize(matrix_.rows(), kTwist * movers());
  for (Index m = 0; m < movers(); ++m) {
    const Mover& mover = movers_[m];
    const Var<S> var = tape_.handle(mover.array);
    const Shape shape = tape_.shape(var);
    if (m == 0 || movers_[m - 1].array != mover.array) {
      tape_.forward(var);
      cotangent_.assign(static_cast<std::size_t>(shape.count()), S(0));
    }
    const auto row = cotangent_.begin() + mover.row * shape.cols;
    for (Index k = 0; k < kTwist; ++k) {
      const std::vector<double>& numbers = mover.cotangents[static_cast<std::size_t>(k)];
      std::transform(numbers.begin(), numbers.end(), row, [](double x) { return static_cast<S>(x); });
      tape_.backward(var, std::span<const S>(cotangent_));
      read_row(rows_.col(kTwist * m + k));
    }
    std::fill_n(row, shape.cols, S(0));
  }
  product_.noalias() = rows_ * of_movers_;
  matrix_.noalias() += product_ * rows_.transpose();
  product_ = matrix_.transpose();
  matrix_ = 0.5 * (matrix_ + product_);
}

/// The gradient of all leaves in the tape's last backward run.
template <class S>
void Curvature<S>::read_row(Eigen::Ref<Eigen::VectorXd> row) {
  Index at = 0;
  for (std::size_t k = 0; k < leaves_.size(); ++k) {
    const Shape& shape = tape_.shape(leaves_[k]);
    if (!tape_.has_gradient(leaves_[k])) {
      row.segment(at, shape.count()).setZero();
      at += shape.count();
      continue;
    }
    seen_[k] = 1;
    const ConstArray<S> gradient = tape_.gradient(leaves_[k]);
    for (Index r = 0; r < gradient.total_rows(); ++r) {
      for (Index c = 0; c < shape.cols; ++c) row[at++] = static_cast<double>(gradient.row(r)[c]);
    }
  }
}

template <class S>
bool Curvature<S>::sees(Var<S> leaf) const {
  for (std::size_t k = 0; k < leaves_.size(); ++k) {
    if (leaves_[k].id == leaf.id) return seen_[k] != 0;
  }
  return false;
}

template class Curvature<float>;
template class Curvature<double>;

}  // namespace hsi4d
