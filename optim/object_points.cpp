#include "optim/object_points.h"

#include <algorithm>
#include <array>
#include <limits>

#include "core/check.h"
#include "optim/metrics.h"
#include "optim/object_centres.h"

namespace hsi4d {

namespace {}

struct ObjectPoints::Object {
  std::vector<Vector3<double>> points;  // object's frame
  ObjectCentres centres;

  explicit Object(const Gaussians& gaussians) : centres({&gaussians}) {
    const Index rows = gaussians.count(), count = std::min(kMeasuredObjectPoints, rows);
    for (Index i = 0; i < count; ++i)
      points.push_back(Vector3<float>(gaussians.means.data() + 3 * (i * rows / count)).cast<double>());
  }
};

ObjectPoints::ObjectPoints(const std::vector<const Gaussians*>& objects) {
  for (const Gaussians* object : objects) objects_.push_back(std::make_unique<const Object>(*object));
}
ObjectPoints::ObjectPoints(ObjectPoints&&) noexcept = default;
ObjectPoints::~ObjectPoints() = default;

Index ObjectPoints::objects() const { return std::ssize(objects_); }

ObjectPointErrors ObjectPoints::errors(Index object, const Rigid<double>& pose, const Rigid<double>& truth) const {
  HSI4D_CHECK(object >= 0 && object < objects(), "there is no such object");
  const Object& shape = *objects_[static_cast<std::size_t>(object)];
  ObjectPointErrors errors;
  if (shape.points.empty()) return errors;
  const std::array poses = {pose};
  for (const Vector3<double>& point : shape.points) {
    const Vector3<double> there = transform_point(truth, point);
    errors.add_cm += (transform_point(pose, point) - there).norm();
    const auto nearest = shape.centres.nearest(there, poses, std::numeric_limits<double>::infinity());
    errors.add_s_cm += nearest ? nearest->distance : 0;
  }
  const double scale = kCentimetres / static_cast<double>(shape.points.size());
  errors.add_cm *= scale;
  errors.add_s_cm *= scale;
  return errors;
}

}  // namespace hsi4d
