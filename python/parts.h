// The parts of the module; each adds its classes and functions. Those that a part's signatures name come before it.
#pragma once

#include <filesystem>
#include <pybind11/pybind11.h>
#include <string>
#include <vector>

#include "optim/loss_term.h"
#include "pipelines/config/run_config.h"

namespace hsi4d::python {

namespace py = pybind11;

/// A config, and the loss terms that were known when it was read: those are what its names stand for.
struct Config {
  RunConfig settings;
  std::vector<LossTerm> losses;
};

/// The library's terms and those that Python registered.
std::vector<LossTerm> known_losses();

/// An object of JSON's kinds as the text of it. Throws what Python's json does.
std::string json_text(const py::object& value);
/// The object of a JSON text.
py::object from_json(const std::string& text);

/// KEY=VALUE pairs of None, a list of such texts, or a dict whose values are what JSON holds. Throws UserError.
std::vector<std::string> overrides_of(const py::object& overrides);

/// The names of the objects that an objects.npz has tracks of, in its order.
std::vector<std::string> track_names(const std::filesystem::path& path);
/// Names, and pairs of rotations [T,3] and translations [T,3].
py::dict read_tracks(const std::filesystem::path& path);

/// While it lives, other threads of Python run.
using Released = py::gil_scoped_release;
/// For functions that touch nothing of Python: what they log may wait for a sink that does.
using WhileReleased = py::call_guard<py::gil_scoped_release>;

void add_errors(py::module_& module);
void add_log(py::module_& module);
void add_cameras(py::module_& module);
void add_images(py::module_& module);
void add_gaussians(py::module_& module);
void add_bodies(py::module_& module);
void add_render(py::module_& module);
void add_losses(py::module_& module);
void add_config(py::module_& module);
void add_runs(py::module_& module);
void add_stages(py::module_& module);

}  // namespace hsi4d::python
