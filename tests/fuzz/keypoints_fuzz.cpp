// Any bytes as a file of 2D keypoints, and as one that says which joints points stand for.
#include <string>
#include <string_view>

#include "core/check.h"
#include "pipelines/input/keypoints.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz::keypoints_fuzz {

std::vector<Bytes> corpus() {
  std::vector<Bytes> files;
  for (const std::string_view text :
       {R"({"format": "hsi4d keypoints", "version": 1, "joints": ["pelvis", null, {"neck": 0.5, "head": 0.5}],
 "size": [64, 48], "frames": [[[1, 2, 0.5], [3, 4, 1], [5, 6, 0]], []]})",
        R"([{"image_id": 1, "category_id": 1, "keypoints": [1, 2, 1, 3, 4, 0.5], "score": 0.9}])",
        R"([{"pelvis": 1}, "head", null])"})
    files.emplace_back(text.begin(), text.end());
  return files;
}

bool accepts(std::span<const uint8_t> file) {
  const std::string text(file.begin(), file.end());
  const bool is_list = is_read([&] {
    for (const KeypointJoints& point : parse_keypoint_joints(text, "fuzz.json"))
      for (const auto& [joint, weight] : point)
        HSI4D_CHECK(joint >= 0 && joint < 55 && weight > 0, "an accepted joint");
  });
  const bool is_file = is_read([&] {
    const FoundKeypoints found = parse_keypoints(text, "fuzz.json", {{{0, 1.0}}, {}});
    for (const auto& persons : found.frames)
      for (const FoundPerson& person : persons) HSI4D_CHECK(person.size() == 2, "an accepted person");
  });
  return is_list || is_file || is_read([&] { parse_keypoints(text, "fuzz.json"); });
}

const Target target("keypoints", corpus, accepts);

}  // namespace hsi4d::fuzz::keypoints_fuzz
