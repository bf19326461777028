// The files in which a chain of clips leaves its result: those of a run, of all clips one after the other.
#pragma once

#include <string>
#include <vector>

#include "core/camera.h"
#include "pipelines/chain/chain.h"

namespace hsi4d {

/// What a clip has found, as its run folder holds it: the same bits whether it was run just now or before.
struct ClipResult {
  RunSummary summary;
  Motion motion;
  std::vector<Camera> cameras;
  std::vector<SceneState> states;   ///< by frame, frame 0 included
  std::vector<PlaceSigmas> sigmas;  ///< likewise; empty: nobody asked
};

/// Reads the result of a run folder that is complete.
/// @param clip     what messages call it
/// @param objects  names, in the chain's order
/// Throws UserError or DataError naming the file: missing, damaged, of different lengths.
ClipResult read_clip_result(const std::string& clip, const std::string& folder,
                            const std::vector<std::string>& objects);

/// All clips, in order.
struct ChainResult {
  const std::vector<ClipFacts>& facts;
  const std::vector<ClipResult>& clips;
  const std::vector<std::string>& objects;  ///< names
};

/// Writes motion.npz, motion_30fps.npz, objects.npz, cameras.json, body.glb, preview.mp4 and summary.json of all
/// frames, where frame 0 of each later clip is left out, being the last of the one before. Where body or preview cannot
/// be written the log says so.
/// @return  what summary.json holds
ChainSummary write_chain_results(const RunPaths& paths, const RunConfig& config, const ChainResult& result);

}  // namespace hsi4d
