#include "pipelines/sources/sources.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <thread>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/process.h"
#include "core/progress.h"
#include "core/size_text.h"
#include "core/text.h"
#include "pipelines/config/masks.h"
#include "pipelines/draw/camera_selection.h"
#include "pipelines/draw/image_of_scene.h"
#include "pipelines/follow/follow.h"
#include "pipelines/follow/pictures.h"
#include "pipelines/input/clip.h"
#include "pipelines/input/frame_cameras.h"
#include "pipelines/input/keypoints.h"
#include "pipelines/input/pose_estimate.h"
#include "pipelines/sources/lock.h"
#include "pipelines/sources/record.h"
#include "splat/sh_basis.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

constexpr double kLongestDoubled = 3600.0;  // seconds that a wait may become by being doubled

// ---- The first frame ----

SceneView first_view(const RunConfig& config) {
  return {only_camera(config.data.camera), config.background, config.render, {}};
}

/// Rows [begin, end) white and all others black: an image is then what share of a pixel they are.
void paint(Gaussians& gaussians, Index begin, Index end) {
  gaussians = with_sh_degree(gaussians, 0);
  const auto white = static_cast<float>(0.5 / kShC0);
  for (Index i = 0; i < gaussians.count(); ++i)
    std::fill_n(gaussians.sh.begin() + 3 * i, 3, i >= begin && i < end ? white : -white);
}

/// A mask of a pinhole as the lens would have taken it; 0 where it does not reach.
Image bent_mask(const Image& mask, const Camera& camera, const Lens& lens) {
  Image bent(1, mask.height(), mask.width());
  for (int y = 0; y < mask.height(); ++y) {
    for (int x = 0; x < mask.width(); ++x) {
      const Vector2<double> at =
          straight_of(lens, {(x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy});
      bent(0, y, x) = sample(mask, 0, camera.fy * at[1] + camera.cy - 0.5, camera.fx * at[0] + camera.cx - 0.5);
    }
  }
  return bent;
}

// ---- What was made ----

void check_video(const RunConfig& config, const fs::path& path) {
  DataSettings data = config.data;
  data.frames = path;
  const FrameSource frames = frames_of(data);
  const Index wanted = config.sources.video.frames;
  if (wanted > 0 && frames.video_count() != wanted)
    throw DataError("has " + std::to_string(frames.video_count()) + " frames; sources.video.frames asks for " +
                    std::to_string(wanted));
  const Camera camera = first_camera(data.camera, frames);
  for (Index t = 0; t < frames.count(); ++t) {
    const Image frame = frames.read(t);
    if (frame.channels() >= 3 && fits_camera(frame, camera)) continue;
    throw DataError("frame " + std::to_string(frames.number(t)) + " is " + size_text(frame) + " with " +
                    std::to_string(frame.channels()) + " channels; the camera's image is " + size_text(camera) +
                    " with 3, and a video is as large, or larger and of its shape");
  }
}

void check_masks(const DataSettings& data, const fs::path& folder) {
  if (!fs::is_directory(folder))
    throw DataError("is no folder; masks are in human/ and a folder an object in it, or human.mp4 and so on");
  const FrameSource frames = frames_of(data);
  const Image frame = frames.read(0);
  for (const std::string& name : masked_names(data)) {
    const MaskSource masks(folder, name);
    check_has_all(masks, frames, name);
    for (Index t = 0; t < frames.count(); ++t) {
      const Image mask = masks.read(frames, t);
      if (mask.width() == frame.width() && mask.height() == frame.height()) continue;
      throw DataError("the mask of " + name + " in frame " + std::to_string(frames.number(t)) + " is " +
                      size_text(mask) + " pixels, the video's frame " + size_text(frame));
    }
  }
}

void check_person(const DataSettings& asked, const fs::path& folder) {
  if (!fs::is_directory(folder))
    throw DataError(std::string("is no folder; ") + kPersonKeypoints + " and " + kPersonMasks + "/human/ are in it");
  DataSettings data = asked;
  data.keypoints = folder / kPersonKeypoints;
  data.objects = {};
  read_keypoints(data, frames_of(data));
  check_masks(data, folder / kPersonMasks);
}

void check_motion(const DataSettings& data, const fs::path& file) {
  // Laid freely, as no human of frame 0 is read here: the run finds which way is up.
  read_estimate(file, read_avatar(data.avatar.string()), frames_of(data), {}, MotionAlign::kRotation);
}

// ---- Making it ----

/// A folder that is removed at the end.
class WorkFolder {
 public:
  explicit WorkFolder(const fs::path& path) : path_(path) {
    std::error_code error;
    fs::create_directories(path, error);
    if (error) throw UserError(path.string() + ": the folder cannot be made: " + error.message());
  }
  ~WorkFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;

  fs::path member(const std::string& name) const { return path_ / name; }

 private:
  fs::path path_;
};

/// Moves a file or folder in one step over one that may be there.
void put(const fs::path& from, const fs::path& to) {
  std::error_code error;
  if (fs::is_directory(to)) fs::remove_all(to, error);
  fs::rename(from, to, error);
  if (error) throw UserError(to.string() + ": cannot be written: " + error.message());
}

/// Where an output is kept that cannot be used: "video-KEY.refused.mp4", or ".refused2.mp4" beside an earlier one.
fs::path refused_file(const fs::path& output) {
  for (int number = 1;; ++number) {
    const std::string word = ".refused" + (number == 1 ? "" : std::to_string(number));
    const fs::path file = output.parent_path() / (output.stem().string() + word + output.extension().string());
    if (!fs::exists(file)) return file;
  }
}

/// What a check of files throws; empty: nothing.
template <class Check>
std::string fault_of(Check check) {
  try {
    check();
  } catch (const UserError& error) {
    return error.what();
  } catch (const DataError& error) {
    return error.what();
  }
  return "";
}

std::string with_replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}

