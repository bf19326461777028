#include "pipelines/config/synthetic_settings.h"

#include <algorithm>

#include "core/text.h"
#include "pipelines/config/masks.h"
#include "pipelines/config/synthetic_places.h"
#include "splat/files/splat_file.h"

namespace hsi4d {
namespace {

void describe_noise(ConfigFields& f, SyntheticSettings& s) {
  f.number("pose_noise_deg", s.pose_noise_deg, {.min = 0, .max = 90},
           "RMS error of each body joint of the initial motion, new in each frame, degrees");
  f.number("pose_bias_deg", s.pose_bias_deg, {.min = 0, .max = 90},
           "RMS error of a joint that stays for seconds: it turns once in 8 s, degrees");
  f.number("pose_drift_deg", s.pose_drift_deg, {.min = 0, .max = 90},
           "RMS error of a joint that grows to this in the last frame, degrees");
  f.number("hand_noise_share", s.hand_noise_share, {.min = 0, .max = 2},
           "These three errors of finger joints, as a share of a body joint's");
  f.number("root_noise_deg", s.root_noise_deg, {.min = 0, .max = 90},
           "RMS error of the whole body's orientation, degrees");
  f.number("root_noise_m", s.root_noise_m, {.min = 0, .max = 2},
           "Standard deviation of each coordinate of the root, metres");
  f.number("root_drift_m", s.root_drift_m, {.min = 0, .max = 10},
           "The same of an error that grows to this in the last frame");
  f.number("object_noise_deg", s.object_noise_deg, {.min = 0, .max = 180},
           "RMS error of the object in initial_objects.npz, degrees; this or the next makes that file");
  f.number("object_noise_m", s.object_noise_m, {.min = 0, .max = 2},
           "Standard deviation of each coordinate of the object, metres");
}

void describe_files(ConfigFields& f, SyntheticSettings& s) {
  f.path("scene_file", s.scene_file, {.must_exist = true},
         "Gaussians in place of the scene (" + joined(splat_endings(), " or ") + "), z up; empty: the scene is made");
  f.numbers("scene_place", s.scene_place, {.min = -1e6, .max = 1e6},
            "Floor point of scene_file where the person acts, after scene_scale, metres");
  f.number("scene_turn_deg", s.scene_turn_deg, {.min = -360, .max = 360},
           "Turns scene_file about z through scene_place, degrees");
  f.number("scene_scale", s.scene_scale, {.above = 0, .max = 1e6}, "Metres per unit of scene_file");
  f.path("object_file", s.object_file, {.must_exist = true},
         "Gaussians in place of the object, z up, held as `object` is; empty: the object is made");
  f.numbers("object_grip", s.object_grip, {.min = -1e6, .max = 1e6},
            "Middle of its handle in object_file's coordinates; empty: middle of its top", {0, 3});
  f.number("object_turn_deg", s.object_turn_deg, {.min = -360, .max = 360},
           "Turns object_file about z until its front is +x, degrees");
  f.number("object_scale", s.object_scale, {.above = 0, .max = 1e6}, "Metres per unit of object_file");
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
  static const std::vector<Object> gate = {Object::kGate};
  static const std::vector<Object> none = {Object::kNone};
  switch (motion) {
    case SyntheticMotionKind::kPour:
    case SyntheticMotionKind::kPutDown:
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
    case SyntheticMotionKind::kOpen:
      return gate;
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

namespace {

bool is_of_further_person(SyntheticMotionKind motion) {
  return motion == SyntheticMotionKind::kWalk || motion == SyntheticMotionKind::kWave ||
         motion == SyntheticMotionKind::kLean;
}

}  // namespace

void describe(ConfigFields& f, SyntheticPerson& s) {
  f.choice("motion", s.motion, kSyntheticMotionKinds, "What the person does: walk, wave or lean");
  f.rule({"motion"}, [&s]() -> std::string {
    return is_of_further_person(s.motion) ? "" : "needs an object or a place; allowed: walk, wave, lean";
  });
  f.numbers("beside", s.beside, {.min = -100, .max = 100},
            "x, y from where the first person acts to where this one does, metres");
  f.number("turn_deg", s.turn_deg, {.min = -360, .max = 360}, "Turns what it does about z, degrees");
  f.number("begin", s.begin, {.min = 0, .max = 1e4}, "Seconds of what it does that are over in frame 0");
  f.integer("seed", s.seed, {.min = 0, .max = kLargestSeed},
            "Added to the seed of the dataset, for its Gaussians, its clothes and its noise");
}

void describe(ConfigFields& f, SyntheticLight& s) {
  f.number("shading", s.shading, {.min = 0, .max = 1},
           "How much darker human and object are where they face away from the light");
  f.number("shadow", s.shadow, {.min = 0, .max = 1}, "Darkness of the shadow of human and object");
}

void describe(ConfigFields& f, SyntheticFaults& s) {
  f.number("revealed", s.revealed, {.min = 0, .max = 1},
           "Strength of invented content where human or object were in an earlier frame");
  f.number("hands_fade", s.hands_fade, {.min = 0, .max = 1}, "How far hands fade into the background in mid-clip");
  f.number("appearance", s.appearance, {.min = 0, .max = 1}, "How far the human's colours change by the last frame");
}

void describe(ConfigFields& f, SyntheticMaskNoise& s) {
  f.number("grow_px", s.grow_px, {.min = -32, .max = 32},
           "How far masks reach beyond the truth, pixels; negative: short of it");
  f.number("jagged_px", s.jagged_px, {.min = 0, .max = 32}, "How far their boundaries are off in places, pixels");
  f.number("dropped_share", s.dropped_share, {.min = 0, .max = 1}, "Share of masks after frame 0 that are empty");
}

void describe(ConfigFields& f, SyntheticSettings& s) {
  f.choice("kind", s.kind, kSyntheticKinds,
           "A clip in a scene; views: pictures of the human alone in several poses, for `hsi4d avatar fit`; photos: "
           "pictures of a scene or an object with their cameras, for `hsi4d reconstruct`");
  f.integer("seed", s.seed, {.min = 0, .max = kLargestSeed}, "Seed of textures, arrangement and noise");
  f.integer("frames", s.frames, {.min = 2, .max = 100000}, "Frames of the clip");
  f.integer("clips", s.clips, {.min = 1, .max = 1000},
            "Number of consecutive clips, each with its own camera: a chain");
  f.rule({"clips", "kind"}, [&s]() -> std::string {
    return s.clips > 1 && s.kind != SyntheticKind::kClip ? "views and photos are of no clip" : "";
  });
  f.number("frame_rate", s.frame_rate, {.min = 1, .max = 1000},
           "Frames per second; fewer: larger steps between frames");
  f.integer("size_px", s.size_px, {.min = 16, .max = 8192}, "Width and height of a frame, pixels");
  f.integer("supersample", s.supersample, {.min = 1, .max = 8}, "Frames are rendered at this multiple and reduced");
  f.choice("video", s.video, kSyntheticVideos,
           "mp4: H.264 with a colour per pixel (4:4:4); mp4_420: four pixels share one, as generators write it; png: "
           "frames/, exact, without ffmpeg");
  f.integer("video_quality", s.video_quality, {.min = 0, .max = 51},
            "Constant rate factor of H.264: 0 lossless but for colours, 51 worst");
  f.rule({"video", "size_px"}, [&s]() -> std::string {
    if (s.video != SyntheticVideo::kMp4Shared || s.size_px % 2 == 0) return "";
    return "mp4_420 has blocks of 2x2 pixels, which size_px " + std::to_string(s.size_px) +
           " cannot be divided into; take an even size, or mp4";
  });
  f.choice("scene", s.scene, kSyntheticSceneKinds, "The scene; `hsi4d list scenes` describes them");
  f.choice("object", s.object, kSyntheticObjectKinds, "The object in use");
  f.choice("motion", s.motion, kSyntheticMotionKinds, "The action; each motion has its objects");
  f.rule({"motion", "object"}, [&s]() -> std::string {
    const auto& objects = objects_of(s.motion);
    if (std::find(objects.begin(), objects.end(), s.object) != objects.end()) return "";
    return "the motion " + std::string(choice_name<SyntheticMotionKind>(kSyntheticMotionKinds, s.motion)) +
           " makes no sense with the object " +
           std::string(choice_name<SyntheticObjectKind>(kSyntheticObjectKinds, s.object)) + "; it goes with " +
           object_names_of(s.motion);
  });
  f.string("place", s.place, "Place of a motion that needs one; empty: the first. `hsi4d list scenes` names them");
  f.rule({"place", "motion", "scene"}, [&s] { return place_problem(s.scene, s.motion, s.place); });
  f.map("people", s.people, "People beside the first one, by name, in clothes of their own");
  f.rule({"people", "clips", "kind", "object"}, [&s]() -> std::string {
    if (s.people.empty()) return "";
    for (const auto& [name, person] : s.people) {
      if (name == kHumanMasks || name == choice_name<SyntheticObjectKind>(kSyntheticObjectKinds, s.object))
        return "\"" + name + "\" is the name of the first person's or the object's masks; use another name";
    }
    if (s.kind != SyntheticKind::kClip) return "views and photos show one person";
    return s.clips > 1 ? "the clips of a chain show one person" : "";
  });
  f.number("variation", s.variation, {.min = 0, .max = 1},
           "How far the seed varies timing, camera, start, clothes and light; 0: not at all");
  describe_files(f, s);
  f.integer("scene_gaussians", s.scene_gaussians, {.min = kFewestSceneGaussians, .max = 20000000},
            "Gaussians of the scene, at most; a few percent fewer are made");
  f.integer("avatar_gaussians", s.avatar_gaussians, {.min = 100, .max = 2000000}, "Gaussians of the human");
  f.integer("object_gaussians", s.object_gaussians, {.min = kFewestObjectGaussians, .max = 2000000},
            "Gaussians of the object, at most; a few percent fewer are made");
  f.number(
      "avatar_difference", s.avatar_difference, {.min = 0, .max = 2},
      "How far the human in the video differs from avatar.safetensors; 1: other Gaussians, colours off by hundredths");
  f.object("light", s.light, "How frames are lit beyond what is baked into the colours");
  f.number("camera_drift", s.camera_drift, {.min = 0, .max = 5}, "How far the camera moves; 0: not at all");
  f.number("camera_distance", s.camera_distance, {.min = 0.2, .max = 5},
           "Camera distance, as a multiple of the designed one");
  describe_noise(f, s);
  f.object("masks", s.masks, "Faults of the masks");
  f.object("faults", s.faults, "Faults of generated videos");
  f.integer("views_cameras", s.views_cameras, {.min = 1, .max = 1000}, "Cameras in a ring (kind views)");
  f.integer("views_poses", s.views_poses, {.min = 1, .max = 1000}, "Poses that each of them sees (kind views)");
  f.integer("photos", s.photos, {.min = 1, .max = 100000}, "Pictures at most (kind photos)");
  f.choice("photos_of", s.photos_of, kSyntheticSubjects, "What they show (kind photos)");
}

std::string synthetic_settings_json(const SyntheticSettings& settings, const BodySettings& body) {
  SyntheticSettings copy = settings;  // a description binds to something that it could change
  BodySettings body_copy = body;
  ConfigFields fields;
  describe(fields, copy);
  if (body.kind != BodyKind::kProcedural || !body.shape.empty()) fields.object("body", body_copy, "The body model");
  ConfigValue tree = write_config(fields);
  std::erase_if(tree.members, [](const ConfigMember& member) {  // as it was written before there were some
    return member.key == "people" && member.value.members.empty();
  });
  return to_json(tree);
}

}  // namespace hsi4d
