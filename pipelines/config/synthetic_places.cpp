#include "pipelines/config/synthetic_places.h"

#include <algorithm>
#include <numbers>
#include <vector>

#include "core/rotation.h"
#include "core/text.h"

namespace hsi4d {
namespace {

using Use = PlaceUse;

// name, use, {where, heading}, height, reach, rise, width, view {turn, distance, left, up}
// clang-format off
constexpr auto ground = [](double x, double y, double heading) { return Ground{{x, y}, heading}; };

const std::vector<ScenePlace> kBedroom = {
    {"bed", Use::kSeat, ground(-0.8, 1.35, 8), 0.485, 0.3, 0, 1.4, {8, 1.12, 0.1, -0.1}},
    {"windowsill", Use::kSeat, ground(1.15, 1.6, -12), 0.56, 0.36, 0, 1.1, {-14, 1.12, 0, -0.05}},
    {"ladder", Use::kRest, ground(0.72, 1.42, 90), 1.18, 0.36, 0.3, 0.5, {0, 1.15, 0.1, 0}}};
const std::vector<ScenePlace> kLivingRoom = {
    {"sofa", Use::kSeat, ground(-0.3, 1.18, 4), 0.43, 0.5, 0, 1.3, {6, 1.1, 0, -0.12}},
    {"sofa_back", Use::kSeat, ground(-0.3, 1.15, 14), 0.72, 0.16, 0, 1.5, {10, 1.2, 0, -0.1}},
    {"table", Use::kSeat, ground(-0.25, 1.2, -16), 0.68, 0.6, 0, 1.3, {-6, 1.18, 0, -0.1}}};
const std::vector<ScenePlace> kGym = {
    {"treadmill", Use::kBelt, ground(-0.7, 2, 66), 0.17, 0.62, 0, 0.52, {-4, 1.3, -0.1, 0.1}}};
const std::vector<ScenePlace> kBar = {
    {"bar", Use::kRest, ground(-0.02, 1.9, 78), 1.08, 0.36, 0, 1, {6, 1.15, 0, 0}}};
const std::vector<ScenePlace> kPlayground = {
    {"slide", Use::kSlide, ground(-0.55, 1.6, -52), 1.4, 2.1, 0, 0.56, {0, 1.45, 0.5, 0}}};
const std::vector<ScenePlace> kGreenhouse = {
    {"chair", Use::kSeat, ground(-0.5, 1.62, 46), 0.46, 0.42, 0, 0.46, {8, 1.15, 0.05, -0.1}},
    {"flowers", Use::kFlowers, ground(0.15, 1.42, 112), 0.35, 0.78, 0, 1.1, {-4, 1.2, 0.25, 0}}};
const std::vector<ScenePlace> kCafe = {
    {"chair", Use::kSeat, ground(-0.3, 1.55, 42), 0.46, 0.42, 0, 0.46, {4, 1.15, 0.15, -0.1}}};
const std::vector<ScenePlace> kStore = {
    {"shelf", Use::kShelf, ground(0.1, 1.3, 128), 1.2, 0.42, 0, 1.5, {-4, 1.15, 0.15, 0}}};
const std::vector<ScenePlace> kGarden = {
    {"flowers", Use::kFlowers, ground(-0.55, 1.32, 122), 0.05, 0.78, 0, 1.1, {0, 1.15, 0.2, 0}}};
const std::vector<ScenePlace> kBicycle = {
    {"bench", Use::kSeat, ground(-0.2, 1.7, 4), 0.45, 0.4, 0, 1.6, {8, 1.42, 0.42, -0.05}}};
const std::vector<ScenePlace> kRoom = {
    {"sofa", Use::kSeat, ground(-0.15, 1.6, 0), 0.43, 0.5, 0, 1.5, {-8, 1.15, 0, -0.1}}};
const std::vector<ScenePlace> kTruck = {
    {"car", Use::kPanel, ground(-0.35, 1.4, 158), 1.36, 0.5, 0, 1, {6, 1.35, 0.3, 0.05}}};
// clang-format on

/// One plays only where one sits with bent knees.
bool suits(const ScenePlace& place, SyntheticMotionKind motion) {
  constexpr double kHighSeat = 0.6;
  return use_of(motion) == place.use && (motion != SyntheticMotionKind::kPlay || place.height < kHighSeat);
}

}  // namespace

Matrix3<double> Ground::turn() const { return so3_exp(Vector3<double>(0, 0, heading_deg * std::numbers::pi / 180)); }

Vector3<double> Ground::direction(const Vector3<double>& v) const {
  return turn() * Vector3<double>(v[0], -v[1], v[2]);
}

Vector3<double> Ground::point(const Vector3<double>& v) const {
  return Vector3<double>(place[0], place[1], 0) + direction(v);
}

std::span<const ScenePlace> places_of(SyntheticSceneKind scene) {
  switch (scene) {
    case SyntheticSceneKind::kBedroom:
      return kBedroom;
    case SyntheticSceneKind::kLivingRoom:
      return kLivingRoom;
    case SyntheticSceneKind::kGym:
      return kGym;
    case SyntheticSceneKind::kBar:
      return kBar;
    case SyntheticSceneKind::kPlayground:
      return kPlayground;
    case SyntheticSceneKind::kGreenhouse:
      return kGreenhouse;
    case SyntheticSceneKind::kCafe:
      return kCafe;
    case SyntheticSceneKind::kStore:
      return kStore;
    case SyntheticSceneKind::kGarden:
      return kGarden;
    case SyntheticSceneKind::kBicycle:
      return kBicycle;
    case SyntheticSceneKind::kRoom:
      return kRoom;
    case SyntheticSceneKind::kTruck:
      return kTruck;
    case SyntheticSceneKind::kKitchen:
    case SyntheticSceneKind::kTerrace:
      break;
  }
  return {};
}

std::optional<PlaceUse> use_of(SyntheticMotionKind motion) {
  switch (motion) {
    case SyntheticMotionKind::kSitOn:
    case SyntheticMotionKind::kPlay:
      return Use::kSeat;
    case SyntheticMotionKind::kLeanOn:
      return Use::kRest;
    case SyntheticMotionKind::kRun:
      return Use::kBelt;
    case SyntheticMotionKind::kSlide:
      return Use::kSlide;
    case SyntheticMotionKind::kReach:
      return Use::kShelf;
    case SyntheticMotionKind::kWipe:
      return Use::kPanel;
    case SyntheticMotionKind::kWater:
      return Use::kFlowers;
    default:
      return std::nullopt;
  }
}

const ScenePlace* find_place(SyntheticSceneKind scene, SyntheticMotionKind motion, const std::string& name) {
  for (const ScenePlace& place : places_of(scene))
    if (suits(place, motion) && (name.empty() || name == place.name)) return &place;
  return nullptr;
}

std::string place_problem(SyntheticSceneKind scene, SyntheticMotionKind motion, const std::string& name) {
  const std::string of_motion(choice_name<SyntheticMotionKind>(kSyntheticMotionKinds, motion)),
      of_scene(choice_name<SyntheticSceneKind>(kSyntheticSceneKinds, scene));
  if (!use_of(motion)) return name.empty() ? "" : "the motion " + of_motion + " is done at no place; leave it empty";
  if (find_place(scene, motion, name) != nullptr) return "";
  const std::string what = name.empty() ? "nothing" : "no \"" + name + "\"";
  return "the scene " + of_scene + " has " + what + " for the motion " + of_motion + "; there are " +
         place_names_of(motion);
}

double room_of(const ScenePlace& place) {
  switch (place.use) {
    case Use::kSeat:
      return std::max(0.0, 0.5 * (place.width - 0.5)) * 0.4;
    case Use::kRest:
      return place.rise > 0 ? 0 : 0.1;
    case Use::kShelf:
    case Use::kPanel:
    case Use::kFlowers:
      return 0.1;
    case Use::kBelt:
    case Use::kSlide:
      break;
  }
  return 0;
}

double slide_height(const ScenePlace& slide, double behind) {
  constexpr double kEnd = 0.3, kLevel = 0.14, kBend = 0.2;  // metres; shares of the length
  const auto rise = [](double x) {
    if (x < kLevel) return 0.0;
    if (x < kLevel + kBend) return (x - kLevel) * (x - kLevel) / (2 * kBend);
    return x - kLevel - kBend / 2;
  };
  return kEnd + (slide.height - kEnd) * rise(std::clamp(behind / slide.reach, 0.0, 1.0)) / rise(1);
}

std::string place_names_of(SyntheticSceneKind scene) {
  std::vector<std::string> names;
  for (const ScenePlace& place : places_of(scene)) names.emplace_back(place.name);
  return joined(names);
}

std::string place_names_of(SyntheticMotionKind motion) {
  std::vector<std::string> names;
  for (const auto& scene : kSyntheticSceneKinds)
    for (const ScenePlace& place : places_of(scene.value))
      if (suits(place, motion)) names.push_back(std::string(scene.name) + "/" + place.name);
  return joined(names);
}

}  // namespace hsi4d
