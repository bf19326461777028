#include "pipelines/config/data_settings.h"

#include <algorithm>

#include "core/angles.h"
#include "core/text.h"
#include "splat/files/splat_file.h"

namespace hsi4d {

DataSettings dataset_inputs(const std::filesystem::path& folder) {
  namespace fs = std::filesystem;
  const fs::path base = fs::absolute(folder).lexically_normal();
  DataSettings data;
  data.scene = base / "scene.ply";
  data.avatar = base / "avatar.safetensors";
  if (!fs::exists(data.avatar) && fs::exists(base / "avatar.npz")) data.avatar = base / "avatar.npz";  // of version 1
  data.frames = base / (fs::exists(base / kDatasetVideo) ? kDatasetVideo : "frames");
  data.masks = base / "masks";
  data.camera = base / "camera.json";
  data.initial = base / "initial.json";
  if (fs::exists(base / "keypoints.json")) data.keypoints = base / "keypoints.json";
  if (fs::exists(base / "truth")) data.truth = base / "truth";
  if (fs::exists(base / "truth" / "surface.ply")) data.surface = base / "truth" / "surface.ply";
  std::error_code error;  // no such folder: no objects
  for (const fs::directory_entry& entry : fs::directory_iterator(base / "objects", error)) {
    if (has_splat_ending(entry.path().string()) && !is_hidden(entry.path().string()))
      data.objects.push_back({entry.path().stem().string(), {.gaussians = entry.path()}});
  }
  for (const fs::directory_entry& entry : fs::directory_iterator(base / "people", error)) {
    const fs::path avatar = entry.path() / "avatar.safetensors";
    if (fs::exists(avatar))
      data.people.push_back(
          {entry.path().filename().string(), {.avatar = avatar, .initial = entry.path() / "initial.json"}});
  }
  const auto by_name = [](const auto& a, const auto& b) { return a.first < b.first; };
  std::sort(data.objects.begin(), data.objects.end(), by_name);
  std::sort(data.people.begin(), data.people.end(), by_name);
  return data;
}

DataSettings data_of_person(const DataSettings& data, const PersonSettings& person) {
  DataSettings own = data;
  own.objects.clear();
  own.people.clear();
  own.avatar = person.avatar;
  own.initial = person.initial;
  own.motion = person.motion;
  own.keypoints = person.keypoints;
  return own;
}

std::string motion_file_of(const std::string& person) { return "motion_of_" + person + ".npz"; }

bool has_hint(const ObjectSettings& object) {
  return !object.first_mask.empty() || !object.first_box.empty() || !object.first_clicks.empty();
}

void describe(ConfigFields& f, JointSettings& s) {
  constexpr double kFarthest = 1e6;  // metres
  f.choice("type", s.type, kJointTypes,
           "free: it moves as it likes; hinge: it turns about the axis; slide: it moves along it");
  f.string("parent", s.parent, "The object, named before, that has the axis; empty: the scene");
  f.numbers("axis", s.axis, {.min = -kFarthest, .max = kFarthest},
            "Direction of the axis, of any length, in the parent's frame");
  f.numbers("origin", s.origin, {.min = -kFarthest, .max = kFarthest},
            "A point of a hinge's axis, in the parent's frame (of an object: relative to its centroid), metres");
  f.numbers("limits", s.limits, {.min = -kFarthest, .max = kFarthest},
            "How far it goes from where it is in frame 0: low, high, radians or metres; empty: any way", {0, 2});
  f.rule({"axis"}, [&s]() -> std::string {
    const bool is_zero = s.axis[0] == 0 && s.axis[1] == 0 && s.axis[2] == 0;
    return is_zero ? "an axis of length 0 has no direction" : "";
  });
  f.rule({"limits", "type"}, [&s]() -> std::string {
    if (s.limits.empty()) return "";
    if (s.limits.size() == 1 || !(s.limits[0] <= 0 && s.limits[1] >= 0 && s.limits[0] < s.limits[1]))
      return "limits are two numbers, low and high, low <= 0 <= high: 0 is where the object is in frame 0";
    return s.type == JointType::kHinge && (s.limits[0] < -kPi || s.limits[1] > kPi)
               ? "a hinge turns by half a turn at most in either direction; allowed: -3.14159 to 3.14159"
               : "";
  });
  f.rule({"type", "parent", "axis", "origin", "limits"}, [&s]() -> std::string {
    const JointSettings none;
    const bool is_bare = s.parent.empty() && s.limits.empty() && s.axis == none.axis && s.origin == none.origin;
    return s.type != JointType::kFree || is_bare
               ? ""
               : "an object that is free has no parent, axis, origin and limits; allowed: hinge, slide";
  });
  f.rule({"type", "origin"}, [&s]() -> std::string {
    return s.type != JointType::kSlide || s.origin == JointSettings().origin
               ? ""
               : "a slide has a direction alone; leave the origin out";
  });
}

namespace {

/// What is wrong with the parents of joints: "" or words.
std::string parent_problem(const ConfigMap<ObjectSettings>& objects) {
  std::vector<std::string> before;
  for (const auto& [name, object] : objects) {
    const std::string& parent = object.joint.parent;
    if (!parent.empty() && std::find(before.begin(), before.end(), parent) == before.end())
      return "the joint of \"" + name + "\" has the parent \"" + parent +
             "\", which is no object that is named before; allowed: " +
             (before.empty() ? "\"\", the scene" : joined(before) + ", or \"\", the scene");
    before.push_back(name);
  }
  return "";
}

}  // namespace

void describe(ConfigFields& f, ObjectSettings& s) {
  f.path("gaussians", s.gaussians, {.must_exist = true},
         "Its Gaussians (" + joined(splat_endings(), " or ") + "), relative to the centroid of their means")
      .required();
  f.path("first_mask", s.first_mask, {.must_exist = true},
         "Its mask in frame 0, for sources.masks.program \"embedded\"; empty: as the state of frame 0 shows it");
  f.numbers("first_box", s.first_box, {}, "Instead: x0, y0, x1, y1 of a box around it, pixels of the video");
  f.numbers("first_clicks", s.first_clicks, {}, "Instead: x, y of a pixel on it, or of several, pixels of the video");
  f.rule({"first_mask", "first_box", "first_clicks"}, [&s]() -> std::string {
    const int given = (s.first_mask.empty() ? 0 : 1) + (s.first_box.empty() ? 0 : 1) + (s.first_clicks.empty() ? 0 : 1);
    return given > 1 ? "first_mask, first_box and first_clicks say the same; give one of them" : "";
  });
  f.rule({"first_box"}, [&s]() -> std::string {
    return s.first_box.empty() || s.first_box.size() == 4 ? "" : "a box has four numbers: x0, y0, x1, y1";
  });
  f.rule({"first_clicks"},
         [&s]() -> std::string { return s.first_clicks.size() % 2 == 0 ? "" : "a click has two numbers, x and y"; });
  f.object("joint", s.joint, "What it hangs on, if it does not move freely");
}

void describe(ConfigFields& f, PersonSettings& s) {
  f.path("avatar", s.avatar, {.must_exist = true}, "As data.avatar").required();
  f.path("initial", s.initial, {.must_exist = true}, "As data.initial, of a person alone").required();
  f.path("motion", s.motion, {.must_exist = true}, "As data.motion");
  f.path("keypoints", s.keypoints, {.must_exist = true}, "As data.keypoints, of the same points");
}

void describe(ConfigFields& f, LensSettings& s) {
  constexpr double kMost = 10;
  f.number("k1", s.lens.k1, {.min = -kMost, .max = kMost}, "Radial, of the squared radius at depth 1");
  f.or_word("k1", "estimate", s.estimate_k1);
  f.number("k2", s.lens.k2, {.min = -kMost, .max = kMost}, "Radial, of its second power");
  f.number("k3", s.lens.k3, {.min = -kMost, .max = kMost}, "Radial, of its third power");
  f.number("p1", s.lens.p1, {.min = -kMost, .max = kMost}, "Tangential");
  f.number("p2", s.lens.p2, {.min = -kMost, .max = kMost}, "Tangential");
}

void describe(ConfigFields& f, DataSettings& s) {
  f.path("scene", s.scene, {.must_exist = true},
         "The static scene (" + joined(splat_endings(), " or ") + "), metres, z up");
  f.map("objects", s.objects, "Rigid objects that move, by name");
  f.rule({"objects"}, [&s] { return parent_problem(s.objects); });
  f.map("people", s.people,
        "People beside the one whose avatar, initial, motion and keypoints stand here, by name: it names the folder of "
        "their masks, beside human/");
  f.path("avatar", s.avatar, {.must_exist = true}, "The human's Gaussians and skinning weights (.safetensors)");
  f.path("frames", s.frames, {.must_exist = true},
         "Video file, or folder of .png files sorted by name; as large as the camera's image or larger");
  f.path("masks", s.masks, {.must_exist = true},
         "Folder with human/, one folder per object and per further person, grey .png files named as the frames; or "
         "human.mp4 and so on");
  f.number("video_rate", s.video_rate, {.min = 0, .max = 1e4}, "Frames per second of the video; 0: as its file says");
  f.number("frame_rate", s.frame_rate, {.min = 0, .max = 1e4},
           "Frames per second that are kept; estimated poses are resampled; 0: all");
  f.path("camera", s.camera, {.must_exist = true}, "Camera of frame 0 (.json)");
  f.object("lens", s.lens,
           "How the lens of the video bends, as OpenCV has it: frames, masks and keypoints are straightened");
  f.path("initial", s.initial, {.must_exist = true}, "State of frame 0 and estimated poses (.json)");
  f.path("motion", s.motion, {.must_exist = true},
         "Motion estimated from the video (.npz); replaces the poses of `initial` after frame 0");
  f.choice("motion_align", s.motion_align, kMotionAligns,
           "How `motion` is aligned with frame 0: moved and turned about the vertical (heading), or freely (rotation)");
  f.path("keypoints", s.keypoints, {.must_exist = true},
         "2D keypoints of the human by frame, for the losses keypoints_2d and bone_directions: a .json file, or "
         "OpenPose's folder");
  f.path("keypoint_joints", s.keypoint_joints, {.must_exist = true},
         "List of the joints that the detector's points stand for (.json); empty: of a known set of points");
  f.path("tracks", s.tracks, {.must_exist = true},
         "Points that a tracker followed through the video, for the loss tracks (.npz)");
  f.path(
      "depth_maps", s.depth_maps, {.must_exist = true},
      "Folder of depths or disparities of any scale and shift, for the loss depth_map: a .png, .exr, .npy or .npz file "
      "with the name of each frame");
  f.path("depth_confidence", s.depth_confidence, {.must_exist = true},
         "Folder of how sure the depth maps are, likewise: a pixel with twice the number counts twice; empty: alike");
  f.path("contacts", s.contacts, {.must_exist = true},
         "Which part of the body touches what in which frames, for the loss annotated_contact (.json)");
  f.path("truth", s.truth, {},
         "Folder with motion.npz, objects.npz, cameras.json to compare the result with; may be missing");
  f.path("surface", s.surface, {},
         "Mesh of what is solid (.obj, .ply, .glb), metres, world: only for measuring penetration");
  f.number("mask_threshold", s.mask_threshold, {.above = 0, .max = 1}, "Coverage from which a pixel belongs to a mask");
  f.integer("mask_margin_px", s.mask_margin_px, {.min = 0, .max = 64},
            "Pixels by which masks grow before they hide what is not scene from the camera stage");
}

}  // namespace hsi4d
