#include "pipelines/sources/record.h"

#include <algorithm>
#include <fstream>

#include "core/check.h"
#include "core/file.h"
#include "core/process.h"
#include "optim/checkpoint.h"
#include "pipelines/config/masks.h"
#include "pipelines/config/parameter_groups.h"
#include "pipelines/follow/follow.h"
#include "pipelines/input/clip.h"
#include "pipelines/input/input_hashes.h"
#include "pipelines/input/keypoints.h"
#include "splat/render_settings.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kWholeBytes = std::uintmax_t{64} << 20;  // up to which a file's hash is of all of it
constexpr std::int64_t kEndBytes = std::int64_t{4} << 20;         // of a larger one, at either end

ConfigValue strings(const std::vector<std::string>& texts) {
  ConfigValue array = ConfigValue::make_array();
  for (const std::string& text : texts) array.items.push_back(ConfigValue::make_string(text));
  return array;
}

/// What the first frame shows, and how.
ConfigValue first_frame_record(const RunConfig& config) {
  const DataSettings& data = config.data;
  std::vector<ClipFile> files = {{"scene", data.scene},
                                 {"avatar", data.avatar},
                                 {"camera", data.camera},
                                 {"initial", data.initial},
                                 {"motion", initial_motion_file(data)}};
  for (const auto& [name, object] : data.objects) files.push_back({"object " + name, object.gaussians});
  ConfigValue record = ConfigValue::make_object();
  record.add("files", ConfigValue::make_string(input_hashes(files)));
  ConfigValue background = ConfigValue::make_array();
  for (const double value : config.background) background.items.push_back(ConfigValue::make_number(value));
  record.add("background", std::move(background));
  RenderSettings render = config.render;  // a description binds to something that it could change
  ConfigFields fields;
  describe(fields, render);
  record.add("render", write_config(fields));
  return record;
}

ConfigValue command_record(const RunConfig& config, const std::vector<std::string>& command) {
  ConfigValue record = ConfigValue::make_object();
  record.add("command", strings(command));
  record.add("files", ConfigValue::make_string(command_hashes(command)));
  if (uses_placeholder(command, "prompt")) record.add("prompt", ConfigValue::make_string(config.sources.prompt));
  if (uses_placeholder(command, "seed")) record.add("seed", ConfigValue::make_number(static_cast<double>(config.seed)));
  return record;
}

SourceOutput output_of(const RunConfig& config, const std::string& what, const std::vector<std::string>& command,
                       const ConfigValue& record, const std::string& ending) {
  SourceOutput output{what, command, {}, to_json(record), false};
  output.path = config.sources.folder / (what + "-" + text_hash(output.record) + ending);
  const fs::path made_of = record_file(output);
  output.is_there = fs::exists(output.path) && fs::exists(made_of) && read_text_file(made_of.string()) == output.record;
  return output;
}

/// The content of a video, a file or a folder of frames.
std::string video_hashes(const FrameSource& frames, const fs::path& path) {
  if (!frames.file().empty()) return input_hashes({{"video", path}});
  std::vector<ClipFile> files;
  for (const std::string& name : frames.names()) files.push_back({name, path / name});
  return input_hashes(files);
}

/// The content of a folder or video of masks.
std::string mask_hashes(const MaskSource& masks, const FrameSource& frames) {
  if (masks.is_video()) return input_hashes({{kHumanMasks, masks.path()}});
  std::vector<ClipFile> files;
  for (Index t = 0; t < frames.count(); ++t) {
    const fs::path file = masks.file(frames, t);
    if (fs::exists(file)) files.push_back({file.filename().string(), file});
  }
  return input_hashes(files);
}

ConfigValue numbers(const std::vector<double>& values) {
  ConfigValue array = ConfigValue::make_array();
  for (const double value : values) array.items.push_back(ConfigValue::make_number(value));
  return array;
}

/// What is said of an object in frame 0.
ConfigValue hint_record(const ObjectSettings& object) {
  ConfigValue record = ConfigValue::make_object();
  if (!object.first_mask.empty())
    record.add("mask", ConfigValue::make_string(input_hashes({{"first_mask", object.first_mask}})));
  if (!object.first_box.empty()) record.add("box", numbers(object.first_box));
  if (!object.first_clicks.empty()) record.add("clicks", numbers(object.first_clicks));
  return record;
}

