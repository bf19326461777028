#include "pipelines/input/joint_fit.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "core/angles.h"
#include "core/check.h"
#include "core/text.h"

namespace hsi4d {

namespace {

constexpr int kMostSteps = 100;
constexpr double kDifference = 1e-6, kSmallestStep = 1e-12;
constexpr Index kOfFrame = 12;  // residuals: the centroid, and what is left of the turn on the object's extent

using Parameters = Eigen::Vector4d;  // of the axis across itself, of its point across it

/// The root of the centres' covariance: |R₁ x − R₂ x|² over centres x is |(R₁ − R₂) L|² on average.
Matrix3<double> extent_of(const Gaussians& object) {
  Matrix3<double> covariance = Matrix3<double>::Zero();
  for (Index i = 0; i < object.count(); ++i) {
    const Vector3<double> x = Vector3<float>(object.means.data() + 3 * i).cast<double>();
    covariance += x * x.transpose() / static_cast<double>(object.count());
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3<double>> solved(covariance);
  return solved.eigenvectors() * solved.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
}

/// Two directions across the axis.
Eigen::Matrix<double, 3, 2> across_axis(const Vector3<double>& axis) {
  Index least = 0;
  axis.cwiseAbs().minCoeff(&least);
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = axis.cross(Vector3<double>::Unit(least)).normalized();
  basis.col(1) = axis.cross(basis.col(0));
  return basis;
}

ObjectJoint moved_joint(const ObjectJoint& joint, const Parameters& by) {
  const Eigen::Matrix<double, 3, 2> basis = across_axis(joint.axis);
  ObjectJoint result = joint;
  result.axis = (joint.axis + basis * by.head<2>()).normalized();
  result.origin = joint.origin + basis * by.tail<2>();
  return result;
}

class Fit {
 public:
  Fit(std::span<const Rigid<double>> poses, const Matrix3<double>& extent) : poses_(poses), extent_(extent) {}

  /// The best q: of a hinge the largest tr(exp(q a)ᵀ G) with G from arms and turns, as joint_value has it of turns
  /// alone.
  double value(const ObjectJoint& joint, std::size_t frame) const {
    if (joint.type == JointType::kSlide) return joint_value(joint, poses_[frame]);
    const Rigid<double>& pose = poses_[frame];
    const Matrix3<double> g = (pose.translation - joint.origin) * (joint.rest.translation - joint.origin).transpose() +
                              pose.rotation * extent_ * (joint.rest.rotation * extent_).transpose();
    return std::atan2(axial(g).dot(joint.axis), g.trace() - joint.axis.dot(g * joint.axis));
  }
  Eigen::VectorXd residuals(const ObjectJoint& joint) const {
    Eigen::VectorXd all(kOfFrame * std::ssize(poses_));
    for (std::size_t t = 0; t < poses_.size(); ++t) {
      const Rigid<double> on = on_joint(joint, value(joint, t));
      const Matrix3<double> turned = (on.rotation - poses_[t].rotation) * extent_;
      auto of_frame = all.segment(kOfFrame * static_cast<Index>(t), kOfFrame);
      of_frame.head<3>() = on.translation - poses_[t].translation;
      of_frame.tail<9>() = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(turned.data());
    }
    return all;
  }
  /// Damped steps until none is left.
  ObjectJoint refined(ObjectJoint joint) const {
    double damping = 1e-3;
    Eigen::VectorXd r = residuals(joint);
    for (int step = 0; step < kMostSteps && damping < 1e9; ++step) {
      Eigen::MatrixXd jacobian(r.size(), 4);
      for (int i = 0; i < 4; ++i) {
        const Parameters by = kDifference * Parameters::Unit(i);
        jacobian.col(i) = (residuals(moved_joint(joint, by)) - residuals(moved_joint(joint, -by))) / (2 * kDifference);
      }
      Eigen::Matrix4d normal = jacobian.transpose() * jacobian;
      normal.diagonal() *= 1 + damping;
      normal.diagonal().array() += 1e-12;
      const Parameters by = normal.ldlt().solve(Eigen::Vector4d(-jacobian.transpose() * r));
      const ObjectJoint next = moved_joint(joint, by);
      const Eigen::VectorXd left = residuals(next);
      if (!(left.squaredNorm() < r.squaredNorm())) {
        damping *= 10;
        continue;
      }
      joint = next;
      r = left;
      damping /= 10;
      if (by.norm() < kSmallestStep) break;
    }
    return joint;
  }

 private:
  std::span<const Rigid<double>> poses_;
  Matrix3<double> extent_;
};

/// By the frame in which the object is turned most.
void begin_hinge(std::span<const Rigid<double>> poses, ObjectJoint& joint) {
  double most = 0;
  for (const Rigid<double>& pose : poses) {
    const Matrix3<double> turn = pose.rotation * joint.rest.rotation.transpose();
    const Vector3<double> w = so3_log(turn);
    if (!(w.norm() > most)) continue;
    most = w.norm();
    joint.axis = w.normalized();
    const Matrix3<double> system = Matrix3<double>::Identity() - turn;  // of rank 2: it knows nothing along the axis
    Eigen::CompleteOrthogonalDecomposition<Matrix3<double>> decomposition;
    decomposition.setThreshold(1e-6);  // its rounding would count as a third rank
    decomposition.compute(system);
    joint.origin = decomposition.solve(Vector3<double>(pose.translation - turn * joint.rest.translation));
  }
  if (most < kLeastTurn)
    throw UserError("the object turns by less than " + rounded(kLeastTurn / kDegree, 1) +
                    " degrees, which tells no axis");
}

void begin_slide(std::span<const Rigid<double>> poses, ObjectJoint& joint) {
  Matrix3<double> scatter = Matrix3<double>::Zero();
  double most = 0;
  for (const Rigid<double>& pose : poses) {
    const Vector3<double> way = pose.translation - joint.rest.translation;
    scatter += way * way.transpose();
    most = std::max(most, way.norm());
  }
  if (most < kLeastWay)
    throw UserError("the object moves by less than " + rounded(1000 * kLeastWay, 2) + " mm, which tells no axis");
  joint.axis = Eigen::SelfAdjointEigenSolver<Matrix3<double>>(scatter).eigenvectors().col(2);
}

}  // namespace

JointFit fit_joint(JointType type, std::span<const Rigid<double>> parent_from_object, const Gaussians& object) {
  HSI4D_CHECK(parent_from_object.size() > 1, "a joint shows in two frames at least");
  ObjectJoint joint = object_joint({.type = type, .parent = {}, .limits = {}}, {});
  joint.rest = parent_from_object.front();
  const Fit fit(parent_from_object, extent_of(object));
  if (type == JointType::kHinge) {
    begin_hinge(parent_from_object, joint);
    joint = fit.refined(joint);
    joint.origin += joint.axis * joint.axis.dot(joint.rest.translation - joint.origin);
  } else {
    begin_slide(parent_from_object, joint);
  }
  JointFit found{joint, {}, {}};
  double sum = 0;
  for (std::size_t t = 0; t < parent_from_object.size(); ++t) sum += fit.value(joint, t);
  if (sum < 0) found.joint.axis = -joint.axis;  // the object goes forwards
  const Eigen::VectorXd r = fit.residuals(found.joint);
  for (std::size_t t = 0; t < parent_from_object.size(); ++t) {
    found.values.push_back(fit.value(found.joint, t));
    found.distances.push_back(r.segment(kOfFrame * static_cast<Index>(t), kOfFrame).norm());
  }
  return found;
}

}  // namespace hsi4d
