// `hsi4d follow` as a user runs it.
#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "core/image_io.h"
#include "optim/metrics.h"
#include "tests/support/moving_shapes.h"
#include "tests/support/program.h"

namespace follow_command_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::StartsWith;
namespace fs = std::filesystem;

namespace {

/// frames/, truth/human/ and truth/can/ in the current folder.
struct Film {
  TemporaryFolder folder;
  MovingShapes clip{.frames = 5, .bar_width = 14};

  Film() {
    for (const char* name : {"frames", "truth/human", "truth/can"}) fs::create_directories(name);
    for (int t = 0; t < clip.frames; ++t) {
      const std::string file = "/000" + std::to_string(t) + ".png";
      write_image("frames" + file, clip.frame(t));
      write_image("truth/human" + file, clip.bar_mask(t));
      write_image("truth/can" + file, clip.object_mask(t));
    }
  }

  static ProgramResult run(std::vector<std::string> more) {
    std::vector<std::string> arguments = {"follow", "frames", "--out", "found"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_hsi4d(arguments);
  }
};

}  // namespace

TEST_CASE("hsi4d follow makes masks from a click, a box and a mask") {
  const Film film;
  const auto [x, y] = film.clip.object_center(0);
  const auto text = [](double value) { return std::to_string(static_cast<int>(value)); };
  for (const std::string& hint :
       {text(x) + "," + text(y), text(x - 20) + "," + text(y - 20) + "," + text(x + 20) + "," + text(y + 20),
        std::string("truth/can/0000.png")}) {
    INFO(hint);
    const ProgramResult result = Film::run({"--object", "can=" + hint, "--masks", "truth", "--quiet"});
    INFO(result.err);
    REQUIRE(result.status == 0);
    CHECK(result.err.empty());
    CHECK_THAT(result.out, StartsWith("can: seen in 5 of 5 frames, score ") && Contains("\nfound/followed.jpg shows "));
    for (int t = 0; t < film.clip.frames; ++t) {
      const std::string file = "/000" + std::to_string(t) + ".png";
      CHECK(mask_iou(read_image("found/can" + file), film.clip.object_mask(t)).value() > 0.8);
      CHECK(mask_iou(read_image("found/human" + file), film.clip.bar_mask(t)).value() == 1);
    }
    CHECK(read_image("found/followed.jpg").width() == 5 * film.clip.width);
    const nlohmann::json scores = nlohmann::json::parse(file_text("found/scores.json"));
    CHECK(scores["can"]["states"].size() == 5);
    CHECK(scores["can"]["scores"][0] == 1);
    fs::remove_all("found");
  }
}

TEST_CASE("hsi4d follow refuses what it cannot do, and leaves nothing") {
  const Film film;
  const auto error = [](const std::vector<std::string>& more) {
    const ProgramResult run = Film::run(more);
    CHECK(run.status == 2);
    CHECK_FALSE(fs::exists("found"));
    return run.err;
  };
  CHECK_THAT(error({}), Contains("--object"));
  CHECK_THAT(error({"--object", "can"}), StartsWith("hsi4d follow: --object: \"can\" is no object; allowed: NAME=X,Y"));
  CHECK_THAT(error({"--object", "=3,4"}), Contains("is no object"));
  CHECK_THAT(error({"--object", "a/b=3,4"}), Contains("a/b is no name of a file or folder"));
  CHECK_THAT(error({"--object", "human=3,4"}), Contains("human is the folder of the human's masks"));
  CHECK_THAT(error({"--object", "can=3,4,5"}), Contains("--object can"));
  CHECK_THAT(error({"--object", "can=200,4"}),
             Contains("--object can: 200,4 is outside of the first frame, which has 160x120 pixels"));
  CHECK_THAT(error({"--object", "can=1,2", "--object", "can=1,2,30,40"}), Contains("--object can: given twice"));
  CHECK_THAT(error({"--object", "can=no.png"}), Contains("no.png"));
  CHECK_THAT(error({"--object", "can=30,62", "--longest-side-px", "20"}),
             Contains("--longest-side-px: 20 is out of range; allowed: 64 to 4096"));
  CHECK_THAT(error({"--object", "can=30,62", "--frame-rate", "-1"}), Contains("--frame-rate: -1"));
  CHECK_THAT(error({"--object", "can=30,62", "--masks", "frames"}), Contains("human"));
  write_image("empty.png", Image(1, 120, 160));
  CHECK_THAT(error({"--object", "can=empty.png"}), Contains("empty.png: the mask is empty"));
  write_image("small.png", Image(1, 60, 80));
  CHECK_THAT(error({"--object", "can=small.png"}),
             Contains("small.png: the mask is 80x60 pixels, the first frame 160x120"));
  write_image("truth/human/0003.png", Image(1, 60, 80));
  CHECK_THAT(error({"--object", "can=30,62", "--masks", "truth"}),
             Contains("0003.png: is 80x60 pixels, the first frame 160x120"));
  for (int t = 1; t < film.clip.frames; ++t) fs::remove("frames/000" + std::to_string(t) + ".png");
  CHECK_THAT(error({"--object", "can=30,62"}), Contains("frames"));
}

}  // namespace follow_command_test
