// Walking in a circle, from footstep to footstep.
//
// Step k lands at t_k = t_1 + (k − 1) τ; odd steps are the left foot's. A foot stands from its landing until `swing`
// seconds before its next one, and its place is beside where the pelvis is in the middle of that time: so steps follow
// the speed, feet never slide, and a foot is as far ahead when it lands as it is behind when it leaves.
#include <algorithm>
#include <cmath>

#include "core/angles.h"
#include "pipelines/synthetic/moment.h"

namespace hsi4d::detail {
namespace {

using Vector = Vector3<double>;

constexpr double kStep = 0.56, kSwing = 0.4;     // seconds
constexpr double kFirstLanding = 0.5;            // seconds
constexpr double kStart = 0.5;                   // seconds until full speed
constexpr double kTrack = 0.088;                 // metres from the path to each foot
constexpr double kToesOut = 7;                   // degrees
constexpr double kHeelRise = 26, kRaised = 0.2;  // degrees; seconds before a foot leaves
constexpr double kFootLift = 0.05;               // metres

/// The way of the pelvis: an arc to the left around `middle`.
struct Path {
  Vector2<double> middle;
  double radius, start_deg, speed;

  /// Distance travelled: the speed rises smoothly from 0.
  double distance(double seconds) const {
    const double x = std::clamp(seconds / kStart, 0.0, 1.0);
    return speed * kStart * (x * x * x - x * x * x * x / 2) + speed * std::max(0.0, seconds - kStart);
  }
  /// Speed as a share of the full one.
  double pace(double seconds) const { return smooth_step(seconds / kStart); }

  Ground at(double distance) const {
    Ground ground;
    ground.heading_deg = start_deg + distance / radius * 180 / kPi;
    const Vector left = ground.direction({1, 0, 0});
    ground.place = middle - radius * left.head<2>();
    return ground;
  }
};

Path path_of(const Actor& actor) {
  if (actor.motion == SyntheticMotionKind::kPush) {
    if (actor.object.is_long) return {{-0.05, 0.6}, 1.05, 28, 0.45};
    return {{0, 0.25}, 0.65, 45, 0.42};
  }
  return {{0, 0.75}, 0.6, 62, 0.445};
}

double landing_time(int step) { return kFirstLanding + (step - 1) * kStep; }

/// The middle of the time that a step stands.
double middle_time(int step) { return landing_time(step) + (2 * kStep - kSwing) / 2; }

int side_of(int step) { return step % 2 != 0 ? kLeft : kRight; }

/// Where step k stands; the first two before anything moves.
FigureFoot footprint(const Path& path, int step) {
  const int side = side_of(step);
  const Ground ground = path.at(step <= 0 ? 0 : path.distance(middle_time(step)));
  FigureFoot foot;
  foot.place = ground.point({outward(side) * kTrack, step <= 0 ? 0.02 * outward(side) : 0.0, 0});
  foot.yaw_deg = ground.heading_deg + kToesOut * outward(side);
  return foot;
}

/// From 0 to 1 with speed and acceleration 0 at both ends.
double swung(double u) { return u * u * u * (10 + u * (6 * u - 15)); }

FigureFoot foot_at(const Path& path, int side, double seconds) {
  int step = side == kLeft ? -1 : 0;
  while (landing_time(step + 2) <= seconds) step += 2;
  const double leaves = landing_time(step + 2) - kSwing;
  FigureFoot foot = footprint(path, step);
  const double rise = kHeelRise * std::min(1.0, path.pace(leaves) + 0.4);
  foot.pitch_deg = rise * smooth_step((seconds - leaves + kRaised) / kRaised);
  if (seconds <= leaves) return foot;
  const FigureFoot next = footprint(path, step + 2);
  const double u = (seconds - leaves) / kSwing, along = swung(u), up = 16 * u * u * (1 - u) * (1 - u);
  foot.place += along * (next.place - foot.place) + Vector(0, 0, kFootLift * up);
  foot.yaw_deg += along * (next.yaw_deg - foot.yaw_deg);
  foot.pitch_deg = rise * (1 - smooth_step(u / 0.6)) - 5 * up;
  foot.flat_toes = true;
  return foot;
}

/// Swings with each pair of steps: 1 when the left foot lands, −1 when the right one does.
double stride(double seconds) { return std::cos(kPi * (seconds - landing_time(1)) / kStep); }

void swing_arm(const Actor& actor, const Ground& ground, int side, double degrees, FigureTarget& figure) {
  const double angle = degrees * kPi / 180, out = outward(side), arm = 0.965 * actor.sizes.arm;
  FigureHand& hand = figure.hands[static_cast<std::size_t>(side)];
  hand.wrist = ground.point({out * (actor.sizes.shoulder_width / 2 + 0.08), 0.02 + arm * std::sin(angle),
                             actor.sizes.shoulder - 0.02 - arm * std::cos(angle)});
  hand.elbow = ground.direction({0.35 * out, -0.9, -0.2});
  hand.curl_deg = 26;
}

}  // namespace

Moment walking_moment(const Actor& actor, double seconds) {
  const bool pushes = actor.motion == SyntheticMotionKind::kPush;
  const Path path = path_of(actor);
  const double pace = path.pace(seconds), lands = pace * stride(seconds);
  const double stands = pace * std::cos(kPi * (seconds - middle_time(1)) / kStep);  // 1 when the left foot carries
  const double lean = pushes ? 1 : 0;
  Moment moment;
  FigureTarget& figure = moment.figure;
  figure.ground = path.at(path.distance(seconds));
  const double bob = 0.01 * std::cos(2 * kPi * (seconds - middle_time(1)) / kStep);
  figure.pelvis = {0.018 * stands, -0.03 * lean, -0.009 - pace * (0.012 - bob) - 0.006 * lean};
  figure.pelvis_turn = {2 + 5 * lean, -5 * lands, -2 * stands};
  figure.spine = {3 + 11 * lean, 7 * lands + 4 * pace, 2 * stands};
  figure.head = {2 - 8 * lean, 6 * pace - 2 * lands, 0};
  for (const int side : {kLeft, kRight}) {
    figure.feet[static_cast<std::size_t>(side)] = foot_at(path, side, seconds);
    swing_arm(actor, figure.ground, side, -17 * outward(side) * lands + 3, figure);
  }
  if (!actor.object.exists()) return moment;
  const Vector sway(0.5 * figure.pelvis[0], 0.006 * pace * std::cos(2 * kPi * seconds / kStep),
                    0.7 * (figure.pelvis[2] + 0.02));
  const Vector place = actor.object.carried + (pushes ? Vector(0, 0, 0) : sway);
  const Vector tilt =
      pushes ? Vector(0, 0, 0) : Vector(1.5 * pace * std::sin(2 * kPi * seconds / kStep), 0, -2.5 * lands);
  const ObjectPlace at{actor.object.grip, place, tilt};
  moment.object = object_on(figure.ground, at);
  moment.in_hand = !pushes;
  for (const int side : {kLeft, kRight})
    if (actor.object.hands[static_cast<std::size_t>(side)])
      figure.hands[static_cast<std::size_t>(side)].elbow = figure.ground.direction({0.65 * outward(side), -0.6, -0.35});
  hold_object(actor, at, Vector::Zero(), 62, moment);
  return moment;
}

}  // namespace hsi4d::detail
