#include "pipelines/run/checkpoint.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "core/check.h"
#include "core/simd.h"
#include "optim/checkpoint.h"
#include "optim/metrics.h"
#include "pipelines/metrics/sequence_errors.h"

namespace hsi4d {

namespace {

constexpr Index kPoseNumbers = 3 * kSmplxJoints;
constexpr Index kRigidNumbers = 12;
constexpr std::size_t kCounts = 5;  // whole numbers of a stage's totals

/// Errors of images, frame by frame: as "KIND/FRAME/NAME".
std::string error_name(const char* kind, std::size_t frame, const std::string& name) {
  return std::string(kind) + "/" + std::to_string(frame) + "/" + name;
}

void store_errors(const char* kind, const std::vector<MetricValues>& errors, Checkpoint& checkpoint) {
  for (std::size_t t = 0; t < errors.size(); ++t) {
    for (const auto& [name, value] : errors[t]) checkpoint.set(error_name(kind, t, name), std::vector<double>{value});
  }
}

std::vector<MetricValues> stored_errors(const char* kind, std::size_t frames, const Checkpoint& checkpoint) {
  std::vector<MetricValues> errors(frames);
  for (std::size_t t = 0; t < frames; ++t) {
    for (const char* name : kImageMetrics) {
      const std::string entry = error_name(kind, t, name);
      if (!checkpoint.has(entry)) continue;
      const std::vector<double>& error = checkpoint.doubles(entry);
      if (error.size() != 1)
        throw DataError(checkpoint.source() + ": \"" + entry + "\" holds " + std::to_string(error.size()) +
                        " numbers, 1 is needed");
      errors[t].emplace_back(name, error[0]);
    }
  }
  return errors;
}

constexpr const char* kIsa = "instruction_set";
constexpr const char* kLeftOut = "left_out";

/// A line each: "STAGE FRAME OBJECT TERM<tab>REASON".
std::string left_out_text(const std::vector<LeftOutInFrame>& left_out) {
  std::string text;
  for (const LeftOutInFrame& entry : left_out) {
    text += std::to_string(entry.stage) + " " + std::to_string(entry.frame) + " " + std::to_string(entry.object) + " " +
            entry.term + "\t" + entry.reason + "\n";
  }
  return text;
}

/// @param stages       of the config
/// @param first_frame  1, or 0 where there are stages over frame 0
std::vector<LeftOutInFrame> left_out_of(const Checkpoint& checkpoint, const Clip& clip, std::size_t stages,
                                        Index first_frame) {
  std::vector<LeftOutInFrame> left_out;
  if (!checkpoint.has(kLeftOut)) return left_out;
  std::istringstream lines(checkpoint.text(kLeftOut));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    LeftOutInFrame entry;
    words >> entry.stage >> entry.frame >> entry.object;
    words.get();
    std::getline(words, entry.term, '\t');
    std::getline(words, entry.reason);
    if (!words || entry.stage >= stages || entry.object < 0 || entry.object >= std::ssize(clip.objects) ||
        entry.frame < first_frame || entry.frame >= clip.frames()) {
      throw DataError(checkpoint.source() + ": \"" + kLeftOut + "\" holds \"" + line +
                      "\", which is no stage, frame, object, term and reason of this clip");
    }
    left_out.push_back(entry);
  }
  return left_out;
}

constexpr const char* kStill = "still";
constexpr const char* kLeftRanges = "left_ranges";

/// A line each: "STAGE FRAME NAME".
template <class Entry>
std::string names_text(const std::vector<Entry>& entries) {
  std::string text;
  for (const auto& [stage, frame, name] : entries)
    text += std::to_string(stage) + " " + std::to_string(frame) + " " + name + "\n";
  return text;
}

/// @param key    of the entry, which need not be there
/// @param what   the name is
/// @param stages, first_frame  as left_out_of
template <class Entry>
std::vector<Entry> names_of(const Checkpoint& checkpoint, const char* key, const char* what, const Clip& clip,
                            std::size_t stages, Index first_frame) {
  std::vector<Entry> entries;
  if (!checkpoint.has(key)) return entries;
  std::istringstream lines(checkpoint.text(key));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::size_t stage = 0;
    Index frame = 0;
    std::string name;
    words >> stage >> frame >> name;
    if (!words || stage >= stages || frame < first_frame || frame >= clip.frames())
      throw DataError(checkpoint.source() + ": \"" + key + "\" holds \"" + line + "\", which is no stage, frame and " +
                      what + " of this clip");
    entries.push_back({stage, frame, name});
  }
  return entries;
}

