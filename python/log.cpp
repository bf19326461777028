// The log, handed to functions of Python.
#include "core/log.h"

#include <memory>
#include <optional>
#include <pybind11/functional.h>

#include "core/check.h"
#include "core/text.h"
#include "python/held_function.h"
#include "python/parts.h"

namespace hsi4d::python {

namespace {

constexpr LogLevel kLevels[] = {LogLevel::kTrace, LogLevel::kDebug, LogLevel::kInfo, LogLevel::kWarning,
                                LogLevel::kError};

LogLevel level_named(const std::string& name) {
  std::vector<std::string> known;
  for (const LogLevel level : kLevels) {
    if (log_level_name(level) == name) return level;
    known.emplace_back(log_level_name(level));
  }
  throw UserError("level: \"" + name + "\" is not known; allowed: " + joined(known));
}

/// Levels of Python's logging.
int python_level(LogLevel level) {
  switch (level) {
    case LogLevel::kTrace:
    case LogLevel::kDebug:
      return 10;
    case LogLevel::kInfo:
      return 20;
    case LogLevel::kWarning:
      return 30;
    case LogLevel::kError:
      break;
  }
  return 40;
}

/// A sink that Python holds.
class PythonSink {
 public:
  PythonSink(const py::object& target, const std::string& level) {
    const bool is_logger = py::hasattr(target, "log");
    const HeldFunction function(is_logger ? py::object(target.attr("log")) : target, "target");
    const LogLevel least = level_named(level);
    const Released released;  // the log waits for a sink that may wait for us
    sink_ = log_to(
        [function, is_logger](LogLevel of_message, std::string_view message) {
          const py::gil_scoped_acquire acquired;
          if (is_logger) {
            function.get()(python_level(of_message), "%s", py::str(message.data(), message.size()));
          } else {
            function.get()(py::str(std::string(log_level_name(of_message))), py::str(message.data(), message.size()));
          }
        },
        least);
  }
  ~PythonSink() { close(); }
  PythonSink(const PythonSink&) = delete;
  PythonSink& operator=(const PythonSink&) = delete;

  void close() {
    const Released released;
    sink_.reset();
  }

 private:
  std::optional<LogSink> sink_;
};

}  // namespace

void add_log(py::module_& module) {
  py::class_<PythonSink>(module, "LogSink", "Where messages of the library go, until it is closed or forgotten.")
      .def("close", &PythonSink::close, "Sends nothing more.")
      .def("__enter__", [](py::object self) { return self; })
      .def("__exit__", [](PythonSink& sink, const py::args&) { sink.close(); });
  module.def(
      "log_to",
      [](const py::object& target, const std::string& level) { return std::make_unique<PythonSink>(target, level); },
      py::arg("target"), py::arg("level") = "info",
      "Sends messages of the library to a function of (level, message), or to a logging.Logger.\n\n"
      "level: the least that is sent: trace, debug, info, warning or error.\n"
      "Messages come as long as the returned LogSink lives, on the thread that makes them, one at a time. The\n"
      "function must not call hsi4d. Without a sink nothing is written anywhere.");
}

}  // namespace hsi4d::python
