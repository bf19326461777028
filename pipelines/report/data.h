// What a report tells, read from a run folder.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/file.h"
#include "core/types.h"
#include "pipelines/draw/report_images.h"
#include "pipelines/record/summary.h"
#include "pipelines/report/view3d.h"

namespace hsi4d {

/// How the loss of one stage went in one frame, or in all at once.
struct LossCurve {
  std::optional<int> frame;                       ///< none: all at once
  std::vector<std::pair<double, double>> points;  ///< iteration, loss; without those that were not finite
};

/// What metrics.jsonl tells of one stage.
struct StageCurves {
  std::string stage;
  double seconds = 0;
  Index iterations = 0;
  Index rolled_back = 0;
  std::vector<LossCurve> curves;  ///< a frame each, in order
};

/// How sure a joint or an object is: means over the frames at which it is surer than kUnsure, metres.
struct PlaceRow {
  std::string name;
  bool is_object = false;
  double across = 0, along = 0;  ///< PlaceSigma
  Index sure = 0, unsure = 0;    ///< frames, without those at which nobody looked
};

/// A run folder, as far as it is there.
struct ReportData {
  std::string name;                                        ///< of the run, or of its folder
  std::string state;                                       ///< status.json's; "unknown" without it
  bool is_orphaned = false;                                ///< it says "running", but nobody holds its lock
  std::vector<std::pair<std::string, std::string>> facts;  ///< what status and config tell, for people
  std::string message;                                     ///< why it failed
  std::string config;                                      ///< the text of the resolved config
  std::optional<RunSummary> summary;
  std::vector<StageCurves> stages;  ///< in the order of their first line
  std::vector<FrameImages> frames;
  View3d view3d;
  std::vector<PlaceRow> places;    ///< objects, then joints; empty: the run does not say how sure they are
  std::vector<std::string> notes;  ///< what is missing or odd
};

/// Reads a run folder. Errors as write_report.
ReportData read_report_data(const std::string& run_folder);

}  // namespace hsi4d
