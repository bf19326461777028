// Settings of synthetic datasets: config section `synthetic`.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/config.h"
#include "core/types.h"
#include "pipelines/config/body_settings.h"

namespace hsi4d {

/// The largest whole number that every JSON tool keeps (RFC 8259, section 6).
inline constexpr std::int64_t kLargestSeed = (std::int64_t{1} << 53) - 1;

/// Where it happens.
enum class SyntheticSceneKind {
  kLivingRoom,
  kKitchen,
  kBedroom,
  kGarden,
  kTerrace,
  kGym,
  kBar,
  kPlayground,
  kGreenhouse,
  kCafe,
  kStore,
  kBicycle,
  kRoom,
  kTruck
};

inline constexpr std::array<ConfigChoice<SyntheticSceneKind>, 14> kSyntheticSceneKinds = {
    {{SyntheticSceneKind::kLivingRoom, "living_room"},
     {SyntheticSceneKind::kKitchen, "kitchen"},
     {SyntheticSceneKind::kBedroom, "bedroom"},
     {SyntheticSceneKind::kGarden, "garden"},
     {SyntheticSceneKind::kTerrace, "terrace"},
     {SyntheticSceneKind::kGym, "gym"},
     {SyntheticSceneKind::kBar, "bar"},
     {SyntheticSceneKind::kPlayground, "playground"},
     {SyntheticSceneKind::kGreenhouse, "greenhouse"},
     {SyntheticSceneKind::kCafe, "cafe"},
     {SyntheticSceneKind::kStore, "store"},
     {SyntheticSceneKind::kBicycle, "bicycle"},
     {SyntheticSceneKind::kRoom, "room"},
     {SyntheticSceneKind::kTruck, "truck"}}};

/// What is used.
enum class SyntheticObjectKind {
  kWateringCan,
  kBox,
  kVase,
  kGuitar,
  kOfficeChair,
  kBarbell,
  kShoppingCart,
  kMower,
  kGate,
  kNone
};

inline constexpr std::array<ConfigChoice<SyntheticObjectKind>, 10> kSyntheticObjectKinds = {
    {{SyntheticObjectKind::kWateringCan, "watering_can"},
     {SyntheticObjectKind::kBox, "box"},
     {SyntheticObjectKind::kVase, "vase"},
     {SyntheticObjectKind::kGuitar, "guitar"},
     {SyntheticObjectKind::kOfficeChair, "office_chair"},
     {SyntheticObjectKind::kBarbell, "barbell"},
     {SyntheticObjectKind::kShoppingCart, "shopping_cart"},
     {SyntheticObjectKind::kMower, "mower"},
     {SyntheticObjectKind::kGate, "gate"},
     {SyntheticObjectKind::kNone, "none"}}};

/// What is done.
enum class SyntheticMotionKind {
  kPour,
  kLift,
  kPutDown,
  kWalk,
  kPush,
  kSit,
  kLean,
  kWave,
  kSitOn,
  kLeanOn,
  kRun,
  kSlide,
  kReach,
  kWipe,
  kPlay,
  kWater,
  kRoll,
  kOpen
};

inline constexpr std::array<ConfigChoice<SyntheticMotionKind>, 18> kSyntheticMotionKinds = {
    {{SyntheticMotionKind::kPour, "pour"},
     {SyntheticMotionKind::kLift, "lift"},
     {SyntheticMotionKind::kPutDown, "put_down"},
     {SyntheticMotionKind::kWalk, "walk"},
     {SyntheticMotionKind::kPush, "push"},
     {SyntheticMotionKind::kSit, "sit"},
     {SyntheticMotionKind::kLean, "lean"},
     {SyntheticMotionKind::kWave, "wave"},
     {SyntheticMotionKind::kSitOn, "sit_on"},
     {SyntheticMotionKind::kLeanOn, "lean_on"},
     {SyntheticMotionKind::kRun, "run"},
     {SyntheticMotionKind::kSlide, "slide"},
     {SyntheticMotionKind::kReach, "reach"},
     {SyntheticMotionKind::kWipe, "wipe"},
     {SyntheticMotionKind::kPlay, "play"},
     {SyntheticMotionKind::kWater, "water"},
     {SyntheticMotionKind::kRoll, "roll"},
     {SyntheticMotionKind::kOpen, "open"}}};

/// The objects that a motion makes sense with.
const std::vector<SyntheticObjectKind>& objects_of(SyntheticMotionKind motion);

/// The words of the objects that go with a motion: "watering_can, box, vase".
std::string object_names_of(SyntheticMotionKind motion);

/// What is made.
enum class SyntheticKind { kClip, kViews, kPhotos };

inline constexpr std::array<ConfigChoice<SyntheticKind>, 3> kSyntheticKinds = {
    {{SyntheticKind::kClip, "clip"}, {SyntheticKind::kViews, "views"}, {SyntheticKind::kPhotos, "photos"}}};

/// What photos show.
enum class SyntheticSubject { kScene, kObject };
inline constexpr std::array<ConfigChoice<SyntheticSubject>, 2> kSyntheticSubjects = {
    {{SyntheticSubject::kScene, "scene"}, {SyntheticSubject::kObject, "object"}}};

/// How the frames of a clip are kept.
enum class SyntheticVideo {
  kMp4,        ///< video.mp4, H.264 of 8 bit, a colour a pixel (4:4:4)
  kMp4Shared,  ///< the same with colours shared by four pixels (4:2:0), as generators write it
  kPng         ///< frames/, exact to 8 bit
};

inline constexpr std::array<ConfigChoice<SyntheticVideo>, 3> kSyntheticVideos = {
    {{SyntheticVideo::kMp4, "mp4"}, {SyntheticVideo::kMp4Shared, "mp4_420"}, {SyntheticVideo::kPng, "png"}}};

/// Fewest Gaussians that a scene and an object can be made of: one for each of their surfaces.
inline constexpr Index kFewestSceneGaussians = 700;
inline constexpr Index kFewestObjectGaussians = 60;

/// How frames are lit beyond what is baked into the colours.
struct SyntheticLight {
  double shading = 0;  ///< of human and object, by the direction of their surfaces
  double shadow = 0;   ///< of human and object on the scene
};

/// Faults of generated videos; 0 leaves each out.
struct SyntheticFaults {
  double revealed = 0;    ///< invented content where the human or the object once was
  double hands_fade = 0;  ///< how far the hands vanish in the middle of the clip
  double appearance = 0;  ///< how far the human's colours have changed in the last frame
};

/// Faults of the masks; 0 leaves each out.
struct SyntheticMaskNoise {
  double grow_px = 0;        ///< outward; negative: eaten away
  double jagged_px = 0;      ///< how far boundaries are off here and there
  double dropped_share = 0;  ///< of masks that show nothing
};

/// A person beside the first one, without an object.
struct SyntheticPerson {
  SyntheticMotionKind motion = SyntheticMotionKind::kWalk;
  std::array<double, 2> beside = {0.9, 0.6};  ///< x, y from where the first person acts to where this one does, metres
  double turn_deg = 0;                        ///< of the motion about where it is done, about z
  double begin = 0;                           ///< seconds of the motion that are over in frame 0
  std::int64_t seed = 1;                      ///< added to that of the dataset, for Gaussians, clothes and noise
};

/// What a synthetic dataset holds.
struct SyntheticSettings {
  SyntheticKind kind = SyntheticKind::kClip;
  std::int64_t seed = 0;
  Index frames = 8;
  Index clips = 1;         ///< that follow one another, of `frames` each, the last of one the first of the next
  double frame_rate = 10;  ///< frames a second
  int size_px = 256;
  int supersample = 2;
  SyntheticVideo video = SyntheticVideo::kMp4;
  int video_quality = 4;  ///< x264's constant rate factor
  SyntheticSceneKind scene = SyntheticSceneKind::kLivingRoom;
  SyntheticObjectKind object = SyntheticObjectKind::kWateringCan;
  SyntheticMotionKind motion = SyntheticMotionKind::kPour;
  std::string place;  ///< of the scene, where the motion is done; empty: the first that it can be done at
  ConfigMap<SyntheticPerson> people;    ///< beside the first one, by name
  double variation = 0;                 ///< how far the seed changes timing, camera, start and appearance
  std::filesystem::path scene_file;     ///< stands in for the scene
  std::array<double, 3> scene_place{};  ///< of the file, where the person acts; metres after scene_scale
  double scene_turn_deg = 0;            ///< about z
  double scene_scale = 1;
  std::filesystem::path object_file;  ///< stands in for the object
  std::vector<double> object_grip;    ///< where it is held, in the file's coordinates; empty: middle of its top
  double object_turn_deg = 0;         ///< about z, until its front is +x
  double object_scale = 1;
  Index scene_gaussians = 12000;
  Index avatar_gaussians = 5000;
  Index object_gaussians = 1500;
  double avatar_difference = 0;  ///< of the human in the video from the one in avatar.safetensors
  SyntheticLight light;
  double camera_drift = 1;
  double camera_distance = 1;  ///< from where it looks, of that as designed
  double pose_noise_deg = 8;
  double pose_bias_deg = 0;
  double pose_drift_deg = 0;
  double hand_noise_share = 0.25;
  double root_noise_deg = 2;
  double root_noise_m = 0.02;
  double root_drift_m = 0;
  double object_noise_deg = 0;
  double object_noise_m = 0;
  SyntheticMaskNoise masks;
  SyntheticFaults faults;
  Index views_cameras = 6;  ///< of kind views
  Index views_poses = 4;
  Index photos = 100;  ///< of kind photos, at most
  SyntheticSubject photos_of = SyntheticSubject::kScene;
};

/// Describes the section: every setting with its range.
void describe(ConfigFields& fields, SyntheticSettings& settings);
void describe(ConfigFields& fields, SyntheticPerson& settings);
void describe(ConfigFields& fields, SyntheticLight& settings);
void describe(ConfigFields& fields, SyntheticFaults& settings);
void describe(ConfigFields& fields, SyntheticMaskNoise& settings);

/// The settings as JSON text: what a dataset's synthetic.json holds. The body is in it unless it is the default.
std::string synthetic_settings_json(const SyntheticSettings& settings, const BodySettings& body = {});

}  // namespace hsi4d
