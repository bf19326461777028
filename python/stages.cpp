// A stage at hand.
#include <atomic>
#include <memory>
#include <optional>
#include <pybind11/stl.h>
#include <variant>

#include "core/check.h"
#include "core/parallel.h"
#include "pipelines/run/pixel_filter.h"
#include "pipelines/run/stage_session.h"
#include "python/arrays.h"
#include "python/parts.h"

namespace hsi4d::python {

namespace {

/// What Python holds of a stage: in the precision of its config. One call at a time.
class Stage {
  using Session = std::variant<std::unique_ptr<StageSession<float>>, std::unique_ptr<StageSession<double>>>;

  /// What `use` makes of the session, while no other call does.
  template <class F>
  auto visit(F use) const {
    if (is_busy_.exchange(true))
      throw UserError("the stage is at work in another call; allowed: one call at a time, a stage for each thread");
    struct Free {
      std::atomic<bool>& busy;
      ~Free() { busy = false; }
    } free{is_busy_};
    return std::visit([&](const auto& session) { return use(*session); }, session_);
  }

  /// Runs `body` on the threads that were asked for, while other threads of Python run.
  template <class F>
  void work(F body) const {
    const Released released;
    if (threads_ > 0) return with_threads(threads_, body);
    body();
  }

 public:
  Stage(const Config& config, const std::string& name, std::optional<Index> frame,
        const std::optional<std::vector<SceneState>>& before, const std::optional<SceneState>& start, int threads)
      : threads_(threads) {
    if (threads < 0)
      throw UserError("threads: " + std::to_string(threads) + "; allowed: 0 (as the config says) or more");
    if (threads_ == 0) threads_ = config.settings.threads;
    work([&] {
      auto inputs = std::make_unique<StageInputs>(config.settings, config.losses, StageChoice{name, frame});
      estimate_blur(*inputs);
      set_states(*inputs, before ? &*before : nullptr, start ? &*start : nullptr);
      if (inputs->config.precision == RunPrecision::kFloat) {
        session_ = std::make_unique<StageSession<float>>(std::move(inputs));
      } else {
        session_ = std::make_unique<StageSession<double>>(std::move(inputs));
      }
    });
  }

  py::tuple evaluate(const py::object& parameters) {
    if (!parameters.is_none()) set_parameters(parameters);
    return visit([&](auto& session) -> py::tuple {
      double loss = 0;
      work([&] { loss = session.run().evaluate(); });
      return py::make_tuple(loss, dict_of(session.gradients()));
    });
  }

  py::dict step() {
    return visit([&](auto& session) {
      auto& run = session.run();
      if (run.is_done())
        throw UserError("stage '" + session.inputs().name() + "': all its " + std::to_string(run.iteration()) +
                        " iterations are done; `iterations` of its settings says how many there are");
      py::dict report;
      Index iteration = 0;
      double loss = 0, seconds = 0;
      bool rolled_back = false;
      work([&] {
        run.step([&](const IterationReport& made) {
          iteration = made.iteration;
          loss = made.loss;
          seconds = made.seconds;
          rolled_back = made.rolled_back;
        });
      });
      report["iteration"] = iteration;
      report["loss"] = loss;
      report["seconds"] = seconds;
      report["rolled_back"] = rolled_back;
      return report;
    });
  }

  double finish() {
    return visit([&](auto& session) {
      if (is_finished_) throw UserError("stage '" + session.inputs().name() + "': it is finished already");
      is_finished_ = true;
      double loss = 0;
      work([&] { loss = session.run().finish().loss; });
      return loss;
    });
  }

  py::dict parameters() const {
    return visit([&](const auto& session) { return dict_of(session.parameters()); });
  }

  void set_parameters(const py::object& parameters) {
    if (!py::isinstance<py::dict>(parameters))
      throw UserError("parameters: a " + std::string(Py_TYPE(parameters.ptr())->tp_name) +
                      "; allowed: a dict of groups and arrays");
    visit([&](auto& session) { write(session, py::dict(parameters)); });
  }

