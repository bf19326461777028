#include "pipelines/run/hidden_objects.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include "body/kinematics.h"
#include "core/rigid.h"
#include "core/rotation.h"
#include "optim/metrics.h"
#include "optim/motion_start.h"
#include "optim/object_centres.h"
#include "pipelines/graph/frame_masks.h"

namespace hsi4d {

namespace {

using Vector = Vector3<double>;

constexpr Index kChest = 9;
constexpr std::size_t kFramesOfCarrier = 8;  // that tell it
constexpr double kHandShift = 0.01;          // metres that a hand may shift what it holds
constexpr double kHalf = 0.5;                // of a pixel is covered
const Vector kBehindCamera(0, 0, -1000);     // metres

/// A turn about the vertical by the angle in which the pelvis shows its left.
Matrix3<double> heading_of(const BodyPose& pose) {
  const Vector left = so3_exp(pose.rotation_of(0)) * Vector(1, 0, 0);
  return so3_exp(Vector(0, 0, std::atan2(left[1], left[0])));
}

/// world_from_carrier.
Rigid<double> carrier_pose(const Clip& clip, const Carrier& carrier, const SceneState& state) {
  if (!carrier.joint) return {};
  const BodyPose& person = state.person(carrier.person);
  const Avatar& avatar = clip.person(carrier.person).avatar;
  if (carrier.is_upright) return {heading_of(person), Vector(pose_joints(avatar, person).data() + 3 * *carrier.joint)};
  const PosedJoints body = pose_skeleton(avatar, person);
  const double* const row = body.transforms.data() + 12 * *carrier.joint;
  Rigid<double> pose;
  for (Index r = 0; r < 3; ++r) {
    for (Index c = 0; c < 3; ++c) pose.rotation(r, c) = row[4 * r + c];
    pose.translation[r] = row[4 * r + 3];
  }
  return pose;
}

/// Mean distance from their mean.
double spread_of(const std::vector<Vector>& places) {
  Vector mean = Vector::Zero();
  for (const Vector& place : places) mean += place / static_cast<double>(places.size());
  double sum = 0;
  for (const Vector& place : places) sum += (place - mean).norm();
  return sum / static_cast<double>(places.size());
}

/// How much an object's place as its carrier sees it changes, metres.
double spread_with(const Clip& clip, const Carrier& carrier, std::size_t object,
                   std::span<const SceneState* const> states) {
  std::vector<Vector> places;
  for (const SceneState* const state : states)
    places.push_back(transform_point(inverse(carrier_pose(clip, carrier, *state)), state->objects[object].translation));
  return spread_of(places);
}

double image_difference(const RunConfig& config, const Clip& clip, const SceneState& state, const ClipFrame& frame,
                        const ColorState& colors) {
  const Image image = render_state(config, clip, state, colors);
  double sum = 0;
  for (int c = 0; c < image.channels(); ++c) {
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x)
        sum += std::fabs(static_cast<double>(image(c, y, x) - frame.target(c, y, x)));
    }
  }
  return sum;
}

/// The same depth, where the middle of the mask is in the image.
ObjectPose at_mask(const Camera& camera, const Vector& center, ObjectPose pose) {
  Vector place = transform_point(camera.camera_from_world, pose.translation);
  place[0] = (center[0] - camera.cx) / camera.fx * place[2];
  place[1] = (center[1] - camera.cy) / camera.fy * place[2];
  pose.translation = transform_point(inverse(camera.camera_from_world), place);
  return pose;
}

/// @param pixels  of the object that show
double shown_share(const Clip& clip, double pixels, std::size_t object, const SceneState& state) {
  Camera camera = clip.camera;
  camera.camera_from_world = state.camera_from_world;
  const double all = covered_area(clip.objects[object].gaussians, state.objects[object], camera);
  return pixels < all ? pixels / all : pixels > 0 ? 1.0 : 0.0;
}

}  // namespace

std::string carrier_text(const Clip& clip, const Carrier& carrier) {
  if (!carrier.joint) return "stays where it was";
  const std::optional<std::size_t> hand = hand_of_joint(*carrier.joint);
  const std::string part = !hand ? "chest" : *hand == 0 ? "left hand" : "right hand";
  return "stays with the " + part + (carrier.person == 0 ? "" : " of " + clip.person(carrier.person).name);
}

