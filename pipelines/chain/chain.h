// A chain of clips: each begins with the last state of the one before, and is a whole run of its own. [method.md, §6]
//
//   DIR/clips/NAME/                    the run folder of a clip
//   DIR/starts/NAME.json, NAME.npz     the state of frame 0 that a later clip was given, in place of its data.initial
//   DIR/starts/NAME.camera.json        the camera that was chosen for a clip, where it asks for that
//   DIR/motion.npz ...                 all frames, without those that two clips have in common
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "body/motion_io.h"
#include "pipelines/chain/summary.h"
#include "pipelines/input/state.h"
#include "pipelines/run/run.h"

namespace hsi4d {

/// The paths of a chain's members beside those that it has as a run.
struct ChainPaths {
  std::filesystem::path folder;

  std::string clip(const std::string& name) const { return (folder / "clips" / name).string(); }
  std::string start(const std::string& name) const { return (folder / "starts" / (name + ".json")).string(); }
  std::string camera(const std::string& name) const { return (folder / "starts" / (name + ".camera.json")).string(); }
  std::string start_motion(const std::string& name) const { return (folder / "starts" / (name + ".npz")).string(); }
};

/// What is known of a clip before it runs. Where a program has yet to make an input, or the camera is yet to be
/// chosen, frames is 0 and no truth is known.
struct ClipFacts {
  std::string name;
  Index frames = 0;
  double frame_rate = 10;
  Avatar avatar;
  Motion motion;  ///< estimates of its own, frame 0 of no meaning; one pose: none
  std::filesystem::path object_tracks;
  std::optional<SceneState> true_first;  ///< frame 0 in truth
};

/// The config of clip `index` as a run of its own: programs make what its data do not name.
RunConfig clip_config(const RunConfig& chain, std::size_t index);

/// Reads the inputs of every clip, frames included, and keeps what is small. Later clips without a state of their own
/// are read with the first one's; of those with inputs that are yet to be made only scene, objects and human. Throws as
/// execute_run, and UserError where clips do not fit each other: other joints of the human, another frame rate.
std::vector<ClipFacts> check_chain(const RunConfig& config);

/// How many clips of the chain in a folder are done. Throws DataError naming the clip and its inputs that have changed
/// since, or are not there any more.
std::size_t finished_clips(const RunConfig& config, const std::string& folder, const std::vector<LossTerm>& losses);

/// Carries out the clips of `config.chain` one after the other, and joins what they found. With options.resume clips
/// that are done are taken as they are, and the one that was interrupted goes on: the result has the same bits.
///
/// Before a clip begins its camera is chosen, where it asks for that, and programs make of its first frame what its
/// data do not name. What is made is kept as that of a run (pipelines/sources/sources.h). Throws as execute_run; what
/// is said of a clip begins with its number and name.
ChainSummary execute_chain(const RunConfig& config, const std::vector<LossTerm>& losses, const RunOptions& options);

}  // namespace hsi4d
