#include "optim/object_centres.h"

#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>
#include <utility>
#include <vector>

#include "core/check.h"

namespace hsi4d {

namespace {

/// The centres of an object's Gaussians, as nanoflann reads them.
struct Centres {
  const Gaussians& gaussians;
  std::size_t kdtree_get_point_count() const { return static_cast<std::size_t>(gaussians.count()); }
  double kdtree_get_pt(std::size_t row, std::size_t axis) const {
    return static_cast<double>(gaussians.means[3 * row + axis]);
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Centres>, Centres, 3>;

/// Trees bound distances with rounding of their own, which may leave out what is exactly as far as the nearest: what is
/// within so much more of its squared distance is looked at.
constexpr double kRounding = 1e-9;

/// The nearest centre, the first of equally near ones: trees have an order of their own.
Index first_nearest(const Tree& tree, const Vector3<double>& place, std::uint32_t nearest, double squared) {
  std::vector<std::pair<std::uint32_t, double>> found;
  tree.radiusSearch(place.data(), std::nextafter(squared * (1 + kRounding), HUGE_VAL), found, {});
  std::pair<double, std::uint32_t> first = {squared, nearest};
  for (const auto& [row, distance] : found) first = std::min(first, {distance, row});
  return static_cast<Index>(first.second);
}

}  // namespace

struct ObjectCentres::Object {
  Centres centres;
  Tree tree;
  explicit Object(const Gaussians& gaussians) : centres{gaussians}, tree(3, centres) {}
};

ObjectCentres::ObjectCentres(const std::vector<const Gaussians*>& objects) {
  for (const Gaussians* object : objects) objects_.push_back(std::make_unique<Object>(*object));
}
ObjectCentres::ObjectCentres(ObjectCentres&&) noexcept = default;
ObjectCentres& ObjectCentres::operator=(ObjectCentres&&) noexcept = default;
ObjectCentres::~ObjectCentres() = default;

std::optional<NearestGaussian> ObjectCentres::nearest(const Vector3<double>& place,
                                                      std::span<const Rigid<double>> world_from_object,
                                                      double within) const {
  HSI4D_CHECK_EQ(world_from_object.size(), objects_.size());
  std::optional<NearestGaussian> nearest;
  double least = within * within;
  for (std::size_t o = 0; o < objects_.size(); ++o) {
    const Rigid<double>& pose = world_from_object[o];
    const Vector3<double> local = pose.rotation.transpose() * (place - pose.translation);
    const Tree& tree = objects_[o]->tree;
    std::uint32_t found = 0;
    double squared = 0;
    if (tree.knnSearch(local.data(), 1, &found, &squared) == 0 || !(squared < least)) continue;
    least = squared;
    nearest = NearestGaussian{static_cast<Index>(o), first_nearest(tree, local, found, squared), std::sqrt(squared)};
  }
  return nearest;
}

}  // namespace hsi4d
