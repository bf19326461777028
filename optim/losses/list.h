// The loss terms of the library, one line each. HSI4D_LOSS(name) stands for `LossTerm name_loss()` in
// optim/losses/name.cpp; every term listed here is found by configs, by `hsi4d list losses` and by the gradient tests.
#pragma once

#include "optim/loss_term.h"

// clang-format off
#define HSI4D_LOSSES        \
  HSI4D_LOSS(photometric)       \
  HSI4D_LOSS(masked_l2)         \
  HSI4D_LOSS(center)            \
  HSI4D_LOSS(depth)             \
  HSI4D_LOSS(mask)              \
  HSI4D_LOSS(keypoints_2d)      \
  HSI4D_LOSS(bone_directions)   \
  HSI4D_LOSS(depth_map)         \
  HSI4D_LOSS(tracks)            \
  HSI4D_LOSS(fit)               \
  HSI4D_LOSS(contact)           \
  HSI4D_LOSS(annotated_contact) \
  HSI4D_LOSS(grip)              \
  HSI4D_LOSS(smooth)            \
  HSI4D_LOSS(object_smooth)     \
  HSI4D_LOSS(ground)            \
  HSI4D_LOSS(foot_sliding)      \
  HSI4D_LOSS(penetration)       \
  HSI4D_LOSS(joint_limits)      \
  HSI4D_LOSS(pose_prior)        \
  HSI4D_LOSS(unknowns_prior)    \
  HSI4D_LOSS(gaussian_opacity)  \
  HSI4D_LOSS(gaussian_scale)    \
  HSI4D_LOSS(depth_spread)      \
  HSI4D_LOSS(look)
// clang-format on

namespace hsi4d {

#define HSI4D_LOSS(name) LossTerm name##_loss();
HSI4D_LOSSES
#undef HSI4D_LOSS

}  // namespace hsi4d