  py::dict terms() const {
    return visit([](const auto& session) {
      py::dict values;
      for (const LossValue& term : session.run().terms()) values[py::str(term.name)] = term.value;
      return values;
    });
  }
  py::dict weights() const {
    return visit([](const auto& session) {
      py::dict values;
      for (const LossValue& term : session.run().terms()) values[py::str(term.name)] = term.weight;
      return values;
    });
  }
  std::vector<std::string> off() const {
    return visit([](const auto& session) { return session.run().off(); });
  }
  std::vector<std::string> objects() const {
    return visit([](const auto& session) {
      std::vector<std::string> names;
      for (const ClipObject& object : session.inputs().clip.objects) names.push_back(object.name);
      return names;
    });
  }
  std::string name() const {
    return visit([](const auto& session) { return session.inputs().name(); });
  }
  std::optional<Index> frame() const {
    return visit([](const auto& session) { return session.inputs().frame; });
  }
  Index iteration() const {
    return visit([](const auto& session) { return session.run().iteration(); });
  }
  Index iterations() const {
    return visit([](const auto& session) { return session.inputs().settings().iterations; });
  }
  bool is_done() const {
    return visit([](const auto& session) { return session.run().is_done(); });
  }
  SceneState state() const {
    return visit([](const auto& session) { return session.state(); });
  }
  std::vector<SceneState> states() const {
    return visit([](const auto& session) { return session.states(); });
  }
  Camera camera() const {
    return visit([](const auto& session) {
      Camera camera = session.inputs().clip.camera;
      camera.camera_from_world = session.state().camera_from_world;
      return camera;
    });
  }

  py::array_t<float> image() {
    return visit([&](auto& session) {
      Image image;
      work([&] { image = session.image(); });
      return array_of(image);
    });
  }
  py::array_t<float> target() const {
    return visit([](const auto& session) { return array_of(session.inputs().picture.target); });
  }

  py::dict check_gradients(Index entries, std::uint64_t seed) {
    if (entries < 1) throw UserError("entries: " + std::to_string(entries) + "; allowed: 1 or more");
    return visit([&](auto& session) {
      StageGradcheck found;
      work([&] { found = checked(session, entries, seed); });
      return gradcheck_dict(found);
    });
  }

 private:
  /// As a run does before its first frame.
  static void estimate_blur(StageInputs& inputs) {
    if (!inputs.config.estimate_blur) return;
    const PixelFilter filter = estimated_pixel_filter(inputs.config, inputs.clip);
    if (!filter.is_widest) inputs.config.render.blur = filter.blur;
  }

  template <class S>
  static py::dict dict_of(std::vector<GroupNumbers<S>> groups) {
    py::dict arrays;
    for (GroupNumbers<S>& group : groups)
      arrays[py::str(group.group)] = array_of(std::move(group.numbers), {group.rows, group.cols});
    return arrays;
  }

  template <class S>
  static void write(StageSession<S>& session, const py::dict& parameters) {
    std::vector<GroupNumbers<S>> groups;
    for (const auto& [key, value] : parameters) {
      const std::string name = py::str(key);
      Numbers<S> numbers = numbers_of<S>(value, {-1, -1}, name, "[rows,cols]");
      groups.push_back({name, numbers.shape[0], numbers.shape[1], std::move(numbers.values)});
    }
    session.set_parameters(groups);
  }

  template <class S>
  static StageGradcheck checked(const StageSession<S>& session, Index entries, std::uint64_t seed) {
    const StageInputs& inputs = session.inputs();
    RunConfig config = inputs.config;
    config.color_net.camera_gradient = true;
    const StageTask whole{config, inputs.clip, inputs.losses, inputs.stage};
    StageGradcheckOptions options;
    options.differences.entries = entries;
    options.differences.seed = seed;
    return inputs.frame ? check_frame_stage(whole, inputs.frame_task(), session.state(), inputs.colors(), options)
                        : check_sequence_stage(whole, session.states(), options);
  }