/// A program with what it needs to make one output.
struct Job {
  const SourceOutput& output;
  const ProgramSettings& settings;
  std::vector<std::string> command;  ///< filled in
  fs::path out;                      ///< where it writes
  const Observer& observer;

  std::string section() const { return "/sources/" + output.what + ": "; }
};

/// A program failed in a way after which it may be run again.
class Failed : public UserError {
 public:
  using UserError::UserError;
};

/// Runs the program once. @return  what it printed
/// Throws Failed, or UserError where running it again would not help; Interrupted.
std::string run_once(const Job& job) {
  const bool on_any = job.settings.retry_on == RetryOn::kAny;
  std::optional<std::string> said;
  try {
    said = run_process(job.command, {job.settings.timeout_s, job.observer.stop_requested});
  } catch (const ProgramNotStartedError& error) {
    throw UserError(job.section() + error.what());
  } catch (const ProgramFailedError& error) {
    const bool is_temporary = error.status() == kTryAgainStatus;
    if (is_temporary || (on_any && error.status() != kAskedWronglyStatus)) throw Failed(job.section() + error.what());
    throw UserError(job.section() + error.what());
  } catch (const UserError& error) {  // its time is over, or a signal
    if (on_any) throw Failed(job.section() + error.what());
    throw UserError(job.section() + error.what());
  }
  if (!said)
    throw Interrupted("interrupted while " + job.command.front() + " made the " + job.output.what +
                      "; nothing is left of it");
  if (fs::exists(job.out)) return *said;
  const std::string message = job.section() + job.command.front() +
                              ": ended with status 0 and wrote nothing at {out}, " + job.out.string() +
                              end_of_output(*said);
  if (on_any) throw Failed(message);
  throw UserError(message);
}

