// `hsi4d reconstruct` as a user runs it, and kills it.
#include <catch2/catch.hpp>

#include "pipelines/synthetic/dataset.h"
#include "pipelines/synthetic/photos.h"
#include "tests/support/program.h"
#include "tests/support/running_program.h"

namespace reconstruct_command_test {

using namespace hsi4d;
using namespace hsi4d::test;

namespace fs = std::filesystem;

namespace {

std::vector<std::string> arguments(const std::string& out) {
  std::vector<std::string> words = {"reconstruct", std::string(HSI4D_SOURCE_DIR) + "/configs/reconstruct/object.json",
                                    "--out",       out,
                                    "--threads",   "1"};
  for (const char* setting :
       {"photos.path=photos/transforms.json", "start.count=600", "density.most=800", "density.from=20",
        "density.until=120", "density.every=20", "stage.iterations=160", "save_every=20", "sh_degree=1"}) {
    words.push_back("--set");
    words.push_back(setting);
  }
  return words;
}

}  // namespace

TEST_CASE("a reconstruction that is killed goes on to the same bits") {
  const TemporaryFolder folder;
  SyntheticSettings settings;
  settings.kind = SyntheticKind::kPhotos;
  settings.photos_of = SyntheticSubject::kObject;
  settings.photos = 12;
  settings.size_px = 64;
  write_photos(settings, video_render_settings(), "photos");
  const ProgramResult whole = run_hsi4d(arguments("whole"));
  CAPTURE(whole.err);
  REQUIRE(whole.status == 0);
  CHECK_THAT(whole.out, Catch::Contains("whole/object.ply: ") && Catch::Contains("held back: "));

  RunningProgram program(arguments("killed"));
  REQUIRE(program.signal_at(SIGKILL, [] { return fs::exists("killed/checkpoint.npz"); }));
  CHECK(program.result() == -SIGKILL);
  CHECK_FALSE(fs::exists("killed/object.ply"));
  std::vector<std::string> again = arguments("killed");
  again.emplace_back("--resume");
  const ProgramResult resumed = run_hsi4d(again);
  CAPTURE(resumed.err);
  REQUIRE(resumed.status == 0);
  CHECK(file_text("killed/object.ply") == file_text("whole/object.ply"));
}

}  // namespace reconstruct_command_test
