// `hsi4d locate`: the camera of frame 0 in a scene.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/angles.h"
#include "core/camera_file.h"
#include "core/check.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/parallel.h"
#include "core/text.h"
#include "optim/metrics.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/scene_options.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/cli/text.h"
#include "pipelines/input/clip.h"
#include "pipelines/locate/camera_search.h"
#include "pipelines/locate/colmap_camera.h"
#include "pipelines/locate/first_picture.h"
#include "pipelines/locate/picks.h"
#include "pipelines/metrics/quality.h"

namespace hsi4d::cli {

namespace {

namespace fs = std::filesystem;

struct LocateArguments {
  std::string frame, scene, masks, out;
  std::string picks, view;              ///< picked places, and the camera of the other picture
  std::string colmap, name, alignment;  ///< a model that has registered the frame
  std::string guess, position, target;  ///< a rough camera
  std::optional<double> focal_px, fov_deg, tolerance_px;
  std::string spread;
  std::optional<int> starts, longest_side_px, threads;
  bool moves_focal = false, is_final = false, quiet = false;
  std::string background = "0,0,0";
  std::vector<std::string> settings;
};

const std::string kLocateCommand = "hsi4d locate: ";
constexpr double kToleranceShare = 0.01;  // of the longer side, at which a pick counts as wrong
constexpr double kFewAgreeing = 2.0 / 3;  // of the picks

/// How far a way to a camera may be off, and how many starts that takes.
struct Spread {
  double metres, degrees;
  int starts;
};
constexpr Spread kOfGuess{0.2, 10, 256}, kOfPicks{0.05, 1.5, 32}, kOfModel{0.03, 0.5, 16};

/// A camera from which the search begins, and what is told of it.
struct Beginning {
  Camera camera;
  Spread spread = kOfGuess;
  std::string text = {};                 ///< lines
  std::vector<std::string> doubts = {};  ///< what is to be checked
};

/// The frame's size, its principal point in the middle; the focal length where an option says it, else 0.
Camera intrinsics_of_frame(const LocateArguments& a, const Image& frame) {
  if (a.focal_px && a.fov_deg) throw UserError(kLocateCommand + "--focal-px and --fov say the same; give one");
  const double width = frame.width();
  const double focal = a.fov_deg ? width / (2 * std::tan(*a.fov_deg * kDegree / 2)) : a.focal_px.value_or(0);
  return {frame.width(), frame.height(), focal, focal, width / 2, frame.height() / 2.0, {}};
}

std::vector<std::string> wrong_picks(const std::vector<Pick>& picks, const PickedCamera& found) {
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < picks.size(); ++i) {
    if (!(found.errors_px[i] <= found.tolerance_px)) lines.push_back(std::to_string(picks[i].line));
  }
  return lines;
}

std::string told(const std::vector<Pick>& picks, const PickedCamera& found, bool has_focal) {
  const std::vector<std::string> wrong = wrong_picks(picks, found);
  return "  picks: " + std::to_string(found.agreeing) + " of " + std::to_string(picks.size()) + " agree within " +
         rounded(found.tolerance_px, 3) + " px, RMS " + rounded(found.rms_px, 3) + " px; they leave " +
         rounded(kCentimetres * found.position_m, 2) + " cm, " + rounded(found.rotation_deg, 2) + " degrees" +
         (has_focal ? "" : ", " + rounded(100 * found.focal_share, 2) + " % of the focal length") + " open\n" +
         (wrong.empty() ? "" : "  picks that do not agree: lines " + few_names(wrong) + "\n");
}

Beginning from_picks(const LocateArguments& a, const Gaussians& scene, const Image& frame, const SceneView& drawn) {
  const std::vector<Pick> picks = decode_picks(read_text_file(a.picks), a.picks);
  Camera intrinsics = intrinsics_of_frame(a, frame);
  const bool has_focal = intrinsics.fx > 0;
  if (!has_focal) intrinsics.fx = intrinsics.fy = 1;
  std::optional<SceneView> view;
  if (!a.view.empty()) {
    view = drawn;
    view->camera = read_camera(a.view);
  }
  const std::vector<PickedPoint> points = picked_points(picks, scene, intrinsics, view, a.picks);
  const double tolerance = a.tolerance_px.value_or(kToleranceShare * std::max(frame.width(), frame.height()));
  const PickedCamera found = camera_from_picks(points, intrinsics, has_focal, tolerance, a.picks);
  Beginning beginning{found.camera, kOfPicks, told(picks, found, has_focal)};
  if (static_cast<double>(found.agreeing) < kFewAgreeing * static_cast<double>(picks.size()))
    beginning.doubts.push_back("only " + std::to_string(found.agreeing) + " of " + std::to_string(picks.size()) +
                               " picks agree");
  return beginning;
}

Beginning from_guess(const LocateArguments& a, const Image& frame) {
  if (!a.guess.empty()) return {read_camera(a.guess)};
  if (a.position.empty() || a.target.empty())
    throw UserError(kLocateCommand + "--position and --target go together: where the camera is, and what it looks at");
  Camera camera = intrinsics_of_frame(a, frame);
  if (!(camera.fx > 0)) throw UserError(kLocateCommand + "how wide does the camera see? --fov or --focal-px says it");
  const std::vector<double> eye = parse_numbers(a.position, 3, kLocateCommand + "--position", "x,y,z"),
                            target = parse_numbers(a.target, 3, kLocateCommand + "--target", "x,y,z");
  camera.camera_from_world = look_at(Vector3<double>(eye.data()), Vector3<double>(target.data()));
  return {camera};
}

Beginning from_model(const LocateArguments& a, const FirstPicture& picture) {
  Similarity alignment;
  if (!a.alignment.empty()) alignment = decode_alignment(read_text_file(a.alignment), a.alignment);
  return {colmap_camera(a.colmap, a.name.empty() ? picture.name : a.name, alignment), kOfModel};
}

void check_options(const LocateArguments& a) {
  const bool is_guess = !a.guess.empty(), is_place = !a.position.empty() || !a.target.empty();
  const int ways = (a.picks.empty() ? 0 : 1) + (a.colmap.empty() ? 0 : 1) + (is_guess ? 1 : 0) + (is_place ? 1 : 0);
  if (ways != 1)
    throw UserError(kLocateCommand +
                    (ways == 0 ? "what is known of the camera?" : "several ways to a camera are given;") +
                    " One of --picks, --colmap, --guess, or --position with --target says it");
  const auto needs = [&](bool is_given, const char* option, bool is_used, const char* other) {
    if (is_given && !is_used) throw UserError(kLocateCommand + option + " has no meaning without " + other);
  };
  needs(!a.view.empty(), "--view", !a.picks.empty(), "--picks");
  needs(a.tolerance_px.has_value(), "--tolerance-px", !a.picks.empty(), "--picks");
  needs(!a.name.empty(), "--name", !a.colmap.empty(), "--colmap");
  needs(!a.alignment.empty(), "--alignment", !a.colmap.empty(), "--colmap");
  needs(a.focal_px.has_value(), "--focal-px", !a.picks.empty() || is_place, "--picks or --position");
  needs(a.fov_deg.has_value(), "--fov", !a.picks.empty() || is_place, "--picks or --position");
  check_range(a.focal_px, kLocateCommand + "--focal-px", 1, 1e6);
  check_range(a.fov_deg, kLocateCommand + "--fov", 1, 170);
  check_range(a.tolerance_px, kLocateCommand + "--tolerance-px", 0.1, 1000);
  check_range(a.starts, kLocateCommand + "--starts", 1, 100000);
  check_range(a.longest_side_px, kLocateCommand + "--longest-side-px", 64, 4096);
  check_ending(a.out, kLocateCommand + "--out", {".json"});
}

/// Metres and degrees of --spread.
void set_spread(const std::string& text, CameraSearch& search) {
  const std::vector<double> numbers = parse_numbers(text, 2, kLocateCommand + "--spread", "metres,degrees");
  if (!(numbers[0] >= 0 && numbers[0] <= 100 && numbers[1] >= 0 && numbers[1] <= 90))
    throw UserError(kLocateCommand + "--spread: \"" + text +
                    "\" is out of range; allowed: 0 to 100 metres, 0 to 90 degrees");
  search.spread_m = numbers[0];
  search.spread_deg = numbers[1];
}

CameraSearch search_of(const LocateArguments& a, const Spread& spread, const SceneView& drawn) {
  CameraSearch search;
  search.spread_m = spread.metres;
  search.spread_deg = spread.degrees;
  if (!a.spread.empty()) set_spread(a.spread, search);
  search.starts = a.starts.value_or(spread.starts);
  search.longest_side = a.longest_side_px.value_or(search.longest_side);
  search.moves_focal = a.moves_focal;
  search.background = drawn.background;
  search.render = drawn.settings;
  return search;
}

void check_fits(const Image& frame, const Camera& camera, const std::string& place, const std::string& file) {
  check_camera(camera, file);
  if (!fits_camera(frame, camera))
    throw UserError(place + ": is " + std::to_string(frame.width()) + "x" + std::to_string(frame.height()) +
                    " pixels, the image of the camera of " + file + " " + std::to_string(camera.width) + "x" +
                    std::to_string(camera.height) + "; allowed: a frame as large, or larger and of the same shape");
}

std::string place_text(const Camera& camera) {
  const Vector3<double> at = camera_center_world(camera);
  const Vector3<double> way = camera.camera_from_world.rotation.row(2).transpose();
  const auto three = [](const Vector3<double>& v) {
    return fixed_number(v[0], 3) + "," + fixed_number(v[1], 3) + "," + fixed_number(v[2], 3);
  };
  return "at " + three(at) + " m, looks along " + three(way) + ", focal length " + rounded(camera.fx, 4) + " px";
}

std::string told(const FoundCamera& found, const Camera& start) {
  const PoseError moved = camera_error(found.camera.camera_from_world, start.camera_from_world);
  return "  moved by " + rounded(moved.translation_cm, 3) + " cm, " + rounded(moved.rotation_deg, 3) + " degrees" +
         (found.camera.fx == start.fx
              ? ""
              : ", the focal length by " + rounded(100 * (found.camera.fx / start.fx - 1), 2) + " %") +
         "; " + std::to_string(found.agreeing) + " of the " + std::to_string(found.tried) +
         " best starts end near there\n";
}

std::string image_beside(const LocateArguments& a) { return fs::path(a.out).replace_extension(".png").string(); }

std::string doubt_text(const std::vector<std::string>& doubts) {
  std::string text;
  for (const std::string& doubt : doubts) text += "  check: " + doubt + "\n";
  return text;
}

/// Writes the camera, and beside it frame, render and difference. Returns what the command prints.
/// Throws UserError for options and files, DataError as readers of pictures do, and as camera_from_picks, colmap_camera
/// and find_camera; Interrupted.
std::string locate(const LocateArguments& a) {
  SceneView drawn;
  drawn.background = parse_color(a.background, kLocateCommand + "--background");
  drawn.settings = render_settings(a.settings);
  FirstPicture picture = read_first_picture(a.frame);
  if (!a.masks.empty()) leave_out_masks(a.masks, picture);
  const Gaussians scene = read_drawn(a.scene, drawn.settings).gaussians;
  Beginning beginning = !a.picks.empty()    ? from_picks(a, scene, picture.color, drawn)
                        : !a.colmap.empty() ? from_model(a, picture)
                                            : from_guess(a, picture.color);
  check_fits(picture.color, beginning.camera, picture.place, a.colmap.empty() ? a.guess : a.colmap);
  const CameraSearch search = search_of(a, beginning.spread, drawn);
  FoundCamera found{beginning.camera};
  const double before = compare_camera(scene, beginning.camera, picture.color, picture.weight, search).psnr_db;
  if (!a.is_final)
    found = find_camera(scene, beginning.camera, picture.color, picture.weight, search, observer_on_terminal(a.quiet));
  const ComparedCamera compared = compare_camera(scene, found.camera, picture.color, picture.weight, search);
  const std::vector<QualityGate> gates = quality_of({{"psnr_background_db", compared.psnr_db}}, 0);
  if (word_of(gates.front()) != "pass") beginning.doubts.push_back("scene and frame differ much; look at the image");
  if (found.tried > 1 && found.agreeing < 2)
    beginning.doubts.push_back(
        "no two starts end in one place; a nearer guess, or more --starts, may find a better one");
  const std::string image = image_beside(a);
  write_image(image, comparison_image(compared));
  write_camera(a.out, found.camera);
  return a.out + ": the camera is " + place_text(found.camera) + "\n" + beginning.text +
         (a.is_final ? "" : told(found, beginning.camera)) +
         "  PSNR of the compared pixels: " + fixed_number(before, 1) +
         (a.is_final ? "" : " dB before, " + fixed_number(compared.psnr_db, 1)) + " dB (" +
         std::string(word_of(gates.front())) + ")\n  " + image + ": frame, render, difference\n" +
         doubt_text(beginning.doubts);
}

std::string locate_command(const LocateArguments& a) {
  check_options(a);
  check_writable(a.out);
  for (const std::string& written : {a.out, image_beside(a)})
    check_no_input(written, kLocateCommand + "--out", {a.frame, a.scene, a.picks, a.view, a.guess, a.alignment});
  const InterruptWatch watch;
  std::string text;
  with_threads(a.threads.value_or(0) > 0 ? *a.threads : thread_count(), [&] { text = locate(a); });
  return text;
}

void add_ways(CLI::App& command, LocateArguments& a) {
  command
      .add_option("--picks", a.picks, "Places in the frame and their points in the scene, or in another picture of it")
      ->type_name("F.csv");
  command.add_option("--view", a.view, "Camera of that other picture")->type_name("C.json");
  command.add_option("--tolerance-px", a.tolerance_px, "How far off a pick may be; default: 1 % of the longer side")
      ->type_name("PX");
  command.add_option("--colmap", a.colmap, "A folder with a model of COLMAP that has registered the frame")
      ->type_name("DIR");
  command.add_option("--name", a.name, "What that model calls the frame; default: the frame's file")->type_name("NAME");
  command.add_option("--alignment", a.alignment, "alignment.json of hsi4d align, if the scene was moved")
      ->type_name("F.json");
  command.add_option("--guess", a.guess, "A rough camera")->type_name("C.json");
  command.add_option("--position", a.position, "Where the camera is, roughly, metres")->type_name("x,y,z");
  command.add_option("--target", a.target, "What it looks at, roughly, metres; up is +z")->type_name("x,y,z");
  command.add_option("--fov", a.fov_deg, "Horizontal field of view; of picks it is found where it is not given")
      ->type_name("DEGREES");
  command.add_option("--focal-px", a.focal_px, "Instead: the focal length, pixels of the frame")->type_name("F");
}

}  // namespace

