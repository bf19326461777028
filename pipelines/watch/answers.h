// What the server of `hsi4d watch` answers, without the server: who may ask, and where each answer comes from.
#pragma once

#include <map>
#include <string>

#include "pipelines/watch/server_library.h"

namespace hsi4d {

/// The answer to a request about the runs of a folder.
///
///   /                                          the page, with /watch.css and /watch.js
///   /runs                                      watched_runs_json
///   /run?run=ID                                watched_run_json
///   /metrics?run=ID&from=BYTES&file=FILE       watched_metrics_json
///   /image?run=ID&frame=N&kind=target|render   a PNG
///
/// ID is compared with those of watched_runs: no path of a request leads to a file. 403 for a request that is not to
/// this machine by its name (a page elsewhere whose name leads here), 405 for all but GET, 400 and 404 for what is not
/// there; 500 with the message of a damaged plan.
ServedReply watch_answer(const std::string& path, const ServedRequest& request);

}  // namespace hsi4d
