#include "pipelines/record/summary.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "core/check.h"

namespace summary_test {

using namespace hsi4d;
using Catch::Matchers::Contains;

namespace {

RunSummary small_summary() {
  RunSummary summary;
  summary.name = "a \"walk\"";
  summary.frames = 2;
  summary.seconds = 12.5;
  summary.is_on_plate = true;
  summary.metrics = {{"camera", 2, 60, {{"camera_translation_cm", 0.125}, {"tiles", 4096}}},
                     {"interaction", 10, 600, {{"mpjpe_mm", 20.04}, {"camera_translation_cm", 0.125}, {"ssim", 0.9}}}};
  summary.baselines = {{"start", {{"mpjpe_mm", 60}, {"ssim", 0.5}}, {{1, {{"mpjpe_mm", 50}}}, {2, {{"mpjpe_mm", 70}}}}},
                       {"copy_frame_0", {{"mpjpe_mm", 20.01}}, {}}};
  summary.start = {0.25, {{"objects", {{"previous", 3}, {"estimate", 0}, {"velocity", 4}}}}};
  summary.per_frame = {{1, {{"mpjpe_mm", 10}}}, {2, {{"mpjpe_mm", 30.1}}}};
  summary.first_pass = {{1, {{"mpjpe_mm", 12}}}, {2, {{"mpjpe_mm", 33}}}};
  summary.quality = {{"silhouette_iou", 0.75, 0.85, 0.7}, {"jitter", 3, 165, 330}};
  return summary;
}

}  // namespace

TEST_CASE("a summary reads back as it was written") {
  const std::string text = summary_json(small_summary());
  const RunSummary back = parse_summary(text, "summary.json");
  CHECK(summary_json(back) == text);
  CHECK(back.name == "a \"walk\"");
  CHECK(back.is_on_plate);
  CHECK(back.seconds == 12.5);
  REQUIRE(back.metrics.size() == 2);
  CHECK(back.metrics[0].iterations == 60);
  CHECK(back.metrics[0].values == MetricValues{{"camera_translation_cm", 0.125}, {"tiles", 4096}});
  CHECK(back.start.seconds == 0.25);
  REQUIRE(back.start.parts.size() == 1);
  CHECK(back.start.parts[0].begun ==
        std::vector<std::pair<std::string, Index>>{{"previous", 3}, {"estimate", 0}, {"velocity", 4}});
  REQUIRE(back.baselines.size() == 2);
  CHECK(back.baselines[0].per_frame.size() == 2);
  CHECK(*find_metric(back.per_frame[1].values, "mpjpe_mm") == 30.1);
  CHECK(find_metric(back.per_frame[1].values, "ssim") == nullptr);
  REQUIRE(back.first_pass.size() == 2);
  CHECK(*find_metric(back.first_pass[1].values, "mpjpe_mm") == 33);
  REQUIRE(back.quality.size() == 2);
  CHECK(back.quality[0].metric == "silhouette_iou");
  CHECK(back.quality[0].value == 0.75);
  CHECK(word_of(back.quality[0]) == "check");
  CHECK(back.quality[1].check == 330);
  CHECK_THAT(text, Contains("\"word\": \"check\""));
  CHECK_THAT(text, Contains("\"stage\": \"interaction\",\n      \"seconds\": 10,\n      \"iterations\": 600"));
}

TEST_CASE("numbers that are not finite are refused by name") {
  const auto message_of = [](RunSummary summary) {
    try {
      summary_json(summary);
    } catch (const InternalError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  const double infinity = std::numeric_limits<double>::infinity();
  RunSummary summary = small_summary();
  summary.metrics[1].values[0].second = std::nan("");
  CHECK_THAT(message_of(summary), Contains("/metrics/1/mpjpe_mm: nan is not finite"));
  summary = small_summary();
  summary.seconds = infinity;
  CHECK_THAT(message_of(summary), Contains("/seconds: inf is not finite"));
  summary = small_summary();
  summary.baselines[0].per_frame[1].values[0].second = -infinity;
  CHECK_THAT(message_of(summary), Contains("/baselines_per_frame/start/1/mpjpe_mm: -inf is not finite"));
  summary = small_summary();
  summary.per_frame[0].values.emplace_back("mpjpe_mm", 3);
  CHECK_THAT(message_of(summary), Contains("/per_frame/0/mpjpe_mm: the name occurs twice"));
  summary = small_summary();
  summary.metrics[0].values.emplace_back("stage", 3);
  CHECK_THAT(message_of(summary), Contains("/metrics/0/stage: the name occurs twice"));
}

TEST_CASE("a damaged summary is told with file and line") {
  const auto message_of = [](const std::string& text) {
    try {
      parse_summary(text, "s.json");
    } catch (const DataError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  CHECK_THAT(message_of("{\n  \"frames\": 1,\n  \"seconds\" 3\n}"), Catch::Matchers::StartsWith("s.json:3"));
  CHECK(message_of("[]") == "s.json:1: [] is an array, not an object");
  CHECK(message_of("{\n\"metrics\": {}}") == "s.json:2: /metrics: {} is an object, not an array");
  CHECK(message_of("{\"metrics\": [{}]}") == "s.json:1: /metrics/0: there is no \"stage\", the name of the stage");
  CHECK(message_of("{\"per_frame\": [\n{\"mpjpe_mm\": 1}]}") == "s.json:2: /per_frame/0: there is no \"frame\"");
  CHECK(message_of("{\"frames\": 1.5}") == "s.json:1: /frames: 1.5 is not a whole number from 0 to 2^53");
  CHECK(message_of("{\"baselines\": {\"start\": 1}}") == "s.json:1: /baselines/start: 1 is a number, not an object");
  CHECK_THAT(message_of("{\"seconds\": 1e999}"), Contains("s.json:1"));
  CHECK(message_of("{\"future\": [1], \"metrics\": [{\"stage\": \"a\", \"mpjpe_mm\": null, \"x\": \"y\"}]}") ==
        "accepted");
}

TEST_CASE("the table of errors has baselines, then stages, and marks the best") {
  const RunSummary summary = small_summary();
  const Table table = error_table(summary);
  REQUIRE(table.rows.size() == 3);
  CHECK(table.rows[0][0].text == "MPJPE [mm]");
  REQUIRE(table.head.size() == 5);
  CHECK((table.head[1].text == "start" && table.head[1].mark == "baseline"));
  CHECK((table.head[4].text == "interaction" && table.head[4].mark.empty()));
  CHECK(table.rows[0][3].text == kNoCell.text);
  CHECK(table.rows[0][1].mark == "baseline");
  CHECK(table.rows[0][2].mark == "best");  // 20.0 is shown for 20.01 and for 20.04: a tie
  CHECK(table.rows[0][4].mark == "best");
  CHECK_FALSE(table.rows[1][3].is_marked());  // the same everywhere
  CHECK(table.rows[2][4].mark == "best");     // larger is better
  CHECK_FALSE(table.rows[2][1].is_marked());
  CHECK(error_text(summary) ==
        "                       start   copy_frame_0   camera   interaction\n"
        "MPJPE [mm]              60.0           20.0*       -          20.0*\n"
        "camera position [cm]       -              -     0.12          0.12\n"
        "SSIM                  0.5000              -        -        0.9000*\n");
  CHECK(error_text(RunSummary()) == "no errors were measured\n");
}

TEST_CASE("every metric of the contract is known") {
  for (const char* name : {"mpjpe_mm",
                           "pa_mpjpe_mm",
                           "world_mpjpe_mm",
                           "world_mpjpe_image_mm",
                           "world_mpjpe_depth_mm",
                           "root_translation_mm",
                           "object_translation_cm",
                           "object_rotation_deg",
                           "camera_translation_cm",
                           "camera_rotation_deg",
                           "psnr_db",
                           "psnr_foreground_db",
                           "psnr_background_db",
                           "camera_drift_px",
                           "background_change",
                           "ssim",
                           "silhouette_iou",
                           "object_iou",
                           "object_seen_share",
                           "keypoints_px",
                           "keypoints_pck",
                           "floor_drift_mm",
                           "contact_share",
                           "contact_distance_mm",
                           "penetration_share",
                           "penetration_depth_mm",
                           "foot_sliding_mm",
                           "jitter"}) {
    INFO(name);
    CHECK(find_metric_facts(name) != nullptr);
  }
  CHECK(find_metric_facts("tiles") == nullptr);
}

TEST_CASE("numbers for people have fixed decimals") {
  CHECK(fixed_number(1234.565, 1) == "1234.6");
  CHECK(fixed_number(-0.001, 2) == "0.00");
  CHECK(fixed_number(-0.006, 2) == "-0.01");
  CHECK(fixed_number(3, 0) == "3");
  CHECK(fixed_number(1e300, 0).size() == 301);
  CHECK(fixed_number(std::nan(""), 2) == "not finite");
}

}  // namespace summary_test