void wait_before_retry(const Job& job, double seconds) {
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::milliseconds kLook{50};
  for (const Clock::time_point begin = Clock::now();
       std::chrono::duration<double>(Clock::now() - begin).count() < seconds;) {
    if (job.observer.wants_stop())
      throw Interrupted("interrupted before " + job.command.front() + " was run again; nothing is left of the " +
                        job.output.what);
    std::this_thread::sleep_for(kLook);
  }
}

/// Runs the program, again where that may help. @return  what it printed
std::string run_program(const Job& job) {
  for (int retry = 1;; ++retry) {
    const double wait = seconds_before_retry(job.settings, retry);
    try {
      return run_once(job);
    } catch (const Failed& failure) {
      if (retry > job.settings.retries) {
        throw UserError(retry == 1 ? failure.what()
                                   : std::string(failure.what()) + "\nIt was run " + std::to_string(retry) + " times.");
      }
      log_warning(std::string(failure.what()) + "\nIt is run again in " + number_text(wait) + " s, " +
                  std::to_string(retry) + " of " + std::to_string(job.settings.retries));
    }
    std::error_code ignored;
    fs::remove_all(job.out, ignored);
    wait_before_retry(job, wait);
  }
}

/// Runs the program, looks at what it wrote, and gives that its name.
template <class Check>
void make(const Job& job, Check check) {
  const SourceOutput& output = job.output;
  const std::vector<std::string>& command = job.command;
  const fs::path& out = job.out;
  log_info(output.what + ": runs " + joined(command));
  const auto begin = std::chrono::steady_clock::now();
  const std::string said = run_program(job);
  const std::string fault = fault_of([&] { check(out); });
  if (!fault.empty()) {
    const fs::path refused = refused_file(output.path);
    put(out, refused);
    throw DataError(job.section() + command.front() + " wrote what cannot be used, kept as " + refused.string() + ": " +
                    with_replaced(fault, out.string(), refused.string()) + end_of_output(said));
  }
  // The record first: only with both is it there, and the program may cost something.
  write_text_file(record_file(output).string(), output.record);
  put(out, output.path);
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
  log_info(output.what + ": " + output.path.string() + ", made in " + duration_text(taken.count()));
}

/// Where the first frame is kept that a video was made of.
fs::path first_frame_file(const SourceOutput& video) {
  return video.path.parent_path() / (video.path.stem().string() + ".first_frame.png");
}

void make_video(const RunConfig& config, const SourceOutput& output, const Observer& observer) {
  const WorkFolder work(work_folder_of(output.path));
  const fs::path first = work.member("first_frame.png"),
                 out = work.member("video" + ending_of(config.sources.video.output));
  const bool has_first_frame = uses_placeholder(output.command, "first_frame");
  if (has_first_frame) write_image(first.string(), first_frame_image(config));
  const std::vector<std::string> command = filled_in(output.command, {{"first_frame", first.string()},
                                                                      {"prompt", config.sources.prompt},
                                                                      {"seed", std::to_string(config.seed)},
                                                                      {"out", out.string()}});
  make(Job{output, config.sources.video, command, out, observer},
       [&config](const fs::path& made) { check_video(config, made); });
  if (has_first_frame) put(first, first_frame_file(output));
}

void write_first_masks(const RunConfig& config, const fs::path& folder) {
  const std::vector<std::string> names = masked_names(config.data);
  const std::vector<Image> masks = first_masks(config);
  fs::create_directories(folder);
  for (std::size_t i = 0; i < names.size(); ++i) write_image((folder / (names[i] + ".png")).string(), masks[i]);
}

