#include "pipelines/synthetic/motion.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "body/kinematics.h"
#include "body/motion_edit.h"
#include "core/angles.h"
#include "core/check.h"
#include "core/rotation.h"
#include "pipelines/synthetic/moment.h"

namespace hsi4d {
namespace {

using Vector = Vector3<double>;
using Matrix = Matrix3<double>;
using detail::Actor;
using detail::Moment;

bool is_walking(SyntheticMotionKind motion) {
  return motion == SyntheticMotionKind::kWalk || motion == SyntheticMotionKind::kPush;
}

void check_object(const SyntheticObject& object, SyntheticMotionKind motion) {
  const auto& objects = objects_of(motion);
  const bool may_be_none = std::find(objects.begin(), objects.end(), SyntheticObjectKind::kNone) != objects.end();
  const bool is_held = object.hands[kLeft] || object.hands[kRight];
  if (object.exists() ? is_held : may_be_none) return;
  throw UserError("the motion " + std::string(choice_name<SyntheticMotionKind>(kSyntheticMotionKinds, motion)) +
                  " needs an object: " + object_names_of(motion));
}

/// The object in the frame of the wrist that it is fixed to: the same on any ground.
Rigid<double> wrist_from_object(const Actor& actor, const Ground& ground) {
  const HandGrip& grip = *actor.object.hands[kRight];
  Ground facing = ground;
  facing.heading_deg -= 90;
  Rigid<double> result;
  result.rotation = detail::grasp_on(ground, grip, kRight).transpose() * facing.turn();
  result.translation = actor.sizes.palm[kRight] - result.rotation * grip.point;
  return result;
}

/// When a clip's object is on what it stands on.
double standing_at(SyntheticMotionKind motion) { return motion == SyntheticMotionKind::kPutDown ? kClipSeconds : 0; }

/// What has to stand where for the object to stand there.
/// @param standing  the moment of standing_at
ScenePlan plan_of(const Moment& standing, const SyntheticObject& object, SyntheticMotionKind motion) {
  ScenePlan plan;
  plan.middle = is_walking(motion) ? Vector2<double>(0, 0.6) : standing.figure.ground.place;
  plan.seen_from_y = is_walking(motion) ? -1.4 : 0.2;
  plan.has_screen = motion == SyntheticMotionKind::kPutDown;
  const bool stands = motion == SyntheticMotionKind::kPour || plan.has_screen ||
                      (motion == SyntheticMotionKind::kLift && !object.is_heavy);
  plan.has_table = stands && !object.on_floor;
  plan.has_stand = stands && object.on_floor;
  if (object.hinge) {
    plan.has_posts = true;
    plan.support = transform_point(*standing.object, *object.hinge);
    plan.support_turn = so3_log(standing.object->rotation)[2];
  }
  if (!stands) return plan;
  const Ground& ground = standing.figure.ground;
  const Vector foot = standing.object->translation - Vector(0, 0, object.above_ground);
  plan.support = plan.has_table ? Vector(foot + ground.direction({0, 0.09, 0})) : foot;
  plan.support_turn = ground.heading_deg * kDegree;
  return plan;
}

}  // namespace

namespace detail {

double smooth_step(double x) {
  const double t = std::clamp(x, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

Vector3<double> hanging_wrist(const FigureSizes& sizes, int side) {
  const double out = side == kLeft ? 1 : -1;
  return {out * (sizes.shoulder_width / 2 + 0.07), 0.02, sizes.shoulder - 0.975 * sizes.arm};
}

Rigid<double> object_on(const Ground& ground, const ObjectPlace& at) {
  Ground facing = ground;  // the object's front is +x, a person's −y
  facing.heading_deg -= 90;
  Rigid<double> pose;
  pose.rotation = so3_exp(Vector(ground.direction(at.turn_deg) * kDegree)) * facing.turn();
  pose.translation = ground.point(at.place) - pose.rotation * at.pivot;
  return pose;
}

Matrix3<double> grasp_on(const Ground& ground, const HandGrip& grip, int side) {
  const auto in_world = [&](const Vector& v) { return ground.direction({v.y(), v.x(), v.z()}); };
  const Vector thumb = in_world(grip.thumb), fingers = in_world(grip.fingers);
  const Vector out = side == kRight ? Vector(-fingers) : fingers;  // +x of the wrist's frame
  Matrix grasp;
  grasp << out, cross(thumb, out), thumb;
  return grasp;
}

void hold_object(const Actor& actor, const ObjectPlace& at, const Vector3<double>& away, double curl_deg,
                 Moment& moment) {
  hold_object(actor, actor.object.hands, at, away, curl_deg, moment);
}

void hold_object(const Actor& actor, const HandGrips& grips, const ObjectPlace& at, const Vector3<double>& away,
                 double curl_deg, Moment& moment) {
  const Ground& ground = moment.figure.ground;
  for (const int side : {kLeft, kRight}) {
    const auto i = static_cast<std::size_t>(side);
    const auto& grip = grips[i];
    if (!grip) continue;
    const Matrix turn = so3_exp(Vector(ground.direction(at.turn_deg) * kDegree)) * grasp_on(ground, *grip, side);
    const Vector beside = moment.object->rotation * Vector(grip->point - at.pivot) + ground.direction(away);
    FigureHand& hand = moment.figure.hands[i];
    hand.turn = turn;
    hand.wrist = ground.point(at.place) - turn * actor.sizes.palm[i] + beside;
    hand.curl_deg = curl_deg;
  }
}

}  // namespace detail

namespace {

/// Before a place: a little from the right and from above, as for other motions.
Viewpoint view_of_place(const ScenePlace& place) {
  const PlaceView& view = place.view;
  const Matrix turn = so3_exp(Vector(0, 0, view.turn_deg * kDegree));
  Viewpoint result;
  result.focal = 1.12;
  result.target = Vector(place.ground.place[0] + view.left, place.ground.place[1], 0.82 + view.up);
  result.eye = result.target + view.distance * (turn * Vector(0.4, -2.3, 0.5));
  result.turn = view.turn_deg * kDegree;
  return result;
}

Viewpoint designed_viewpoint(const ClipSettings& settings) {
  const SyntheticMotionKind motion = settings.motion;
  if (settings.place != nullptr) return view_of_place(*settings.place);
  if (motion == SyntheticMotionKind::kRoll) return {{0.5, -2.5, 1.3}, {0.0, 0.55, 0.72}, 1.2};
  if (motion == SyntheticMotionKind::kWalk) return {{0.5, -2.5, 1.4}, {0.02, 0.5, 0.85}, 1.2};
  if (motion == SyntheticMotionKind::kPush) return {{0.5, -3.5, 1.5}, {0, 0.35, 0.72}, 1.25};
  if (motion == SyntheticMotionKind::kOpen) return {{0.45, -2.2, 1.5}, {0, 0.6, 0.8}, 1.2};
  if (motion == SyntheticMotionKind::kWave) return {{0.45, -1.95, 1.4}, {0.05, 0.7, 0.9}, 1.15};
  return {{0.42, -1.56, 1.36}, {0.02, 0.72, 0.85}, 1.12};
}

}  // namespace

Viewpoint first_viewpoint(const ClipSettings& settings) {
  Viewpoint view = designed_viewpoint(settings);
  if (settings.camera_distance != 1) view.eye = view.target + settings.camera_distance * (view.eye - view.target);
  const ClipVariation& varied = settings.variation;
  if (varied.turn == 0) return view;
  view.eye = view.target + varied.distance * (so3_exp(Vector(0, 0, varied.turn)) * Vector(view.eye - view.target));
  view.eye[2] += varied.up;
  view.turn += varied.turn;
  return view;
}

Camera camera_at(const Viewpoint& view, double seconds, const ClipSettings& settings) {
  constexpr double kFastest = 0.142;  // metres a second
  constexpr double kSwing = 0.4;      // radians a second: it comes back after 8 seconds
  const double way = settings.camera_drift * settings.variation.drift * kFastest / kSwing * std::sin(kSwing * seconds);
  Vector of_eye(-0.94, 0.26, 0.22), of_target(0.12, 0, -0.04);
  if (view.turn != 0) {
    const Matrix turn = so3_exp(Vector(0, 0, view.turn));
    of_eye = turn * of_eye;
    of_target = turn * of_target;
  }
  Camera camera;
  camera.width = camera.height = settings.size_px;
  camera.fx = camera.fy = view.focal * settings.size_px;
  camera.cx = 0.512 * settings.size_px;
  camera.cy = 0.494 * settings.size_px;
  camera.camera_from_world = look_at(view.eye + way * of_eye, view.target + way * of_target);
  return camera;
}

ClipSettings clip_settings(const SyntheticSettings& settings) {
  return {settings.clips * (settings.frames - 1) + 1,
          settings.frame_rate,
          settings.size_px,
          settings.camera_drift,
          settings.motion,
          settings.camera_distance,
          find_place(settings.scene, settings.motion, settings.place),
          clip_variation(settings)};
}

Rigid<double> joint_frame(const BodyModel& body, const BodyPose& pose, int joint) {
  const PosedJoints posed = pose_skeleton(body, pose);
  const double* row = posed.transforms.data() + 12 * joint;
  Rigid<double> frame;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) frame.rotation(i, j) = row[4 * i + j];
  const double* x = posed.joints.data() + 3 * joint;
  frame.translation = {x[0], x[1], x[2]};
  return frame;
}

namespace {

/// The function that makes a motion.
auto moments_of(SyntheticMotionKind motion) -> Moment (*)(const Actor&, double) {
  switch (motion) {
    case SyntheticMotionKind::kWalk:
    case SyntheticMotionKind::kPush:
      return detail::walking_moment;
    case SyntheticMotionKind::kSitOn:
    case SyntheticMotionKind::kLeanOn:
    case SyntheticMotionKind::kReach:
    case SyntheticMotionKind::kWipe:
    case SyntheticMotionKind::kWater:
      return detail::placed_moment;
    case SyntheticMotionKind::kRun:
    case SyntheticMotionKind::kSlide:
    case SyntheticMotionKind::kPlay:
    case SyntheticMotionKind::kRoll:
      return detail::flowing_moment;
    default:
      return detail::keyed_moment;
  }
}

/// Body and object at one moment.
struct ClipState {
  BodyPose pose;
  std::optional<Rigid<double>> object;
};

ClipState state_of(const BodyModel& body, const Actor& actor, const Moment& moment,
                   Moment (*moment_at)(const Actor&, double)) {
  ClipState state{posed_figure(body, moment.figure), moment.object};
  if (moment.object && moment.in_hand) {
    state.object = compose(joint_frame(body, state.pose, smplx_joint("right_wrist")),
                           wrist_from_object(actor, moment_at(actor, 0).figure.ground));
  }
  return state;
}

/// Where what happens is moved to: along a place as far as that leaves, or about the middle of where it happens.
Rigid<double> start_moved(const ClipSettings& settings, const Ground& ground) {
  const ClipVariation& varied = settings.variation;
  Rigid<double> moved;
  if (settings.place != nullptr) {
    moved.translation = ground.direction({varied.aside * room_of(*settings.place), 0, 0});
    return moved;
  }
  const Vector middle(ground.place[0], ground.place[1], 0);
  moved.rotation = so3_exp(Vector(0, 0, varied.heading_deg * kDegree));
  moved.translation = middle - moved.rotation * middle + Vector(0.07 * varied.aside, 0, 0);
  return moved;
}

void move_start(const Rigid<double>& moved, SyntheticClip& clip) {
  clip.motion = transformed(clip.motion, moved, *clip.motion.pelvis_rest);
  for (Rigid<double>& place : clip.object) place = compose(moved, place);
  ScenePlan& plan = clip.plan;
  plan.support = transform_point(moved, plan.support);
  plan.support_turn += so3_log(moved.rotation)[2];
  plan.middle = transform_point(moved, Vector(plan.middle[0], plan.middle[1], 0)).head<2>();
}

}  // namespace

SyntheticClip synthetic_clip(const BodyModel& body, const SyntheticObject& object, const ClipSettings& settings) {
  HSI4D_CHECK_EQ(body.joint_count(), kSmplxJoints);
  HSI4D_CHECK(settings.frames > 0 && settings.frame_rate > 0 && settings.size_px > 0, "a clip needs frames");
  check_object(object, settings.motion);
  if (use_of(settings.motion) && settings.place == nullptr)
    throw UserError("the motion " +
                    std::string(choice_name<SyntheticMotionKind>(kSyntheticMotionKinds, settings.motion)) +
                    " needs a place: " + place_names_of(settings.motion));
  const Actor actor{figure_sizes(body), object, settings.motion, settings.place};
  const auto moment_at = moments_of(settings.motion);
  const ClipVariation& varied = settings.variation;
  const Rigid<double> moved = start_moved(settings, moment_at(actor, 0).figure.ground);
  const auto state_at = [&](double seconds) { return state_of(body, actor, moment_at(actor, seconds), moment_at); };
  SyntheticClip clip;
  clip.motion.frame_rate = settings.frame_rate;
  clip.motion.pelvis_rest = pelvis_of(body.joints);
  for (Index frame = 0; frame < settings.frames; ++frame) {
    const double seconds = double(frame) / settings.frame_rate;
    auto [pose, place] = state_at(varied.begin + varied.speed * seconds);
    clip.motion.poses.push_back(std::move(pose));
    if (place) clip.object.push_back(*place);
    clip.cameras.push_back(camera_at(first_viewpoint(settings), seconds, settings));
  }
  Moment standing = moment_at(actor, standing_at(settings.motion));
  if (standing.object) standing.object = state_at(standing_at(settings.motion)).object;
  clip.plan = plan_of(standing, object, settings.motion);
  if (settings.place != nullptr) {
    clip.plan.place = settings.place;
    clip.plan.seen_from_y = settings.place->ground.place[1] - 1.4;
  }
  if (varied.aside != 0 || varied.heading_deg != 0) move_start(moved, clip);
  return clip;
}

Motion motion_beside(const BodyModel& body, const SyntheticPerson& person, const SyntheticClip& first,
                     const ClipSettings& settings) {
  ClipSettings own = settings;
  own.motion = person.motion;
  own.place = nullptr;
  own.variation = {};
  own.variation.begin = person.begin;
  const SyntheticClip clip = synthetic_clip(body, SyntheticObject(), own);
  const Vector2<double> from = clip.plan.middle, to = first.plan.middle + Vector2<double>(person.beside.data());
  Rigid<double> moved;
  moved.rotation = so3_exp(Vector(0, 0, person.turn_deg * kDegree));
  moved.translation = Vector(to[0], to[1], 0) - moved.rotation * Vector(from[0], from[1], 0);
  return transformed(clip.motion, moved, *clip.motion.pelvis_rest);
}

const char* motion_summary(SyntheticMotionKind motion) {
  switch (motion) {
    case SyntheticMotionKind::kPour:
      return "lifts it from a table, turns and pours";
    case SyntheticMotionKind::kLift:
      return "reaches for it, takes it and holds it up";
    case SyntheticMotionKind::kPutDown:
      return "puts it down on a table behind a screen, lets go and takes it up again";
    case SyntheticMotionKind::kWalk:
      return "walks in a circle, carrying it";
    case SyntheticMotionKind::kPush:
      return "walks in a circle, pushing it";
    case SyntheticMotionKind::kSit:
      return "sits down on it, leans back and swivels";
    case SyntheticMotionKind::kLean:
      return "leans on its back; without one, on the knees";
    case SyntheticMotionKind::kSitOn:
      return "sits down on a seat of the scene and looks around";
    case SyntheticMotionKind::kLeanOn:
      return "leans on a counter or a ladder";
    case SyntheticMotionKind::kRun:
      return "runs on a treadmill";
    case SyntheticMotionKind::kSlide:
      return "slides down a slide";
    case SyntheticMotionKind::kReach:
      return "takes things from a shelf";
    case SyntheticMotionKind::kWipe:
      return "wipes a car";
    case SyntheticMotionKind::kPlay:
      return "sits and plays it";
    case SyntheticMotionKind::kWater:
      return "waters flowers with it";
    case SyntheticMotionKind::kRoll:
      return "sits on it and rolls backwards";
    case SyntheticMotionKind::kOpen:
      return "opens it, the right hand on its handle";
    case SyntheticMotionKind::kWave:
      break;
  }
  return "waves with the left hand, the object in the right";
}

}  // namespace hsi4d