/// One state as numbers: camera [R | t] (12), then 6 an object, then each body's transl (3) and axis-angles (165).
void append(const SceneState& state, std::vector<double>& numbers) {
  for (Index r = 0; r < 3; ++r) {
    for (Index c = 0; c < 3; ++c) numbers.push_back(state.camera_from_world.rotation(r, c));
    numbers.push_back(state.camera_from_world.translation[r]);
  }
  for (const ObjectPose& pose : state.objects) {
    numbers.insert(numbers.end(), pose.rotation.data(), pose.rotation.data() + 3);
    numbers.insert(numbers.end(), pose.translation.data(), pose.translation.data() + 3);
  }
  for (std::size_t p = 0; p < state.people(); ++p) {
    const BodyPose& body = state.person(p);
    numbers.insert(numbers.end(), body.transl.data(), body.transl.data() + 3);
    numbers.insert(numbers.end(), body.axis_angle.begin(), body.axis_angle.end());
  }
}

/// The pixels of a mask, row by row, without what pads its rows.
std::vector<float> pixels_of(const Image& mask) {
  std::vector<float> pixels;
  for (int y = 0; y < mask.height(); ++y) pixels.insert(pixels.end(), mask.row(0, y), mask.row(0, y) + mask.width());
  return pixels;
}

void set_pixels(const std::vector<float>& pixels, Image& mask) {
  for (int y = 0; y < mask.height(); ++y) {
    std::copy_n(pixels.data() + static_cast<std::ptrdiff_t>(y) * mask.width(), mask.width(), mask.row(0, y));
  }
}

Index numbers_per_state(const Clip& clip) {
  return kRigidNumbers + 6 * std::ssize(clip.objects) + static_cast<Index>(clip.people()) * (3 + kPoseNumbers);
}

SceneState state_from(const double* numbers, const Clip& clip) {
  SceneState state;
  for (Index r = 0; r < 3; ++r) {
    for (Index c = 0; c < 3; ++c) state.camera_from_world.rotation(r, c) = *numbers++;
    state.camera_from_world.translation[r] = *numbers++;
  }
  for (std::size_t o = 0; o < clip.objects.size(); ++o, numbers += 6) {
    state.objects.push_back({Vector3<double>(numbers), Vector3<double>(numbers + 3)});
  }
  state.others.resize(clip.others.size());
  for (std::size_t p = 0; p < clip.people(); ++p, numbers += 3 + kPoseNumbers) {
    state.person(p).transl = Vector3<double>(numbers);
    state.person(p).axis_angle.assign(numbers + 3, numbers + 3 + kPoseNumbers);
  }
  return state;
}

// ---- Totals ----

/// Counts and seconds of stages, as a checkpoint has them.
struct StoredTotals {
  std::vector<std::int64_t> counts;  // kCounts a stage
  std::vector<double> seconds;

  void add(const StageTotals& totals) {
    counts.insert(counts.end(), {totals.iterations, totals.rollbacks, totals.tiles, totals.pairs, totals.fragments});
    seconds.push_back(totals.seconds);
  }
};

StageTotals totals_at(const std::vector<std::int64_t>& counts, const std::vector<double>& seconds, std::size_t stage) {
  const std::int64_t* count = counts.data() + kCounts * stage;
  return {count[0], count[1], seconds[stage], count[2], count[3], count[4]};
}

