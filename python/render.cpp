// Renders and their gradients.
#include <pybind11/stl.h>

#include "core/check.h"
#include "core/config_file.h"
#include "core/parallel.h"
#include "core/text.h"
#include "pipelines/draw/image_cotangent.h"
#include "pipelines/draw/posed_avatar.h"
#include "python/arrays.h"
#include "python/parts.h"

namespace hsi4d::python {

namespace {

/// Render settings of a JSON text or a dict, and of keywords, which win.
RenderSettings render_settings_of(const py::object& settings, const py::kwargs& keywords) {
  py::dict all;
  if (py::isinstance<py::str>(settings)) {
    const py::object read = from_json(settings.cast<std::string>());
    if (!py::isinstance<py::dict>(read)) throw UserError("settings: allowed: a JSON object of render settings");
    all = py::dict(read);
  } else if (!settings.is_none()) {
    all = py::dict(settings);
  }
  for (const auto& [key, value] : keywords) all[key] = value;
  ConfigProblems problems;
  const ConfigValue tree = load_config_text(json_text(all), "render settings", {}, {}, problems);
  return read_settings<RenderSettings>(tree, problems);
}

py::object settings_dict(const py::object& settings, const py::kwargs& keywords) {
  RenderSettings render = render_settings_of(settings, keywords);
  ConfigFields fields;
  describe(fields, render);
  return from_json(to_json(write_config(fields)));
}

/// Keywords that every render has.
struct RenderArguments {
  SceneView view;
  int threads = 0;

