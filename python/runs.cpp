// Runs: how they are carried out, and what is in their folders; the table of a sweep.
#include <exception>
#include <optional>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/json_text.h"
#include "pipelines/chain/chain.h"
#include "pipelines/config/masks.h"
#include "pipelines/input/body_files.h"
#include "pipelines/record/folder.h"
#include "pipelines/run/run.h"
#include "pipelines/sweep/results.h"
#include "python/arrays.h"
#include "python/held_function.h"
#include "python/parts.h"

namespace hsi4d::python {

namespace {

namespace fs = std::filesystem;

// --- a run -----------------------------------------------------------------------------------------------------------

py::dict progress_dict(const ProgressState& state) {
  py::dict progress;
  progress["task"] = py::str(state.task.data(), state.task.size());
  progress["done"] = state.done;
  progress["total"] = state.total;
  progress["seconds"] = state.seconds;
  progress["seconds_left"] = state.seconds_left >= 0 ? py::object(py::float_(state.seconds_left)) : py::none();
  py::dict terms;
  for (const ProgressPart& part : state.parts) terms[py::str(part.name.data(), part.name.size())] = part.value;
  progress["loss"] = state.value_name.empty() ? py::none() : py::object(py::float_(state.value));
  progress["terms"] = terms;
  progress["is_finished"] = state.is_finished;
  return progress;
}

/// Who watches a run in Python. What the function or Ctrl-C raises stops the run, and is raised when that has ended.
class Watcher {
 public:
  explicit Watcher(const py::object& progress) {
    if (!progress.is_none()) function_.emplace(progress, "progress");
  }

  Observer observer(double interval) {
    Observer observer;
    if (function_) observer.progress = [this](const ProgressState& state) { show(state); };
    observer.progress_interval = interval;
    observer.stop_requested = [this] { return wants_stop(); };
    return observer;
  }

  /// Raises what was raised meanwhile.
  void raise_if_any() const {
    if (raised_) std::rethrow_exception(raised_);
  }

 private:
  void show(const ProgressState& state) {
    if (stops_) return;
    const py::gil_scoped_acquire acquired;
    try {
      const py::object answer = function_->get()(progress_dict(state));
      stops_ = !answer.is_none() && !answer.cast<bool>();
    } catch (py::error_already_set&) {
      stop_with(std::current_exception());
    }
  }
  bool wants_stop() {
    if (stops_) return true;
    const py::gil_scoped_acquire acquired;
    if (PyErr_CheckSignals() != 0) stop_with(std::make_exception_ptr(py::error_already_set()));
    return stops_;
  }
  void stop_with(std::exception_ptr raised) {
    raised_ = std::move(raised);
    stops_ = true;
  }

