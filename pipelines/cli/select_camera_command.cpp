#include "pipelines/cli/select_camera_command.h"

#include <algorithm>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/image_io.h"
#include "core/parallel.h"
#include "core/text.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/cli/text.h"
#include "pipelines/config/run_config.h"
#include "pipelines/draw/camera_selection.h"
#include "pipelines/record/summary.h"

namespace hsi4d::cli {
namespace {

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
  Table table{.head = {"VISIBLE", "COVERED [%]", "RADIUS [m]", "AZIMUTH [°]", "ELEVATION [°]"}};
  for (std::size_t i = 0; i < std::min(kMostTold, choice.candidates.size()); ++i) {
    const CandidateView& view = choice.candidates[i];
    table.rows.push_back({std::to_string(view.visible) + " of 22",
                          view.cover ? fixed_number(100 * *view.cover, 0) : "-", rounded(view.radius_m, 4),
                          rounded(view.azimuth_deg, 4), rounded(view.elevation_deg, 4)});
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

}  // namespace

std::string select_camera_command(const SelectCameraOptions& options, const std::vector<LossDescription>& losses) {
  const RunConfig config = load_run_config(options.config, options.overrides, losses);
  check_camera_inputs(config.data);
  const InterruptWatch watch;
  CameraChoice choice;
  with_threads(config.threads > 0 ? config.threads : thread_count(), [&] {
    const SceneSetup setup = read_scene_setup(config.data);
    std::optional<Camera> intrinsics;
    if (!config.data.camera.empty()) intrinsics = read_camera(config.data.camera.string());
    choice =
        select_camera(setup, config.camera_selection, config.render, intrinsics, observer_on_terminal(options.quiet));
    if (!options.image.empty()) write_view(options.image, setup, choice.camera, config);
  });
  if (!options.out.empty()) write_camera(options.out, choice.camera);
  return table_of(choice);
}

}  // namespace hsi4d::cli
