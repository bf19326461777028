// What `hsi4d render` and `hsi4d gradients` share: options, and how they become a scene and a view.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "core/npz.h"
#include "core/parallel.h"
#include "pipelines/draw/image_of_scene.h"
#include "splat/files/splat_file.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace hsi4d::cli {

/// Options as they stand on the command line.
struct SceneOptions {
  std::string scene;                 ///< --scene F.ply
  std::string camera;                ///< --camera C.json
  std::optional<int> camera_frame;   ///< --camera-frame I, of a file with several; not given: the first, with a warning
  std::string background = "0,0,0";  ///< --background r,g,b
  std::string precision = "float";   ///< --precision float|double|reference
  std::vector<std::string> settings;  ///< --set render.KEY=VALUE
  std::optional<int> threads;         ///< --threads N
};

/// Adds them to a command; returns the option --scene.
CLI::Option* add_scene(CLI::App& command, SceneOptions& options);

/// What the command prints, run on the threads that the options give.
std::string run_on_threads(const SceneOptions& options, FunctionRef<std::string()> command);

/// The camera, colours and settings that the options name.
///
/// @param command  "hsi4d render", which messages begin with
/// Throws UserError that names the option, its value and what is allowed; and what read_camera throws. Settings have
/// the messages of a config's overrides.
SceneView view_of(const SceneOptions& options, const std::string& command);

/// Render settings from KEY=VALUE pairs, each of which begins with "render."; all problems in one UserError.
RenderSettings render_settings(const std::vector<std::string>& overrides);

/// Three finite numbers "r,g,b". @param where  starts the message: "hsi4d render: --background"
std::array<double, 3> parse_color(const std::string& text, const std::string& where);

/// Gaussians of a file that are drawn with these settings; what the reader left out or put right, its cautions, and
/// that they were trained for other settings go to the log as warnings.
SplatFile read_drawn(const std::string& path, const RenderSettings& settings);

/// Warns of an image in which no Gaussian is drawn: because there is none, because all are too faint, or because the
/// camera looks away, most often since its axes are of another convention, which the warning names.
///
/// @param shows_something  alpha is above 0 somewhere in the image
/// @param alpha_min        of the render settings
void warn_if_nothing_drawn(bool shows_something, const Gaussians& gaussians, double alpha_min);

/// Adds an array of numbers, float32 where the precision is float, else float64.
void add_numbers(NpzWriter& npz, Precision precision, const std::string& name, const std::vector<int64_t>& shape,
                 const std::vector<double>& values);

/// Throws UserError unless the path ends in one of `allowed`. Returns the ending.
std::string check_ending(const std::string& path, const std::string& where, const std::vector<std::string>& allowed);

/// Throws UserError that names both when `out` is one of the files `in`, by another spelling or a link too: writing
/// would replace it. Empty names in `in` are passed over.
void check_no_input(const std::string& out, const std::string& where, const std::vector<std::string>& in);

/// Throws UserError, as writing does, unless a file can be written there; tried before the work is done. What is there
/// stays as it is.
void check_writable(const std::string& path);

}  // namespace hsi4d::cli
