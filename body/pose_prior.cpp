#include "body/pose_prior.h"

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "autodiff/rotations.h"
#include "body/natural_pose.h"

namespace hsi4d {

template <class S>
const Vposer<S>& PosePrior::network() const {
  if constexpr (std::is_same_v<S, float>) {
    return networks_->single;
  } else {
    return networks_->full;
  }
}

template <class S>
Var<S> PosePrior::decode(Var<S> latents, Source where) const {
  HSI4D_CHECK_EQ(latents.shape(), shape_of(latents.shape().rows, latents_));
  return networks_ == nullptr ? natural_decode(latents, where) : vposer_decode(network<S>(), latents, where);
}

template <class S>
Var<S> PosePrior::encode(Var<S> rotations, Source where) const {
  const Index frames = rotations.shape().rows / kBodyPoseJoints;
  HSI4D_CHECK_EQ(rotations.shape(), shape_of(kBodyPoseJoints * frames, 9));
  if (networks_ == nullptr) return natural_encode(rotations, where);
  return vposer_encode(network<S>(), axis_angle_from_rotations(rotations, where), where);
}

std::vector<double> PosePrior::encode(std::span<const double> axis_angle) const {
  const Index rows = static_cast<Index>(axis_angle.size() / 3);
  HSI4D_CHECK_EQ(axis_angle.size() % static_cast<std::size_t>(3 * kBodyPoseJoints), std::size_t{0});
  if (rows == 0) return {};
  Tape<double> tape;
  const Var<double> pose = tape.constant("pose", shape_of(rows, 3));
  tape.set(pose, axis_angle);
  const Var<double> latents = encode(rotations_from_axis_angle(pose));
  tape.forward(latents);
  const ConstArray<double> value = tape.value(latents);
  return {value.data, value.data + value.shape.count()};
}

template <class S>
Var<S> PosePrior::energy(Var<S> latents, Source where) const {
  const Index frames = latents.shape().rows;
  HSI4D_CHECK_EQ(latents.shape(), shape_of(frames, latents_));
  return sum(square(latents, where), where) * Operand<S>(1.0 / static_cast<double>(frames), where);
}

PosePrior natural_pose_prior() {
  PosePrior prior;
  prior.name_ = "natural";
  prior.latents_ = 3 * kBodyPoseJoints;
  return prior;
}

PosePrior vposer_prior(const VposerWeights& weights) {
  PosePrior prior;
  prior.name_ = "vposer";
  prior.latents_ = weights.latents;
  prior.networks_ =
      std::make_shared<const PosePrior::Networks>(PosePrior::Networks{Vposer<float>(weights), Vposer<double>(weights)});
  return prior;
}

PosePrior read_pose_prior(const std::string& path) {
  return path.empty() ? natural_pose_prior() : vposer_prior(read_vposer(path));
}

template <class S>
Var<S> joint_limit_energy(Var<S> rotations, Source where) {
  const double frames = static_cast<double>(rotations.shape().rows) / static_cast<double>(kBodyPoseJoints);
  return sum(joint_limit_excess(rotations, where), where) * Operand<S>(1 / frames, where);
}

#define HSI4D_INSTANTIATE(S)                               \
  template Var<S> PosePrior::decode(Var<S>, Source) const; \
  template Var<S> PosePrior::encode(Var<S>, Source) const; \
  template Var<S> PosePrior::energy(Var<S>, Source) const; \
  template Var<S> joint_limit_energy(Var<S>, Source);
HSI4D_INSTANTIATE(float)
HSI4D_INSTANTIATE(double)
#undef HSI4D_INSTANTIATE

}  // namespace hsi4d
