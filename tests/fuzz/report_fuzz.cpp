// What a report reads of a run folder: one file of it is tried, the others are good.
#include "core/image_io.h"
#include "core/safetensors.h"
#include "pipelines/record/gradient_table.h"
#include "pipelines/report/data.h"
#include "pipelines/report/page.h"
#include "tests/fuzz/scratch.h"

namespace hsi4d::fuzz::report_fuzz {

namespace {

constexpr std::string_view kStatus =
    R"({"state": "done", "message": "no", "version": "0.1", "git": "0123", "host": "a", "seed": 3, "threads": 0,
 "precision": "float", "started": "now", "resumed": "then", "updated": null})";

constexpr std::string_view kConfig =
    R"({"name": "a", "seed": 3, "threads": 2, "render": {"quality": "accurate", "compatibility": "gsplat"}})";

constexpr std::string_view kSummary =
    R"({"name": "a", "frames": 2, "seconds": 1.5, "truth": true, "surface": "b.ply",
 "metrics": [{"stage": "camera", "seconds": 1, "iterations": 8, "camera_rotation_deg": 0.5},
  {"stage": "interaction", "frame": 0, "seconds": 0.5, "iterations": 9, "mpjpe_mm": 20, "psnr_db": 30,
   "gradient_shares": {"transl": {"center": {"share": 0.5, "cosine": -0.5, "evaluations": 3}}}}],
 "start": {"seconds": 0.1, "pose": {"previous": 1, "estimate": 2}},
 "baselines": {"start": {"mpjpe_mm": 30}, "copy_frame_0": {"frame": 0, "mpjpe_mm": 40}},
 "per_frame": [{"frame": 1, "mpjpe_mm": 10}, {"frame": 2, "mpjpe_mm": 30, "jitter": 1e3}],
 "baselines_per_frame": {"start": [{"frame": 1, "mpjpe_mm": 30}]}})";

constexpr std::string_view kMetrics =
    R"({"frame": 1, "stage": "interaction", "iteration": 0, "loss": 0.5, "seconds": 0.1, "losses": {"center": 0.5},
)";
constexpr std::string_view kMoreMetrics =
    R"( "gradient_shares": {"transl": {"center": {"norm": 1, "share": 1, "cosine": 1}}}}
{"frame": 1, "stage": "interaction", "iteration": 1, "loss": null, "rolled_back": true}
{"stage": "smooth", "iteration": 0, "loss": -1e-3}
)";

Bytes metrics() {
  std::string lines(kMetrics);
  lines.pop_back();  // a line of the file is two here
  return bytes_of(lines + std::string(kMoreMetrics));
}

Bytes view3d() {
  SafetensorsWriter file(std::string(kView3dFormat), kView3dVersion);
  file.add<float>("body/translations", {1, 3}, {0, 1, 2});
  file.set_text("frame_rate", "10");
  return file.encode();
}

Scratch& scratch() {
  Image image(3, 2, 3);
  static Scratch made({{"status.json", bytes_of(kStatus)},
                       {"config.resolved.json", bytes_of(kConfig)},
                       {"summary.json", bytes_of(kSummary)},
                       {"metrics.jsonl", metrics()},
                       {"view3d.safetensors", view3d()},
                       {"frames/0001_target.png", encode_image("a.png", image)}});
  return made;
}

}  // namespace

std::vector<Bytes> corpus() { return scratch().corpus(); }

bool accepts(std::span<const uint8_t> file) {
  scratch().try_file(file);
  is_read([&] {
    const std::string lines = read_text_file(scratch() / "metrics.jsonl");
    mean_gradient_shares(lines, "interaction", "metrics.jsonl");
  });
  return is_read([&] {
    const ReportData data = read_report_data(scratch().path());
    if (data.summary) gradient_table(*data.summary);
    HSI4D_CHECK(!report_page(data).empty(), "a report without text");
  });
}

const Target target("report", corpus, accepts);

}  // namespace hsi4d::fuzz::report_fuzz
