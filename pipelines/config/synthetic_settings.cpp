#include "pipelines/config/synthetic_settings.h"

#include <algorithm>

#include "core/text.h"
#include "pipelines/config/synthetic_places.h"

namespace hsi4d {
namespace {

void describe_noise(ConfigFields& f, SyntheticSettings& s) {
  f.number("pose_noise_deg", s.pose_noise_deg, {.min = 0, .max = 90},
           "Root mean square angle by which each body joint of the initial motion is off, degrees; another in each "
           "frame");
  f.number("pose_bias_deg", s.pose_bias_deg, {.min = 0, .max = 90},
           "The same of an error that stays for seconds: of a joint it turns once in 8 s");
  f.number("pose_drift_deg", s.pose_drift_deg, {.min = 0, .max = 90},
           "The same of an error that grows from frame to frame; this large in the last one");
  f.number("hand_noise_share", s.hand_noise_share, {.min = 0, .max = 2},
           "The three of finger joints, as a share of a body joint's");
  f.number("root_noise_deg", s.root_noise_deg, {.min = 0, .max = 90},
           "Root mean square angle by which the whole body's orientation is off");
  f.number("root_noise_m", s.root_noise_m, {.min = 0, .max = 2},
           "Standard deviation of each coordinate of the initial motion's root, metres");
  f.number("root_drift_m", s.root_drift_m, {.min = 0, .max = 10},
           "The same of an error that grows from frame to frame; this large in the last one");
  f.number("object_noise_deg", s.object_noise_deg, {.min = 0, .max = 180},
           "Root mean square angle by which the object is off in initial_objects.npz; with this or the next, that file "
           "is written");
  f.number("object_noise_m", s.object_noise_m, {.min = 0, .max = 2},
           "Standard deviation of each coordinate of the object there, metres");
}

void describe_files(ConfigFields& f, SyntheticSettings& s) {
  f.path("scene_file", s.scene_file, {.must_exist = true},
         "Gaussians that stand in for the scene (.ply, .splat or .spz), z up; none: the scene is made");
  f.numbers("scene_place", s.scene_place, {.min = -1e6, .max = 1e6},
            "Point of the floor of scene_file that the person acts at, after scene_scale, metres");
  f.number("scene_turn_deg", s.scene_turn_deg, {.min = -360, .max = 360},
           "Turns scene_file about z through scene_place, degrees");
  f.number("scene_scale", s.scene_scale, {.above = 0, .max = 1e6}, "Metres in a unit of scene_file");
  f.path("object_file", s.object_file, {.must_exist = true},
         "Gaussians that stand in for the object, z up as it stands; they are held as `object` is; none: it is made");
  f.numbers("object_grip", s.object_grip, {.min = -1e6, .max = 1e6},
            "Where it is held: middle of its handle, in object_file's coordinates; empty: the middle of its top",
            {0, 3});
  f.number("object_turn_deg", s.object_turn_deg, {.min = -360, .max = 360},
           "Turns object_file about z until its front is +x, degrees");
  f.number("object_scale", s.object_scale, {.above = 0, .max = 1e6}, "Metres in a unit of object_file");
  f.rule({"object_grip"}, [&s]() -> std::string {
    return s.object_grip.empty() || s.object_grip.size() == 3 ? "" : "a place has three numbers";
  });
  f.rule({"object_file", "object"}, [&s]() -> std::string {
    if (s.object_file.empty() || s.object != SyntheticObjectKind::kNone) return "";
    return "with object none there is nothing that a file could stand in for; name the object that it is held like";
  });
}

}  // namespace

const std::vector<SyntheticObjectKind>& objects_of(SyntheticMotionKind motion) {
  using Object = SyntheticObjectKind;
  static const std::vector<Object> on_table = {Object::kWateringCan, Object::kBox, Object::kVase};
  static const std::vector<Object> lifted = {Object::kWateringCan, Object::kBox, Object::kVase, Object::kGuitar,
                                             Object::kBarbell};
  static const std::vector<Object> carried = {Object::kWateringCan, Object::kBox, Object::kVase, Object::kGuitar,
                                              Object::kNone};
  static const std::vector<Object> in_one_hand = {Object::kWateringCan, Object::kBox, Object::kGuitar, Object::kNone};
  static const std::vector<Object> pushed = {Object::kOfficeChair, Object::kShoppingCart, Object::kMower};
  static const std::vector<Object> chair = {Object::kOfficeChair};
  static const std::vector<Object> chair_or_none = {Object::kOfficeChair, Object::kNone};
  static const std::vector<Object> guitar = {Object::kGuitar};
  static const std::vector<Object> can = {Object::kWateringCan};
  static const std::vector<Object> none = {Object::kNone};
  switch (motion) {
    case SyntheticMotionKind::kPour:
      return on_table;
    case SyntheticMotionKind::kLift:
      return lifted;
    case SyntheticMotionKind::kWalk:
      return carried;
    case SyntheticMotionKind::kWave:
      return in_one_hand;
    case SyntheticMotionKind::kLean:
      return chair_or_none;
    case SyntheticMotionKind::kPush:
      return pushed;
    case SyntheticMotionKind::kSit:
    case SyntheticMotionKind::kRoll:
      return chair;
    case SyntheticMotionKind::kPlay:
      return guitar;
    case SyntheticMotionKind::kWater:
      return can;
    case SyntheticMotionKind::kSitOn:
    case SyntheticMotionKind::kLeanOn:
    case SyntheticMotionKind::kRun:
    case SyntheticMotionKind::kSlide:
    case SyntheticMotionKind::kReach:
    case SyntheticMotionKind::kWipe:
      break;
  }
  return none;
}

std::string object_names_of(SyntheticMotionKind motion) {
  std::vector<std::string> names;
  for (const SyntheticObjectKind object : objects_of(motion))
    names.emplace_back(choice_name<SyntheticObjectKind>(kSyntheticObjectKinds, object));
  return joined(names);
}

void describe(ConfigFields& f, SyntheticLight& s) {
  f.number("shading", s.shading, {.min = 0, .max = 1},
           "How much darker surfaces of human and object are that face away from the light");
  f.number("shadow", s.shadow, {.min = 0, .max = 1}, "How dark the shadow of human and object on the scene is");
}

void describe(ConfigFields& f, SyntheticFaults& s) {
  f.number("revealed", s.revealed, {.min = 0, .max = 1},
           "Strength of invented content where the human or the object was in an earlier frame");
  f.number("hands_fade", s.hands_fade, {.min = 0, .max = 1},
           "How far the hands fade into the background in the middle of the clip");
  f.number("appearance", s.appearance, {.min = 0, .max = 1}, "How far the human's colours change until the last frame");
}

void describe(ConfigFields& f, SyntheticMaskNoise& s) {
  f.number("grow_px", s.grow_px, {.min = -32, .max = 32},
           "How far masks reach beyond the truth, pixels; negative: short of it");
  f.number("jagged_px", s.jagged_px, {.min = 0, .max = 32}, "How far their boundaries are off here and there, pixels");
  f.number("dropped_share", s.dropped_share, {.min = 0, .max = 1}, "Share of masks after frame 0 that show nothing");
}

void describe(ConfigFields& f, SyntheticSettings& s) {
  f.choice("kind", s.kind, kSyntheticKinds,
           "A clip in a scene, or views: pictures of the human alone in several poses, for `hsi4d avatar fit`");
  f.integer("seed", s.seed, {.min = 0, .max = kLargestSeed}, "Seed of textures, arrangement and noise");
  f.integer("frames", s.frames, {.min = 2, .max = 100000}, "Frames of the clip");
  f.integer("clips", s.clips, {.min = 1, .max = 1000},
            "Clips of that many frames that follow one another, each with a camera of its own: a chain");
  f.rule({"clips", "kind"}, [&s]() -> std::string {
    return s.clips > 1 && s.kind == SyntheticKind::kViews ? "views are of no clip" : "";
  });
  f.number("frame_rate", s.frame_rate, {.min = 1, .max = 1000},
           "Frames a second; a lower rate gives larger steps between frames");
  f.integer("size_px", s.size_px, {.min = 16, .max = 8192}, "Width and height of a frame, pixels");
  f.integer("supersample", s.supersample, {.min = 1, .max = 8}, "Frames are rendered at this multiple and reduced");
  f.choice(
      "video", s.video, kSyntheticVideos,
      "How frames are kept: mp4: video.mp4, H.264 with a colour a pixel (4:4:4); mp4_420: four pixels share one, as "
      "generators write it; png: frames/, exact and without ffmpeg");
  f.integer("video_quality", s.video_quality, {.min = 0, .max = 51},
            "Constant rate factor of the H.264: 0 without loss but that of colours, 51 worst");
  f.rule({"video", "size_px"}, [&s]() -> std::string {
    if (s.video != SyntheticVideo::kMp4Shared || s.size_px % 2 == 0) return "";
    return "mp4_420 has blocks of 2x2 pixels, which size_px " + std::to_string(s.size_px) +
           " cannot be divided into; take an even size, or mp4";
  });
  f.choice("scene", s.scene, kSyntheticSceneKinds, "Where it happens; `hsi4d list scenes` tells what there is");
  f.choice("object", s.object, kSyntheticObjectKinds, "What is used");
  f.choice("motion", s.motion, kSyntheticMotionKinds, "What is done; each motion has its objects");
  f.rule({"motion", "object"}, [&s]() -> std::string {
    const auto& objects = objects_of(s.motion);
    if (std::find(objects.begin(), objects.end(), s.object) != objects.end()) return "";
    return "the motion " + std::string(choice_name<SyntheticMotionKind>(kSyntheticMotionKinds, s.motion)) +
           " makes no sense with the object " +
           std::string(choice_name<SyntheticObjectKind>(kSyntheticObjectKinds, s.object)) + "; it goes with " +
           object_names_of(s.motion);
  });
  f.string(
      "place", s.place,
      "Place of the scene where a motion is done that needs one; empty: the first there. `hsi4d list scenes` tells "
      "them");
  f.rule({"place", "motion", "scene"}, [&s] { return place_problem(s.scene, s.motion, s.place); });
  f.number("variation", s.variation, {.min = 0, .max = 1},
           "How far the seed changes when and how fast it is done, camera, start, clothes and light: 0 not at all");
  describe_files(f, s);
  f.integer("scene_gaussians", s.scene_gaussians, {.min = kFewestSceneGaussians, .max = 20000000},
            "Gaussians of the scene, at most; a few percent fewer are made");
  f.integer("avatar_gaussians", s.avatar_gaussians, {.min = 100, .max = 2000000}, "Gaussians of the human");
  f.integer("object_gaussians", s.object_gaussians, {.min = kFewestObjectGaussians, .max = 2000000},
            "Gaussians of the object, at most; a few percent fewer are made");
  f.number("avatar_difference", s.avatar_difference, {.min = 0, .max = 2},
           "How different the human in the video is from avatar.safetensors: 0 the same, 1 other Gaussians and colours "
           "off by some hundredths");
  f.object("light", s.light, "How frames are lit beyond what is baked into the colours");
  f.number("camera_drift", s.camera_drift, {.min = 0, .max = 5}, "How far the camera moves; 0: it stands");
  f.number("camera_distance", s.camera_distance, {.min = 0.2, .max = 5},
           "How far the camera is from what it looks at, of the distance as designed; smaller: nearer");
  describe_noise(f, s);
  f.object("masks", s.masks, "Faults of the masks");
  f.object("faults", s.faults, "Faults of generated videos");
  f.integer("views_cameras", s.views_cameras, {.min = 1, .max = 1000}, "Cameras in a ring, of kind views");
  f.integer("views_poses", s.views_poses, {.min = 1, .max = 1000}, "Poses that each of them sees");
}

std::string synthetic_settings_json(const SyntheticSettings& settings, const BodySettings& body) {
  SyntheticSettings copy = settings;  // a description binds to something that it could change
  BodySettings body_copy = body;
  ConfigFields fields;
  describe(fields, copy);
  if (body.kind != BodyKind::kProcedural || !body.shape.empty()) fields.object("body", body_copy, "The body model");
  return to_json(write_config(fields));
}

}  // namespace hsi4d
