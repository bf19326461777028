#include "optim/unit_numbers.h"

#include <algorithm>
#include <cmath>

#include "autodiff/inspect.h"
#include "core/check.h"

namespace hsi4d {

namespace {

/// The range of a group's numbers in a block.
template <class S>
std::optional<ParameterRange> range_of(const ParameterGroup<S>& group, Var<S> block) {
  const auto is_it = [block](Var<S> other) { return other.id == block.id; };
  const auto found = std::find_if(group.blocks.begin(), group.blocks.end(), is_it);
  return group.range_of(static_cast<std::size_t>(found - group.blocks.begin()));
}

/// Calls visit(number, group, block, row, column of its array) for all numbers, in order.
template <class S, class F>
void for_numbers(const std::vector<OptimizerGroup<S>>& groups, const F& visit) {
  Index i = 0;
  for (const OptimizerGroup<S>& group : groups) {
    for (const Var<S> block : group.parameters.blocks) {
      const Shape& shape = block.shape();
      for (Index r = 0; r < shape.planes * shape.rows; ++r) {
        for (Index c = 0; c < shape.cols; ++c) visit(i++, group, block, r, c);
      }
    }
  }
}

}  // namespace

template <class S>
UnitNumbers<S>::UnitNumbers(Tape<S>& tape, std::vector<OptimizerGroup<S>> groups, const std::string& method,
                            bool ranges)
    : tape_(tape), groups_(std::move(groups)) {
  Index count = 0;
  for (const OptimizerGroup<S>& group : groups_) {
    reports_.push_back({group.parameters.name});
    if (group.parameters.are_axis_angles || (group.parameters.has_range() && !ranges)) {
      throw UserError("group \"" + group.parameters.name + "\": " + method + " does not move " +
                      (ranges ? "" : "numbers that are held in a range, or ") +
                      "rotations as axis and angle; "
                      "allowed: rotations \"6d\", or the optimizer adam");
    }
    for (const Var<S> block : group.parameters.blocks) count += tape.shape(block).count();
  }
  if (count > kMostUnitNumbers) {
    throw UserError(method + " keeps a matrix of all pairs of the numbers that move: " + std::to_string(count) +
                    " numbers, at most " + std::to_string(kMostUnitNumbers) + " are allowed");
  }
  unit_.setZero(count);
  start_.setZero(count);
  low_.setZero(count);
  high_.setZero(count);
  for_numbers(groups_, [&](Index i, const OptimizerGroup<S>& group, Var<S> block, Index r, Index c) {
    unit_[i] = group.settings.lr;
    if (!(unit_[i] > 0)) return;
    start_[i] = static_cast<double>(tape_.value(block).row(r)[c]) / unit_[i];
    const std::optional<ParameterRange> range = range_of(group.parameters, block);
    low_[i] = std::max(start_[i] - kLongestUnitWay, range ? range->low / unit_[i] : -HUGE_VAL);
    high_[i] = std::min(start_[i] + kLongestUnitWay, range ? range->high / unit_[i] : HUGE_VAL);
  });
}

template <class S>
std::vector<Var<S>> UnitNumbers<S>::blocks() const {
  std::vector<Var<S>> all;
  for (const OptimizerGroup<S>& group : groups_)
    all.insert(all.end(), group.parameters.blocks.begin(), group.parameters.blocks.end());
  return all;
}

template <class S>
void UnitNumbers<S>::read_shares(Index iteration, Index iterations, VectorX& shares) const {
  for_numbers(groups_, [&](Index i, const OptimizerGroup<S>& group, Var<S>, Index, Index) {
    const ParameterGroupSettings& moving = group.settings;
    shares[i] =
        moving.lr > 0 && moves_in(moving, iteration) ? scheduled_rate(moving, iteration, iterations) / moving.lr : 0.0;
  });
}

template <class S>
std::optional<BadNumber> UnitNumbers<S>::read_gradient(double loss, VectorX& gradient) {
  std::optional<BadNumber> bad;
  if (!std::isfinite(loss)) bad.emplace().value = loss;
  for (std::size_t g = 0; g < groups_.size(); ++g)
    reports_[g] = {groups_[g].parameters.name, false, groups_[g].settings.lr, 0};
  for_numbers(groups_, [&](Index i, const OptimizerGroup<S>& group, Var<S> block, Index r, Index c) {
    gradient[i] = 0;
    if (!tape_.has_gradient(block)) return;
    const double value = static_cast<double>(tape_.gradient(block).row(r)[c]);
    gradient[i] = value * unit_[i];
    GroupStep& report = reports_[static_cast<std::size_t>(&group - groups_.data())];
    report.moved = true;
    report.gradient_norm = std::hypot(report.gradient_norm, value);
    if (bad || std::fabs(value) <= kLargestGradient) return;
    const Index rows = block.shape().rows;
    bad = BadNumber{group.parameters.name, TapeInspector<S>(tape_).array_name(block.id), r / rows, r % rows, c, value};
  });
  for (GroupStep& report : reports_) report.moved = report.moved && !bad;
  return bad;
}

template <class S>
void UnitNumbers<S>::write(VectorX& z) {
  std::uint32_t written = 0;
  Array<S> numbers;
  for_numbers(groups_, [&](Index i, const OptimizerGroup<S>&, Var<S> block, Index r, Index c) {
    if (!(unit_[i] > 0)) return;  // a rate of 0: it stays
    if (!numbers || written != block.id) numbers = tape_.write(block);
    written = block.id;
    const auto value = static_cast<S>(z[i] * unit_[i]);
    numbers.row(r)[c] = value;
    z[i] = static_cast<double>(value) / unit_[i];
  });
}

template <class S>
double UnitNumbers<S>::share_within(const VectorX& point, const VectorX& step) const {
  const double inside = kLongestUnitWay * (1 - 1e-6);  // numbers are rounded when they are written
  double share = 1;
  for (Index i = 0; i < step.size(); ++i) {
    if (step[i] == 0) continue;
    const double left = std::copysign(inside, step[i]) - (point[i] - start_[i]);
    share = std::min(share, std::max(0.0, left / step[i]));
  }
  return share;
}

template class UnitNumbers<float>;
template class UnitNumbers<double>;

void update_inverse_hessian(Eigen::MatrixXd& inverse_hessian, const Eigen::VectorXd& s, const Eigen::VectorXd& y,
                            double curvature, Eigen::VectorXd& product) {
  const Index n = s.size();
  auto h = inverse_hessian.selfadjointView<Eigen::Lower>();
  product.noalias() = h * y;
  h.rankUpdate(s, (curvature + y.dot(product)) / (curvature * curvature));
  for (Index j = 0; j < n; ++j) {  // − (H y sᵀ + s yᵀ H) / sᵀy; rankUpdate of two vectors would allocate
    inverse_hessian.col(j).tail(n - j) -=
        product[j] / curvature * s.tail(n - j) + s[j] / curvature * product.tail(n - j);
  }
}

std::vector<double> whole_of(const Eigen::MatrixXd& inverse_hessian) {
  Eigen::MatrixXd whole = inverse_hessian.selfadjointView<Eigen::Lower>();
  whole /= whole.diagonal().maxCoeff();
  return {whole.data(), whole.data() + whole.size()};
}

}  // namespace hsi4d
