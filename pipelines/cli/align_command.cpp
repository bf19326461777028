// `hsi4d align`: a scene and its cameras in a world with z up, the ground at z = 0, in metres.
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/config_value.h"
#include "core/file.h"
#include "core/folder_in_making.h"
#include "core/image_io.h"
#include "core/text.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/text.h"
#include "pipelines/draw/image_of_scene.h"
#include "pipelines/scan/align.h"
#include "pipelines/scan/start.h"
#include "splat/files/splat_file.h"

namespace hsi4d::cli {

namespace {

struct AlignArguments {
  std::string scene, cameras, up, out;
  std::string distance;                 ///< two points and the metres between them
  std::string height;                   ///< a point and its metres over the ground
  std::optional<double> camera_height;  ///< metres over the ground, the cameras' median
  std::optional<int> picture;           ///< camera of ground.png; none: the first
};

const std::string kAlignCommand = "hsi4d align: ";

Vector3<double> vector_at(const std::vector<double>& numbers, std::size_t first) {
  return {numbers[first], numbers[first + 1], numbers[first + 2]};
}

double positive(double metres, const char* option) {
  if (metres > 0 && std::isfinite(metres)) return metres;
  throw UserError(kAlignCommand + option + ": " + short_number(metres) + " is no length; allowed: above 0 metres");
}

/// Metres that `length` units are.
double ratio(double metres, double length, const char* option) {
  if (length > 0) return positive(metres, option) / length;
  throw UserError(kAlignCommand + option + ": measures nothing: " + short_number(length) + " units in the scene");
}

double median_height(const std::vector<Camera>& cameras, const GroundPlane& ground) {
  std::vector<double> heights;
  for (const Camera& camera : cameras) heights.push_back(height_over(ground, camera_center_world(camera)));
  std::sort(heights.begin(), heights.end());
  return heights[heights.size() / 2];
}

double scale_of(const AlignArguments& a, const GroundPlane& ground, const std::vector<Camera>& cameras) {
  const int given = (a.distance.empty() ? 0 : 1) + (a.height.empty() ? 0 : 1) + (a.camera_height ? 1 : 0);
  if (given > 1)
    throw UserError(kAlignCommand + "one of --distance, --height and --camera-height says how large the scene is");
  if (!a.distance.empty()) {
    const std::vector<double> n = parse_numbers(a.distance, 7, kAlignCommand + "--distance", "x,y,z,x,y,z,metres");
    return ratio(n[6], (vector_at(n, 3) - vector_at(n, 0)).norm(), "--distance");
  }
  if (!a.height.empty()) {
    const std::vector<double> n = parse_numbers(a.height, 4, kAlignCommand + "--height", "x,y,z,metres");
    return ratio(n[3], height_over(ground, vector_at(n, 0)), "--height");
  }
  if (!a.camera_height) return 1;
  if (cameras.empty()) throw UserError(kAlignCommand + "--camera-height needs --cameras");
  return ratio(*a.camera_height, median_height(cameras, ground), "--camera-height");
}

Vector3<double> first_up(const AlignArguments& a, const std::vector<Camera>& cameras) {
  if (a.up.empty() && cameras.empty())
    throw UserError(kAlignCommand + "which way is about up? --cameras, whose mean tells, or --up x,y,z");
  if (a.up.empty()) return up_of(cameras);
  const Vector3<double> up = vector_at(parse_numbers(a.up, 3, kAlignCommand + "--up", "x,y,z"), 0);
  if (!(up.norm() > 0)) throw UserError(kAlignCommand + "--up: 0,0,0 is no direction");
  return up.normalized();
}

Vector3<double> middle_of(const std::vector<Camera>& cameras, const std::vector<Vector3<double>>& points) {
  if (!cameras.empty()) return looked_at(cameras);
  Vector3<double> sum = Vector3<double>::Zero();
  for (const Vector3<double>& point : points) sum += point;
  return sum / static_cast<double>(points.size());
}

std::string alignment_json(const GroundPlane& ground, const Similarity& similarity) {
  ConfigValue file = ConfigValue::make_object();
  ConfigValue rows = ConfigValue::make_array();
  for (Index i = 0; i < 4; ++i) {
    ConfigValue row = ConfigValue::make_array();
    for (Index j = 0; j < 4; ++j) {
      const double value = i == 3   ? (j == 3 ? 1 : 0)
                           : j == 3 ? similarity.translation[i]
                                    : similarity.scale * similarity.rotation(i, j);
      row.items.push_back(ConfigValue::make_number(value));
    }
    rows.items.push_back(std::move(row));
  }
  file.add("matrix", std::move(rows));
  file.add("scale", ConfigValue::make_number(similarity.scale));
  file.add("ground_share", ConfigValue::make_number(ground.share));
  file.add("below_share", ConfigValue::make_number(ground.below));
  return to_json(file);
}

void write_picture_of_ground(const std::string& file, const Gaussians& gaussians, const Camera& camera) {
  SceneView view;
  view.camera = camera;
  const SceneImage rendered = render_scene({gaussians, {}}, view);
  const std::vector<float> values(rendered.image.begin(), rendered.image.end());
  Image image = from_interleaved(values, rendered.height, rendered.width, 3);
  draw_ground_grid(camera, rendered.depth, image);
  write_image(file, image);
}

/// Finds the ground, moves scene and cameras, and writes scene.ply, cameras.json, alignment.json and ground.png.
/// Returns what the command prints.
///
/// Throws UserError for options and files, and as find_ground.
std::string align_command(const AlignArguments& a) {
  const SplatFile file = read_splats_with_warnings(a.scene);
  std::vector<Camera> cameras;
  if (!a.cameras.empty()) cameras = read_cameras(a.cameras);
  if (a.picture && cameras.empty()) throw UserError(kAlignCommand + "--picture needs --cameras");
  const auto picture = static_cast<std::size_t>(a.picture.value_or(0));
  if (a.picture && picture >= cameras.size())
    throw UserError(kAlignCommand + "--picture: " + a.cameras + " has no camera " + std::to_string(picture) +
                    "; allowed: 0 to " + std::to_string(cameras.size() - 1));
  const std::vector<Vector3<double>> points = solid_points(file.gaussians);
  const Vector3<double> up = first_up(a, cameras);
  const GroundPlane ground = find_ground(points, up);
  const Similarity similarity = alignment(ground, scale_of(a, ground, cameras), middle_of(cameras, points));
  const Gaussians moved = transformed(file.gaussians, similarity);
  for (Camera& camera : cameras) camera = moved_camera(camera, similarity);
  FolderInMaking out(a.out);
  write_splats(out.file("scene.ply"), moved);
  if (!cameras.empty()) {
    write_cameras(out.file("cameras.json"), cameras);
    write_picture_of_ground(out.file("ground.png"), moved, cameras[picture]);
  }
  write_text_file(out.file("alignment.json"), alignment_json(ground, similarity));
  out.commit();
  std::string text = a.out + ": the ground holds " + rounded(100 * ground.share, 3) + " % of " +
                     count_text(std::ssize(points), "Gaussian") + " of opacity above 0.5; scale " +
                     rounded(similarity.scale, 5) + "\n";
  if (!cameras.empty())
    text += "  cameras are " + rounded(median_height(cameras, {}), 3) + " m over the ground; ground.png shows it\n";
  if (similarity.scale == 1 && a.distance.empty() && a.height.empty() && !a.camera_height)
    text += "  the scale is that of the file: nothing says how large the scene is\n";
  return text;
}

}  // namespace

void add_align(CLI::App& app, Program& program) {
  AlignArguments& a = program.options<AlignArguments>();
  CLI::App& command = *app.add_subcommand("align", "Put a scene and its cameras on the ground: z up, in metres");
  command.add_option("SCENE", a.scene, "Gaussians")->required();
  command.add_option("--cameras", a.cameras, "Cameras that go along; their mean tells which way is about up")
      ->type_name("C.json");
  command.add_option("--up", a.up, "Which way is about up, in the scene's axes; without: the cameras' mean")
      ->type_name("x,y,z");
  command.add_option("--distance", a.distance, "Scale by two points of the scene and the metres between them")
      ->type_name("x,y,z,x,y,z,M");
  command.add_option("--height", a.height, "Scale by a point of the scene and its metres over the ground: a head")
      ->type_name("x,y,z,M");
  command.add_option("--camera-height", a.camera_height, "Scale by the cameras' median height over the ground, metres")
      ->type_name("M");
  command.add_option("--picture", a.picture, "Camera of ground.png, from 0")->check(whole_number())->type_name("I");
  command.add_option("--out", a.out, "Where to: a new or empty folder")->type_name("DIR")->required();
  run_when_chosen(command, program, [&] { return align_command(a); });
}

}  // namespace hsi4d::cli
