// The folder that a run writes: its lock, its state, and the files that are written while it goes on.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/config_value.h"
#include "core/log.h"
#include "core/types.h"
#include "optim/gradient_shares.h"
#include "pipelines/config/data_settings.h"
#include "pipelines/record/summary.h"

namespace hsi4d {

class AppendedFile;

/// How a run stands, the `state` of status.json. A run that was killed still says "running".
enum class RunState { kRunning, kDone, kFailed, kInterrupted };

/// "running", "done", "failed" or "interrupted".
std::string_view run_state_name(RunState state);

/// What a run folder notes of its run.
struct RunIdentity {
  std::string config;  ///< the text of config.resolved.json; a run is resumed only where without_data has the same
  std::int64_t seed = 0;
  int threads = 0;
  std::string precision = "float";
  bool is_chain = false;  ///< of clips with folders of their own: without frames, checkpoint and metrics.jsonl
  ConfigValue sweep_axes = ConfigValue::make_object();  ///< what tells it from other runs of its sweep, by name
};

/// One iteration, a line of metrics.jsonl.
struct IterationRecord {
  std::optional<int> frame;  ///< none: all at once
  std::string_view stage;
  Index iteration = 0;
  double loss = 0;
  std::vector<std::pair<std::string, double>> losses;  ///< the terms
  double seconds = 0;
  bool rolled_back = false;  ///< the step was undone; numbers that are not finite are then written as null
  std::span<const GradientShare> gradient_shares = {};
  std::optional<MatrixStep> matrix = {};
  MetricValues counters = {};  ///< work done: channels, tiles, pairs, groups, fragments, layers, adjoint_tiles
};

/// The paths of a run folder's members.
struct RunPaths {
  std::filesystem::path folder;

  std::string config() const { return member("config.resolved.json"); }
  std::string status() const { return member("status.json"); }
  std::string log() const { return member("log.txt"); }
  std::string metrics() const { return member("metrics.jsonl"); }
  std::string summary() const { return member("summary.json"); }
  std::string motion() const { return member("motion.npz"); }
  /// That of a person beside the first one.
  std::string motion_of(const std::string& person) const { return (folder / motion_file_of(person)).string(); }
  std::string motion_at_30() const { return member("motion_30fps.npz"); }
  std::string body() const { return member("body.glb"); }
  std::string avatar() const { return member("avatar.safetensors"); }
  std::string view3d() const { return member("view3d.safetensors"); }
  std::string preview() const { return member("preview.mp4"); }
  std::string objects() const { return member("objects.npz"); }
  std::string cameras() const { return member("cameras.json"); }
  std::string color_net() const { return member("color_net.safetensors"); }
  std::string color_net_of(const std::string& person) const {
    return member(("color_net_of_" + person + ".safetensors").c_str());
  }
  std::string report() const { return member("report.html"); }
  std::string tensorboard() const { return member("tensorboard"); }
  std::string frames() const { return member("frames"); }
  std::string checkpoint() const { return member("checkpoint"); }
  std::string lock() const { return member(".lock"); }
  /// checkpoint/color_net_NNNN.safetensors: the human's color net after a frame.
  std::string frame_color_net(int frame) const;
  /// frames/NNNN_KIND.png; kinds: target, render, difference, start (the run's start) and side (from another side).
  std::string frame_image(int frame, std::string_view kind) const;

 private:
  std::string member(const char* name) const { return (folder / name).string(); }
};

/// What RunFolder would find at a path: throws UserError as its constructor would, and writes nothing.
/// @return  how the run stands that it would go on with; null where it would begin one
std::optional<RunState> look_at_run_folder(const std::string& path, const std::string& config, bool resume);

/// A run folder that this process writes, and no other: a lock is held as long as this lives.
///
/// Opening one makes the folder and its frames/ and checkpoint/, writes config.resolved.json and status.json (state
/// running), and sends the log to log.txt. Every file but the log and metrics.jsonl is replaced in one step. Used by
/// one thread at a time.
class RunFolder {
 public:
  /// @param path    UTF-8; made with its parents
  /// @param resume  go on with the run that is there. Where there is none (no folder, or an empty one) it starts anew.
  /// Throws UserError naming the folder: another process writes to it; it holds a run and `resume` is false; it holds
  /// something else; the config of the run in it differs in more than threads, log and places of files (the settings
  /// that do are told); it cannot be written.
  RunFolder(const std::string& path, RunIdentity identity, bool resume);
  ~RunFolder();
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;

  const RunPaths& paths() const { return paths_; }
  const RunIdentity& identity() const { return identity_; }

  /// When the run began, the one that is resumed: as utc_now_text tells it.
  const std::string& started() const { return started_; }

  /// Replaces the config.resolved.json of a run that is resumed by that of now: its data may have been moved since.
  void take_over_config();

  /// How the run stood that was found and is resumed; nothing for a new one.
  std::optional<RunState> resumed_from() const { return resumed_from_; }

  /// Writes status.json.
  /// @param message  why it failed, for people; may be empty
  void set_state(RunState state, std::string_view message = "");

  /// Writes a message into log.txt alone; what the library logs while this lives goes there too.
  void note(std::string_view message, LogLevel level = LogLevel::kInfo) const { log_->write(level, message); }

  /// Appends a line to metrics.jsonl; it is with the system when this returns.
  /// Throws InternalError naming the member for a number that is not finite, unless the step was rolled back.
  void append_metrics(const IterationRecord& record);

  /// Keeps the lines of metrics.jsonl that `is_kept` says, of those that are whole: asked for what the checkpoint has,
  /// the file is as if the run had never gone further. Throws DataError naming the line that is none of ours.
  /// @param is_kept  called with the stage and the frame of a line; none: it is of all frames at once
  void keep_metrics(const std::function<bool(const std::string& stage, std::optional<int> frame)>& is_kept);

  /// Writes summary.json. Errors as summary_json.
  void write_summary(const RunSummary& summary);

 private:
  struct Lock;

  void write_status();

  RunPaths paths_;
  RunIdentity identity_;
  std::unique_ptr<Lock> lock_;
  std::optional<RunState> resumed_from_;
  RunState state_ = RunState::kRunning;
  std::string started_, resumed_, message_;
  std::unique_ptr<AppendedFile> metrics_;
  std::optional<LogSink> log_;
};

/// True while some process holds the lock of a run folder.
bool is_run_locked(const std::string& path);

}  // namespace hsi4d