// ---- Entries of a checkpoint ----

/// Throws DataError unless an entry has as many numbers as this clip needs.
void expect_size(const Checkpoint& checkpoint, const std::string& name, std::size_t found, std::size_t wanted) {
  if (found == wanted) return;
  throw DataError(checkpoint.source() + ": \"" + name + "\" holds " + std::to_string(found) +
                  " numbers, this clip needs " + std::to_string(wanted) +
                  "; the inputs have changed since the run began");
}

/// An entry of states, all of them finite.
const std::vector<double>& stored_states(const Checkpoint& checkpoint, const std::string& name, std::size_t numbers) {
  const std::vector<double>& states = checkpoint.doubles(name);
  expect_size(checkpoint, name, states.size(), numbers);
  if (!std::all_of(states.begin(), states.end(), [](double x) { return std::isfinite(x); }))
    throw DataError(checkpoint.source() + ": \"" + name + "\" holds a number that is not finite");
  return states;
}

void store_first_frame(const std::vector<FirstFrameState>& stages, Checkpoint& checkpoint) {
  if (stages.empty()) return;
  std::vector<double> states;
  StoredTotals totals;
  for (const FirstFrameState& stage : stages) {
    append(stage.state, states);
    totals.add(stage.totals);
  }
  checkpoint.set("first_frame/states", std::move(states));
  checkpoint.set("first_frame/counts", std::move(totals.counts));
  checkpoint.set("first_frame/seconds", std::move(totals.seconds));
}

std::vector<FirstFrameState> stored_first_frame(const Checkpoint& checkpoint, const Clip& clip, std::size_t stages) {
  std::vector<FirstFrameState> found;
  if (stages == 0) return found;
  const auto per_state = static_cast<std::size_t>(numbers_per_state(clip));
  const std::vector<double>& states = stored_states(checkpoint, "first_frame/states", stages * per_state);
  const std::vector<std::int64_t>& counts = checkpoint.integers("first_frame/counts");
  expect_size(checkpoint, "first_frame/counts", counts.size(), kCounts * stages);
  const std::vector<double>& seconds = checkpoint.doubles("first_frame/seconds");
  expect_size(checkpoint, "first_frame/seconds", seconds.size(), stages);
  for (std::size_t s = 0; s < stages; ++s)
    found.push_back({state_from(states.data() + s * per_state, clip), totals_at(counts, seconds, s)});
  return found;
}

// ---- After the first pass ----

constexpr const char* kLaterFrames = "later/frames";

void store_later(const std::vector<LaterStage>& stages, Checkpoint& checkpoint) {
  if (stages.empty()) return;
  std::vector<std::int64_t> frames;
  std::vector<double> states;
  StoredTotals totals;
  for (const LaterStage& stage : stages) {
    frames.push_back(std::ssize(stage.states));
    for (const SceneState& state : stage.states) append(state, states);
    totals.add(stage.totals);
  }
  checkpoint.set(kLaterFrames, std::move(frames));
  checkpoint.set("later/states", std::move(states));
  checkpoint.set("later/counts", std::move(totals.counts));
  checkpoint.set("later/seconds", std::move(totals.seconds));
}

/// Whether as many frames of each stage can be done: all, but for the stages of a last pass, which go through the
/// frames together.
bool are_frames_of_later(const std::vector<std::int64_t>& frames, std::int64_t all, std::span<const StageScope> over) {
  const auto is_within_pass = [over](std::size_t s) {
    return s > 0 && s < over.size() && over[s - 1] == StageScope::kFrame && over[s] == StageScope::kFrame;
  };
  const std::size_t count = frames.size();
  if (count > over.size() || is_within_pass(count)) return false;
  std::size_t first = 0;  // that has not done all
  while (first < count && frames[first] == all) ++first;
  if (first == count) return true;
  if (is_within_pass(first) || frames[first] < 1 || frames[first] > all) return false;
  for (std::size_t s = first; s < count; ++s) {
    if (over[s] != StageScope::kFrame || frames[s] != frames[first]) return false;
  }
  return true;
}

