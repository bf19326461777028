#include "pipelines/cli/scene_options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/config_file.h"
#include "core/file.h"
#include "core/log.h"
#include "core/suggest.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/text.h"

namespace hsi4d::cli {
namespace {

/// The part of a config that these commands read.
struct RenderSection {
  RenderSettings render;
};

void describe(ConfigFields& f, RenderSection& s) { f.object("render", s.render, "How Gaussians become pixels"); }

Precision parse_precision(const std::string& word, const std::string& where) {
  std::vector<std::string> known;
  for (const ConfigChoice<Precision>& choice : kPrecisions) {
    if (word == choice.name) return choice.value;
    known.emplace_back(choice.name);
  }
  throw UserError(where + ": \"" + word + "\" is no precision; allowed: " + joined(known) + did_you_mean(word, known));
}

/// That the first of several cameras is taken.
void tell_of_other_cameras(const std::string& path) {
  const std::vector<PictureCamera> cameras = read_picture_cameras(path);
  if (cameras.size() < 2) return;
  const std::string& picture = cameras.front().picture;
  log_warning(path + ": holds " + std::to_string(cameras.size()) + " cameras; the first" +
              (picture.empty() ? "" : ", of " + with_escapes(picture) + ",") + " is taken (--camera-frame)");
}

}  // namespace

RenderSettings render_settings(const std::vector<std::string>& overrides) {
  ConfigProblems problems;
  const ConfigValue tree = config_from_overrides(overrides, problems);
  return read_settings<RenderSection>(tree, problems).render;
}

std::array<double, 3> parse_color(const std::string& text, const std::string& where) {
  const auto refuse = [&] {
    return UserError(where + ": \"" + text + "\" is no colour; allowed: three numbers r,g,b, for example 0.5,0.5,0.5");
  };
  std::array<double, 3> color{};
  const char* at = text.data();
  const char* end = text.data() + text.size();
  for (std::size_t c = 0; c < 3; ++c) {
    const auto done = std::from_chars(at, end, color[c]);
    if (done.ec != std::errc() || !std::isfinite(color[c])) throw refuse();
    at = done.ptr;
    if (c < 2 && (at == end || *at++ != ',')) throw refuse();
  }
  if (at != end) throw refuse();
  return color;
}

std::string run_on_threads(const SceneOptions& options, FunctionRef<std::string()> command) {
  const int asked = options.threads.value_or(0);
  std::string printed;
  with_threads(asked > 0 ? asked : thread_count(), [&] { printed = command(); });
  return printed;
}

SceneView view_of(const SceneOptions& options, const std::string& command) {
  SceneView view;
  view.background = parse_color(options.background, command + ": --background");
  view.precision = parse_precision(options.precision, command + ": --precision");
  view.settings = render_settings(options.settings);
  view.camera = read_camera(options.camera, options.camera_frame.value_or(0));
  if (!options.camera_frame) tell_of_other_cameras(options.camera);
  return view;
}

SplatFile read_drawn(const std::string& path, const RenderSettings& settings) {
  SplatFile file = read_splats_with_warnings(path);
  if (file.report.antialiased) warn_of_antialiasing({&path, 1}, settings.antialias);
  return file;
}

void add_numbers(NpzWriter& npz, Precision precision, const std::string& name, const std::vector<int64_t>& shape,
                 const std::vector<double>& values) {
  if (precision == Precision::kFloat) {
    const std::vector<float> rounded(values.begin(), values.end());
    npz.add<float>(name, shape, rounded);
  } else {
    npz.add<double>(name, shape, values);
  }
}

std::string check_ending(const std::string& path, const std::string& where, const std::vector<std::string>& allowed) {
  const std::string ending = file_ending(path);
  if (std::find(allowed.begin(), allowed.end(), ending) != allowed.end()) return ending;
  throw UserError(where + ": " + path + " does not end as it must; allowed: " + joined(allowed));
}

void warn_if_nothing_drawn(bool shows_something, const Gaussians& gaussians, double alpha_min) {
  if (shows_something) return;
  const Index count = gaussians.count();
  if (count == 0) return log_warning("no Gaussian is drawn: the files hold none");
  const std::vector<float>& logits = gaussians.opacity_logits;
  const double highest = 1 / (1 + std::exp(-static_cast<double>(*std::max_element(logits.begin(), logits.end()))));
  if (highest < alpha_min)
    return log_warning("no Gaussian is drawn: the opacity of all " + std::to_string(count) + " is at most " +
                       rounded(highest, 3) + ", below render.alpha_min, " + rounded(alpha_min, 3));
  log_warning("no Gaussian is drawn: the camera sees none of " + std::to_string(count) +
              ". Its pose must be camera_from_world in OpenCV's axes (x right, y down, z forward), in metres");
}

void check_no_input(const std::string& out, const std::string& where, const std::vector<std::string>& in) {
  for (const std::string& name : in) {
    std::error_code missing;  // what cannot be looked at is told by who reads or writes it
    if (!std::filesystem::equivalent(name, out, missing) || missing) continue;
    throw UserError(where + ": " + out + " is the file that is read, " + name +
                    ", which would be replaced; give another name");
  }
}

void check_writable(const std::string& path) {
  namespace fs = std::filesystem;
  std::vector<fs::path> missing;  // innermost first
  std::error_code error;
  for (fs::path folder = fs::path(path).parent_path(); !folder.empty() && !fs::exists(folder, error);
       folder = folder.parent_path())
    missing.push_back(folder);
  { const AtomicFile trial(path); }
  for (const fs::path& folder : missing)
    fs::remove(folder, error);  // it is made again with the file, if it comes to that
}

CLI::Option* add_scene(CLI::App& command, SceneOptions& options) {
  CLI::Option* const scene = command.add_option("--scene", options.scene, "Gaussians")->type_name(splat_type_name());
  command.add_option("--camera", options.camera, "A camera, or nerfstudio's transforms.json")
      ->type_name("C.json")
      ->required();
  command.add_option("--camera-frame", options.camera_frame, "Which camera of a file with several, from 0")
      ->check(whole_number())
      ->type_name("I");
  command.add_option("--background", options.background, "Colour behind everything; black without")->type_name("r,g,b");
  command.add_option("--precision", options.precision, "float, double, or reference: brute force in double")
      ->type_name("WORD");
  add_several(command, "--set", options.settings, "Change a setting of the renderer: render.blur=0.1")
      ->type_name("render.KEY=VALUE");
  add_threads(command, options.threads);
  return scene;
}

}  // namespace hsi4d::cli