void make_masks(const RunConfig& config, const DataSettings& data, const SourceOutput& output,
                const Observer& observer) {
  const WorkFolder work(work_folder_of(output.path));
  const fs::path out = work.member("masks");
  std::string names;
  for (const std::string& name : masked_names(data)) names += (names.empty() ? "" : ",") + name;
  const fs::path first = work.member("first_masks");
  if (uses_placeholder(output.command, "first_masks")) write_first_masks(config, first);
  const std::vector<std::string> command = filled_in(output.command, {{"video", data.frames.string()},
                                                                      {"first_masks", first.string()},
                                                                      {"objects", names},
                                                                      {"prompt", config.sources.prompt},
                                                                      {"seed", std::to_string(config.seed)},
                                                                      {"out", out.string()}});
  make(Job{output, config.sources.masks, command, out, observer},
       [&data](const fs::path& made) { check_masks(data, made); });
}

void make_person(const RunConfig& config, const DataSettings& data, const SourceOutput& output,
                 const Observer& observer) {
  const WorkFolder work(work_folder_of(output.path));
  const fs::path out = work.member("person");
  const std::vector<std::string> command =
      filled_in(output.command, {{"video", data.frames.string()}, {"out", out.string()}});
  make(Job{output, config.sources.person, command, out, observer},
       [&data](const fs::path& made) { check_person(data, made); });
}

ObjectHint hint_of(const ObjectSettings& object) {
  ObjectHint hint{object.first_mask, object.first_box, {}};
  for (std::size_t i = 0; i + 1 < object.first_clicks.size(); i += 2)
    hint.clicks.push_back({object.first_clicks[i], object.first_clicks[i + 1]});
  return hint;
}

/// Each object's mask in frame 0: as the config says it, or as the state of frame 0 shows it; likewise the human's,
/// where it is not known.
std::vector<ObjectToFollow> objects_to_follow(const RunConfig& config, const FrameSource& frames, const Image& human) {
  const Image frame = read_rgb(frames, 0);
  const auto& objects = config.data.objects;
  const bool all_hinted =
      std::all_of(objects.begin(), objects.end(), [](const auto& one) { return has_hint(one.second); });
  const std::vector<Image> rendered = all_hinted && !human.empty() ? std::vector<Image>{} : first_masks(config);
  const auto shown = [&](std::size_t part, const std::string& what) {
    Image mask = enlarged_mask(rendered[part], frame.height(), frame.width());
    if (!shows_something(mask)) throw UserError(what + " is seen in frame 0 in the state that data.initial says");
    return mask;
  };
  std::vector<ObjectToFollow> found;
  if (human.empty()) found.push_back({kHumanMasks, shown(0, "/sources/masks: nothing of the human")});
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const auto& [name, object] = objects[i];
    const std::string where = child_pointer("/data/objects", name);
    if (has_hint(object)) {
      found.push_back({name, first_mask(hint_of(object), frame, human, kFollowSide, where)});
      continue;
    }
    found.push_back({name, shown(i + 1, where + ": without first_mask, first_box and first_clicks it is followed from "
                                                "where it is, and nothing of it")});
  }
  return found;
}

void make_embedded_masks(const RunConfig& config, const DataSettings& data, const SourceOutput& output,
                         const Observer& observer) {
  const WorkFolder work(work_folder_of(output.path));
  const fs::path out = work.member("masks");
  const FrameSource frames = frames_of(data);
  std::optional<MaskSource> human;
  if (!data.masks.empty()) human.emplace(data.masks, kHumanMasks);
  const std::vector<ObjectToFollow> objects = objects_to_follow(config, frames, human_mask(human, frames, 0));
  const auto path_of = [&out](const fs::path& file) {
    fs::create_directories((out / file).parent_path());
    return (out / file).string();
  };
  for (const FollowedTrack& track : follow_objects(frames, human, objects, kFollowSide, path_of, observer))
    log_message(is_whole(track) ? LogLevel::kInfo : LogLevel::kWarning, "masks: " + track_text(track, frames));
  check_masks(data, out);
  write_text_file(record_file(output).string(), output.record);
  put(out, output.path);
  log_info("masks: " + output.path.string() + "; " + (output.path / kSheetFile).string() + " shows them");
}