std::vector<LaterStage> stored_later(const Checkpoint& checkpoint, const Clip& clip, std::span<const StageScope> over) {
  std::vector<LaterStage> found;
  if (!checkpoint.has(kLaterFrames)) return found;
  const std::vector<std::int64_t>& frames = checkpoint.integers(kLaterFrames);
  if (!are_frames_of_later(frames, clip.frames(), over))
    throw DataError(checkpoint.source() + ": \"" + kLaterFrames + "\" holds numbers of frames that the " +
                    std::to_string(over.size()) + " stages after the first pass cannot have done in a clip of " +
                    std::to_string(clip.frames()));
  std::size_t all = 0;
  for (const std::int64_t done : frames) all += static_cast<std::size_t>(done);
  const auto per_state = static_cast<std::size_t>(numbers_per_state(clip));
  const double* next = stored_states(checkpoint, "later/states", all * per_state).data();
  const std::vector<std::int64_t>& counts = checkpoint.integers("later/counts");
  expect_size(checkpoint, "later/counts", counts.size(), kCounts * frames.size());
  const std::vector<double>& seconds = checkpoint.doubles("later/seconds");
  expect_size(checkpoint, "later/seconds", seconds.size(), frames.size());
  for (std::size_t s = 0; s < frames.size(); ++s) {
    found.push_back({{}, totals_at(counts, seconds, s)});
    for (std::int64_t t = 0; t < frames[s]; ++t, next += per_state)
      found.back().states.push_back(state_from(next, clip));
  }
  return found;
}

constexpr const char* kBias = "depth_bias";  // the human's factor, then the objects', then the other people's

void store_bias(const DepthBias& bias, Checkpoint& checkpoint) {
  std::vector<double> factors = {bias.human};
  factors.insert(factors.end(), bias.objects.begin(), bias.objects.end());
  factors.insert(factors.end(), bias.others.begin(), bias.others.end());
  checkpoint.set(kBias, std::move(factors));
}

std::optional<DepthBias> stored_bias(const Checkpoint& checkpoint, const Clip& clip) {
  if (!checkpoint.has(kBias)) return {};
  const std::vector<double>& factors = stored_states(checkpoint, kBias, clip.people() + clip.objects.size());
  const auto others = factors.begin() + 1 + std::ssize(clip.objects);
  return DepthBias{factors[0], {factors.begin() + 1, others}, {others, factors.end()}};
}

// ---- Other entries ----

constexpr const char* kSeen = "objects_seen";  // by frame, a number an object

void store_seen(const std::vector<std::vector<double>>& seen, Checkpoint& checkpoint) {
  std::vector<double> shares;
  for (const std::vector<double>& frame : seen) shares.insert(shares.end(), frame.begin(), frame.end());
  checkpoint.set(kSeen, std::move(shares));
}

std::vector<std::vector<double>> stored_seen(const Checkpoint& checkpoint, const Clip& clip, std::size_t frames) {
  std::vector<std::vector<double>> seen;
  if (!checkpoint.has(kSeen)) return seen;
  const auto objects = std::ssize(clip.objects);
  const std::vector<double>& shares = stored_states(checkpoint, kSeen, frames * clip.objects.size());
  for (auto next = shares.begin(); next != shares.end(); next += objects) seen.emplace_back(next, next + objects);
  return seen;
}

void store_start(const StartTotals& start, Checkpoint& checkpoint) {
  std::vector<std::int64_t> frames;
  for (const auto& part : start.frames) frames.insert(frames.end(), part.begin(), part.end());
  checkpoint.set("start/frames", std::move(frames));
  checkpoint.set("start/seconds", std::vector<double>{start.seconds});
}