std::vector<double> seen_shares(const Clip& clip, const ClipFrame& frame, double mask_threshold,
                                const SceneState& state) {
  std::vector<double> shares(clip.objects.size(), 1.0);
  for (std::size_t o = 0; o < clip.objects.size(); ++o) {
    if (o >= frame.object_masks.size() || frame.object_masks[o].empty()) continue;
    shares[o] = shown_share(clip, mask_center(frame.object_masks[o], mask_threshold)[2], o, state);
  }
  return shares;
}

double drawn_share(const Clip& clip, const StatePicture& picture, std::size_t object, const SceneState& state) {
  return shown_share(clip, mask_center(picture.objects.at(object), 0)[2], object, state);
}

std::array<bool, 2> touching_hands(const Clip& clip, std::size_t object, std::size_t person, const SceneState& state) {
  const ObjectCentres centres({&clip.objects[object].gaussians});
  const std::array<Rigid<double>, 1> pose = {rigid_of(state.objects[object])};
  const std::vector<double> joints = pose_joints(clip.person(person).avatar, state.person(person));
  std::array<bool, 2> touching = {};
  for (Index j = 0; 3 * j < std::ssize(joints); ++j) {
    const std::optional<std::size_t> hand = hand_of_joint(j);
    if (hand && centres.nearest(Vector(joints.data() + 3 * j), pose, kContactDistance)) touching[*hand] = true;
  }
  return touching;
}

Carrier carrier_of(const Clip& clip, std::size_t object, const std::vector<const SceneState*>& seen) {
  const std::span<const SceneState* const> last = std::span(seen).last(std::min(kFramesOfCarrier, seen.size()));
  Carrier best;
  double least = spread_with(clip, best, object, last) + kHandShift;
  for (std::size_t p = 0; p < clip.people(); ++p) {
    const std::array<bool, 2> touching = touching_hands(clip, object, p, *last.back());
    if (!touching[0] && !touching[1]) continue;
    const Carrier person{kChest, p};
    const double spread = spread_with(clip, person, object, last);
    if (!(spread < least)) continue;
    best = person;
    least = spread;
  }
  return best;
}

ObjectPose carried_pose(const Clip& clip, const Carrier& carrier, std::size_t object, const SceneState& from,
                        const SceneState& to) {
  if (!carrier.joint) return from.objects[object];
  const Rigid<double> to_from_from =
      compose(carrier_pose(clip, carrier, to), inverse(carrier_pose(clip, carrier, from)));
  return pose_of(compose(to_from_from, rigid_of(from.objects[object])));
}

std::optional<double> object_iou(const StatePicture& picture, const ClipFrame& frame, std::size_t object) {
  constexpr double kSliver = 1.0 / 4096;  // of the picture
  if (object >= picture.objects.size() || object >= frame.object_masks.size() || frame.object_masks[object].empty())
    return {};
  const Image& mask = frame.object_masks[object];
  if (mask_center(mask, kHalf)[2] < kSliver * mask.width() * mask.height()) return {};
  return mask_iou(picture.objects.at(object), mask);
}

bool is_shown_at(const RunConfig& config, const Clip& clip, std::size_t object, const ClipFrame& frame,
                 const SceneState& state, const ColorState& colors) {
  SceneState without = state;
  without.objects[object].translation = transform_point(inverse(state.camera_from_world), kBehindCamera);
  return image_difference(config, clip, state, frame, colors) < image_difference(config, clip, without, frame, colors);
}

FoundObject find_object(const RunConfig& config, const Clip& clip, std::size_t object, const ClipFrame& frame,
                        const SceneState& state, const SceneState& last, const ColorState& colors) {
  Camera camera = clip.camera;
  camera.camera_from_world = state.camera_from_world;
  FoundObject best;
  double least = std::numeric_limits<double>::infinity();
  const auto consider = [&](const ObjectPose& pose, const std::string& from) {
    SceneState tried = state;
    tried.objects[object] = pose;
    const double difference = image_difference(config, clip, tried, frame, colors);
    if (!(difference < least)) return;
    least = difference;
    best = {pose, from};
  };
  const Vector center = mask_center(frame.object_masks.at(object), config.data.mask_threshold);
  consider(state.objects[object], "as expected");
  consider(last.objects[object], "where it was");
  if (center[2] > 0) {
    consider(at_mask(camera, center, state.objects[object]), "as expected, at its mask");
    consider(at_mask(camera, center, last.objects[object]), "where it was, at its mask");
  }
  return best;
}

}  // namespace hsi4d