  bool is_float() const { return view.precision == Precision::kFloat; }
  Sizes shape() const { return {view.camera.height, view.camera.width, 3}; }
  Sizes plane() const { return {view.camera.height, view.camera.width}; }
};

Precision precision_named(const std::string& name) {
  std::vector<std::string> known;
  for (const auto& choice : kPrecisions) {
    if (choice.name == name) return choice.value;
    known.emplace_back(choice.name);
  }
  throw UserError("precision: \"" + name + "\" is not known; allowed: " + joined(known));
}

RenderArguments arguments_of(const Camera& camera, py::handle background, const std::string& precision, int threads,
                             const py::object& settings, const py::kwargs& keywords) {
  RenderArguments arguments;
  const Vector3<double> behind = vector_of(background, "background");
  if (!behind.allFinite()) throw UserError("background: allowed: finite numbers");
  if (threads < 0) throw UserError("threads: " + std::to_string(threads) + "; allowed: 0 (one a core) or more");
  arguments.view = {
      camera, {behind[0], behind[1], behind[2]}, render_settings_of(settings, keywords), precision_named(precision)};
  arguments.threads = threads;
  return arguments;
}

/// What `work` gives on the threads that were asked for, while other threads of Python run.
template <class F>
auto released_on(int threads, F work) {
  const Released released;
  if (threads == 0) return work();
  decltype(work()) result;
  with_threads(threads, [&] { result = work(); });
  return result;
}

/// One set of Gaussians, or several, one after the other. While `kept` lives so do they.
struct Drawn {
  std::vector<py::object> kept;
  PosedGaussians together;  // of several
  const PosedGaussians* scene = nullptr;
};

void gather(const py::object& gaussians, Drawn& drawn) {
  if (py::isinstance<PosedGaussians>(gaussians)) {
    drawn.kept.push_back(gaussians);
    drawn.scene = &gaussians.cast<const PosedGaussians&>();
    return;
  }
  if (!py::isinstance<py::sequence>(gaussians) || py::len(gaussians) == 0)
    throw UserError("gaussians: a " + std::string(Py_TYPE(gaussians.ptr())->tp_name) +
                    "; allowed: Gaussians, or a list of some");
  std::vector<PosedGaussians> parts;
  for (const py::handle part : gaussians) {
    const std::string name = "gaussians[" + std::to_string(parts.size()) + "]";
    if (!py::isinstance<PosedGaussians>(part))
      throw UserError(name + ": a " + std::string(Py_TYPE(part.ptr())->tp_name) + "; allowed: Gaussians");
    parts.push_back(part.cast<const PosedGaussians&>());
    if (parts.back().gaussians.origin_world != parts.front().gaussians.origin_world)
      throw UserError(name + ": its origin_world is not that of the first; allowed: one origin for all");
  }
  drawn.together = concatenated(parts);
  drawn.scene = &drawn.together;
}

py::array render_image(const py::object& gaussians, const Camera& camera, py::handle background,
                       const std::string& precision, int threads, const py::object& settings,
                       const py::kwargs& keywords) {
  const RenderArguments arguments = arguments_of(camera, background, precision, threads, settings, keywords);
  Drawn drawn;
  gather(gaussians, drawn);
  if (arguments.is_float())
    return array_of(released_on(threads, [&] { return render_picture(*drawn.scene, arguments.view); }).image);
  SceneImage image = released_on(threads, [&] { return render_scene(*drawn.scene, arguments.view); });
  return array_of(std::move(image.image), arguments.shape());
}

py::dict render_layers(const py::object& gaussians, const Camera& camera, py::handle background,
                       const std::string& precision, int threads, const py::object& settings,
                       const py::kwargs& keywords) {
  const RenderArguments arguments = arguments_of(camera, background, precision, threads, settings, keywords);
  Drawn drawn;
  gather(gaussians, drawn);
  const SceneImage image = released_on(threads, [&] { return render_scene(*drawn.scene, arguments.view); });
  py::dict layers;
  layers["image"] = rounded_array(image.image, arguments.shape(), arguments.is_float());
  layers["alpha"] = rounded_array(image.alpha, arguments.plane(), arguments.is_float());
  layers["depth"] = rounded_array(image.depth, arguments.plane(), arguments.is_float());
  return layers;
}

py::dict render_gradients(const PosedGaussians& posed, const Camera& camera, py::handle cotangent,
                          py::handle background, const std::string& precision, int threads, const py::object& settings,
                          const py::kwargs& keywords) {
  const RenderArguments arguments = arguments_of(camera, background, precision, threads, settings, keywords);
  if (!posed.transforms.empty())
    throw UserError("gaussians: they are bent by a body's pose; allowed: those that stand as their numbers say");
  const std::vector<double> by_image = numbers_of<double>(cotangent, arguments.shape(), "cotangent",
                                                          shape_text(arguments.shape()) + ", as the camera's image")
                                           .values;
  const ImageAdjoint adjoint =
      released_on(threads, [&] { return image_adjoint(posed.gaussians, arguments.view, by_image); });
  const SceneGradients& numbers = adjoint.numbers;
  const py::ssize_t n = posed.gaussians.count();
  const bool is_float = arguments.is_float();
  py::dict result;
  result["image"] = rounded_array(numbers.rendered.image, arguments.shape(), is_float);
  result["means"] = rounded_array(numbers.means, {n, 3}, is_float);
  result["quats"] = rounded_array(numbers.quats, {n, 4}, is_float);
  result["log_scales"] = rounded_array(numbers.log_scales, {n, 3}, is_float);
  result["opacity_logits"] = rounded_array(numbers.opacity_logits, {n}, is_float);
  result["sh"] = rounded_array(numbers.sh, {n, posed.gaussians.sh_coefficients(), 3}, is_float);
  result["camera"] = rounded_array({numbers.camera.begin(), numbers.camera.end()}, {6}, is_float);
  result["background"] = rounded_array({adjoint.background.begin(), adjoint.background.end()}, {3}, is_float);
  return result;
}

}  // namespace

void add_render(py::module_& module) {
  const py::tuple black = py::make_tuple(0, 0, 0);
  module.def(
      "render", &render_image, py::arg("gaussians"), py::arg("camera"), py::arg("background") = black,
      py::arg("precision") = "float", py::arg("threads") = 0, py::arg("settings") = py::none(),
      "The image [H,W,3] of Gaussians, or of a list of some, not clamped; float32, or float64 where precision is\n"
      "\"double\" or \"reference\" (brute force).\n\n"
      "background: [3] colour behind everything. threads: 0, one a core. settings: those of the section `render`\n"
      "of a config, a dict or JSON text; each may be a keyword too: render(g, camera, quality=\"accurate\").");
  module.def("render_layers", &render_layers, py::arg("gaussians"), py::arg("camera"), py::arg("background") = black,
             py::arg("precision") = "float", py::arg("threads") = 0, py::arg("settings") = py::none(),
             "As render, a dict: image [H,W,3], alpha [H,W], depth [H,W] in metres, 0 where nothing is.");
  module.def(
      "render_gradients", &render_gradients, py::arg("gaussians"), py::arg("camera"), py::arg("cotangent"),
      py::arg("background") = black, py::arg("precision") = "float", py::arg("threads") = 0,
      py::arg("settings") = py::none(),
      "Gradients of sum(cotangent * image), cotangent [H,W,3]: a dict with means, quats, log_scales,\n"
      "opacity_logits and sh in the shapes of the Gaussians, camera [6] (by the numbers of T <- Exp(xi) T, xi =\n"
      "(translation, rotation) in the camera's axes, at 0), background [3], and the image itself.");
  module.def("render_settings", &settings_dict, py::arg("settings") = py::none(),
             "All render settings as a dict, those given and the defaults of the others.");
}

}  // namespace hsi4d::python