/// Nothing where there is none: a checkpoint of a version that did not count.
StartTotals stored_start(const Checkpoint& checkpoint) {
  StartTotals start;
  if (!checkpoint.has("start/frames")) return start;
  const std::vector<std::int64_t>& frames = checkpoint.integers("start/frames");
  expect_size(checkpoint, "start/frames", frames.size(), kChosenParts.size() * kChosenStarts.size());
  const std::vector<double>& seconds = checkpoint.doubles("start/seconds");
  expect_size(checkpoint, "start/seconds", seconds.size(), 1);
  for (std::size_t i = 0; i < frames.size(); ++i)
    start.frames[i / kChosenStarts.size()][i % kChosenStarts.size()] = frames[i];
  start.seconds = seconds[0];
  return start;
}

void store_unknowns(const ClipUnknowns& unknowns, Checkpoint& checkpoint) {
  if (unknowns == ClipUnknowns{}) return;
  checkpoint.set("unknowns/numbers",
                 std::vector<double>{unknowns.focal_length, unknowns.scene_scale, unknowns.scene_height});
  checkpoint.set("unknowns/object_scales", unknowns.object_scales);
  checkpoint.set("unknowns/betas", unknowns.betas);
}

ClipUnknowns stored_unknowns(const Checkpoint& checkpoint, const Clip& clip) {
  if (!checkpoint.has("unknowns/numbers")) return {};
  const std::vector<double>& numbers = stored_states(checkpoint, "unknowns/numbers", 3);
  const std::vector<double>& scales = checkpoint.doubles("unknowns/object_scales");
  if (!scales.empty()) stored_states(checkpoint, "unknowns/object_scales", clip.objects.size());
  const std::vector<double>& betas = checkpoint.doubles("unknowns/betas");
  if (!betas.empty())
    stored_states(checkpoint, "unknowns/betas", clip.directions ? static_cast<std::size_t>(clip.directions->betas) : 0);
  return {numbers[0], numbers[1], numbers[2], scales, betas};
}

/// Calls f(place) of all places of a frame: joints, objects, joints of others.
template <class Sigmas, class F>
void for_places(Sigmas& frame, const F& f) {
  std::for_each(frame.joints.begin(), frame.joints.end(), f);
  std::for_each(frame.objects.begin(), frame.objects.end(), f);
  for (auto& other : frame.others) std::for_each(other.begin(), other.end(), f);
}

/// By frame and place: across, along.
void store_sigmas(const std::vector<PlaceSigmas>& sigmas, Checkpoint& checkpoint) {
  std::vector<double> numbers;
  for (const PlaceSigmas& frame : sigmas)
    for_places(frame, [&](const PlaceSigma& place) { numbers.insert(numbers.end(), {place.across, place.along}); });
  checkpoint.set("sigmas", std::move(numbers));
}

std::vector<PlaceSigmas> stored_sigmas(const Checkpoint& checkpoint, const Clip& clip, std::size_t frames) {
  if (!checkpoint.has("sigmas")) return {};
  std::vector<PlaceSigmas> sigmas(frames, no_sigmas(clip.objects.size(), clip.others.size()));
  const std::vector<double>& numbers = checkpoint.doubles("sigmas");
  expect_size(checkpoint, "sigmas", numbers.size(),
              frames * 2 * (clip.people() * static_cast<std::size_t>(kMetricJoints) + clip.objects.size()));
  const double* next = numbers.data();
  for (PlaceSigmas& frame : sigmas)
    for_places(frame, [&next](PlaceSigma& place) { place = {next[0], next[1]}, next += 2; });
  return sigmas;
}

// ---- Lights on objects ----

constexpr const char* kLights = "lights";  // 6 an object, of all states; absent where no stage has moved one