void add_locate(CLI::App& app, Program& program) {
  LocateArguments& a = program.options<LocateArguments>();
  CLI::App& command = *app.add_subcommand(
      "locate", "Find the camera of a frame in a scene: by picked places, a model of COLMAP, or a rough guess");
  command.add_option("FRAME", a.frame, "A picture; or a video or a folder of frames, of which the first counts")
      ->required();
  command.add_option("--scene", a.scene, "Gaussians")->type_name(splat_type_name())->required();
  command.add_option("--masks", a.masks, "Masks of people and objects, which are left out: a folder as for data.masks")
      ->type_name("DIR");
  add_ways(command, a);
  command
      .add_option("--spread", a.spread,
                  "How far the guess may be off: default 0.2,10; 0.05,1.5 of picks, 0.03,0.5 of a model")
      ->type_name("METRES,DEGREES");
  command.add_option("--starts", a.starts, "How many cameras are tried there: default 256, 32 of picks, 16 of a model")
      ->check(whole_number())
      ->type_name("N");
  command.add_flag("--move-focal", a.moves_focal, "Find the focal length too, from that of the guess");
  command.add_flag("--no-refine", a.is_final, "Take the camera as picks, model or guess give it");
  command.add_option("--longest-side-px", a.longest_side_px, "Of the images that are compared; default: 512")
      ->type_name("N");
  command.add_option("--background", a.background, "Colour behind everything; black without")->type_name("r,g,b");
  add_several(command, "--set", a.settings, "Change a setting of the renderer: render.blur=0.1")
      ->type_name("render.KEY=VALUE");
  add_threads(command, a.threads);
  command.add_option("--out", a.out, "Where to: a camera file; beside it an image, frame, render and difference")
      ->type_name("F.json")
      ->required();
  command.add_flag("--quiet", a.quiet, "No progress on stderr");
  run_when_chosen(command, program, [&] { return locate_command(a); });
}

}  // namespace hsi4d::cli
