#include "pipelines/input/frame_cameras.h"

#include <functional>

#include <catch2/catch.hpp>

#include "core/image_io.h"
#include "core/log.h"
#include "tests/support/temporary_folder.h"

namespace frame_cameras_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;

namespace {

/// An entry of transforms.json with the camera at (x, 0, 0).
std::string entry(const std::string& picture, int x) {
  return "{" + (picture.empty() ? "" : "\"file_path\": \"" + picture + "\", ") + "\"transform_matrix\": [[1, 0, 0, " +
         std::to_string(x) + "], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}";
}

std::string transforms(const std::vector<std::string>& entries) {
  std::string text = R"({"w": 8, "h": 6, "fl_x": 7, "fl_y": 7, "cx": 4, "cy": 3, "frames": [)";
  for (std::size_t i = 0; i < entries.size(); ++i) text += (i == 0 ? "" : ",\n") + entries[i];
  return text + "]}";
}

/// frames/frame_00001.png to frame_00003.png, of which only the names count here.
struct Here {
  TemporaryFolder folder;
  FrameSource frames = made();
  std::vector<std::string> told;
  LogSink sink = log_to([this](LogLevel, std::string_view message) { told.emplace_back(message); });

  FrameSource made() {
    for (const char* name : {"1", "2", "3"}) folder.write(std::string("frames/frame_0000") + name + ".png", "");
    return FrameSource("frames", {});
  }
  std::string write(const std::vector<std::string>& entries) {
    folder.write("c.json", transforms(entries));
    return "c.json";
  }
};

double place(const Camera& camera) { return camera_center_world(camera)[0]; }

std::string fault(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no fault";
}

}  // namespace

TEST_CASE("entries in any order are matched to frames by the names of their pictures") {
  Here here;
  const std::string file =
      here.write({entry("images/frame_00003.png", 3), entry("./images/frame_00001.jpg", 1), entry("frame_00002", 2)});
  CHECK(place(first_camera(file, here.frames)) == 1);
  CHECK(here.told == std::vector<std::string>{"c.json: /frames/1, \"./images/frame_00001.jpg\", is the camera of frame "
                                              "0; the others are not used"});
  const std::vector<Camera> all = cameras_of_frames(file, here.frames);
  REQUIRE(all.size() == 3);
  for (std::size_t i = 0; i < 3; ++i) CHECK(place(all[i]) == static_cast<double>(i) + 1);
}

TEST_CASE("entries of no frame and frames without an entry are named") {
  Here here;
  const std::string file = here.write({entry("other_7.png", 7), entry("frame_00001.png", 1)});
  CHECK(place(first_camera(file, here.frames)) == 1);
  REQUIRE(here.told.size() == 3);
  CHECK(here.told[0] == "c.json: entries whose file_path is of no frame are not used: other_7.png");
  CHECK(here.told[1] == "c.json: no entry's file_path is of the frames frame_00002.png, frame_00003.png");
  CHECK(fault([&] { cameras_of_frames(file, here.frames); }) ==
        "c.json: no entry's file_path is of the frames frame_00002.png, frame_00003.png");
  here.write({entry("frame_00002.png", 2), entry("frame_00003.png", 3)});
  CHECK(fault([&] { first_camera(file, here.frames); }) ==
        "c.json: no entry's file_path is of frame 0, \"frame_00001.png\"; there are frame_00002.png, frame_00003.png");
  here.write({entry("frame_00002.png", 2)});
  CHECK_THAT(fault([&] { first_camera(file, here.frames); }), Contains("the one is frame_00002.png"));
  here.write({entry("train/frame_00001.png", 1), entry("test/frame_00001.png", 2)});
  CHECK(fault([&] { first_camera(file, here.frames); }) ==
        "c.json: /frames/0 and /frames/1 are both of \"frame_00001\" by their file_path; a frame has one camera");
  here.write({entry("frame_00001.png", 1), entry("", 2)});
  CHECK_THAT(fault([&] { first_camera(file, here.frames); }), Contains("/frames/1 has no file_path"));
}

TEST_CASE("cameras without names are in the order of frames, and as many") {
  Here here;
  const std::string file = here.write({entry("", 5)});
  CHECK(place(first_camera(file, here.frames)) == 5);
  CHECK(here.told.empty());
  CHECK(place(only_camera(file)) == 5);
  here.write({entry("", 5), entry("", 6), entry("", 7)});
  CHECK(place(first_camera(file, here.frames)) == 5);
  CHECK(here.told.size() == 1);
  CHECK(place(cameras_of_frames(file, here.frames)[2]) == 7);
  CHECK(camera_for_size(file).fx == 7);
  CHECK_THAT(fault([&] { only_camera(file); }), Contains("holds 3 cameras"));
  here.write({entry("", 5), entry("", 6)});
  CHECK(fault([&] { first_camera(file, here.frames); }) ==
        "c.json: holds 2 cameras, the video has 3 frames; allowed: that many, or 1");
}

TEST_CASE("cameras of a zoom are refused, as frames are drawn with one lens") {
  Here here;
  std::string wide = entry("frame_00003.png", 3);
  wide.insert(1, "\"fl_x\": 9, ");
  const std::string file = here.write({entry("frame_00001.png", 1), entry("frame_00002.png", 2), wide});
  const std::string refused = "c.json: camera 2 has another size, focal length or principal point than camera 0, and ";
  CHECK(fault([&] { first_camera(file, here.frames); }) ==
        refused + "all frames of a clip are drawn with that of frame 0; allowed: one for all");
  CHECK(fault([&] { camera_for_size(file); }) == refused + "one is to be chosen for both");
}

}  // namespace frame_cameras_test
