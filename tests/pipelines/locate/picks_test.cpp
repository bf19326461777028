#include "pipelines/locate/picks.h"

#include <catch2/catch.hpp>

#include "core/check.h"

namespace picks_test {

using namespace hsi4d;

namespace {

std::string error_of(const std::string& text) {
  try {
    decode_picks(text, "p.csv");
  } catch (const DataError& error) {
    return error.what();
  }
  return "";
}

/// A wall of large opaque Gaussians at y = 2.
Gaussians wall() {
  Gaussians g;
  for (int i = 0; i < 21; ++i) {
    for (int j = 0; j < 21; ++j) {
      g.means.insert(g.means.end(), {0.1F * static_cast<float>(i - 10), 2, 0.1F * static_cast<float>(j - 10)});
      g.quats.insert(g.quats.end(), {1, 0, 0, 0});
      g.log_scales.insert(g.log_scales.end(), {-2.3F, -7, -2.3F});
      g.opacity_logits.push_back(6);
      g.sh.insert(g.sh.end(), {0.5F, 0.2F, 0.1F});
    }
  }
  return g;
}

const Camera kFrame{64, 48, 60, 60, 32, 24, {}};

SceneView view_of_wall() {
  SceneView view;
  view.camera = {80, 60, 80, 80, 40, 30, look_at({0.2, -1, 0.1}, {0.2, 2, 0.1})};
  return view;
}

}  // namespace

TEST_CASE("files of picks are read by the names in their first line") {
  const std::vector<Pick> points = decode_picks(
      "# of frame 0\r\nframe_x, frame_y, x, y, z\r\n\r\n10.5,20,1,-2e-1,3 # a corner\r\n0,0,0,0,0", "p.csv");
  REQUIRE(points.size() == 2);
  CHECK(points[0].line == 4);
  CHECK(points[0].frame_pixel == Vector2<double>(10.5, 20));
  CHECK(*points[0].point_world == Vector3<double>(1, -0.2, 3));
  CHECK_FALSE(points[0].view_pixel.has_value());
  const std::vector<Pick> places = decode_picks("frame_x,frame_y,view_x,view_y\n1,2,3,4\n", "p.csv");
  REQUIRE(places.size() == 1);
  CHECK(*places[0].view_pixel == Vector2<double>(3, 4));
  CHECK_FALSE(places[0].point_world.has_value());
}

TEST_CASE("what is no file of picks is refused by line") {
  CHECK(error_of("") ==
        "p.csv: holds no picks; allowed: a line frame_x,frame_y,x,y,z or "
        "frame_x,frame_y,view_x,view_y, then such numbers, a pick a line");
  CHECK(error_of("1,2,3,4,5\n") ==
        "p.csv: line 1: \"1,2,3,4,5\" does not name what the lines hold; allowed: "
        "frame_x,frame_y,x,y,z or frame_x,frame_y,view_x,view_y");
  const std::string head = "frame_x,frame_y,x,y,z\n";
  CHECK(error_of(head + "1,2,3,4\n") ==
        "p.csv: line 2: \"1,2,3,4\" is no pick; allowed: 5 finite numbers apart by commas");
  for (const char* line :
       {"1,2,3,4,nan", "1,2,3,4,inf", "1,2,3,4,1e400", "1,2,3,4,1e10", "1,2,3,4,5,6", "1,2,3,4,", "a"})
    CHECK_THAT(error_of(head + line), Catch::StartsWith("p.csv: line 2: \"") && Catch::Contains("is no pick"));
  CHECK(error_of(head + "1,2,3,4,5\n1,2,0,0,0\n") == "p.csv: line 3: picks the place in the frame that line 2 picks");
}

TEST_CASE("a pick in another picture is the point that is seen there") {
  const SceneView view = view_of_wall();
  const std::vector<Pick> picks = decode_picks("frame_x,frame_y,view_x,view_y\n1,2,40,30\n3,4,20.25,41.5\n", "p.csv");
  const std::vector<PickedPoint> points = picked_points(picks, wall(), kFrame, view, "p.csv");
  REQUIRE(points.size() == 2);
  CHECK(points[1].pixel == Vector2<double>(3, 4));
  CHECK((points[0].point_world - Vector3<double>(0.2, 2, 0.1)).norm() < 2e-3);
  // 3 m away: (20.25 − 40)/80 · 3 to the right, (41.5 − 30)/80 · 3 down
  CHECK((points[1].point_world - Vector3<double>(0.2 - 19.75 / 80 * 3, 2, 0.1 - 11.5 / 80 * 3)).norm() < 3e-3);
}

TEST_CASE("picks that do not fit frame, view or scene are refused, all at once") {
  const auto error = [](const std::string& text, const std::optional<SceneView>& view) -> std::string {
    try {
      picked_points(decode_picks(text, "p.csv"), wall(), kFrame, view, "p.csv");
    } catch (const UserError& refused) {
      return refused.what();
    }
    return "";
  };
  const std::string of_points = "frame_x,frame_y,x,y,z\n", of_view = "frame_x,frame_y,view_x,view_y\n";
  CHECK(error(of_points + "64,2,0,0,0\n1,1,0,0,0\n-1,48,0,0,0\n", {}) ==
        "p.csv: line 2: 64,2 is outside of the frame, which has 64x48 pixels\n"
        "p.csv: line 4: -1,48 is outside of the frame, which has 64x48 pixels");
  CHECK(error(of_view + "1,2,80,3\n", view_of_wall()) ==
        "p.csv: line 2: 80,3 is outside of the view, which has 80x60 pixels");
  SceneView away = view_of_wall();
  away.camera.camera_from_world = look_at({0, -1, 0}, {0, -5, 0});
  CHECK(error(of_view + "1,2,40,3\n", away) ==
        "p.csv: line 2: the view sees through the scene at 40,3, so that no point is there");
  CHECK_THAT(error(of_view + "1,2,3,4\n", {}), Catch::Contains("--view says it"));
  CHECK_THAT(error(of_points + "1,2,3,4,5\n", view_of_wall()), Catch::Contains("--view has no meaning"));
}

}  // namespace picks_test