  static py::dict gradcheck_dict(const StageGradcheck& found) {
    py::dict groups;
    for (const GroupGradcheck& group : found.groups) {
      py::dict entry;
      entry["numbers"] = group.numbers;
      entry["tried"] = group.report.entries;
      entry["at_kinks"] = group.report.kinks;
      entry["worst_error"] = group.report.worst_error;
      entry["ok"] = group.numbers == 0 || group.report.ok();
      groups[py::str(group.group)] = entry;
    }
    py::dict result;
    result["ok"] = found.ok();
    result["loss"] = found.loss;
    result["groups"] = groups;
    return result;
  }

  int threads_ = 0;
  Session session_;
  bool is_finished_ = false;
  mutable std::atomic<bool> is_busy_{false};
};

}  // namespace

void add_stages(py::module_& module) {
  py::class_<Stage>(
      module, "Stage",
      "A stage of a config, in a frame of its clip or over the sequence: to be evaluated, stepped and looked\n"
      "at. After as many steps as it has iterations its parameters have the bits of a run's.\n\n"
      "frame: of a stage over frames; None: the first that has three frames before it. before: the State of\n"
      "each frame before it (of a stage over the sequence: of all frames); None: as they are given. start:\n"
      "the State in which it begins, that of the stage before it for example; None: as a run begins the frame.\n"
      "A color net begins as in a run's first frame. For one thread at a time.")
      .def(py::init<const Config&, const std::string&, std::optional<Index>,
                    const std::optional<std::vector<SceneState>>&, const std::optional<SceneState>&, int>(),
           py::arg("config"), py::arg("name"), py::arg("frame") = py::none(), py::arg("before") = py::none(),
           py::arg("start") = py::none(), py::arg("threads") = 0)
      .def(
          "evaluate", &Stage::evaluate, py::arg("parameters") = py::none(),
          "(loss, gradients): of the parameters as they are, or of those given, which then are the stage's. Gradients\n"
          "are arrays by group, of all groups that the stage moves. The optimiser notices nothing.")
      .def("step", &Stage::step,
           "One iteration, as a run makes it. A dict: iteration, loss (before the step), seconds, rolled_back.")
      .def("finish", &Stage::finish,
           "Ends the stage as a run does: evaluates the parameters that are left, takes the last step back where they\n"
           "give no finite loss. Returns the loss; no step follows.")
      .def_property(
          "parameters", &Stage::parameters, &Stage::set_parameters,
          "Arrays [rows,cols] by group, copies; what is assigned may have some of the groups. Rotations are as\n"
          "the config's `rotations` says, objects are rows in the clip's order.")
      .def_property_readonly("terms", &Stage::terms, "Values of the loss terms as last evaluated, without weights.")
      .def_property_readonly("weights", &Stage::weights, "Weights of these terms in the loss.")
      .def_property_readonly("off", &Stage::off, "Terms of the config that are off, for weight 0 or a missing input.")
      .def_property_readonly("objects", &Stage::objects, "Names of the clip's objects.")
      .def_property_readonly("name", &Stage::name, "Its name in the config.")
      .def_property_readonly("frame", &Stage::frame, "The frame; None: over the sequence.")
      .def_property_readonly("iteration", &Stage::iteration, "How many steps were made.")
      .def_property_readonly("iterations", &Stage::iterations, "How many there are.")
      .def_property_readonly("is_done", &Stage::is_done, "No further step is wanted.")
      .def_property_readonly("state", &Stage::state, "The State, with what the stage has moved. Of a stage of a frame.")
      .def_property_readonly("states", &Stage::states, "The State of each frame. Of a stage over the sequence.")
      .def_property_readonly("camera", &Stage::camera, "The camera as the state has it. Of a stage of a frame.")
      .def("image", &Stage::image, "[H,W,3] float32, what is drawn of the parameters as they are.")
      .def_property_readonly("target", &Stage::target,
                             "[H,W,3] float32, the frame of the video. Of a stage of a frame.")
      .def(
          "check_gradients", &Stage::check_gradients, py::arg("entries") = 8, py::arg("seed") = 1,
          "Gradients by each group against central differences in double, at the present parameters, each moved by up\n"
          "to 0.01, at random. A dict: ok, loss, groups by name (numbers, tried, at_kinks, worst_error, ok).");
}

}  // namespace hsi4d::python
