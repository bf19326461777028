// Points that tracks follow: found on what is drawn, and seen where they were found.
#include <cmath>

#include <catch2/catch.hpp>

#include "autodiff/gradcheck.h"
#include "core/log.h"
#include "core/rotation.h"
#include "pipelines/draw/track_points.h"
#include "pipelines/graph/frame_graph.h"
#include "tests/support/loss_terms.h"
#include "tests/support/small_clip.h"

namespace frame_tracks_test {

using namespace hsi4d;
using test::small_clip;

namespace {

constexpr int kWidth = 64, kHeight = 56;

/// A dense clip of two frames, with tracks of which the second is not seen in frame 0, nor the last ever.
Clip clip_with_tracks() {
  Clip clip = small_clip(kWidth, kHeight, 3000, 200);
  for (ClipObject& object : clip.objects)
    for (float& logit : object.gaussians.opacity_logits) logit = 6;
  for (float& logit : clip.avatar.opacity_logits) logit = 6;
  clip.tracks = PointTracks();
  std::vector<TrackPlace> first, second;
  Camera camera = clip.camera;
  camera.camera_from_world = clip.first.camera_from_world;
  const auto add = [&](const Vector3<double>& world, double seen_at_first) {
    const Vector2<double> px = project_point(camera, transform_point(camera.camera_from_world, world));
    first.push_back({px[0] / kWidth, px[1] / kHeight, seen_at_first});
    second.push_back({px[0] / kWidth + 0.01, px[1] / kHeight, 1});
  };
  const Vector3<double> chest = clip.first.body.transl + Vector3<double>(0, -0.35, 0.15);
  add(chest, 1);
  add(chest, 0);
  for (const ObjectPose& pose : clip.first.objects) add(pose.translation, 1);
  first.push_back({0.97, 0.97, 1}), second.push_back({0.97, 0.97, 1});  // a corner, where nobody is
  first.push_back({0.5, 0.5, 0}), second.push_back({0.5, 0.5, 0});
  clip.tracks->frames = {first, second};
  return clip;
}

}  // namespace

TEST_CASE("tracks follow the human and the objects that are seen where they begin", "[frame_graph]") {
  const Clip clip = clip_with_tracks();
  std::string told;
  const LogSink sink = log_to([&told](LogLevel, std::string_view text) { told += text; });
  TrackPoints all;
  const std::vector<TrackPoint> points = all.of(clip, {}, std::array{clip.first});
  INFO(told);
  REQUIRE(points.size() == 3);
  CHECK(points[0].track == 0);
  CHECK(points[0].object == 2);  // the human
  CHECK(points[1].track == 2);
  CHECK(points[1].object == 0);
  CHECK(points[2].track == 3);
  CHECK(points[2].object == 1);
  CHECK(told ==
        "data.tracks: of 4 tracks that begin in frame 0, 1 follow the human, 1 follow box, 1 follow ball, 1 "
        "nothing that moves");
  const std::vector<TrackPoint> later = all.of(clip, {}, std::array{clip.first, clip.first});
  REQUIRE(later.size() == 4);
  CHECK(later[3].track == 1);
  CHECK(later[3].object == 2);
}

TEST_CASE("a point is seen where its track began, and moves as what it lies on", "[frame_graph]") {
  const Clip clip = clip_with_tracks();
  const std::vector<TrackPoint> points = TrackPoints().of(clip, {}, std::array{clip.first});
  REQUIRE(points.size() == 3);
  SceneState state = clip.first;
  const auto seen = [&] {
    Tape<double> tape;
    FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, {});
    graph.set_state(state);
    graph.give_motion(clip.first, {clip.first, state});
    graph.give_tracks(points, clip.tracks->frames[1]);
    tape.forward(graph.loss_inputs().tracks);
    std::vector<double> places;
    const auto found = tape.value(graph.loss_inputs().tracks), target = tape.value(graph.loss_inputs().tracks_target);
    CHECK(target(0, 0) == Approx(clip.tracks->frames[1][0].x * kWidth));
    CHECK(target(1, 1) == Approx(clip.tracks->frames[1][2].y * kHeight));
    for (Index i = 0; i < 3; ++i) places.insert(places.end(), {found(i, 0), found(i, 1)});
    return places;
  };
  const std::vector<double> before = seen();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const TrackPlace& begin = clip.tracks->frames[0][static_cast<std::size_t>(points[i].track)];
    CHECK(before[2 * i] == Approx(begin.x * kWidth).epsilon(1e-9));
    CHECK(before[2 * i + 1] == Approx(begin.y * kHeight).epsilon(1e-9));
  }
  const Vector3<double> right = clip.first.camera_from_world.rotation.transpose() * Vector3<double>(0.1, 0, 0);
  state.body.transl += right;
  state.objects[1].translation += right;
  const std::vector<double> after = seen();
  CHECK(after[0] > before[0] + 1);
  CHECK(after[1] == Approx(before[1]).epsilon(1e-9));
  CHECK(after[2] == before[2]);
  CHECK(after[4] > before[4] + 1);
  state.objects[0].rotation += Vector3<double>(0, 0, 0.5);  // a point off the axis goes round it
  CHECK(seen()[2] != before[2]);
}

TEST_CASE("the gradient of tracks through a frame is right for what moves", "[frame_graph][release]") {
  const Clip clip = clip_with_tracks();
  const std::vector<TrackPoint> points = TrackPoints().of(clip, {}, std::array{clip.first});
  Tape<double> tape;
  FrameGraph<double> graph(tape, clip, clip.first.camera_from_world, {});
  graph.set_state(clip.first);
  graph.give_motion(clip.first, {clip.first, clip.first});
  graph.give_tracks(points, clip.tracks->frames[1]);
  const Var<double> loss = test::record_term("tracks", graph.loss_inputs(), "{}");
  Index moving = 0;
  for (const ParameterGroup<double>& group : graph.groups()) {
    INFO("group " << group.name);
    for (const Var<double> block : group.blocks) tape.unfreeze(block);
    GradcheckOptions options;
    options.tolerance = 1e-6;
    options.entries = 16;
    options.each_node = false;
    const GradcheckReport report = gradcheck(tape, loss, options);
    INFO(report.text());
    CHECK(report.failures.empty());
    moving += report.entries > 0 ? 1 : 0;
    for (const Var<double> block : group.blocks) tape.freeze(block);
  }
  CHECK(moving > 4);
}

}  // namespace frame_tracks_test
