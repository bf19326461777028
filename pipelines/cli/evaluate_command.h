// `hsi4d evaluate`: errors of runs and motions against the truth, and what of them needs none.
#pragma once

#include <string>
#include <vector>

#include "pipelines/evaluate/evaluation.h"

namespace hsi4d::cli {

struct EvaluateOptions {
  std::vector<std::string> inputs;           ///< folders of runs, runs of sweeps, motions (.npz), folders of SMPLer-X
  EvaluationSettings settings;               ///< --truth, --data, --body-model, ...
  std::vector<std::string> object_surfaces;  ///< --object-surface NAME=F
  std::string align = "none";                ///< --align none|heading|rotation
  std::string up;                            ///< --up y|z; empty: to be found
  std::vector<std::string> clips;            ///< --clip F.npz, one for each input; none: RUN/clip.npz where it is there
  std::string json;                          ///< --json F; empty: none
  std::string export_folder;                 ///< --export DIR; empty: none
};

/// A table with a row for each metric of summary.json that can be measured, and a column for each input; for several
/// repetitions their mean, standard deviation and diversity too. Runs of a sweep that differ in more than seeds have a
/// row each, and the tables of the sweep's report. Then what was taken for the truth, the scene and the world of each,
/// and the paper's figures beside ours. Writes the JSON file, and what other methods start from.
///
/// Throws UserError or DataError with one message for whatever is wrong with options and files.
std::string evaluate_command(const EvaluateOptions& options);

}  // namespace hsi4d::cli
