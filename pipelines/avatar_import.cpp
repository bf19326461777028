#include "pipelines/avatar_import.h"

#include <algorithm>

#include "body/surface_index.h"
#include "core/parallel.h"
#include "core/text.h"
#include "splat/sh.h"

namespace hsi4d {

namespace {

constexpr Index kGrain = 1024;
constexpr Index kWeightsKept = 4;

std::vector<SurfacePlace> nearest_places(const std::vector<float>& means, const BodyModel& body) {
  const SurfaceIndex index(body);
  std::vector<SurfacePlace> places(means.size() / 3);
  parallel_for(std::ssize(places), kGrain, [&](Index begin, Index end) {
    for (Index i = begin; i < end; ++i) {
      const Vector3<float> mean(means.data() + 3 * i);
      places[static_cast<std::size_t>(i)] = index.nearest(mean.cast<double>());
    }
  });
  return places;
}

/// Half plus the constant part, as the renderer has it; what varies with the direction is left out.
std::vector<float> colors_of(const Gaussians& gaussians) {
  const auto stride = static_cast<std::size_t>(3 * gaussians.sh_coefficients());
  std::vector<float> colors;
  for (std::size_t i = 0; i < gaussians.sh.size(); i += stride) {
    for (std::size_t c = 0; c < 3; ++c) {
      const double color = 0.5 + kShC0 * static_cast<double>(gaussians.sh[i + c]);
      colors.push_back(static_cast<float>(std::max(color, 0.0)));
    }
  }
  return colors;
}

bool varies_with_view(const Gaussians& gaussians) {
  const auto stride = static_cast<std::size_t>(3 * gaussians.sh_coefficients());
  for (std::size_t i = 0; i < gaussians.sh.size(); ++i) {
    if (i % stride >= 3 && gaussians.sh[i] != 0) return true;
  }
  return false;
}

}  // namespace

AvatarImport import_avatar(const Gaussians& gaussians, const BodyModel& body, const std::string& source) {
  check_sizes(gaussians);
  if (gaussians.count() == 0) throw DataError(source + ": holds no Gaussians");
  AvatarImport result;
  Avatar& avatar = result.avatar;
  avatar.means = gaussians.means;
  for (std::size_t i = 0; i < avatar.means.size(); ++i)
    avatar.means[i] += static_cast<float>(gaussians.origin_world[static_cast<Index>(i % 3)]);
  avatar.quats = gaussians.quats;
  avatar.log_scales = gaussians.log_scales;
  avatar.opacity_logits = gaussians.opacity_logits;
  avatar.colors = colors_of(gaussians);
  avatar.parents = body.parents;
  avatar.joints = body.joints;
  avatar.joint_names = body.joint_names;
  avatar.body = body.name;
  avatar.weights = {gaussians.count(), body.joint_count(), kWeightsKept, {}, {}};
  const std::vector<SurfacePlace> places = nearest_places(avatar.means, body);
  double sum = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    append_weights(body, places[i], avatar.weights);
    const Vector3<float> mean(avatar.means.data() + 3 * i);
    const double distance = (places[i].point - mean.cast<double>()).norm();
    sum += distance;
    result.largest_distance = std::max(result.largest_distance, distance);
    result.far += distance > kFarFromBody ? 1 : 0;
  }
  avatar.weights = normalized_weights(std::move(avatar.weights), source);
  result.mean_distance = sum / static_cast<double>(gaussians.count());
  result.lost_views = varies_with_view(gaussians);
  if (2 * result.far > gaussians.count())
    throw DataError(source + ": " + std::to_string(result.far) + " of " + std::to_string(gaussians.count()) +
                    " Gaussians are more than " + rounded(kFarFromBody, 3) + " m from the body (" +
                    rounded(result.mean_distance, 3) +
                    " m on average); they have to be in its rest pose: metres, Y up, facing +z, the pelvis near the "
                    "origin (hsi4d convert moves, turns and scales)");
  return result;
}

}  // namespace hsi4d
