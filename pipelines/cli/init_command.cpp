// `hsi4d init`: a dataset of a video of a person, in a scene or without one.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "body/procedural_body.h"
#include "core/angles.h"
#include "core/camera_file.h"
#include "core/check.h"
#include "core/config_file.h"
#include "core/file.h"
#include "core/folder_in_making.h"
#include "core/image_io.h"
#include "core/lens.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/size_text.h"
#include "core/text.h"
#include "pipelines/cli/avatar_command.h"
#include "pipelines/cli/first_state.h"
#include "pipelines/cli/info_command.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/scene_options.h"
#include "pipelines/cli/text.h"
#include "pipelines/config/run_config.h"
#include "pipelines/config/shipped_configs.h"
#include "pipelines/draw/plate_mark.h"
#include "pipelines/footage/person_camera.h"
#include "pipelines/footage/plate.h"
#include "pipelines/input/body_files.h"
#include "pipelines/input/frame_cameras.h"
#include "pipelines/input/straight_keypoints.h"
#include "splat/files/splat_file.h"

namespace hsi4d::cli {

namespace {

namespace fs = std::filesystem;

struct InitArguments {
  std::string video, keypoints, masks, out;
  std::string scene;   ///< empty: of the video's background
  std::string avatar;  ///< empty: made
  std::string camera;  ///< empty: from the keypoints
  std::optional<double> focal_px, camera_height, lens_k1, video_rate, frame_rate;
  std::optional<int> longest_side_px, threads;
  bool check = false;  ///< look at what is there, and write nothing
};

const std::string kInitCommand = "hsi4d init: ";
constexpr int kLongestSide = 512;
constexpr double kWallBehind = 1.5;      // of how far the person goes from the camera
constexpr double kNearestWall = 4;       // metres
constexpr double kMarginOfMoving = 0.2;  // of the longer side: what such a camera may come to see
constexpr double kLeastAgreeing = 0.5;

DataSettings data_of(const InitArguments& a) {
  DataSettings data;
  data.frames = a.video;
  data.keypoints = a.keypoints;
  data.masks = a.masks;
  data.video_rate = a.video_rate.value_or(0);
  data.frame_rate = a.frame_rate.value_or(0);
  return data;
}

/// A camera of the size and focal length of the pictures that a run compares: the one that is given, or else the
/// video's, reduced.
Camera camera_of_images(const InitArguments& a, const FrameSource& frames) {
  if (!a.camera.empty()) {
    const Camera camera = first_camera(a.camera, frames);
    if (!(camera_center_world(camera)[2] > 0))
      throw DataError(a.camera + ": the camera is " + number_text(camera_center_world(camera)[2]) +
                      " m above the ground, which is at z = 0; allowed: above 0");
    return a.longest_side_px ? reduced_camera(camera, *a.longest_side_px) : camera;
  }
  const Image frame = frames.read(0);
  const double focal = a.focal_px.value_or(usual_focal_length(frame.width(), frame.height()));
  return reduced_camera({frame.width(), frame.height(), focal, focal, frame.width() / 2.0, frame.height() / 2.0, {}},
                        a.longest_side_px.value_or(kLongestSide));
}

/// Throws UserError for one that turns back within the picture.
Lens lens_of(const InitArguments& a, const Camera& images) {
  const Lens lens{.k1 = a.lens_k1.value_or(0)};
  if (!covers_picture(lens, images))
    throw UserError(kInitCommand + "--lens-k1 is " + number_text(lens.k1) +
                    ": such a lens turns back before an edge of the picture (" + size_text(images) + ", focal length " +
                    number_text(images.fx) + " px); allowed: numbers nearer to 0");
  return lens;
}

Avatar avatar_of(const InitArguments& a) {
  return a.avatar.empty() ? surface_avatar(procedural_body(), AvatarOptions().settings) : read_person(a.avatar);
}

/// What the keypoints say of camera and person. Of a camera that moves, those of frame 0 alone count.
PersonCamera look_for_person(const InitArguments& a, Keypoints keypoints, const Avatar& avatar, const Camera& images,
                             bool is_still) {
  if (!is_still) keypoints.frames.resize(1);
  const std::string name = a.keypoints + (is_still ? "" : ": frame 0, which counts alone as the camera moves");
  const PersonCamera found = a.camera.empty() ? camera_of_person(keypoints, avatar, images, a.camera_height, name)
                                              : placed_person(keypoints, avatar, images, name);
  if (found.agreeing < kLeastAgreeing)
    log_warning(a.keypoints + ": a person who stands or sits would show only " + rounded(100 * found.agreeing, 2) +
                " % of the points where they are; is this camera right? Give --camera-height, --focal-px or --camera");
  return found;
}

/// Where the person is first seen to stand.
Vector2<double> first_place(const PersonCamera& found, const std::string& keypoints) {
  for (std::size_t t = 0; t < found.places.size(); ++t) {
    if (!found.places[t]) continue;
    if (t > 0)
      log_warning(keypoints + ": no ankles are on the ground in frame 0; the first state has the person of frame " +
                  std::to_string(t));
    return *found.places[t];
  }
  throw DataError(keypoints + ": the ankles are nowhere on the ground before the camera");
}

ConfigValue data_section(const InitArguments& a) {
  const auto from_out = [&a](const std::string& file) {
    return ConfigValue::make_string(fs::proximate(fs::absolute(file), fs::absolute(a.out)).generic_string());
  };
  ConfigValue data = ConfigValue::make_object();
  data.add("scene", a.scene.empty() ? ConfigValue::make_string("scene.ply") : from_out(a.scene));
  data.add("avatar", a.avatar.empty() ? ConfigValue::make_string("avatar.safetensors") : from_out(a.avatar));
  data.add("frames", from_out(a.video));
  data.add("masks", from_out(a.masks));
  data.add("camera", ConfigValue::make_string("camera.json"));
  data.add("initial", ConfigValue::make_string("initial.json"));
  data.add("keypoints", from_out(a.keypoints));
  if (a.lens_k1) {
    ConfigValue lens = ConfigValue::make_object();
    lens.add("k1", ConfigValue::make_number(*a.lens_k1));
    data.add("lens", std::move(lens));
  }
  if (a.video_rate) data.add("video_rate", ConfigValue::make_number(*a.video_rate));
  if (a.frame_rate) data.add("frame_rate", ConfigValue::make_number(*a.frame_rate));
  return data;
}

/// configs/from_video.json, with what was found, without what there is no use for: a camera that stands still is not
/// followed, and bones need landmarks.
ConfigValue config_of(const InitArguments& a, RunConfig shipped, bool is_still, bool has_landmarks,
                      const std::vector<LossDescription>& losses) {
  if (is_still) std::erase_if(shipped.stages, [](const auto& stage) { return stage.first == "camera"; });
  for (auto& [name, stage] : shipped.stages) {
    if (!has_landmarks) std::erase_if(stage.losses, [](const auto& loss) { return loss.first == "bone_directions"; });
  }
  ConfigValue config = ConfigValue::make_object();
  config.add("name", ConfigValue::make_string(fs::path(a.video).stem().string()));
  config.add("data", data_section(a));
  return merged(dataset_sections(shipped, losses), std::move(config));
}

RunConfig shipped_config(const std::vector<LossDescription>& losses) {
  const std::map<std::string, std::string> texts = shipped_config_texts();
  ConfigProblems problems;
  const ConfigValue tree =
      load_config_text(texts.at("from_video.json"), "from_video.json", fs::current_path(), {}, problems, texts);
  return read_run_config(tree, losses, problems, ConfigUse::kStages);
}

/// Upright, facing the camera; stages find the pose.
StandingPlace first_standing(const Vector2<double>& at, const Camera& camera) {
  const Vector2<double> to_camera = camera_center_world(camera).head<2>() - at;
  return {at[0], at[1], std::atan2(to_camera[1], to_camera[0]) / kDegree, 0};
}

std::string told(const InitArguments& a, const PersonCamera& found, const Plate& plate) {
  const std::string unrest = rounded(plate.unrest_px, 2) + " px";
  if (!a.scene.empty())
    return (fs::path(a.out) / "config.json").generic_string() + ": the camera " +
           (plate.is_still ? "stands still (" : "moves (") + unrest + ")" +
           (plate.is_still ? "" : " and is followed in the scene") + "\n";
  const std::string camera = (fs::path(a.out) / "config.json").generic_string() + ": the camera is " +
                             rounded(found.height, 3) + " m above the ground and looks " +
                             rounded(std::abs(found.pitch_deg), 2) + " degrees " +
                             (found.pitch_deg < 0 ? "up" : "down");
  const std::string share = rounded(100 * plate.seen, 3) + " % of the background";
  if (plate.is_still) return camera + "; it stands still (" + unrest + "). " + share + " is seen\n";
  return camera + " in frame 0; it moves (" + unrest + ") and is followed against frame 0, which shows " + share + "\n";
}

void check_options(const InitArguments& a) {
  check_rate(a.video_rate, kInitCommand + "--video-rate");
  check_rate(a.frame_rate, kInitCommand + "--frame-rate");
  check_range(a.focal_px, kInitCommand + "--focal-px", 1, 1e6);
  check_range(a.camera_height, kInitCommand + "--camera-height", 0.1, 100);
  check_range(a.lens_k1, kInitCommand + "--lens-k1", -10, 10);
  check_range(a.longest_side_px, kInitCommand + "--longest-side-px", 64, 4096);
  if (!(a.camera.empty() && a.scene.empty()) && (a.focal_px || a.camera_height))
    throw UserError(kInitCommand +
                    "the camera in a scene, or of --camera, has a focal length and a height; leave out --focal-px and "
                    "--camera-height");
  if (!a.scene.empty() && a.camera.empty() && !a.check)
    throw UserError(kInitCommand +
                    "--scene needs --camera: where the camera of frame 0 is in it, as hsi4d locate says");
}

/// Writes the background, and a scene of it.
void write_plate(const Plate& plate, const PersonCamera& found, const RenderSettings& render,
                 const FolderInMaking& out) {
  const PlateScene walls{.wall_distance = std::max(kNearestWall, kWallBehind * far_distance(found)),
                         .margin = plate.is_still ? 0 : kMarginOfMoving};
  write_image(out.file("plate.png"), plate.image);
  write_plate_splats(out.file("scene.ply"), scene_of_plate(plate.image, found.camera, walls, render));
}

/// Writes the dataset. Returns what the command prints.
/// Throws UserError for options and files, DataError as readers of video, masks and keypoints do, and as
/// camera_of_person and plate_of.
std::string write_footage(const InitArguments& a, const std::vector<LossDescription>& losses) {
  FolderInMaking out(a.out);
  const DataSettings data = data_of(a);
  ClipVideo video = open_video(data, {});
  Keypoints keypoints = read_keypoints(data, video.frames);
  const Avatar avatar = avatar_of(a);
  const RunConfig shipped = shipped_config(losses);
  const Camera images = camera_of_images(a, video.frames);
  video.lens = lens_of(a, images);
  video.camera = images;
  straighten(video.lens, images, keypoints);
  if (!a.scene.empty()) read_drawn(a.scene, shipped.render);  // a wrong file is refused before the work
  const Plate plate = plate_of(video, images);
  const PersonCamera found = look_for_person(a, keypoints, avatar, images, plate.is_still);
  if (a.scene.empty()) write_plate(plate, found, shipped.render, out);
  write_camera(out.file("camera.json"), found.camera);
  if (a.avatar.empty()) write_avatar(out.file("avatar.safetensors"), avatar);
  const double rate = video.frames.frame_rate();
  write_first_state(out, avatar, first_standing(first_place(found, a.keypoints), found.camera),
                    rate > 0 ? rate : Motion().frame_rate);
  write_text_file(out.file("config.json"),
                  to_json(config_of(a, shipped, plate.is_still, keypoints.has_landmarks(), losses)));
  out.commit();
  return told(a, found, plate);
}

/// Options, the video and the files that are there, before keypoints and masks are. Returns what the command prints.
std::string check_footage(const InitArguments& a, const std::vector<LossDescription>& losses) {
  const FrameSource frames(a.video,
                           {a.video_rate.value_or(0), a.frame_rate.value_or(0), "--video-rate", "--frame-rate"});
  const bool is_to_be_located = !a.scene.empty() && a.camera.empty();
  if (!is_to_be_located) lens_of(a, camera_of_images(a, frames));
  if (!a.avatar.empty()) read_person(a.avatar);
  if (!a.scene.empty()) read_drawn(a.scene, shipped_config(losses).render);
  return video_info(a.video, a.video_rate, a.frame_rate);
}

std::string init_command(const InitArguments& a, const std::vector<LossDescription>& losses) {
  check_options(a);
  if (a.check) return check_footage(a, losses);
  const int threads = a.threads.value_or(0);
  std::string text;
  with_threads(threads > 0 ? threads : thread_count(), [&] { text = write_footage(a, losses); });
  return text;
}

}  // namespace

void add_init(CLI::App& app, Program& program) {
  InitArguments& a = program.options<InitArguments>();
  CLI::App& command = *app.add_subcommand(
      "init", "A dataset of a person's video, with a scene or without: camera, background, first state, config");
  command.add_option("VIDEO", a.video, "A video, or a folder of frames")->required();
  command.add_option("--keypoints", a.keypoints, "Of the person, in all frames, as for data.keypoints")
      ->type_name("F")
      ->required();
  command.add_option("--masks", a.masks, "A folder with human/, as for data.masks")->type_name("DIR")->required();
  command.add_option("--scene", a.scene, "Gaussians, metres, z up, the ground at z = 0; default: of the background")
      ->type_name("F");
  command.add_option("--avatar", a.avatar, "Gaussians of the person; default: made, 1.72 m tall")
      ->type_name("F.safetensors");
  command.add_option("--camera", a.camera, "Where the camera is, z up, the ground at z = 0; default: by the keypoints")
      ->type_name("F.json");
  command
      .add_option("--camera-height", a.camera_height, "Metres above the ground; default: by the keypoints, near 1.5")
      ->type_name("M");
  command.add_option("--focal-px", a.focal_px, "Focal length, pixels of the video; default: its diagonal")
      ->type_name("F");
  command.add_option("--lens-k1", a.lens_k1, "Radial bend of the lens, as data.lens.k1; default: 0")->type_name("K");
  command.add_option("--video-rate", a.video_rate, "Frames a second of the video; needed of a folder")->type_name("HZ");
  command.add_option("--frame-rate", a.frame_rate, "Frames a second that are kept; default: all")->type_name("HZ");
  command
      .add_option("--longest-side-px", a.longest_side_px,
                  "Of the images that are compared; default: 512, or the camera's")
      ->type_name("N");
  add_threads(command, a.threads);
  command.add_flag("--check", a.check,
                   "Look at options, video and files before keypoints and masks, and the camera in a scene, are there");
  command.add_option("--out", a.out, "Where to: a new or empty folder")->type_name("DIR")->required();
  run_when_chosen(command, program, [&] { return init_command(a, descriptions_of(program.terms)); });
}

}  // namespace hsi4d::cli