/// A video that was made before has as many frames as are asked for now.
void check_length(const RunConfig& config, const fs::path& video) {
  DataSettings data = config.data;
  data.frames = video;
  const Index found = frames_of(data).video_count(), wanted = config.sources.video.frames;
  if (found == wanted) return;
  throw UserError("/sources/video/frames: asks for " + std::to_string(wanted) + " frames; " + video.string() +
                  ", which the same command has made before, has " + std::to_string(found) +
                  "; remove that to have it made again");
}

/// Masks that were made before are of every frame that is kept now.
void check_cached_masks(const DataSettings& data, const fs::path& folder) {
  const FrameSource frames = frames_of(data);
  try {
    for (const std::string& name : masked_names(data)) check_has_all(MaskSource(folder, name), frames, name);
  } catch (const DataError& error) {
    throw UserError("/sources/masks: " + folder.string() + ", made before: " + error.what() +
                    "; remove that folder to have it made again");
  }
}

/// The last bytes of a file.
std::string end_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string bytes(static_cast<std::size_t>(kEndBytes), '\0');
  file.seekg(-kEndBytes, std::ios::end);
  if (!file.read(bytes.data(), kEndBytes)) throw UserError(path + ": cannot be read");
  return bytes;
}

/// What stands for a file's content: all of it, or of a large one its size and both ends.
std::string content_hash(const std::string& path) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(path, error);
  if (error || size <= kWholeBytes) return text_hash(read_text_file(path));
  const Bytes begin = read_file_start(path, kEndBytes);
  return text_hash(std::to_string(size) + " " + std::string(begin.begin(), begin.end()) + end_of(path));
}

}  // namespace

std::vector<std::string> files_of_command(const std::vector<std::string>& command) {
  std::vector<std::string> files;
  for (std::size_t i = 0; i < command.size(); ++i) {
    const std::string& argument = command[i];
    if (!placeholders_in(argument).empty() || (i == 0 && argument.find('/') == std::string::npos)) continue;
    for (const std::string& name : {argument, argument.substr(argument.find('=') + 1)}) {
      std::error_code ignored;
      if (!fs::is_regular_file(name, ignored)) continue;
      if (std::find(files.begin(), files.end(), name) == files.end()) files.push_back(name);
      break;
    }
  }
  return files;
}

std::string command_hashes(const std::vector<std::string>& command) {
  std::string lines;
  for (const std::string& file : files_of_command(command)) lines += content_hash(file) + " " + file + "\n";
  return lines;
}

SourceOutput video_output(const RunConfig& config) {
  const VideoSourceSettings& video = config.sources.video;
  ConfigValue record = command_record(config, video.command);
  if (uses_placeholder(video.command, "first_frame")) record.add("first_frame", first_frame_record(config));
  const SourceOutput output = output_of(config, "video", video.command, record, ending_of(video.output));
  if (output.is_there && video.frames > 0) check_length(config, output.path);
  return output;
}

/// The files of the front end beside its script, which calls them.
void add_front_end(const std::vector<std::string>& command, ConfigValue& record) {
  if (command.empty()) return;
  const fs::path services = fs::path(command.front()).parent_path() / "services";
  std::string lines;
  for (const char* const name : {"blazepose.mjs", "hands.mjs", "track.mjs"})
    lines += content_hash((services / name).string()) + " " + name + "\n";
  record.add("front_end", ConfigValue::make_string(lines));
}

/// The five numbers of a lens.
ConfigValue lens_record(const Lens& lens) {
  ConfigValue numbers = ConfigValue::make_array();
  for (const double number : {lens.k1, lens.k2, lens.k3, lens.p1, lens.p2})
    numbers.items.push_back(ConfigValue::make_number(number));
  return numbers;
}

SourceOutput person_output(const RunConfig& config, const DataSettings& data) {
  const std::vector<std::string> command = person_command(config.sources);
  ConfigValue record = command_record(config, command);
  record.add("video", ConfigValue::make_string(video_hashes(frames_of(data), data.frames)));
  if (config.sources.person.command.empty()) add_front_end(command, record);
  return output_of(config, "person", command, record, "");
}

bool finds_first_frame(const RunConfig& config) {
  return std::any_of(config.stages.begin(), config.stages.end(), [](const auto& entry) {
    const auto& [name, stage] = entry;
    return stage.over == StageScope::kFirst && find_entry(stage.optimize, kTranslGroup) != nullptr;
  });
}