void make_embedded_motion(const RunConfig& config, const DataSettings& data, const SourceOutput& output,
                          const MotionMaker& make_motion) {
  const WorkFolder work(work_folder_of(output.path));
  const fs::path out = work.member("motion.npz");
  RunConfig with_inputs = config;
  with_inputs.data = data;
  log_info("motion: is found of " + data.keypoints.string());
  const auto begin = std::chrono::steady_clock::now();
  try {
    make_motion(with_inputs, work.member("run"), out);
  } catch (const Interrupted&) {
    throw Interrupted("interrupted while the motion was found of keypoints; nothing is left of it");
  }
  check_motion(data, out);
  write_text_file(record_file(output).string(), output.record);
  put(out, output.path);
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
  log_info("motion: " + output.path.string() + ", made in " + duration_text(taken.count()));
}

void make_motion(const RunConfig& config, const DataSettings& data, const SourceOutput& output,
                 const Observer& observer) {
  const WorkFolder work(work_folder_of(output.path));
  const fs::path out = work.member("motion.npz");
  const std::vector<std::string> command =
      filled_in(output.command, {{"video", data.frames.string()},
                                 {"video_rate", number_text(frames_of(data).video_rate())},
                                 {"camera", data.camera.string()},
                                 {"prompt", config.sources.prompt},
                                 {"seed", std::to_string(config.seed)},
                                 {"out", out.string()}});
  make(Job{output, config.sources.motion, command, out, observer},
       [&data](const fs::path& made) { check_motion(data, made); });
}

/// The program has changed a file that its command names, a log most likely: the output is called as the next run looks
/// for it.
void rename_to(const SourceOutput& output, const SourceOutput& now) {
  log_warning(
      "/sources/" + output.what + "/command: " + joined(files_of_command(now.command)) +
      ": what of these the program has changed is taken as it is now; a file that it writes is better not named "
      "in its command, as each change makes the " +
      output.what + " be made again");
  write_text_file(record_file(now).string(), now.record);
  put(output.path, now.path);
  const fs::path seen = first_frame_file(output);
  if (fs::exists(seen)) put(seen, first_frame_file(now));
  std::error_code ignored;
  fs::remove(record_file(output), ignored);
}

/// Makes what is not there; by one process at a time, and the others have it then.
/// @param plan  the output as it is now
template <class Plan, class Make>
fs::path made(const Plan& plan, const Observer& observer, const Make& make_it) {
  SourceOutput output = plan();
  if (output.is_there) return output.path;
  sweep_work_folders(output.path.parent_path());
  const SourceLock lock(output.path, observer.stop_requested);
  output = plan();
  if (output.is_there) return output.path;
  make_it(output);
  const SourceOutput now = plan();
  if (now.path != output.path) rename_to(output, now);
  return now.path;
}

/// Whether masks are made here: where the human's are known and there are no objects, nothing is left to make.
bool follows_objects(const RunConfig& config, const DataSettings& data) {
  return config.sources.masks.is_embedded() && !(data.objects.empty() && !data.masks.empty());
}

}  // namespace

double seconds_before_retry(const ProgramSettings& settings, int retry) {
  return std::min(std::ldexp(settings.retry_wait_s, retry - 1), std::max(kLongestDoubled, settings.retry_wait_s));
}

