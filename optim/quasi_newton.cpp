#include "optim/quasi_newton.h"

#include <algorithm>
#include <cmath>

#include "autodiff/inspect.h"
#include "core/check.h"

namespace hsi4d {

namespace {

constexpr double kArmijo = 1e-4;
constexpr double kShortest = 0.1, kLongest = 0.5;  // of the length before, where a step was too long
constexpr double kSmallestStep = 0.02;             // of the learning rates
constexpr Index kSmallSteps = 2;  // in a row: after a long step H tells too little of the numbers that it hardly moved
constexpr double kLeastCurvature = 1e-10;  // of |s| |y|

/// Calls visit(number, column of its array) for all numbers, in order; the index runs over all groups.
template <class S, class F>
void for_numbers(const std::vector<AdamGroup<S>>& groups, const F& visit) {
  Index i = 0;
  for (const AdamGroup<S>& group : groups) {
    for (const Var<S> block : group.parameters.blocks) {
      const Shape& shape = block.shape();
      for (Index r = 0; r < shape.planes * shape.rows; ++r) {
        for (Index c = 0; c < shape.cols; ++c) visit(i++, group, block, r, c);
      }
    }
  }
}

}  // namespace

double longest_quasi_newton_way(const ParameterGroupSettings& settings, Index iterations) {
  return settings.lr * std::min(kLongestQuasiNewtonWay, kLongestQuasiNewtonStep * static_cast<double>(iterations));
}

template <class S>
QuasiNewton<S>::QuasiNewton(Tape<S>& tape, std::vector<AdamGroup<S>> groups) : tape_(tape), groups_(std::move(groups)) {
  Index count = 0;
  for (const AdamGroup<S>& group : groups_) {
    reports_.push_back({group.parameters.name});
    if (group.parameters.are_axis_angles || group.parameters.range) {
      throw UserError("group \"" + group.parameters.name +
                      "\": bfgs does not move numbers that are held in a range, or rotations as axis and angle; "
                      "allowed: rotations \"6d\", or the optimizer adam");
    }
    for (const Var<S> block : group.parameters.blocks) count += tape.shape(block).count();
  }
  if (count > kMostQuasiNewtonNumbers) {
    throw UserError("bfgs keeps a matrix of all pairs of the numbers that move: " + std::to_string(count) +
                    " numbers, at most " + std::to_string(kMostQuasiNewtonNumbers) + " are allowed");
  }
  unit_.resize(count);
  for (VectorX* numbers : {&trial_, &trial_gradient_, &point_, &gradient_, &direction_, &moved_, &change_, &product_})
    numbers->setZero(count);
  for_numbers(groups_, [&](Index i, const AdamGroup<S>& group, Var<S> block, Index r, Index c) {
    unit_[i] = group.settings.lr;
    trial_[i] = unit_[i] > 0 ? static_cast<double>(tape_.value(block).row(r)[c]) / unit_[i] : 0;
  });
  start_ = trial_;
  first_ = Eigen::MatrixXd::Identity(count, count);
}

template <class S>
void QuasiNewton<S>::set_curvature(const std::vector<double>& inverse_hessian) {
  const Index n = unit_.size();
  HSI4D_CHECK(steps_ == 0, "a curvature that comes after the first step");
  if (std::ssize(inverse_hessian) == n * n) first_ = Eigen::Map<const Eigen::MatrixXd>(inverse_hessian.data(), n, n);
}

template <class S>
std::vector<double> QuasiNewton<S>::curvature() const {
  if (!is_learnt_) return {};
  Eigen::MatrixXd whole = inverse_hessian_.template selfadjointView<Eigen::Lower>();
  whole /= whole.diagonal().maxCoeff();
  return {whole.data(), whole.data() + whole.size()};
}

template <class S>
StepReport QuasiNewton<S>::step(Index iteration, Index iterations, double loss) {
  StepReport report;
  report.bad = read_gradient(loss);
  report.rolled_back = report.bad.has_value();
  if (report.rolled_back) ++rollbacks_;
  if (!report.rolled_back && (steps_ == 0 || loss <= loss_ + kArmijo * length_ * slope_)) {
    accept(loss);
    choose_direction();
  } else if (steps_ > 0) {
    shorten(report.rolled_back ? HUGE_VAL : loss);
  }
  if (steps_ > 0) {
    if (iteration + 1 >= iterations) done_ = true;
    trial_ = point_;
    if (!done_) trial_ += length_ * direction_;
    write_trial();
  }
  for (GroupStep& group : reports_) group.moved = group.moved && !report.rolled_back;
  report.rollbacks = rollbacks_;
  report.groups = reports_;
  return report;
}

template <class S>
std::optional<BadNumber> QuasiNewton<S>::read_gradient(double loss) {
  std::optional<BadNumber> bad;
  if (!std::isfinite(loss)) bad.emplace().value = loss;
  for (std::size_t g = 0; g < groups_.size(); ++g)
    reports_[g] = {groups_[g].parameters.name, false, groups_[g].settings.lr, 0};
  for_numbers(groups_, [&](Index i, const AdamGroup<S>& group, Var<S> block, Index r, Index c) {
    trial_gradient_[i] = 0;
    if (!tape_.has_gradient(block)) return;
    const double value = static_cast<double>(tape_.gradient(block).row(r)[c]);
    trial_gradient_[i] = value * unit_[i];
    GroupStep& report = reports_[static_cast<std::size_t>(&group - groups_.data())];
    report.moved = true;
    report.gradient_norm = std::hypot(report.gradient_norm, value);
    if (bad || std::fabs(value) <= kLargestGradient) return;
    const Index rows = block.shape().rows;
    bad = BadNumber{group.parameters.name, TapeInspector<S>(tape_).array_name(block.id), r / rows, r % rows, c, value};
  });
  return bad;
}

/// The trial becomes the point from which the next step goes.
template <class S>
void QuasiNewton<S>::accept(double loss) {
  if (steps_ > 0) {
    moved_ = trial_ - point_;
    change_ = trial_gradient_ - gradient_;
    const double curvature = moved_.dot(change_);
    if (curvature > kLeastCurvature * moved_.norm() * change_.norm()) {
      const Index n = moved_.size();
      if (!is_learnt_) scale_first(change_, curvature);
      is_learnt_ = true;
      auto h = inverse_hessian_.selfadjointView<Eigen::Lower>();
      product_.noalias() = h * change_;
      h.rankUpdate(moved_, (curvature + change_.dot(product_)) / (curvature * curvature));
      for (Index j = 0; j < n; ++j) {  // − (H y sᵀ + s yᵀ H) / sᵀy; rankUpdate of two vectors would allocate
        inverse_hessian_.col(j).tail(n - j) -=
            product_[j] / curvature * moved_.tail(n - j) + moved_[j] / curvature * product_.tail(n - j);
      }
    }
  }
  point_ = trial_;
  gradient_ = trial_gradient_;
  loss_ = loss;
  ++steps_;
}

/// H becomes the first one, scaled so that yᵀ H y is `curvature`.
template <class S>
void QuasiNewton<S>::scale_first(const VectorX& y, double curvature) {
  product_.noalias() = first_ * y;
  inverse_hessian_ = first_ * (curvature / y.dot(product_));
}

template <class S>
void QuasiNewton<S>::choose_direction() {
  const double steepest = gradient_.cwiseAbs().maxCoeff();
  const Index n = gradient_.size();
  if (steps_ == 1 && steepest > 0) {
    product_.noalias() = first_ * gradient_;
    inverse_hessian_ = first_ / product_.cwiseAbs().maxCoeff();
  }
  direction_.setZero();
  if (steepest > 0) direction_.noalias() -= inverse_hessian_.selfadjointView<Eigen::Lower>() * gradient_;
  slope_ = direction_.dot(gradient_);
  if (!(slope_ < 0) && steepest > 0) {  // rounding has spoilt the matrix
    inverse_hessian_ = Eigen::MatrixXd::Identity(n, n) / steepest;
    direction_ = -gradient_ / steepest;
    slope_ = direction_.dot(gradient_);
  }
  length_ = 1;
  const double longest = direction_.cwiseAbs().maxCoeff();
  if (longest > kLongestQuasiNewtonStep) {
    direction_ *= kLongestQuasiNewtonStep / longest;
    slope_ *= kLongestQuasiNewtonStep / longest;
  }
  small_steps_ = longest >= kSmallestStep ? 0 : small_steps_ + 1;
  stay_within_reach();
  done_ = small_steps_ >= kSmallSteps || !(direction_.cwiseAbs().maxCoeff() > 0);
}

/// Shortens the direction to where the first number has gone as far as it may.
template <class S>
void QuasiNewton<S>::stay_within_reach() {
  constexpr double kWay = kLongestQuasiNewtonWay * (1 - 1e-6);  // numbers are rounded when they are written
  double share = 1;
  for (Index i = 0; i < direction_.size(); ++i) {
    if (direction_[i] == 0) continue;
    const double left = std::copysign(kWay, direction_[i]) - (point_[i] - start_[i]);
    share = std::min(share, std::max(0.0, left / direction_[i]));
  }
  direction_ *= share;
  slope_ *= share;
}

/// Nearer to the point: where the parabola through its loss and slope and the trial's loss is least.
template <class S>
void QuasiNewton<S>::shorten(double loss) {
  const double least = -slope_ * length_ / (2 * (loss - loss_ - slope_ * length_));
  length_ *= std::isfinite(loss) ? std::clamp(least, kShortest, kLongest) : kShortest;
  done_ = !(length_ * direction_.cwiseAbs().maxCoeff() >= kSmallestStep);
}

template <class S>
void QuasiNewton<S>::write_trial() {
  std::uint32_t written = 0;
  Array<S> numbers;
  for_numbers(groups_, [&](Index i, const AdamGroup<S>&, Var<S> block, Index r, Index c) {
    if (!(unit_[i] > 0)) return;  // a rate of 0: it stays
    if (!numbers || written != block.id) numbers = tape_.write(block);
    written = block.id;
    const auto value = static_cast<S>(trial_[i] * unit_[i]);
    numbers.row(r)[c] = value;
    trial_[i] = static_cast<double>(value) / unit_[i];  // as it was rounded
  });
}

template class QuasiNewton<float>;
template class QuasiNewton<double>;

}  // namespace hsi4d
