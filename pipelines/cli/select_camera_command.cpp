// `hsi4d select-camera`.
#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/image_io.h"
#include "core/parallel.h"
#include "core/text.h"
#include "optim/loss_description.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/cli/text.h"
#include "pipelines/config/run_config.h"
#include "pipelines/draw/camera_selection.h"
#include "pipelines/input/frame_cameras.h"
#include "pipelines/record/summary.h"

namespace hsi4d::cli {
namespace {

/// Arguments of the command.
struct SelectCameraOptions {
  std::filesystem::path config;
  std::vector<std::string> overrides;
  std::string out;    ///< camera.json; empty: not written
  std::string image;  ///< what the camera sees, .png, .jpg or .exr; empty: not written
  std::optional<int> threads;
  bool quiet = false;
};

constexpr std::size_t kMostTold = 5;

/// What is missing, all at once.
void check_camera_inputs(const DataSettings& data) {
  std::vector<std::string> missing;
  for (const auto& [path, key] :
       {std::pair{&data.scene, "/data/scene"}, {&data.avatar, "/data/avatar"}, {&data.initial, "/data/initial"}}) {
    if (path->empty()) missing.emplace_back(key);
  }
  if (!missing.empty())
    throw UserError(joined(missing) +
                    ": not given; a camera is chosen by the scene, the human and the state of frame 0");
}

std::string table_of(const CameraChoice& choice) {
  const bool has_cover = choice.candidates.front().cover.has_value();
  Table table{.head = {"VISIBLE", "RADIUS [m]", "AZIMUTH [°]", "ELEVATION [°]"}};
  if (has_cover) table.head.emplace_back("COVERED [%]");
  for (std::size_t i = 0; i < std::min(kMostTold, choice.candidates.size()); ++i) {
    const CandidateView& view = choice.candidates[i];
    table.rows.push_back({std::to_string(view.visible) + " of 22", rounded(view.radius_m, 4),
                          rounded(view.azimuth_deg, 4), rounded(view.elevation_deg, 4)});
    if (has_cover) table.rows.back().push_back(view.cover ? fixed_number(100 * *view.cover, 0) : "-");
  }
  const std::size_t others = choice.candidates.size() - std::min(kMostTold, choice.candidates.size());
  return table_text(table) + (others > 0 ? "and " + std::to_string(others) + " more candidates\n" : "");
}

void write_view(const std::string& file, const SceneSetup& setup, const Camera& camera, const RunConfig& config) {
  const Vector3<double> center =
      -(camera.camera_from_world.rotation.transpose() * camera.camera_from_world.translation);
  write_image(file,
              render_picture(first_frame(setup, center).all, {camera, config.background, config.render, {}}).image);
}

/// Chooses the camera of frame 0 (pipelines/draw/camera_selection.h), and returns the best candidates as a table. The
/// config needs data.scene, avatar, initial and the objects; of data.camera, where it is given, size and focal lengths
/// are taken. Throws UserError and DataError for its inputs, Interrupted.
std::string select_camera_command(const SelectCameraOptions& options, const std::vector<LossDescription>& losses) {
  RunConfig config = load_run_config(options.config, options.overrides, losses);
  config.threads = options.threads.value_or(config.threads);
  check_camera_inputs(config.data);
  const InterruptWatch watch;
  CameraChoice choice;
  with_threads(config.threads > 0 ? config.threads : thread_count(), [&] {
    const SceneSetup setup = read_scene_setup(config.data);
    choice = select_camera(setup, config.camera_selection, config.render, intrinsics_of(config.data.camera),
                           observer_on_terminal(options.quiet));
    if (!options.image.empty()) write_view(options.image, setup, choice.camera, config);
  });
  if (!options.out.empty()) write_camera(options.out, choice.camera);
  return table_of(choice);
}

}  // namespace

void add_select_camera(CLI::App& app, Program& program) {
  SelectCameraOptions& o = program.options<SelectCameraOptions>();
  CLI::App* command = app.add_subcommand("select-camera", "Choose the camera of a clip's first frame");
  command
      ->add_option("CONFIG", o.config,
                   "A config with scene, avatar and initial state; section camera_selection says how")
      ->required();
  add_overrides(*command, o.overrides);
  add_threads(*command, o.threads);
  command->add_option("--out", o.out, "Where to: a camera file")->type_name("F.json");
  command->add_option("--image", o.image, "Image of what it sees")->type_name("F.{png,jpg,exr}");
  command->add_flag("--quiet", o.quiet, "No progress on stderr");
  run_when_chosen(*command, program, [&] { return select_camera_command(o, descriptions_of(program.terms)); });
}

}  // namespace hsi4d::cli
