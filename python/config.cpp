// Configs of runs.
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "core/check.h"
#include "core/config_file.h"
#include "pipelines/config/run_config.h"
#include "python/parts.h"

namespace hsi4d::python {

namespace {

namespace fs = std::filesystem;

Config load(const fs::path& file, const py::object& overrides) {
  const std::vector<std::string> set = overrides_of(overrides);
  std::vector<LossTerm> losses = known_losses();
  const Released released;
  RunConfig settings = load_run_config(file, set, descriptions_of(losses), ConfigUse::kRun);
  return {std::move(settings), std::move(losses)};
}

/// @param folder  what relative paths are relative to
Config made(const py::dict& tree, const fs::path& folder, const py::object& overrides) {
  const std::string text = json_text(tree);
  const std::vector<std::string> set = overrides_of(overrides);
  std::vector<LossTerm> losses = known_losses();
  const Released released;
  ConfigProblems problems;
  const ConfigValue read = load_config_text(text, "config", fs::absolute(folder), set, problems);
  RunConfig settings = read_run_config(read, descriptions_of(losses), problems, ConfigUse::kRun);
  problems.throw_if_any();
  return {std::move(settings), std::move(losses)};
}

std::vector<std::string> stage_names(const Config& config) {
  std::vector<std::string> names;
  for (const auto& [name, stage] : with_passes(config.settings).stages) names.push_back(name);
  return names;
}

std::string resolved(const Config& config) { return resolved_config(config.settings, descriptions_of(config.losses)); }

}  // namespace

std::string json_text(const py::object& value) {
  return py::module_::import("json").attr("dumps")(value).cast<std::string>();
}

py::object from_json(const std::string& text) { return py::module_::import("json").attr("loads")(text); }

std::vector<std::string> overrides_of(const py::object& overrides) {
  std::vector<std::string> set;
  if (overrides.is_none()) return set;
  if (py::isinstance<py::dict>(overrides)) {
    for (const auto& [key, value] : py::dict(overrides))
      set.push_back(std::string(py::str(key)) + "=" + json_text(py::reinterpret_borrow<py::object>(value)));
    return set;
  }
  if (!py::isinstance<py::list>(overrides) && !py::isinstance<py::tuple>(overrides))
    throw UserError("overrides: a " + std::string(Py_TYPE(overrides.ptr())->tp_name) +
                    "; allowed: a dict, or a list of texts KEY=VALUE");
  for (const py::handle text : overrides) {
    if (!py::isinstance<py::str>(text))
      throw UserError("overrides: a " + std::string(Py_TYPE(text.ptr())->tp_name) + "; allowed: texts KEY=VALUE");
    set.push_back(text.cast<std::string>());
  }
  return set;
}

void add_config(py::module_& module) {
  py::class_<Config>(module, "Config", "The config of a run, checked, and the loss terms that its names stand for.")
      .def_property_readonly(
          "name", [](const Config& config) { return config.settings.name; }, "Its name.")
      .def_property_readonly("stages", &stage_names, "Names of its stages, in their order.")
      .def_property_readonly(
          "settings", [](const Config& config) { return from_json(resolved(config)); },
          "Every setting, defaults included, as config.resolved.json has it: a dict, a copy.")
      .def("__repr__", [](const Config& config) { return "<hsi4d.Config " + config.settings.name + ">"; });
  module.def(
      "load_config", &load, py::arg("file"), py::arg("overrides") = py::none(),
      "Reads and checks a config file (docs/running.md).\n\n"
      "overrides: a dict of keys, \"stages.camera.iterations\", and values, or a list of texts KEY=VALUE. All that\n"
      "is wrong is in one UserError, a line each.");
  module.def(
      "make_config", &made, py::arg("settings"), py::arg("folder") = ".", py::arg("overrides") = py::none(),
      "A config of a dict, as a file would have it; folder is what its paths, and \"extends\", are relative to.");
}

}  // namespace hsi4d::python
