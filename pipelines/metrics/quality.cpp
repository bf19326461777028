#include "pipelines/metrics/quality.h"

#include <algorithm>
#include <array>

#include "core/check.h"
#include "core/text.h"

namespace hsi4d {

namespace {

struct Threshold {
  std::string_view metric;
  double pass, check;
};

constexpr std::array<Threshold, 8> kThresholds = {{
    {"silhouette_iou", 0.85, 0.7},
    {"object_iou", 0.7, 0.5},
    {"keypoints_pck", 0.9, 0.7},
    {"psnr_background_db", 24, 18},
    {"camera_drift_px", 1, 3},
    {"background_change", 0.02, 0.1},
    {"floor_drift_mm", 30, 100},
    {"foot_sliding_mm", 10, 25},
}};

/// m/s³: what people's motions have, and what a noise of 2 mm adds. Twice as much is to be looked at.
double passing_jitter(double frame_rate) {
  constexpr double kOfMotion = 150, kOfNoise = 0.015;
  return kOfMotion + kOfNoise * frame_rate * frame_rate * frame_rate;
}

const MetricFacts& facts_of(const QualityGate& gate) {
  const MetricFacts* const facts = find_metric_facts(gate.metric);
  HSI4D_CHECK(facts != nullptr, gate.metric + " is no metric");
  return *facts;
}

/// 0: pass, 1: check, 2: fail.
std::size_t rank_of(const QualityGate& gate) {
  const double sign = facts_of(gate).better;
  if (sign * gate.value >= sign * gate.pass) return 0;
  return sign * gate.value >= sign * gate.check ? 1 : 2;
}

std::string limit_text(const MetricFacts& facts, double limit) {
  return (facts.better > 0 ? "≥ " : "≤ ") + fixed_number(limit, facts.decimals);
}

}  // namespace

std::string_view word_of(const QualityGate& gate) {
  constexpr std::array<std::string_view, 3> kWords = {"pass", "check", "fail"};
  return kWords.at(rank_of(gate));
}

std::vector<QualityGate> quality_of(const MetricValues& values, double frame_rate) {
  std::vector<QualityGate> gates;
  for (const Threshold& threshold : kThresholds) {
    if (const double* const value = find_metric(values, threshold.metric))
      gates.push_back({std::string(threshold.metric), *value, threshold.pass, threshold.check});
  }
  const double jitter = passing_jitter(frame_rate);
  if (const double* const value = find_metric(values, "jitter"))
    gates.push_back({"jitter", *value, jitter, 2 * jitter});
  return gates;
}

Index passed_count(const std::vector<QualityGate>& gates) {
  return std::count_if(gates.begin(), gates.end(), [](const QualityGate& gate) { return rank_of(gate) == 0; });
}

std::string quality_text(const std::vector<QualityGate>& gates) {
  if (gates.empty()) return "";
  std::string text =
      "quality: " + std::to_string(passed_count(gates)) + " of " + std::to_string(gates.size()) + " gates pass";
  for (const std::size_t rank : {1u, 2u}) {
    bool is_first = true;
    for (const QualityGate& gate : gates) {
      if (rank_of(gate) != rank) continue;
      const MetricFacts& facts = facts_of(gate);
      text += (is_first ? "; " + std::string(word_of(gate)) + ": " : ", ") + std::string(facts.label) + " " +
              fixed_number(gate.value, facts.decimals) + (facts.unit.empty() ? "" : " " + std::string(facts.unit)) +
              " (" + limit_text(facts, gate.pass) + ")";
      is_first = false;
    }
  }
  return text + "\n";
}

Table quality_table(const std::vector<QualityGate>& gates) {
  Table table{.title = "Quality",
              .caption =
                  "What can be judged without truth. A gate says where to look first; a motion may have good "
                  "reasons not to pass",
              .head = {"gate", "value", "", "passes", "to be looked at"},
              .align = "lrlrr"};
  for (const std::size_t rank : {2u, 1u, 0u}) {
    for (const QualityGate& gate : gates) {
      if (rank_of(gate) != rank) continue;
      const MetricFacts& facts = facts_of(gate);
      table.rows.push_back({Cell(shown_metric(facts), "", std::string(facts.summary)), Cell(gate.value, facts.decimals),
                            Cell(std::string(word_of(gate)), std::string(word_of(gate))), limit_text(facts, gate.pass),
                            limit_text(facts, gate.check)});
    }
  }
  return table;
}

}  // namespace hsi4d