/// Calls f(state) for all states, in the order of the file.
template <class Progress, class F>
void for_states(Progress& progress, const F& f) {
  for (auto& stage : progress.after_stage) std::for_each(stage.begin(), stage.end(), f);
  for (auto& stage : progress.first_frame) f(stage.state);
  for (auto& stage : progress.later) std::for_each(stage.states.begin(), stage.states.end(), f);
}

void store_lights(const RunProgress& progress, Checkpoint& checkpoint) {
  std::vector<double> numbers;
  bool has_lights = false;
  for_states(progress, [&](const SceneState& state) {
    has_lights = has_lights || !state.lights.empty();
    for (std::size_t o = 0; o < state.objects.size(); ++o) {
      const ObjectLight light = light_of(state, o);
      numbers.insert(numbers.end(), light.begin(), light.end());
    }
  });
  if (has_lights) checkpoint.set(kLights, std::move(numbers));
}

void read_stored_lights(const Checkpoint& checkpoint, RunProgress& progress) {
  if (!checkpoint.has(kLights)) return;
  std::size_t lights = 0;
  for_states(progress, [&lights](const SceneState& state) { lights += state.objects.size(); });
  const double* next = stored_states(checkpoint, kLights, lights * std::tuple_size_v<ObjectLight>).data();
  for_states(progress, [&next](SceneState& state) {
    state.lights.resize(state.objects.size());
    for (ObjectLight& light : state.lights) {
      std::copy_n(next, light.size(), light.begin());
      next += light.size();
    }
  });
}

}  // namespace

const std::vector<SceneState>& result_of(const RunProgress& progress) {
  return progress.later.empty() ? progress.after_stage.back() : progress.later.back().states;
}

RunProgress first_progress(const Clip& clip, std::size_t stages, std::vector<ColorNet> nets) {
  RunProgress progress;
  progress.after_stage.assign(stages, {clip.first});
  progress.totals.resize(stages);
  progress.image_errors.resize(1);
  progress.start_errors.resize(1);
  progress.covered = Image(1, clip.camera.height, clip.camera.width);
  progress.colors = first_color_state(std::move(nets));
  return progress;
}

void save_progress(const std::string& file, const std::string& config, const RunProgress& progress) {
  Checkpoint checkpoint;
  std::vector<double> states;
  StoredTotals totals;
  for (const auto& stage : progress.after_stage) {
    for (const SceneState& state : stage) append(state, states);
  }
  for (const StageTotals& stage : progress.totals) totals.add(stage);
  totals.seconds.push_back(progress.seconds);
  checkpoint.set("frames", std::vector<std::int64_t>{progress.frames_done()});
  checkpoint.set("states", std::move(states));
  checkpoint.set("counts", std::move(totals.counts));
  checkpoint.set("seconds", std::move(totals.seconds));
  store_first_frame(progress.first_frame, checkpoint);
  store_unknowns(progress.unknowns, checkpoint);
  store_later(progress.later, checkpoint);
  store_lights(progress, checkpoint);
  if (progress.bias) store_bias(*progress.bias, checkpoint);
  if (!progress.seen.empty()) store_seen(progress.seen, checkpoint);
  checkpoint.set("size_px", std::vector<std::int64_t>{progress.covered.width(), progress.covered.height()});
  checkpoint.set("covered", pixels_of(progress.covered));
  checkpoint.set("inputs", progress.inputs);
  checkpoint.set(kIsa, std::string(isa_name(best_isa())));
  if (!progress.left_out.empty()) checkpoint.set(kLeftOut, left_out_text(progress.left_out));
  if (!progress.still.empty()) checkpoint.set(kStill, names_text(progress.still));
  if (!progress.left_ranges.empty()) checkpoint.set(kLeftRanges, names_text(progress.left_ranges));
  if (progress.start.seconds > 0) store_start(progress.start, checkpoint);
  if (!progress.sigmas.empty()) store_sigmas(progress.sigmas, checkpoint);
  store_color_state(progress.colors, checkpoint);
  store_errors("image_errors", progress.image_errors, checkpoint);
  store_errors("start_errors", progress.start_errors, checkpoint);
  checkpoint.save(file, text_hash(config));
}

