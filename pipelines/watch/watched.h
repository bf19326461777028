// What `hsi4d watch` tells of runs while they go on, as JSON. It only reads, and takes no lock: none of the runs
// notices.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/file.h"

namespace hsi4d {

/// A run that is watched.
struct WatchedRun {
  std::string id;      ///< its folder as seen from the one that is watched, "runs/HASH"; "" where it is that itself
  std::string name;    ///< for people
  std::string folder;  ///< need not be there yet
  bool is_of_sweep = false;
};

/// The runs in a folder, as it is now: itself, those of a sweep or a chain, or those in folders below it, at most three
/// deep and in the order of their paths. Empty where there is none. Throws DataError for the damaged plan of a sweep.
std::vector<WatchedRun> watched_runs(const std::string& path);

/// Throws UserError naming the path unless it is a folder that is empty or holds runs.
void check_watched(const std::string& path);

/// The table of runs: {"title", "metrics": [{"name", "label", "decimals", "better"}...], "runs": [{"id", "name",
/// "state", "frames": FINISHED, "total"?, "message"?, "values": {NAME: NUMBER...}}...]}, `values` of the last stage.
/// Errors as watched_runs.
std::string watched_runs_json(const std::string& path);

/// How a run stands: {"id", "name", "state", "message"?, "started"?, "age"?: SECONDS since it wrote last, "total"?:
/// FRAMES, "stages": [{"name", "iterations"}...], "frames": [[FRAME, MILLISECONDS of its image]...], "results":
/// [[LABEL, NUMBER, DECIMALS]...]}. State is that of status.json, "new" before there is one, "unknown" where it cannot
/// be read.
std::string watched_run_json(const WatchedRun& run);

/// Where reading of a metrics.jsonl goes on.
struct MetricsPlace {
  std::string file;       ///< which file it was: a resumed run writes another one
  std::int64_t from = 0;  ///< bytes
};

/// The lines of metrics.jsonl from a place on, 1 MiB of them at most: {"file", "restarted": BOOL, "next": BYTES,
/// "size": BYTES, "skipped": LINES that are none of a run, "rows": [[FRAME or null, STAGE, ITERATION, LOSS or null,
/// SECONDS, {TERM: NUMBER or null}]...]}. A last line without an end is left for later. `restarted`: the file is
/// another one, or shorter, so that the rows begin anew. A file that is not there is empty.
std::string watched_metrics_json(const WatchedRun& run, const MetricsPlace& place);

/// A frame's image as a PNG. Errors as read_file.
/// @param kind  "target" or "render"
Bytes watched_image(const WatchedRun& run, int frame, const std::string& kind);

}  // namespace hsi4d
