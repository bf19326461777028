// A study in which people choose between the videos of two methods: a page for them, and the key for who asks.
//
//   DIR/index.html        the page, which needs no network; opened from disk or put on any web server
//   DIR/videos/NAME.mp4   its videos, under names that say nothing; not there when they are in the page
//   DIR-key.json          beside it, to be kept: which video is whose (pipelines/study/key.h)
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/observer.h"
#include "pipelines/study/key.h"
#include "pipelines/study/page.h"

namespace hsi4d {

struct StudySettings {
  std::string a, b;           ///< run folders, folders of runs with the same names, or runs of sweeps
  std::filesystem::path out;  ///< a new or empty folder
  std::string texts;          ///< JSON file {"NAME": "what was to happen"}; empty: as the runs' configs say
  Index pairs_per_person = kPairsPerPerson;
  std::optional<std::uint64_t> seed;  ///< of the names of videos and pairs; without it they are random
  bool embed = false;                 ///< videos go into the page
  StudyEnd end;                       ///< no answer and no key depends on it
};

/// A study that was made.
struct Study {
  StudyKey key;
  std::filesystem::path page, key_file;
  std::vector<std::string> notes;  ///< what people should know, a sentence each
};

/// The key's file of a study's folder, beside it: "DIR-key.json".
std::filesystem::path study_key_file(const std::filesystem::path& folder);

/// Makes a study. Of a run of hsi4d its reconstruction is shown: frames/NNNN_render.png where all of them are there,
/// else that part of preview.mp4; of any other folder preview.mp4 as it is. Videos are encoded alike and anew, so that
/// neither their form nor their metadata tell where they come from. Names of videos and pairs are random; with a seed
/// they follow from it and from the runs, so that the same study can be made again, and someone who has the runs and
/// guesses the seed can tell A from B. The key comes before the page, the page last.
///
/// Throws as study_runs; UserError where `out` is not a new or empty folder, its key is there, or an address or code of
/// `end` is none; UserError or
/// DataError of reading and writing videos; Interrupted when asked to stop, with nothing left.
Study make_study(const StudySettings& settings, const Observer& observer);

}  // namespace hsi4d
