// Motions that go on and on, or along a way: run, slide, play, roll.
#include <algorithm>
#include <cmath>

#include "core/angles.h"
#include "pipelines/synthetic/keyframes.h"

namespace hsi4d::detail {
namespace {

using Vector = Vector3<double>;

double wrapped(double x) { return x - std::floor(x); }

// A jog on a belt.
constexpr double kPace = 0.92;       // seconds of two steps
constexpr double kStance = 0.4;      // share of them that a foot is on the belt
constexpr double kBeltSpeed = 1.05;  // metres a second

/// A foot at a phase of its cycle, 0 when it lands.
FigureFoot running_foot(const ScenePlace& place, int side, double phase) {
  const double half = 0.5 * kBeltSpeed * kStance * kPace;
  Vector at(0.085 * outward(side), 0, place.height);
  double pitch = 0;
  if (phase < kStance) {
    at[1] = half - 2 * half * phase / kStance;
    pitch = 32 * smooth_step((phase / kStance - 0.55) / 0.45);
  } else {
    const double u = (phase - kStance) / (1 - kStance);
    const double along = u * u * u * (10 + u * (6 * u - 15));
    at[1] = -half + 2 * half * along - 0.1 * std::sin(kPi * u) * (1 - u);
    at[2] += 0.2 * std::sin(kPi * std::pow(u, 0.8)) * (1 - 0.35 * u);
    pitch = 32 + 34 * std::sin(kPi * std::min(1.0, u / 0.7)) * (1 - u) - 32 * smooth_step(u / 0.85);
  }
  FigureFoot foot;
  foot.place = place.ground.point(at);
  foot.yaw_deg = place.ground.heading_deg + 4 * outward(side);
  foot.pitch_deg = pitch;
  return foot;
}

Moment running_moment(const Actor& actor, double seconds) {
  const ScenePlace& place = *actor.place;
  const double cycle = seconds / kPace, swing = std::cos(2 * kPi * (cycle - 0.06));  // 1: the left foot is ahead
  const double bounce = std::cos(4 * kPi * (cycle - 0.5 * kStance));                 // 1: in the middle of a stance
  Moment moment;
  FigureTarget& figure = moment.figure;
  figure.ground = place.ground;
  figure.pelvis = {0.012 * std::sin(2 * kPi * cycle), 0.0, place.height - 0.055 - 0.022 * bounce};
  figure.pelvis_turn = {8, -6 * swing, 0};
  figure.spine = {5, 12 * swing, 0};
  figure.head = {-6, -5 * swing, 0};
  for (const int side : {kLeft, kRight}) {
    const auto i = static_cast<std::size_t>(side);
    figure.feet[i] = running_foot(place, side, wrapped(cycle + (side == kLeft ? 0.0 : 0.5)));
    const double ahead = -outward(side) * swing;  // arms against legs
    const double up = actor.sizes.shoulder + place.height - 0.055;
    FigureHand& hand = figure.hands[i];
    hand.wrist = place.ground.point(
        {outward(side) * (0.19 - 0.04 * std::max(0.0, ahead)), 0.24 + 0.15 * ahead, up - 0.26 + 0.09 * ahead});
    hand.elbow = place.ground.direction({0.35 * outward(side), -0.9, -0.35});
    hand.local = {0, 0, 0};
    hand.shared = true;
    hand.curl_deg = 58;
  }
  return moment;
}

// Down a slide: sits at the top, pushes off, slides, and sits at the end.
constexpr double kSlideLength = 5, kPushOff = 0.7, kStopped = 4.2;  // seconds

/// How far behind the slide's end the pelvis is: slow at first, then faster, then braking.
double slid(const ScenePlace& place, double t) {
  const double u = std::clamp((t - kPushOff) / (kStopped - kPushOff), 0.0, 1.0);
  const double along = std::pow(u, 2.2) * (1 + 2.2 / 3 - (2.2 / 3) * u * u * u);
  const double from = place.reach + 0.12, to = 0.36;
  return from + (to - from) * along;
}

Moment sliding_moment(const Actor& actor, double seconds) {
  const ScenePlace& place = *actor.place;
  const double t = time_in_clip(seconds, kSlideLength), behind = slid(place, t);
  const auto surface = [&](double b) { return b < 0 ? slide_height(place, 0) - 0.9 * -b : slide_height(place, b); };
  const auto slope = [&](double b) {  // degrees down, over what one sits on
    return std::atan((surface(b + 0.15) - surface(b - 0.25)) / 0.4) / kDegree;
  };
  const double down = slope(behind), push = smooth_step(t / 0.5) * (1 - smooth_step((t - kPushOff) / 0.5));
  const double ends = smooth_step((t - kStopped + 0.3) / 0.9);
  Moment moment;
  FigureTarget& figure = moment.figure;
  figure.ground = place.ground;
  figure.pelvis = {0, -behind, surface(behind) + kSeatToPelvis - actor.sizes.standing + 0.02};
  figure.pelvis_turn = {-14 + 0.35 * down + 8 * push + 10 * ends, 0, 0};
  figure.spine = {10 + 14 * push + 4 * ends, 0, 0};
  figure.head = {0, -14 * smooth_step((t - 1.2) / 0.8), 0};
  for (const int side : {kLeft, kRight}) {
    const auto i = static_cast<std::size_t>(side);
    const double reach = 0.66 - 0.1 * push - 0.04 * ends, b = behind - reach;
    FigureFoot& foot = figure.feet[i];
    const double lift = b < 0 ? 0.0 : 0.02;
    foot.place = place.ground.point({0.1 * outward(side), -b, std::max(0.0, surface(b) + lift)});
    foot.about_ankle = true;
    foot.yaw_deg = place.ground.heading_deg + 5 * outward(side);
    const double on_slope = b > 0 ? std::atan((surface(b + 0.1) - surface(b)) / 0.1) / kDegree : 0;
    foot.pitch_deg = b < 0 ? -12 * std::min(1.0, surface(b) / 0.1) : on_slope - 34;
    foot.flat_toes = false;
    FigureHand& hand = figure.hands[i];  // on the rails
    const double at = behind - 0.06 - 0.1 * push, rail = surface(at) + 0.24;
    hand.wrist = place.ground.point({outward(side) * (place.width / 2 + 0.0), -at, rail});
    hand.elbow = place.ground.direction({0.6 * outward(side), -0.8, 0.1});
    hand.shared = true;
    hand.curl_deg = 40;
  }
  return moment;
}

// A guitar on the right thigh of one who sits.
Moment playing_moment(const Actor& actor, double seconds) {
  const ScenePlace& place = *actor.place;
  const double beat = seconds / 0.75, sway = std::sin(2 * kPi * seconds / 4.5), strum = std::sin(2 * kPi * beat);
  Moment moment;
  FigureTarget& figure = moment.figure;
  figure.ground = place.ground;
  figure.ground.place = place.ground.point({0, 0.12, 0}).head<2>();
  figure.pelvis = {0, -0.33, place.height + kSeatToPelvis - actor.sizes.standing};
  figure.pelvis_turn = {-6 + 1.5 * sway, 0, 1.5 * sway};
  figure.spine = {9 + 2 * sway, 5, -2 * sway};
  figure.head = {12 + 5 * std::sin(2 * kPi * beat / 2), 18 + 10 * sway, 0};
  for (const int side : {kLeft, kRight}) {
    FigureFoot& foot = figure.feet[static_cast<std::size_t>(side)];
    foot.place = figure.ground.point({0.14 * outward(side), side == kLeft ? 0.03 : -0.02, 0});
    foot.yaw_deg = figure.ground.heading_deg + 10 * outward(side);
    if (side == kRight) foot.pitch_deg = 5 * (1 + std::cos(2 * kPi * beat));  // taps with the heel
  }
  // along the neck from the object's grip: of its own frame z; +x is the top, +y down when it lies on the thigh
  const double fret = 0.2 + 0.05 * smooth_step(3 * std::sin(2 * kPi * seconds / 3)), down = 0.045 * strum;
  const double tilt = 9 * kDegree * strum;
  const Vector fingers(0, 0.5 * std::cos(tilt) + 0.87 * std::sin(tilt), 0.87 * std::cos(tilt) - 0.5 * std::sin(tilt));
  const Vector thumb(0, -fingers[2], fingers[1]);
  const HandGrips grips = {
      HandGrip{actor.object.grip + Vector(-0.025, 0.02, fret), Vector::UnitZ(), Vector(0.95, -0.312, 0).normalized()},
      HandGrip{actor.object.grip + Vector(0.055, -0.02 + down, -0.32), thumb, fingers}};
  const Vector waist = actor.object.grip + Vector(-0.045, 0, -0.31);
  const ObjectPlace at{waist, {-0.13, -0.11 + 0.004 * sway, place.height + 0.3}, {-12, -66 + 1.5 * sway, 12}};
  moment.object = object_on(figure.ground, at);
  for (const int side : {kLeft, kRight})
    figure.hands[static_cast<std::size_t>(side)].elbow =
        figure.ground.direction(side == kLeft ? Vector(0.55, -0.3, -0.8) : Vector(-0.8, -0.5, -0.25));
  hold_object(actor, grips, at, Vector::Zero(), 0, moment);
  figure.hands[kLeft].curl_deg = 44;
  figure.hands[kRight].curl_deg = 24;
  return moment;
}

// Rolls backwards on a chair, pushing with both feet.
constexpr double kRollPeriod = 1.7, kRollStep = 0.42;  // seconds, metres a push
constexpr double kLeaves = 0.55, kLands = 0.95;        // shares of the period: feet leave and land
constexpr int kPushes = 3;

double rolled(double t) {
  const double k = std::floor(t / kRollPeriod);
  return kRollStep * (k + smooth_step(t / kRollPeriod - k));
}

Moment rolling_moment(const Actor& actor, double seconds) {
  const double t = time_in_clip(seconds, kPushes * kRollPeriod), way = rolled(t);
  const Ground start{{0.62, 0.55}, 62};
  const double k = std::floor(t / kRollPeriod), u = t / kRollPeriod - k;
  const double swing = std::clamp((u - kLeaves) / (kLands - kLeaves), 0.0, 1.0);
  const double stood = k * kRollStep, eased = swing * swing * swing * (10 + swing * (6 * swing - 15));
  const double feet = 0.33 - stood - kRollStep * eased;  // forward of the start
  const double push = smooth_step(u / 0.25) * (1 - smooth_step((u - 0.45) / 0.35));
  Moment moment;
  FigureTarget& figure = moment.figure;
  figure.ground = start;
  figure.pelvis = {0, -way - 0.01, kChairSeat + kSeatToPelvis - actor.sizes.standing};
  figure.pelvis_turn = {-7 - 4 * push, 0, 0};
  figure.spine = {4 + 6 * push, 0, 0};
  figure.head = {2, -22 * smooth_step((t - 0.6) / 0.8), 0};
  const double up = 0.05 * 16 * swing * swing * (1 - swing) * (1 - swing);
  for (const int side : {kLeft, kRight}) {
    const auto i = static_cast<std::size_t>(side);
    FigureFoot& foot = figure.feet[i];
    foot.place = start.point({0.12 * outward(side), feet + 0.03 * outward(side), up});
    foot.yaw_deg = start.heading_deg + 8 * outward(side);
    FigureHand& hand = figure.hands[i];  // on the arm rests
    hand.wrist = start.point({0.29 * outward(side), -way + 0.03, 0.73});
    hand.elbow = start.direction({0.5 * outward(side), -0.85, -0.1});
    hand.shared = true;
    hand.curl_deg = 26;
  }
  const ObjectPlace at{actor.object.grip + Vector(kChairBack, 0, 0),
                       {0, -way, actor.object.above_ground + actor.object.grip.z()}};
  moment.object = object_on(start, at);
  return moment;
}

}  // namespace

Moment flowing_moment(const Actor& actor, double seconds) {
  switch (actor.motion) {
    case SyntheticMotionKind::kRun:
      return running_moment(actor, seconds);
    case SyntheticMotionKind::kSlide:
      return sliding_moment(actor, seconds);
    case SyntheticMotionKind::kPlay:
      return playing_moment(actor, seconds);
    default:
      return rolling_moment(actor, seconds);
  }
}

}  // namespace hsi4d::detail
