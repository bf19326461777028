// A run that has tracks of points: body and object go where these are.
#include <algorithm>
#include <cmath>
#include <map>

#include <catch2/catch.hpp>

#include "body/motion_io.h"
#include "core/npz.h"
#include "core/random.h"
#include "pipelines/draw/track_points.h"
#include "pipelines/graph/frame_graph.h"
#include "tests/support/program.h"
#include "tests/support/tiny_run.h"

namespace tracks_run_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

/// A grid of tracks over frame 0, followed by the truth: what lies on the scene stays.
void write_true_tracks(Clip clip, const fs::path& file) {
  constexpr Index kAcross = 24;
  const auto frames = std::ssize(*clip.truth);
  std::vector<TrackPlace> grid;
  for (Index i = 0; i < kAcross * kAcross; ++i)
    grid.push_back(
        {(static_cast<double>(i % kAcross) + 0.5) / kAcross, (static_cast<double>(i / kAcross) + 0.5) / kAcross, 1});
  clip.tracks = PointTracks{std::vector(static_cast<std::size_t>(frames), grid)};
  std::vector<TrackPoint> points = TrackPoints().of(clip, {}, std::array{clip.truth->front()});
  std::stable_partition(points.begin(), points.end(), [&clip](const TrackPoint& point) {  // the order of the graph
    return point.object == std::ssize(clip.objects);
  });
  std::vector<double> numbers;
  for (std::size_t t = 0; t < static_cast<std::size_t>(frames); ++t) {
    std::vector<TrackPlace> places = grid;
    const SceneState& state = (*clip.truth)[t];
    Tape<double> tape;
    FrameGraph<double> graph(tape, clip, state.camera_from_world, {});
    graph.set_state(state);
    graph.give_motion(clip.truth->front(), {clip.truth->front(), state});
    graph.give_tracks(points, grid);
    tape.forward(graph.loss_inputs().tracks);
    const auto px = tape.value(graph.loss_inputs().tracks);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto row = static_cast<Index>(i);
      places[static_cast<std::size_t>(points[i].track)] = {px(row, 0) / clip.camera.width,
                                                           px(row, 1) / clip.camera.height, 1};
    }
    for (const TrackPlace& place : places) numbers.insert(numbers.end(), {place.x, place.y});
  }
  NpzWriter archive;
  archive.add<double>("points", {frames, kAcross * kAcross, 2}, numbers);
  archive.add<double>("size", {2}, {1, 1});
  archive.write(file.string());
}

}  // namespace

TEST_CASE("tracks alone bring body and object to where they are", "[run]") {
  const CopiedDataset dataset;
  const Clip clip = dataset.read();
  write_true_tracks(clip, dataset.path / "tracks.npz");
  write_changed(dataset.path / "config.json", dataset.path / "changed.json", [](auto& c) {
    c["data"]["tracks"] = "tracks.npz";
    auto& stage = c["stages"]["interaction"];
    stage["iterations"] = 60;
    stage["losses"] = {{"tracks", {{"weight", 1}, {"scale_px", 3}}}};
    for (const char* group : {"transl", "global_orient", "body_pose", "object_orient", "object_transl"})
      stage["optimize"][group] = {{"lr", 0.02}, {"lr_final_share", 0.05}};
  });
  const RunConfig config =
      load_run_config(dataset.path / "changed.json", {}, descriptions_of(loss_terms()), ConfigUse::kRun);
  const fs::path run = dataset.folder.path() / "run";
  execute_tiny(config, run.string());
  CHECK_THAT(file_text(run / "log.txt"), Contains("data.tracks: of 576 tracks that begin in frame 0, "));
  const std::vector<nlohmann::json> lines = metrics_of(run);
  std::map<int, std::pair<double, double>> by_frame;  // before and after
  for (const nlohmann::json& line : lines) {
    if (line.value("stage", "") != "interaction") continue;
    const double value = line["losses"]["tracks"];
    by_frame.try_emplace(line["frame"], value, value).first->second.second = value;
  }
  double before = 0, after = 0;
  for (const auto& [frame, values] : by_frame) {
    before += values.first;
    after += values.second;
  }
  INFO(before << " px² before, " << after << " px² after, in all frames");
  CHECK(before > 0.1);
  CHECK(after < 0.5 * before);

  // They are inputs: other ones are another run, and the message says so.
  fs::remove(run / "status.json");
  NpzWriter other;
  other.add<double>("points", {kTinyFrames, 1, 2}, std::vector<double>(2 * kTinyFrames, 3.0));
  other.write((dataset.path / "tracks.npz").string());
  CHECK_THROWS_WITH(execute_tiny(config, run.string(), 1, true),
                    Contains("tracks.npz: is not what the run began with (/data/tracks)"));
}

}  // namespace tracks_run_test