std::vector<SourceOutput> planned_sources(const RunConfig& config) {
  std::vector<SourceOutput> outputs;
  DataSettings data = config.data;
  bool has_video = true;
  if (!config.sources.video.command.empty()) {
    outputs.push_back(video_output(config));
    has_video = outputs.back().is_there;
    take_output(outputs.back(), data);
  }
  // What it is made of is there: then its name is known.
  const auto plan = [&](bool is_known, const std::string& what, const std::vector<std::string>& command,
                        const auto& output) {
    outputs.push_back(is_known ? output(config, data) : SourceOutput{what, command, {}, "", false});
  };
  bool has_person = has_video;
  if (finds_person(config.sources, data.keypoints)) {
    plan(has_video, "person", person_command(config.sources), person_output);
    has_person = outputs.back().is_there;
    take_output(outputs.back(), data);
  }
  if (follows_objects(config, data)) {
    plan(has_person, "masks", {}, embedded_mask_output);
  } else if (!config.sources.masks.command.empty()) {
    plan(has_video, "masks", config.sources.masks.command, mask_output);
  }
  if (config.sources.motion.is_embedded()) {
    plan(has_person, "motion", {}, embedded_motion_output);
  } else if (!config.sources.motion.command.empty()) {
    plan(has_video, "motion", config.sources.motion.command, motion_output);
  }
  return outputs;
}

void take_output(const SourceOutput& output, DataSettings& data) {
  if (output.what == "person") {
    data.keypoints = output.path / kPersonKeypoints;
    if (data.masks.empty()) data.masks = output.path / kPersonMasks;
    return;
  }
  (output.what == "video" ? data.frames : output.what == "masks" ? data.masks : data.motion) = output.path;
}

DataSettings make_sources(const RunConfig& config, const MotionMaker& make_poses, const Observer& observer) {
  DataSettings data = config.data;
  if (!config.sources.video.command.empty()) {
    data.frames = made([&] { return video_output(config); }, observer,
                       [&](const SourceOutput& video) { make_video(config, video, observer); });
  }
  if (finds_person(config.sources, data.keypoints)) {
    SourceOutput person;
    person.what = "person";
    person.path = made([&] { return person_output(config, data); }, observer,
                       [&](const SourceOutput& output) { make_person(config, data, output, observer); });
    take_output(person, data);
  }
  if (follows_objects(config, data)) {
    data.masks = made([&] { return embedded_mask_output(config, data); }, observer,
                      [&](const SourceOutput& masks) { make_embedded_masks(config, data, masks, observer); });
  } else if (!config.sources.masks.command.empty()) {
    data.masks = made([&] { return mask_output(config, data); }, observer,
                      [&](const SourceOutput& masks) { make_masks(config, data, masks, observer); });
  }
  if (config.sources.motion.is_embedded()) {
    data.motion = made([&] { return embedded_motion_output(config, data); }, observer,
                       [&](const SourceOutput& motion) { make_embedded_motion(config, data, motion, make_poses); });
  } else if (!config.sources.motion.command.empty()) {
    data.motion = made([&] { return motion_output(config, data); }, observer,
                       [&](const SourceOutput& motion) { make_motion(config, data, motion, observer); });
  }
  return data;
}

Image first_frame_image(const RunConfig& config) {
  const SceneSetup setup = read_scene_setup(config.data);
  const SceneView view = first_view(config);
  return render_picture(first_frame(setup, camera_center_world(view.camera)).all, view).image;
}

std::vector<Image> first_masks(const RunConfig& config) {
  const SceneSetup setup = read_scene_setup(config.data);
  const Lens& lens = config.data.lens.lens;
  SceneView view = first_view(config);
  view.background = {0, 0, 0};
  PosedGaussians all = first_frame(setup, camera_center_world(view.camera)).all;
  std::vector<Index> ends = {setup.scene.count()};  // of scene, objects, human
  for (const ClipObject& object : setup.objects) ends.push_back(ends.back() + object.gaussians.count());
  ends.push_back(all.gaussians.count());
  std::vector<Image> masks;
  for (std::size_t part = 1; part < ends.size(); ++part) {
    paint(all.gaussians, ends[part - 1], ends[part]);
    const Image mask = take_channels(render_picture(all, view).image, 0, 1);
    masks.push_back(lens.is_straight() ? mask : bent_mask(mask, view.camera, lens));
  }
  std::rotate(masks.begin(), masks.end() - 1, masks.end());  // the human first
  return masks;
}

}  // namespace hsi4d
