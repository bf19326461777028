#include "body/avatar_directions.h"

#include "body/surface_index.h"
#include "core/check.h"

namespace hsi4d {

namespace {

/// numbers += directions betas.
template <class T>
void add_directions_to(std::vector<T>& numbers, std::span<const double> directions, std::span<const double> betas) {
  HSI4D_CHECK_EQ(directions.size(), numbers.size() * betas.size());
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    double sum = static_cast<double>(numbers[i]);
    for (std::size_t b = 0; b < betas.size(); ++b) sum += directions[i * betas.size() + b] * betas[b];
    numbers[i] = static_cast<T>(sum);
  }
}

}  // namespace

AvatarDirections avatar_directions(const Avatar& avatar, const SmplxModel& body, std::span<const double> betas) {
  HSI4D_CHECK_EQ(body.joint_count(), avatar.joint_count());
  const BodyModel rest = rest_body(body, betas);
  const SurfaceIndex surface(rest);
  const auto width = static_cast<std::size_t>(body.betas);
  AvatarDirections shape{body.betas, std::vector<double>(avatar.means.size() * width), body.joint_shape};
  for (Index n = 0; n < avatar.count(); ++n) {
    const SurfacePlace place = surface.nearest(Vector3<float>(avatar.means.data() + 3 * n).cast<double>());
    double* const rows = shape.means.data() + 3 * static_cast<std::size_t>(n) * width;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const auto vertex = static_cast<std::size_t>(rest.faces[3 * static_cast<std::size_t>(place.face) + corner]);
      const double* const directions = body.shape.data() + 3 * vertex * width;
      for (std::size_t i = 0; i < 3 * width; ++i) rows[i] += place.shares[corner] * directions[i];
    }
  }
  return shape;
}

void add_betas(const AvatarDirections& shape, std::span<const double> betas, Avatar& avatar) {
  HSI4D_CHECK_EQ(std::ssize(betas), shape.betas);
  add_directions_to(avatar.means, shape.means, betas);
  add_directions_to(avatar.joints, shape.joints, betas);
}

}  // namespace hsi4d
