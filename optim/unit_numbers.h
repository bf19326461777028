// The numbers that a stage moves, as one vector in units of their learning rates: what methods of second order work on.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "optim/adam.h"

namespace hsi4d {

/// The most numbers that a stage may move by a method that keeps a matrix of all pairs of them.
inline constexpr Index kMostUnitNumbers = 1024;

/// No number gets further from its start in a stage than this many times its group's learning rate: what of a scene a
/// camera may come to see is known from it before the stage begins.
inline constexpr double kLongestUnitWay = 40;

/// z = x / lr of all numbers of some groups, in order. A number with a learning rate of 0 stays, and is 0 here.
template <class S>
class UnitNumbers {
 public:
  using VectorX = Eigen::VectorXd;

  /// @param groups  leaves of `tape`, none of them twice
  /// @param method  what messages call it
  /// @param ranges  whether the method keeps to low() and high(), and so to ranges of groups
  /// Throws UserError for more than kMostUnitNumbers numbers, and for groups whose numbers are changed between steps
  /// (axis-angles, ranges).
  UnitNumbers(Tape<S>& tape, std::vector<OptimizerGroup<S>> groups, const std::string& method, bool ranges = false);
  UnitNumbers(const UnitNumbers&) = delete;
  UnitNumbers& operator=(const UnitNumbers&) = delete;

  Index count() const { return unit_.size(); }
  /// z when this was made.
  const VectorX& start() const { return start_; }
  /// The least and the largest z: of the groups' ranges, and kLongestUnitWay from the start.
  const VectorX& low() const { return low_; }
  const VectorX& high() const { return high_; }
  /// lr of each number.
  const VectorX& unit() const { return unit_; }
  /// All arrays, in order.
  std::vector<Var<S>> blocks() const;
  /// Learning rate of each number in an iteration, of that of the settings; 0 where its group is off.
  void read_shares(Index iteration, Index iterations, VectorX& shares) const;

  /// The gradient by z of the tape's last backward; 0 where there is none. Returns the first number that is not finite,
  /// the loss among them.
  std::optional<BadNumber> read_gradient(double loss, VectorX& gradient);

  /// Moves the numbers to z, which is then as it was rounded.
  void write(VectorX& z);

  /// The share of a step from `point` that may be taken until the first number is as far from its start as
  /// kLongestUnitWay.
  double share_within(const VectorX& point, const VectorX& step) const;

  /// What the last read_gradient met, by group; `moved`: it has a gradient, and no number was bad.
  std::span<const GroupStep> reports() const { return reports_; }

 private:
  Tape<S>& tape_;
  std::vector<OptimizerGroup<S>> groups_;
  std::vector<GroupStep> reports_;
  VectorX unit_, start_, low_, high_;
};

extern template class UnitNumbers<float>;
extern template class UnitNumbers<double>;

/// H ≈ the inverse of a matrix A that is known by products y = A s, as BFGS has it:
///
///   H ← (I − s yᵀ/sᵀy) H (I − y sᵀ/sᵀy) + s sᵀ/sᵀy        [Nocedal and Wright 2006, (6.17)]
///
/// @param inverse_hessian  its lower half
/// @param curvature        sᵀy > 0
/// @param product          H y, on return
void update_inverse_hessian(Eigen::MatrixXd& inverse_hessian, const Eigen::VectorXd& s, const Eigen::VectorXd& y,
                            double curvature, Eigen::VectorXd& product);

/// All of H, of which the lower half is given, the largest number of its diagonal 1.
std::vector<double> whole_of(const Eigen::MatrixXd& inverse_hessian);

}  // namespace hsi4d
