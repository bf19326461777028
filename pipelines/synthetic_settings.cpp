#include "pipelines/synthetic_settings.h"

namespace hsi4d {
namespace {

/// The largest whole number that every JSON tool keeps (RFC 8259, section 6).
constexpr std::int64_t kLargestSeed = (std::int64_t{1} << 53) - 1;

}  // namespace

void describe(ConfigFields& f, SyntheticSettings& s) {
  f.choice("kind", s.kind, kSyntheticKinds,
           "A clip in a room, or views: pictures of the human alone in several poses, for `hsi4d avatar fit`");
  f.integer("seed", s.seed, {.min = 0, .max = kLargestSeed}, "Seed of textures, arrangement and noise");
  f.integer("frames", s.frames, {.min = 1, .max = 100000}, "Frames of the clip");
  f.number("frame_rate", s.frame_rate, {.min = 1, .max = 1000},
           "Frames a second; a lower rate gives larger steps between frames");
  f.integer("size_px", s.size_px, {.min = 16, .max = 8192}, "Width and height of a frame, pixels");
  f.integer("supersample", s.supersample, {.min = 1, .max = 8}, "Frames are rendered at this multiple and reduced");
  f.choice("object", s.object, kSyntheticObjectKinds, "What is carried");
  f.integer("scene_gaussians", s.scene_gaussians, {.min = kFewestRoomGaussians, .max = 20000000},
            "Gaussians of the room, at most; a few percent fewer are made");
  f.integer("avatar_gaussians", s.avatar_gaussians, {.min = 100, .max = 2000000}, "Gaussians of the human");
  f.integer("object_gaussians", s.object_gaussians, {.min = kFewestObjectGaussians, .max = 2000000},
            "Gaussians of the object, at most; a few percent fewer are made");
  f.number("camera_drift", s.camera_drift, {.min = 0, .max = 5}, "How far the camera moves; 0: it stands");
  f.number("pose_noise_deg", s.pose_noise_deg, {.min = 0, .max = 90},
           "Root mean square angle by which each body joint of the initial motion is off, degrees");
  f.number("hand_noise_share", s.hand_noise_share, {.min = 0, .max = 2}, "The same of finger joints, as a share of it");
  f.number("root_noise_deg", s.root_noise_deg, {.min = 0, .max = 90}, "The same of the whole body's orientation");
  f.number("root_noise_m", s.root_noise_m, {.min = 0, .max = 2},
           "Standard deviation of each coordinate of the initial motion's root, metres");
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
