#include "pipelines/metrics/sigma_metrics.h"

#include <cmath>

#include "core/check.h"
#include "optim/metrics.h"

namespace hsi4d {

namespace {

/// Of joints, or of objects.
struct Sums {
  double places = 0, unsure = 0, across = 0, along = 0;
  double within_across = 0, within_along = 0;  // of errors that are known

  double sure() const { return places - unsure; }
};

/// @param errors  in the axes of the camera, metres; empty: not known
Sums sums_of(const std::vector<PlaceSigma>& sigmas, const std::vector<Vector3<double>>& errors) {
  Sums sums;
  for (std::size_t i = 0; i < sigmas.size(); ++i) {
    const PlaceSigma& sigma = sigmas[i];
    if (std::isnan(sigma.along)) continue;
    sums.places += 1;
    if (!(sigma.across < kUnsure && sigma.along < kUnsure)) {
      sums.unsure += 1;
      continue;
    }
    sums.across += sigma.across;
    sums.along += sigma.along;
    if (errors.empty()) continue;
    for (Index axis = 0; axis < 2; ++axis) sums.within_across += std::abs(errors[i][axis]) <= sigma.across ? 0.5 : 0;
    sums.within_along += std::abs(errors[i][2]) <= sigma.along ? 1 : 0;
  }
  return sums;
}

/// @param prefix, unit  of names
/// @param factor        from metres to the unit
void add_values(const std::string& prefix, const std::string& unit, double factor, const Sums& sums, bool has_truth,
                MetricValues& values) {
  if (sums.sure() == 0) return;
  values.emplace_back(prefix + "sigma_image_" + unit, factor * sums.across / sums.sure());
  values.emplace_back(prefix + "sigma_depth_" + unit, factor * sums.along / sums.sure());
  if (!has_truth) return;
  values.emplace_back(prefix + "within_sigma_image", sums.within_across / sums.sure());
  values.emplace_back(prefix + "within_sigma_depth", sums.within_along / sums.sure());
}

}  // namespace

MetricValues sigma_values(const PlaceSigmas& sigmas, const FrameState& estimate, const FrameState* truth) {
  std::vector<Vector3<double>> of_joints, of_objects;
  if (truth != nullptr && truth->camera_from_world) {
    const Matrix3<double>& axes = truth->camera_from_world->rotation;
    HSI4D_CHECK(estimate.joints.size() == truth->joints.size() && truth->joints.size() >= 3 * sigmas.joints.size(),
                "sigmas of more joints than there are");
    HSI4D_CHECK_EQ(truth->world_from_object.size(), sigmas.objects.size());
    for (std::size_t j = 0; j < sigmas.joints.size(); ++j)
      of_joints.push_back(
          axes * (Vector3<double>(estimate.joints.data() + 3 * j) - Vector3<double>(truth->joints.data() + 3 * j)));
    for (std::size_t o = 0; o < sigmas.objects.size(); ++o)
      of_objects.push_back(axes *
                           (estimate.world_from_object[o].translation - truth->world_from_object[o].translation));
  }
  const bool has_truth = !of_joints.empty();
  const Sums joints = sums_of(sigmas.joints, of_joints), objects = sums_of(sigmas.objects, of_objects);
  MetricValues values;
  add_values("", "mm", kMillimetres, joints, has_truth, values);
  add_values("object_", "cm", kCentimetres, objects, has_truth, values);
  const double unsure = joints.unsure + objects.unsure;
  if (unsure > 0) values.emplace_back("unsure_share", unsure / (joints.places + objects.places));
  return values;
}

}  // namespace hsi4d
