// What is read of a chain of clips: its summary, of which a report is made, and the result of a clip.
#include "core/camera_file.h"
#include "core/npz.h"
#include "pipelines/chain/report.h"
#include "pipelines/chain/results.h"
#include "pipelines/chain/summary.h"
#include "tests/fuzz/archive_list.h"
#include "tests/fuzz/scratch.h"

namespace hsi4d::fuzz::chain_fuzz {

namespace {

constexpr std::string_view kSummary =
    R"({"name": "a", "frames": 3, "seconds": 1.5, "truth": false,
 "metrics": [{"stage": "camera", "seconds": 1, "iterations": 8, "psnr_db": 30}],
 "baselines": {"start": {"psnr_db": 20}}, "per_frame": [{"frame": 1, "psnr_db": 30}],
 "clips": [{"name": "first", "begin": 0, "frames": 2, "seconds": 1, "psnr_db": 29},
  {"name": "second", "begin": 1, "frames": 2, "psnr_db": 31}],
 "joins": [{"before": "first", "after": "second", "frame": 1, "jump_mm": 0, "world_mpjpe_mm": 12}]})";

constexpr std::string_view kCameras =
    R"({"format": "hsi4d cameras", "version": 1, "cameras": [{"width": 2, "height": 1, "fx": 1, "fy": 1,
 "cx": 1, "cy": 0.5, "world_to_camera": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]})";

Bytes motion() {
  NpzWriter file;
  file.add<double>("trans", {1, 3}, {0, 1, 2});
  file.add<float>("poses", {1, 165}, std::vector<float>(165, 0.5F));
  return file.encode();
}

Bytes objects() {
  NpzWriter file;
  file.add<double>("ball/rotation", {1, 3}, {0, 1, 2});
  file.add<double>("ball/translation", {1, 3}, {0, 1, 2});
  return file.encode();
}

Scratch& scratch() {
  static Scratch made({{"summary.json", bytes_of(kSummary)},
                       {"config.resolved.json", bytes_of(R"({"chain": [{"name": "first"}, {"name": "second"}]})")},
                       {"motion.npz", motion()},
                       {"objects.npz", objects()},
                       {"cameras.json", bytes_of(kCameras)}});
  return made;
}

}  // namespace

std::vector<Bytes> corpus() {
  std::vector<Bytes> all = scratch().corpus();
  all.push_back(Scratch::with_choice(3, list_of(objects())));
  return all;
}

bool accepts(std::span<const uint8_t> file) {
  scratch().try_file(file, [](std::span<const uint8_t> rest) { return archive_of(rest); });
  const bool is_chain = is_read([&] { is_chain_folder(scratch().path()); });
  const bool is_reported = is_read([&] { write_chain_report(scratch().path()); });
  const bool is_clip = is_read([&] { read_clip_result("first", scratch().path(), {"ball"}); });
  return is_chain && is_reported && is_clip;
}

const Target target("chain", corpus, accepts);

}  // namespace hsi4d::fuzz::chain_fuzz
