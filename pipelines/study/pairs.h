// Which runs a study compares with which.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace hsi4d {

/// Two run folders of the same task.
struct StudyRuns {
  std::string name;  ///< of both, relative to A and B; "pair" where these are one run each
  std::filesystem::path a, b;
  std::string text;  ///< what was to happen, by their configs or by `texts`; empty: neither says it
};

/// The runs of A and B, matched by name, in the order of names.
///
/// A run is a folder with preview.mp4; other folders are looked into, at any depth, through links too. A folder that
/// has several names counts once, by its own rather than a link's. Runs of a sweep, of which those count that are done,
/// go by their names in it, without what A or B name: of "runs/s/whole" and "runs/s/no_color_net" by clip and seed.
///
/// @param a, b   runs, folders of runs, or runs of a sweep (pipelines/sweep/selection.h)
/// @param texts  a JSON file {"NAME": "what was to happen"}, which wins against sources.prompt of the runs' configs;
///               empty: none
/// @param notes  receives a sentence for runs that only one of the two has or that are left out, and for pairs without
/// a
///               text
/// Throws UserError naming the folder: it is not there, or holds no run; one is a run and the other a folder of runs;
/// no name is in both; several runs of a sweep come to one name; A and B are the same run; the runs of a pair were made
/// of different texts, or `texts` names a pair that there is not.
std::vector<StudyRuns> study_runs(const std::string& a, const std::string& b, const std::string& texts,
                                  std::vector<std::string>& notes);

}  // namespace hsi4d
