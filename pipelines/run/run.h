// A run from its config to its folder: lock, state, log, reconstruction, summary, report.
#pragma once

#include <string>
#include <vector>

#include "pipelines/run/reconstruct.h"

namespace hsi4d {

/// How a run is carried out; no result depends on it.
struct RunOptions {
  std::string folder;   ///< UTF-8
  bool resume = false;  ///< go on with the run that is in the folder; starts anew where there is none
  int threads = 0;      ///< 0: what the config says
  ConfigValue sweep_axes = ConfigValue::make_object();  ///< as RunIdentity has them
  Observer observer;
};

/// Notes in log.txt and status.json how a run ended. Where that cannot be written either (a full disk), what ended it
/// is still what is thrown.
void note_end(RunFolder& folder, RunState state, const std::string& message) noexcept;

/// The images of a run are of at most approx.longest_side_px pixels: the camera of its clip becomes one of these.
void set_image_size(Clip& clip, const RunConfig& config);

/// The clip of a run, and in `files` all that is read of it, the files that stages and body name included. `body` is
/// read where a loss asks for its vertices; one that the avatar was not made on is left out, which the log tells.
/// Throws as read_clip, rest_body and body_of_avatar.
Clip read_run_clip(const RunConfig& config, const std::vector<LossTerm>& losses);

/// What can be told of a clip before it runs. Throws UserError for a start or frames that cannot be; warns of what is
/// odd.
void check_run_clip(const RunConfig& config, const Clip& clip);

/// Carries out a run and leaves its folder complete, report.html included. status.json then says "done"; "interrupted"
/// or "failed" when this throws.
///
/// Throws UserError and DataError for config, inputs and folder, Interrupted when asked to stop.
/// @return  what summary.json holds
RunSummary execute_run(const RunConfig& config, const std::vector<LossTerm>& losses, const RunOptions& options);

}  // namespace hsi4d
