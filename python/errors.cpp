// Errors as exceptions of Python, with the same messages.
#include "core/check.h"
#include "core/observer.h"
#include "optim/stage.h"
#include "python/parts.h"

namespace hsi4d::python {

void add_errors(py::module_& module) {
  const auto user = py::register_exception<UserError>(module, "UserError", PyExc_ValueError);
  const auto data = py::register_exception<DataError>(module, "DataError", PyExc_ValueError);
  const auto internal = py::register_exception<InternalError>(module, "InternalError", PyExc_RuntimeError);
  const auto interrupted = py::register_exception<Interrupted>(module, "Interrupted", PyExc_RuntimeError);
  const auto diverged = py::register_exception<StageDivergedError>(module, "StageDivergedError", user);
  const auto describe_error = [](const py::handle& type, const char* text) { type.attr("__doc__") = text; };
  describe_error(user, "A mistake of the caller: an argument, a config, a file that is not there.");
  describe_error(data, "What is in a file is wrong. The message names the file and the position.");
  describe_error(internal, "A bug of hsi4d, or a use that no message foresees.");
  describe_error(interrupted, "A run was asked to stop. What is finished is kept; resume=True goes on.");
  describe_error(diverged, "A stage met numbers that are not finite too often.");
}

}  // namespace hsi4d::python