  std::optional<HeldFunction> function_;
  bool stops_ = false;
  std::exception_ptr raised_;
};

/// A run folder, read when it is asked.
struct Run {
  RunPaths paths;
};

Run opened(const fs::path& folder) {
  if (!fs::exists(RunPaths{folder}.status()))
    throw UserError(folder.string() + ": holds no run; allowed: a folder that `run` has written");
  return {RunPaths{folder}};
}

Run run(const Config& config, const fs::path& out, const py::object& progress, int threads, bool resume,
        double progress_interval) {
  if (threads < 0) throw UserError("threads: " + std::to_string(threads) + "; allowed: 0 (as the config says) or more");
  Watcher watcher(progress);
  RunOptions options;
  options.folder = out.string();
  options.resume = resume;
  options.threads = threads;
  options.observer = watcher.observer(progress_interval);
  try {
    const Released released;
    if (config.settings.chain.empty()) {
      execute_run(config.settings, config.losses, options);
    } else {
      execute_chain(config.settings, config.losses, options);
    }
  } catch (const Interrupted&) {
    watcher.raise_if_any();
    throw;
  }
  watcher.raise_if_any();
  return opened(out);
}

// --- its files -------------------------------------------------------------------------------------------------------

py::object json_file(const std::string& path) { return from_json(read_text_file(path)); }

py::object summary(const Run& run) {
  const std::string text = read_text_file(run.paths.summary());
  parse_summary(text, run.paths.summary());
  return from_json(text);
}

py::list metrics(const Run& run) {
  const std::string text = read_text_file(run.paths.metrics());
  py::list lines;
  for (std::size_t begin = 0, end = 0; (end = text.find('\n', begin)) != std::string::npos; begin = end + 1)
    lines.append(from_json(text.substr(begin, end - begin)));
  return lines;
}

ConfigValue config_of(const Run& run) {
  return parse_json_text(read_text_file(run.paths.config()), run.paths.config());
}

/// The keys of a section of `data`; none where there is none.
std::vector<std::string> names_in_data(const ConfigValue& holder, const char* section) {
  const ConfigValue* const data = find_member(holder, "data");
  const ConfigValue* const found = data == nullptr ? nullptr : find_member(*data, section);
  std::vector<std::string> names;
  if (found == nullptr) return names;
  for (const ConfigMember& member : found->members) names.push_back(member.key);
  return names;
}

/// The names of the people: as their masks are called, the first one first.
std::vector<std::string> people_of(const Run& run) {
  std::vector<std::string> names = names_in_data(config_of(run), "people");
  names.insert(names.begin(), kHumanMasks);
  return names;
}

/// Their motions, in the same order.
std::vector<Motion> read_motions(const Run& run, const std::vector<std::string>& people) {
  std::vector<Motion> all = {read_motion_with_warnings(run.paths.motion())};
  for (std::size_t p = 1; p < people.size(); ++p)
    all.push_back(read_motion_with_warnings(run.paths.motion_of(people[p])));
  return all;
}

Motion motion(const Run& run) {
  const Released released;
  return read_motion_with_warnings(run.paths.motion());
}

py::dict motions(const Run& run) {
  std::vector<std::string> people;
  std::vector<Motion> read;
  {
    const Released released;
    people = people_of(run);
    read = read_motions(run, people);
  }
  py::dict all;
  for (std::size_t p = 0; p < people.size(); ++p) all[py::str(people[p])] = std::move(read[p]);
  return all;
}

/// Whether nothing but people moves in it: then there is no file of objects.
bool has_no_objects(const Run& run) {
  const ConfigValue config = config_of(run);
  if (!names_in_data(config, "objects").empty()) return false;
  const ConfigValue* const chain = find_member(config, "chain");  // whose clips all have the same objects
  return chain == nullptr || chain->items.empty() || names_in_data(chain->items.front(), "objects").empty();
}

py::dict objects(const Run& run) { return has_no_objects(run) ? py::dict() : read_tracks(run.paths.objects()); }

std::vector<std::string> object_names(const Run& run) {
  return has_no_objects(run) ? std::vector<std::string>() : track_names(run.paths.objects());
}

void check_frames(const std::string& file, std::size_t frames, const std::string& cameras, std::size_t wanted) {
  if (frames != wanted)
    throw DataError(file + ": it has " + std::to_string(frames) + " frames, " + cameras + " " + std::to_string(wanted));
}

std::vector<SceneState> states(const Run& run) {
  const Released released;
  const std::vector<std::string> people = people_of(run), names = object_names(run);
  const std::vector<Motion> bodies = read_motions(run, people);
  const std::vector<Camera> cameras = read_cameras(run.paths.cameras());
  std::vector<SceneState> all(cameras.size());
  for (std::size_t p = 0; p < people.size(); ++p)
    check_frames(p == 0 ? run.paths.motion() : run.paths.motion_of(people[p]), bodies[p].poses.size(),
                 run.paths.cameras(), cameras.size());
  for (std::size_t t = 0; t < cameras.size(); ++t) {
    all[t].camera_from_world = cameras[t].camera_from_world;
    all[t].body = bodies[0].poses[t];
    for (std::size_t p = 1; p < people.size(); ++p) all[t].others.push_back(bodies[p].poses[t]);
  }
  if (names.empty()) return all;
  auto tracks = read_object_tracks(run.paths.objects(), names);
  check_frames(run.paths.objects(), tracks.size(), run.paths.cameras(), cameras.size());
  for (std::size_t t = 0; t < cameras.size(); ++t) all[t].objects = std::move(tracks[t]);
  return all;
}

py::array_t<double> pairs_of(const std::vector<PlaceSigmas>& frames, std::vector<PlaceSigma> PlaceSigmas::*part,
                             std::size_t begin, std::size_t end, Sizes shape) {
  std::vector<double> numbers;
  for (const PlaceSigmas& frame : frames) {
    for (std::size_t i = begin; i < end; ++i) {
      numbers.push_back((frame.*part)[i].across);
      numbers.push_back((frame.*part)[i].along);
    }
  }
  return array_of(std::move(numbers), std::move(shape));
}

py::dict sigmas(const Run& run) {
  std::vector<std::string> names;
  std::vector<PlaceSigmas> frames;
  {
    const Released released;
    names = object_names(run);
    frames = read_place_sigmas(run.paths.motion(), run.paths.objects(), names);
  }
  py::dict all;
  if (frames.empty()) return all;
  const py::ssize_t count = std::ssize(frames), joints = std::ssize(frames[0].joints);
  all[kHumanMasks] = pairs_of(frames, &PlaceSigmas::joints, 0, frames[0].joints.size(), {count, joints, 2});
  for (std::size_t o = 0; o < names.size(); ++o)
    all[py::str(names[o])] = pairs_of(frames, &PlaceSigmas::objects, o, o + 1, {count, 2});
  return all;
}

py::array_t<float> frame_image(const Run& run, int frame, const std::string& kind) {
  Image image;
  {
    const Released released;
    image = read_image(run.paths.frame_image(frame, kind));
  }
  return array_of(image);
}

// --- sweeps ----------------------------------------------------------------------------------------------------------

py::object word(const std::string& text) { return text.empty() ? py::none() : py::object(py::str(text)); }

py::dict sweep_row(const SweepRun& run, const SweepRow& row, const SweepPaths& paths) {
  py::dict values, metrics;
  for (const auto& [key, text] : run.values) values[py::str(key)] = from_json(text);
  for (const auto& [name, value] : row.values) metrics[py::str(name)] = value;
  py::dict entry;
  entry["label"] = sweep_label(run);
  entry["block"] = word(run.block);
  entry["clip"] = word(run.clip);
  entry["ablation"] = word(run.ablation);
  entry["seed"] = word(run.seed);
  entry["values"] = values;
  entry["state"] = std::string(sweep_run_state_name(row.state));
  entry["metrics"] = metrics;
  entry["folder"] = paths.run(run.id);
  return entry;
}

py::list read_sweep(const fs::path& folder) {
  const SweepPaths paths{folder};
  SweepResults results;
  {
    const Released released;
    results = read_sweep_results(paths);
  }
  py::list rows;
  for (const SweepRow& row : results.rows) rows.append(sweep_row(results.plan.runs[row.index], row, paths));
  return rows;
}

}  // namespace

void add_runs(py::module_& module) {
  py::class_<Run>(module, "Run", "The folder of a run (docs/running.md). Files are read when they are asked for.")
      .def(py::init(&opened), py::arg("folder"))
      .def_property_readonly(
          "folder", [](const Run& run) { return run.paths.folder.string(); }, "Its path.")
      .def_property_readonly(
          "config", [](const Run& run) { return json_file(run.paths.config()); }, "config.resolved.json, a dict.")
      .def_property_readonly(
          "status", [](const Run& run) { return json_file(run.paths.status()); }, "status.json, a dict.")
      .def_property_readonly("summary", &summary, "summary.json, a dict: errors by stage and frame.")
      .def_property_readonly("metrics", &metrics, "metrics.jsonl, a list of dicts, one an iteration.")
      .def_property_readonly("motion", &motion, "The body of the first person in all frames.")
      .def_property_readonly(
          "motions", &motions,
          "The bodies of all people in all frames: a dict of names and Motions. The first person is\n"
          "\"human\", those beside it are called as in data.people.")
      .def_property_readonly(
          "cameras", [](const Run& run) { return read_cameras(run.paths.cameras()); }, "The cameras of all frames.")
      .def_property_readonly("objects", &objects, "The objects' tracks, as read_object_tracks gives them.")
      .def_property_readonly("states", &states, "Camera, objects and bodies of all frames: a list of State.")
      .def_property_readonly(
          "sigmas", &sigmas,
          "How sure the places are that it found: a dict, \"human\" [T,22,2] of the first person's joints, and [T,2]\n"
          "of each object's centroid by name. Metres, one standard deviation across the view and along it; inf: "
          "nothing\n"
          "tells the place, nan: of a frame that was given. Empty unless the config had `uncertainty`.")
      .def("image", &frame_image, py::arg("frame"), py::arg("kind") = "render",
           "[H,W,C] an image of a frame; kinds: target, render, difference, start, side.")
      .def("__repr__", [](const Run& run) { return "<hsi4d.Run " + run.paths.folder.string() + ">"; });
  module.def(
      "run", &run, py::arg("config"), py::arg("out"), py::arg("progress") = py::none(), py::arg("threads") = 0,
      py::arg("resume") = false, py::arg("progress_interval") = 0.1,
      "Reconstructs a clip, or a chain of some, into a run folder, and returns it.\n\n"
      "progress: a function of a dict (task, done, total, seconds, seconds_left, loss, terms, is_finished), called\n"
      "at most every progress_interval seconds. It stops the run by an exception, which is raised when the run\n"
      "has ended in order, or by returning False, for which Interrupted is raised; Ctrl-C stops it as well.\n"
      "threads: 0, as the config says. resume: go on with the run in the folder, to the same bits.");
  module.def(
      "read_sweep", &read_sweep, py::arg("folder"),
      "The runs of a sweep as they stand, a list of dicts: label, block, clip, ablation, seed, values of the grid,\n"
      "state, metrics by name (those of docs/metrics.md; empty unless done), folder.");
}

}  // namespace hsi4d::python
