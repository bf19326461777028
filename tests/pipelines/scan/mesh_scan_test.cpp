#include <map>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/parallel.h"
#include "pipelines/config/run_config.h"
#include "pipelines/scan/scan.h"
#include "stress/scratch_folder.h"
#include "tests/pipelines/rig/mesh_files.h"

namespace mesh_scan_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace fs = std::filesystem;

namespace {

ScanSettings quick_scan(const fs::path& mesh, ScanKind kind) {
  ScanSettings settings;
  settings.kind = kind;
  settings.photos.path = mesh;
  settings.photos.hold_every = 4;
  settings.photos.rig.count = 8;
  settings.photos.rig.size = 32;
  settings.photos.rig.light.supersample = 2;
  settings.start.count = 300;
  settings.density.method = DensityMethod::kNone;
  settings.sh_degree = 1;
  settings.save_every = 10;
  settings.stage.iterations = 20;
  for (const char* name : {"means", "log_scales", "opacity_logits", "sh"}) {
    ParameterGroupSettings group;
    group.lr = std::string(name) == "means" ? 5e-4 : 1e-2;
    settings.stage.optimize.emplace_back(name, group);
  }
  for (const LossDescription& loss : descriptions_of(loss_terms())) {
    if (loss.name == "photometric") settings.stage.losses.emplace_back(loss.name, default_settings(loss));
  }
  return settings;
}

std::string bytes_of(const ScanSettings& settings, const fs::path& folder) {
  return read_text_file(scan_result(settings, folder).string());
}

/// Wants to stop after so many questions.
struct Impatient {
  int left;
  Observer observer() {
    Observer result;
    result.stop_requested = [this] { return --left < 0; };
    return result;
  }
};

}  // namespace

TEST_CASE("Gaussians are made of a mesh, and go on to the same bits wherever they were stopped", "[parallel]") {
  const ScratchFolder scratch;
  const fs::path folder = scratch.path();
  QuadMesh cube;
  cube.add_box(Vector3<double>(-0.2, -0.1, 0), Vector3<double>(0.2, 0.1, 0.3));
  const ScanSettings settings = quick_scan(write_glb(folder, cube, quarters()), ScanKind::kObject);
  const ScanSummary summary = run_scan(settings, folder / "whole", false, loss_terms());
  CHECK(summary.gaussians > 100);
  CHECK(summary.held.psnr_db > 12);
  CHECK(fs::exists(folder / "whole" / "pictures" / "transforms.json"));
  CHECK(fs::exists(folder / "whole" / "pictures" / "depths" / "0007.exr"));
  for (const int questions : {0, 12}) {  // while pictures are made; in the fit
    CAPTURE(questions);
    const fs::path stopped = folder / ("stopped" + std::to_string(questions));
    Impatient impatient{questions};
    CHECK_THROWS_AS(run_scan(settings, stopped, false, loss_terms(), impatient.observer()), Interrupted);
    with_threads(1, [&] { run_scan(settings, stopped, true, loss_terms()); });
    CHECK(bytes_of(settings, stopped) == bytes_of(settings, folder / "whole"));
  }
}

TEST_CASE("a room is seen from inside") {
  const ScratchFolder scratch;
  const fs::path folder = scratch.path();
  QuadMesh room;
  room.add_box(Vector3<double>(0, 0, 0), Vector3<double>(5, 4, 2.5), true);
  room.add_box(Vector3<double>(1.5, 1, 0.01), Vector3<double>(3, 2, 0.8));
  const ScanSettings settings = quick_scan(write_glb(folder, room, quarters()), ScanKind::kScene);
  const ScanSummary summary = run_scan(settings, folder / "room", false, loss_terms());
  CHECK(summary.pictures.size() == 8);
  CHECK(fs::exists(folder / "room" / "scene.ply"));
}

TEST_CASE("a mesh that is none leaves no folder behind") {
  const ScratchFolder scratch;
  const fs::path folder = scratch.path();
  write_text_file((folder / "empty.obj").string(), "v 0 0 0\n");
  const ScanSettings settings = quick_scan(folder / "empty.obj", ScanKind::kObject);
  CHECK_THROWS_WITH(run_scan(settings, folder / "out", false, loss_terms()), Catch::Contains("no faces"));
  CHECK_FALSE(fs::exists(folder / "out"));
}

}  // namespace mesh_scan_test
