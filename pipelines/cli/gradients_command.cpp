#include "pipelines/cli/gradients_command.h"

#include <algorithm>
#include <cmath>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/exr.h"
#include "core/image_io.h"
#include "core/text.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/text.h"

namespace hsi4d::cli {
namespace {

const std::vector<std::string>& target_endings() {
  static const std::vector<std::string> endings = {".exr", ".png", ".npz"};
  return endings;
}

void check_size(const std::string& path, int64_t height, int64_t width, int wanted_height, int wanted_width) {
  if (height == wanted_height && width == wanted_width) return;
  throw DataError(path + ": the image is " + std::to_string(width) + " x " + std::to_string(height) +
                  " pixels; the camera's is " + std::to_string(wanted_width) + " x " + std::to_string(wanted_height));
}

std::vector<double> wide(const Image& rgb) {
  const std::vector<float> values = to_interleaved(rgb);
  return {values.begin(), values.end()};
}

/// v/255 and v/65535 in double: the reader's floats are within half a step of 65535 of what they stand for, and v/255
/// is 257 v/65535.
std::vector<double> png_values(const std::string& path, const Image& image) {
  if (image.channels() < 3)
    throw DataError(path + ": the image has " + std::to_string(image.channels()) +
                    (image.channels() == 1 ? " channel" : " channels") + "; 3 or 4 are needed: RGB, RGBA");
  check_opaque(image, path, "a target");
  std::vector<double> values = wide(take_channels(image, 0, 3));
  for (double& value : values) value = std::round(value * 65535) / 65535;
  return values;
}

std::vector<double> npz_values(const std::string& path, int height, int width) {
  const Npz npz = Npz::read(path);
  const NpyArray& image = npz.array("image").require_shape({-1, -1, 3});
  check_size(path, image.shape()[0], image.shape()[1], height, width);
  return image.as<double>();
}

void check_finite(const std::string& path, const std::vector<double>& values, int width) {
  const auto bad = std::find_if(values.begin(), values.end(), [](double value) { return !std::isfinite(value); });
  if (bad == values.end()) return;
  const auto place = static_cast<std::int64_t>(bad - values.begin()) / 3;
  throw DataError(path + ": row " + std::to_string(place / width) + ", column " + std::to_string(place % width) +
                  " of the image is not finite");
}

/// Rows of `width` numbers put at the file's rows, zeros elsewhere.
std::vector<double> at_file_rows(const std::vector<double>& kept, const SplatReport& report, std::size_t width) {
  std::vector<double> all(static_cast<std::size_t>(report.rows) * width, 0.0);
  for (std::size_t n = 0; n < report.row_of.size(); ++n)
    std::copy_n(kept.begin() + static_cast<std::ptrdiff_t>(n * width), width,
                all.begin() + report.row_of[n] * static_cast<std::ptrdiff_t>(width));
  return all;
}

/// A number that the reader held at a limit does not move what is drawn (row A5: huge scales).
void zero_held(SceneGradients& g, const SplatReport& report) {
  for (const Index i : report.held_log_scales) g.log_scales[static_cast<std::size_t>(i)] = 0;
  for (const Index i : report.held_opacity_logits) g.opacity_logits[static_cast<std::size_t>(i)] = 0;
}

void write_gradients(const std::string& path, const SceneGradients& g, const SplatFile& scene, Precision precision) {
  const Index n = scene.report.rows, k = scene.gaussians.sh_coefficients();
  const Index height = g.rendered.height, width = g.rendered.width;
  NpzWriter npz;
  const auto add = [&](const std::string& name, const std::vector<int64_t>& shape, const std::vector<double>& values) {
    add_numbers(npz, precision, name, shape, values);
  };
  const auto add_rows = [&](const std::string& name, const std::vector<int64_t>& shape,
                            const std::vector<double>& values) {
    std::size_t row = 1;
    for (std::size_t i = 1; i < shape.size(); ++i) row *= static_cast<std::size_t>(shape[i]);
    add(name, shape, at_file_rows(values, scene.report, row));
  };
  npz.add_scalar("loss", g.loss);
  add("image", {height, width, 3}, g.rendered.image);
  add("alpha", {height, width}, g.rendered.alpha);
  add_rows("means", {n, 3}, g.means);
  add_rows("quats", {n, 4}, g.quats);
  add_rows("log_scales", {n, 3}, g.log_scales);
  add_rows("opacity_logits", {n}, g.opacity_logits);
  add_rows("sh", {n, k, 3}, g.sh);
  add("camera", {6}, {g.camera.begin(), g.camera.end()});
  npz.write(path);
}

}  // namespace

std::vector<double> read_target(const std::string& path, int height, int width) {
  const std::string ending = check_ending(path, "hsi4d gradients: --target", target_endings());
  std::vector<double> values;
  if (ending == ".npz") {
    values = npz_values(path, height, width);
  } else if (ending == ".exr") {
    const Image rgb = read_layers(path).select({"R", "G", "B"});
    check_size(path, rgb.height(), rgb.width(), height, width);
    values = wide(rgb);
  } else {
    const Image image = read_image(path);
    check_size(path, image.height(), image.width(), height, width);
    values = png_values(path, image);
  }
  check_finite(path, values, width);
  return values;
}

std::string gradients_command(const GradientsOptions& options) {
  check_ending(options.out, "hsi4d gradients: --out", {".npz"});
  check_ending(options.target, "hsi4d gradients: --target", target_endings());
  const SceneView view = view_of(options.shared, "hsi4d gradients");
  check_no_input(options.out, "hsi4d gradients: --out", {options.target, options.shared.scene, options.shared.camera});
  check_writable(options.out);
  const std::vector<double> target = read_target(options.target, view.camera.height, view.camera.width);
  const SplatFile scene = read_drawn(options.shared.scene, view.settings);
  SceneGradients gradients = scene_gradients(scene.gaussians, view, target);
  zero_held(gradients, scene.report);
  write_gradients(options.out, gradients, scene, view.precision);
  warn_if_nothing_drawn(shows_something(gradients.rendered), scene.gaussians, view.settings.alpha_min);
  return options.out + ": loss " + number_text(gradients.loss) + ", gradients of " +
         count_text(scene.gaussians.count(), "Gaussian") + " and the camera\n";
}

void add_gradients(CLI::App& app, Program& program) {
  GradientsOptions& gradients = program.options<GradientsOptions>();
  CLI::App& command = *app.add_subcommand("gradients", "Differentiate the difference of a render from an image");
  add_scene(command, gradients.shared)->required();
  command.add_option("--target", gradients.target, "The image to compare with")
      ->type_name("F.{exr,png,npz}")
      ->required();
  command.add_option("--out", gradients.out, "Where loss and gradients go")->type_name("F.npz")->required();
  command.footer(
      "Gradients are by the file's own numbers, its rows in order. They are 0 for what does not move the image: "
      "rows\n"
      "that the reader leaves out (a number that is not finite, a zero quaternion); log-scales and opacity logits\n"
      "that it holds at -20 or 20; coefficients above render.sh_degree; what the camera does not see.\n"
      "A pixel where alpha is held at render.alpha_cap adds nothing through that alpha, unless\n"
      "render.cap_gradient is pass (render.compatibility=inria makes it so).");
  run_when_chosen(command, program,
                  [&] { return run_on_threads(gradients.shared, [&] { return gradients_command(gradients); }); });
}

}  // namespace hsi4d::cli
