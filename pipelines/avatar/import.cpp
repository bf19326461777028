#include "pipelines/avatar/import.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "body/surface_index.h"
#include "core/parallel.h"
#include "core/text.h"
#include "splat/render/sh.h"

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

using Cell = std::array<int, 3>;

template <class Numbers>
Cell cell_of(const Numbers& p) {
  Cell cell;
  for (std::size_t i = 0; i < 3; ++i)
    cell[i] = static_cast<int>(std::floor(static_cast<double>(p[static_cast<Index>(i)]) / kCoverCell));
  return cell;
}

/// The cells of the means, and those beside them, in order.
std::vector<Cell> cells_near(const std::vector<float>& means) {
  constexpr float kFarthest = 100;  // metres
  std::vector<Cell> cells;
  for (std::size_t i = 0; i < means.size(); i += 3) {
    const Vector3<float> mean(means.data() + i);
    if (mean.cwiseAbs().maxCoeff() < kFarthest) cells.push_back(cell_of(mean));
  }
  const auto sort = [](std::vector<Cell>& some) {
    std::sort(some.begin(), some.end());
    some.erase(std::unique(some.begin(), some.end()), some.end());
  };
  sort(cells);
  std::vector<Cell> near;
  for (const Cell& cell : cells) {
    for (int k = 0; k < 27; ++k) near.push_back({cell[0] + k % 3 - 1, cell[1] + k / 3 % 3 - 1, cell[2] + k / 9 - 1});
  }
  sort(near);
  return near;
}

}  // namespace

double covered_share(const std::vector<float>& means, const BodyModel& body) {
  const std::vector<Cell> near = cells_near(means);
  double covered = 0, all = 0;
  for (std::int32_t face = 0; face < body.face_count(); ++face) {
    const auto corners = face_corners(body, face);
    const Vector3<double> edge = corners[1] - corners[0], other = corners[2] - corners[0];
    const double area = Vector3<double>(cross(edge, other)).norm() / 2;
    const Vector3<double> middle = (corners[0] + corners[1] + corners[2]) / 3;
    all += area;
    if (std::binary_search(near.begin(), near.end(), cell_of(middle))) covered += area;
  }
  return all > 0 ? covered / all : 0;
}

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
  result.covered = covered_share(avatar.means, body);
  if (result.covered < kLeastCovered)
    throw DataError(source + ": is no avatar: only " + rounded(100 * result.covered, 2) +
                    " % of the body has Gaussians near it; allowed: " + rounded(100 * kLeastCovered, 2) +
                    " % or more, in its rest pose: metres, Y up, facing +z, arms to the sides, the pelvis near the "
                    "origin (hsi4d convert moves, turns and scales)");
  return result;
}

}  // namespace hsi4d