SourceOutput embedded_motion_output(const RunConfig& config, const DataSettings& data) {
  std::vector<ClipFile> files;
  for (const fs::path& file : keypoint_files(data.keypoints)) files.push_back({std::to_string(files.size()), file});
  if (!data.keypoint_joints.empty()) files.push_back({"joints", data.keypoint_joints});
  ConfigValue record = ConfigValue::make_object();
  record.add("method", ConfigValue::make_integer(kKeypointMotionMethod));
  record.add("keypoints", ConfigValue::make_string(input_hashes(files)));
  record.add("first_frame", first_frame_record(config));
  record.add("finds_first", ConfigValue::make_boolean(finds_first_frame(config)));
  record.add("video", ConfigValue::make_string(video_hashes(frames_of(data), data.frames)));
  record.add("lens", lens_record(config.data.lens.lens));
  record.add("video_rate", ConfigValue::make_number(data.video_rate));
  record.add("frame_rate", ConfigValue::make_number(data.frame_rate));
  return output_of(config, "motion", {}, record, ".npz");
}

SourceOutput motion_output(const RunConfig& config, const DataSettings& data) {
  const std::vector<std::string>& command = config.sources.motion.command;
  const FrameSource frames = frames_of(data);
  ConfigValue record = command_record(config, command);
  record.add("video", ConfigValue::make_string(video_hashes(frames, data.frames)));
  if (uses_placeholder(command, "camera"))
    record.add("camera", ConfigValue::make_string(input_hashes({{"camera", data.camera}})));
  if (uses_placeholder(command, "video_rate")) record.add("video_rate", ConfigValue::make_number(frames.video_rate()));
  return output_of(config, "motion", command, record, ".npz");
}

/// What a state of frame 0 shows, as the video's lens sees it.
void add_first_masks(const RunConfig& config, const char* key, ConfigValue& record) {
  record.add(key, first_frame_record(config));
  const Lens& lens = config.data.lens.lens;
  if (lens.is_straight()) return;
  record.add("lens", lens_record(lens));
}

SourceOutput mask_output(const RunConfig& config, const DataSettings& data) {
  const std::vector<std::string>& command = config.sources.masks.command;
  ConfigValue record = command_record(config, command);
  record.add("video", ConfigValue::make_string(video_hashes(frames_of(data), data.frames)));
  record.add("masks_of", strings(masked_names(data)));
  if (uses_placeholder(command, "first_masks")) add_first_masks(config, "first_masks", record);
  const SourceOutput output = output_of(config, "masks", command, record, "");
  if (output.is_there) check_cached_masks(data, output.path);
  return output;
}

SourceOutput embedded_mask_output(const RunConfig& config, const DataSettings& data) {
  const FrameSource frames = frames_of(data);
  ConfigValue record = ConfigValue::make_object(), first = ConfigValue::make_object();
  record.add("method", ConfigValue::make_integer(kFollowMethod));
  record.add("video", ConfigValue::make_string(video_hashes(frames, data.frames)));
  record.add("video_rate", ConfigValue::make_number(data.video_rate));
  record.add("frame_rate", ConfigValue::make_number(data.frame_rate));
  if (!data.masks.empty())
    record.add("human", ConfigValue::make_string(mask_hashes(MaskSource(data.masks, kHumanMasks), frames)));
  bool is_rendered = data.masks.empty();
  for (const auto& [name, object] : data.objects) {
    first.add(name, hint_record(object));
    is_rendered |= !has_hint(object);
  }
  record.add("first", std::move(first));
  if (is_rendered) add_first_masks(config, "first_frame", record);
  return output_of(config, "masks", {}, record, "");
}

fs::path record_file(const SourceOutput& output) { return output.path.string() + ".json"; }

std::string ending_of(VideoOutput output) {
  return output == VideoOutput::kFrames ? "" : "." + std::string(choice_name<VideoOutput>(kVideoOutputs, output));
}

std::vector<std::string> masked_names(const DataSettings& data) {
  std::vector<std::string> names = {kHumanMasks};
  for (const auto& [name, object] : data.objects) names.push_back(name);
  return names;
}

FrameSource frames_of(const DataSettings& data) { return {data.frames, {data.video_rate, data.frame_rate}}; }

void check_has_all(const MaskSource& masks, const FrameSource& frames, const std::string& name) {
  const Index missing = masks.missing(frames);
  if (missing == 0) return;
  if (missing == frames.count())
    throw DataError(name + " has no mask of any frame; their names are those of the frames, " + frames.names().front() +
                    " to " + frames.names().back());
  Index first = 0;
  while (fs::exists(masks.file(frames, first))) ++first;
  throw DataError(name + " has no mask of " + std::to_string(missing) + " of " + std::to_string(frames.count()) +
                  " frames, the first " + frames.names()[static_cast<std::size_t>(first)] +
                  "; where nothing of it is seen a mask is black");
}

}  // namespace hsi4d
