// A function of Python, held by code that does not hold the interpreter.
#pragma once

#include <memory>
#include <pybind11/pybind11.h>
#include <string>

#include "core/check.h"

namespace hsi4d::python {

namespace py = pybind11;

/// Copied and destroyed on any thread, whether it holds the interpreter or not; called where it does.
class HeldFunction {
 public:
  /// @param name  what the message calls it. Throws UserError for what cannot be called.
  HeldFunction(const py::object& function, const std::string& name) {
    if (PyCallable_Check(function.ptr()) == 0)
      throw UserError(name + ": a " + std::string(Py_TYPE(function.ptr())->tp_name) + "; allowed: a function");
    held_ = std::shared_ptr<py::object>(new py::object(function), [](py::object* held) {
      if (Py_IsInitialized() == 0) return;  // the interpreter is gone, and the function with it
      const py::gil_scoped_acquire acquired;
      delete held;
    });
  }

  const py::object& get() const { return *held_; }

 private:
  std::shared_ptr<py::object> held_;
};

}  // namespace hsi4d::python
