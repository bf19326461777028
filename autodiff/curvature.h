// The curvature of a loss by the numbers of some leaves: a Gauss-Newton matrix, from pixels to pose.
//
//   H = Σ_e w_e r_e r_eᵀ,   r_e = ∂x_e/∂θ,   w_e = ∂²loss/∂x_e²   with what lies between θ and x_e taken as linear
//
// x_e are the numbers that the loss's terms compare: pixels, latents, places of joints. Of pixels, r_e is never formed.
// A render moves with *movers*: bones, rigid objects, the camera, each with a twist of six numbers (velocity of a point
// near by, angular velocity), and
//
//   H = Kᵀ (Σ_pixels w a aᵀ) K + the rest,   a = ∂pixel/∂twists,   K = ∂twists/∂θ
//
// where the sum in the middle is made in one pass over the Gaussians of each pixel (splat/render/composite_curvature.h)
// and K by a backward run for each number of each twist. How covariances, colours and opacities follow the pose is left
// out of a: H is that of moving the Gaussians' centres.
//
// Three members of an operator take part, each optional:
//
//   bool weigh(NodeIo&, CurvatureWeights&)  w of its inputs: from the gradient of its output (a sum of squares or of
//                                           absolute values), or from w of its output, times its own derivative
//                                           squared. False where it has none to give: its output is an x.
//   void push(NodeIo&, Movers&)             how rows of its output follow movers, from how its inputs do; or, where its
//                                           input is a transform, the movers themselves.
//   void collect(NodeIo&, const CurvatureWeights&, const Movers&, double* sum)
//                                           Σ w a aᵀ from w of its outputs and from how its inputs move, added to `sum`
//                                           [6 movers, 6 movers], whose blocks below the diagonal and on it count.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "autodiff/curvature_weights.h"
#include "autodiff/twists.h"

namespace hsi4d {

/// Seconds of the steps of one curvature.
struct CurvatureTimes {
  double weights = 0;    ///< from the loss to pixels
  double twists = 0;     ///< from movers to renders
  double renders = 0;    ///< Σ w a aᵀ over pixels
  double residuals = 0;  ///< of all that is no pixel
  double movers = 0;     ///< K, and the product with it

  double sum() const { return weights + twists + renders + residuals + movers; }
};

/// The curvature of one loss. A term whose operators have no `weigh`, and a sum over lambdas of which several operands
/// move, have no part in it: they are followed by their gradient alone. Computed in an order that does not depend on
/// the number of threads.
template <class S>
class Curvature {
 public:
  /// What the loss compares in more numbers than this, and is no pixel of a render, has no part in H.
  static constexpr Index kMostResiduals = 4096;

  /// @param loss    a scalar on the tape
  /// @param leaves  their numbers are the rows and columns of H, in order, row-major without padding
  /// @param rule    its turn goes on by one with every matrix
  Curvature(Tape<S>& tape, Var<S> loss, std::vector<Var<S>> leaves, const CurvatureRule& rule = {});
  Curvature(const Curvature&) = delete;
  Curvature& operator=(const Curvature&) = delete;

  /// H at the tape's last forward and backward run of the loss, [n,n], symmetric, positive semi-definite to rounding.
  /// Rows of what is frozen are 0. Afterwards the tape holds no gradients of the loss.
  ///
  /// Throws StaleError where the last backward run was not the loss's, InternalError naming the operator where a render
  /// moves by something that cannot tell how.
  const Eigen::MatrixXd& compute();

  /// Whether a number of this leaf has a part in the last H.
  bool sees(Var<S> leaf) const;
  /// Operators whose outputs had no part in the last H, "name (file.cpp:12)".
  const std::vector<std::string>& left_out() const { return left_out_; }
  /// Of the last H.
  Index movers() const { return movers_.count(); }
  const CurvatureTimes& times() const { return times_; }

 private:
  using Plan = typename Tape<S>::Plan;

  void pass_weights(const Plan& plan);
  void push_twists(const Plan& plan);
  void collect();
  void add_residuals(std::uint32_t array);
  void add_movers();
  void leave_out(std::uint32_t array);
  std::vector<Index> weighty(const ConstArray<S>& weights) const;
  void read_row(Eigen::Ref<Eigen::VectorXd> row);

  Tape<S>& tape_;
  Var<S> loss_;
  std::vector<Var<S>> leaves_;
  std::vector<std::uint8_t> seen_;  // by leaf
  CurvatureWeights<S> weights_;
  Movers<S> movers_;
  std::vector<std::uint32_t> residuals_, collectors_;  // arrays; nodes
  std::vector<std::string> left_out_;
  Eigen::MatrixXd of_movers_, rows_, product_, matrix_;
  CurvatureTimes times_;
  std::vector<S> cotangent_;
};

extern template class Curvature<float>;
extern template class Curvature<double>;

}  // namespace hsi4d
