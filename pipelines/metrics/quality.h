// What of a result can be judged without truth, each with a word. It says where to look first, not what is right.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/table.h"
#include "pipelines/metrics/metric_facts.h"

namespace hsi4d {

/// A result's value of a metric, against two thresholds.
struct QualityGate {
  std::string metric;
  double value = 0;
  double pass = 0;   ///< from here on (up or down, as the metric's better values lie) it passes,
  double check = 0;  ///< from here on somebody should look; beyond, it fails
};

/// "pass", "check" or "fail".
std::string_view word_of(const QualityGate& gate);

/// The gates of the metrics that a result has: silhouette_iou, object_iou, keypoints_pck, psnr_background_db,
/// camera_drift_px, background_change, floor_drift_mm, foot_sliding_mm and jitter. That of the jitter grows with the
/// rate, as the jitter of noise does.
/// @param frame_rate  frames a second
std::vector<QualityGate> quality_of(const MetricValues& values, double frame_rate);

/// How many pass.
Index passed_count(const std::vector<QualityGate>& gates);

/// "quality: 4 of 6 gates pass; check: silhouette IoU 0.821 (≥ 0.850); fail: …", a line; empty without
/// gates.
std::string quality_text(const std::vector<QualityGate>& gates);

/// A row a gate, the worst first, with title and caption; the word is the mark of its cell.
Table quality_table(const std::vector<QualityGate>& gates);

}  // namespace hsi4d
