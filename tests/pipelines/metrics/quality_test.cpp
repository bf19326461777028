#include "pipelines/metrics/quality.h"

#include <catch2/catch.hpp>

namespace quality_test {

using namespace hsi4d;

TEST_CASE("a gate has a word for where its value lies, both ways round") {
  const auto word = [](const char* metric, double value) {
    const std::vector<QualityGate> gates = quality_of({{metric, value}}, 10);
    REQUIRE(gates.size() == 1);
    return std::string(word_of(gates.front()));
  };
  CHECK(word("silhouette_iou", 0.85) == "pass");
  CHECK(word("silhouette_iou", 0.849) == "check");
  CHECK(word("silhouette_iou", 0.69) == "fail");
  CHECK(word("object_iou", 0.7) == "pass");
  CHECK(word("object_iou", 0.49) == "fail");
  CHECK(word("foot_sliding_mm", 10) == "pass");
  CHECK(word("foot_sliding_mm", 10.1) == "check");
  CHECK(word("foot_sliding_mm", 26) == "fail");
  CHECK(word("psnr_background_db", 17) == "fail");
  CHECK(word("camera_drift_px", 1) == "pass");
  CHECK(word("camera_drift_px", 2) == "check");
  CHECK(word("background_change", 0.02) == "pass");
  CHECK(word("background_change", 0.11) == "fail");
}

TEST_CASE("metrics without a gate are passed over") {
  CHECK(quality_of({{"mpjpe_mm", 3}, {"psnr_db", 10}}, 10).empty());
  CHECK(quality_text({}).empty());
}

TEST_CASE("jitter may be larger at a higher rate") {
  const auto word = [](double jitter, double rate) { return word_of(quality_of({{"jitter", jitter}}, rate).front()); };
  CHECK(word(400, 10) == "fail");
  CHECK(word(400, 30) == "pass");
  CHECK(word(160, 10) == "pass");
}

TEST_CASE("quality in words and as a table") {
  const std::vector<QualityGate> gates =
      quality_of({{"foot_sliding_mm", 30}, {"silhouette_iou", 0.8}, {"keypoints_pck", 1}, {"ssim", 0.1}}, 10);
  CHECK(passed_count(gates) == 1);
  CHECK(quality_text(gates) ==
        "quality: 1 of 3 gates pass; check: silhouette IoU 0.800 (≥ 0.850); fail: foot sliding 30.0 mm (≤ 10.0)\n");
  const Table table = quality_table(gates);
  REQUIRE(table.rows.size() == 3);
  CHECK(table.rows[0][0].text == "foot sliding [mm]");
  CHECK(table.rows[0][2].mark == "fail");
  CHECK(table.rows[2][2].text == "pass");
}

}  // namespace quality_test