RunProgress load_progress(const std::string& file, const std::string& config, const Clip& clip, std::size_t stages,
                          std::vector<ColorNet> nets, std::size_t first_stages, std::span<const StageScope> later) {
  const Checkpoint checkpoint = load_checkpoint(file, text_hash(config));
  const auto expect = [&checkpoint](const char* name, std::size_t found, std::size_t wanted) {
    expect_size(checkpoint, name, found, wanted);
  };
  RunProgress progress = first_progress(clip, stages, std::move(nets));
  const std::vector<std::int64_t>& frames = checkpoint.integers("frames");
  expect("frames", frames.size(), 1);
  if (frames[0] < 1 || frames[0] > clip.frames()) {
    throw DataError(file + ": " + std::to_string(frames[0]) + " frames done, the clip has " +
                    std::to_string(clip.frames()));
  }
  const std::vector<std::int64_t>& size = checkpoint.integers("size_px");
  expect("size_px", size.size(), 2);
  if (size[0] != clip.camera.width || size[1] != clip.camera.height) {
    throw DataError(file + ": of a video of " + std::to_string(size[0]) + "x" + std::to_string(size[1]) +
                    " pixels, the camera's image is " + std::to_string(clip.camera.width) + "x" +
                    std::to_string(clip.camera.height) + "; the inputs have changed since the run began");
  }
  const auto done = static_cast<std::size_t>(frames[0]), per_state = static_cast<std::size_t>(numbers_per_state(clip));
  const std::vector<double>& states = stored_states(checkpoint, "states", stages * done * per_state);
  const std::vector<std::int64_t>& counts = checkpoint.integers("counts");
  expect("counts", counts.size(), kCounts * stages);
  const std::vector<double>& seconds = checkpoint.doubles("seconds");
  expect("seconds", seconds.size(), stages + 1);
  for (std::size_t s = 0; s < stages; ++s) {
    progress.after_stage[s].clear();
    for (std::size_t t = 0; t < done; ++t) {
      progress.after_stage[s].push_back(state_from(states.data() + (s * done + t) * per_state, clip));
    }
    progress.totals[s] = totals_at(counts, seconds, s);
  }
  progress.seconds = seconds.back();
  progress.first_frame = stored_first_frame(checkpoint, clip, first_stages);
  progress.unknowns = stored_unknowns(checkpoint, clip);
  progress.later = stored_later(checkpoint, clip, later);
  read_stored_lights(checkpoint, progress);
  progress.bias = stored_bias(checkpoint, clip);
  progress.seen = stored_seen(checkpoint, clip, static_cast<std::size_t>(frames[0]));
  const std::vector<float>& covered = checkpoint.floats("covered");
  expect("covered", covered.size(), pixels_of(progress.covered).size());
  set_pixels(covered, progress.covered);
  progress.inputs = checkpoint.text("inputs");
  if (checkpoint.has(kIsa)) progress.isa = checkpoint.text(kIsa);
  progress.start = stored_start(checkpoint);
  progress.sigmas = stored_sigmas(checkpoint, clip, static_cast<std::size_t>(frames[0]));
  progress.colors = stored_color_state(checkpoint, std::move(progress.colors));
  const Index first_frame = first_stages > 0 ? 0 : 1;
  const std::size_t all_stages = first_stages + stages + later.size();
  progress.left_out = left_out_of(checkpoint, clip, all_stages, first_frame);
  progress.still = names_of<StillGroup>(checkpoint, kStill, "group", clip, all_stages, first_frame);
  progress.left_ranges = names_of<LeftRange>(checkpoint, kLeftRanges, "setting", clip, all_stages, first_frame);
  progress.image_errors = stored_errors("image_errors", done, checkpoint);
  progress.start_errors = stored_errors("start_errors", done, checkpoint);
  return progress;
}

}  // namespace hsi4d
