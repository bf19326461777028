#include "pipelines/record/run_events.h"

#include <limits>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/host.h"
#include "core/image_io.h"
#include "tests/support/event_records.h"

namespace run_events_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
using Catch::Matchers::Message;
namespace fs = std::filesystem;

namespace {

constexpr double kGap = std::numeric_limits<double>::quiet_NaN();

RunIdentity identity() { return {"{}\n", 7, 2, "double"}; }

/// A line, whose numbers follow from frame and iteration.
IterationRecord line_of(int frame, std::string_view stage, Index iteration) {
  const double loss = 0.1 * frame + 1.0 / static_cast<double>(3 + iteration);
  return {frame, stage, iteration, loss, {{"masked_l2", loss / 7}, {"depth", 1e-9 * loss}}, 0.03 + 1e-4 * loss};
}

void write_images(const RunFolder& folder, int frame) {
  for (const char* const kind : {"target", "render", "difference"}) {
    Image image(3, 1, 1);
    for (int c = 0; c < 3; ++c) image.row(c, 0)[0] = static_cast<float>(frame) / 255;
    write_image(folder.paths().frame_image(frame, kind), image);
  }
}

void note(const IterationRecord& record, RunFolder& folder, RunEvents& events) {
  folder.append_metrics(record);
  events.add(record);
}

/// Runs a frame of three lines, of which one is a gap.
void run_frame(int frame, RunFolder& folder, RunEvents& events) {
  note(line_of(frame, "camera", 0), folder, events);
  IterationRecord gap = line_of(frame, "camera", 1);
  gap.losses[0].second = gap.loss = kGap;
  gap.rolled_back = true;
  note(gap, folder, events);
  note(line_of(frame, "interaction", 0), folder, events);
  write_images(folder, frame);
  events.end_frame(frame);
}

RunSummary summary() {
  RunSummary summary;
  summary.frames = 3;
  summary.metrics = {{"camera", 0, 0, {{"psnr_db", 20}}}, {"interaction", 0, 0, {{"psnr_db", 25}}}};
  summary.per_frame = {{1, {{"psnr_db", 24}, {"ssim", 0.5}}}, {2, {{"psnr_db", 26}}}};
  return summary;
}

}  // namespace

TEST_CASE("events of a run that goes on are those that its lines and images give") {
  for (const bool are_drawn_again : {false, true}) {
    INFO("images are drawn again: " << are_drawn_again);
    const TemporaryFolder here;
    RunFolder folder("run", identity(), false);
    const ShownImages images{2, are_drawn_again};
    std::vector<std::string> whole, again;
    {
      RunEvents events(folder, images, 0, 0);
      for (int frame = 0; frame < 3; ++frame) run_frame(frame, folder, events);
      if (are_drawn_again) events.add_images(2);
      events.add_result(summary());
      whole = messages_in(events_file_of("run"));
    }
    {
      RunEvents events(folder, images, 0, 3);
      if (are_drawn_again) events.add_images(2);
      events.add_result(summary());
      again = messages_in(events_file_of("run"));
    }
    CHECK(whole == again);  // times too
    // Version; of each frame two lines and losses; images of frames 0 and 2; two frames of results, and the mean.
    CHECK(whole.size() == 1 + 3 * 3 + 2 * 3 + 2 + 1);
    CHECK(count_tagged(whole, "loss/camera") == 3);
    CHECK(count_tagged(whole, "loss_interaction/depth") == 3);
    CHECK(count_tagged(whole, "frame_loss/camera") == 3);
    CHECK(count_tagged(whole, "images/difference") == 2);
    CHECK(count_tagged(whole, "result/psnr_db") == 2);
    CHECK(count_tagged(whole, "result/ssim") == 1);
    CHECK(count_tagged(whole, "mean/psnr_db") == 1);
  }
}

TEST_CASE("a line that was not taken counts, and is not shown") {
  const TemporaryFolder here;
  RunFolder folder("run", identity(), false);
  RunEvents events(folder, {}, 1, 1);
  run_frame(1, folder, events);
  const std::vector<std::string> shown = events_of_run("run");
  REQUIRE(shown.size() == 4);
  const IterationRecord first = line_of(1, "camera", 0), last = line_of(1, "interaction", 0);
  const auto expected = [](std::int64_t step, const IterationRecord& line) {
    const std::string stage(line.stage);
    return without_time(scalars_event(
        {0, step}, std::vector<std::pair<std::string, double>>{{"loss/" + stage, line.loss},
                                                               {"loss_" + stage + "/masked_l2", line.losses[0].second},
                                                               {"loss_" + stage + "/depth", line.losses[1].second}}));
  };
  CHECK(shown[1] == expected(0, first));
  CHECK(shown[2] == expected(2, last));
  CHECK(shown[3] == without_time(scalars_event(
                        {0, 1}, std::vector<std::pair<std::string, double>>{{"frame_loss/camera", first.loss},
                                                                            {"frame_loss/interaction", last.loss}})));
}

TEST_CASE("one file of events is there: a run that goes on takes the place of what was stopped") {
  const TemporaryFolder here;
  RunFolder folder("run", identity(), false);
  here.write("run/tensorboard/events.out.tfevents.1.host.hsi4d", "half of a record");
  here.write("run/tensorboard/events.out.tfevents.2.host.hsi4d", "");
  { const RunEvents events(folder, {}, 1, 1); }
  CHECK(messages_in(events_file_of("run")).size() == 1);
  { const RunEvents events(folder, {}, 1, 1); }  // within the same second, most often
  CHECK(messages_in(events_file_of("run")).size() == 1);
  here.write("run/tensorboard/notes.txt", "mine");
  remove_run_events(folder.paths());
  CHECK(fs::exists("run/tensorboard/notes.txt"));
  CHECK(std::distance(fs::directory_iterator("run/tensorboard"), {}) == 1);
  fs::remove("run/tensorboard/notes.txt");
  remove_run_events(folder.paths());
  CHECK_FALSE(fs::exists("run/tensorboard"));
  remove_run_events(folder.paths());
}

TEST_CASE("what tells a run from others of its sweep is shown") {
  const TemporaryFolder here;
  RunIdentity with_axes = identity();
  with_axes.sweep_axes.add("ablation", ConfigValue::make_string("no_color_net"));
  RunFolder folder("run", with_axes, false);
  const RunEvents events(folder, {}, 1, 1);
  const std::vector<std::string> shown = messages_in(events_file_of("run"));
  REQUIRE(shown.size() == 2);
  CHECK_THAT(shown[1], Contains("ablation") && Contains("no_color_net") && Contains("hparams"));
}

TEST_CASE("lines, images and times that events cannot be made of") {
  const TemporaryFolder here;
  RunFolder folder("run", identity(), false);
  const auto error_of = [&](const std::string& lines) {
    here.write("run/metrics.jsonl", lines);
    try {
      const RunEvents events(folder, {1, false}, 1, 2);
    } catch (const DataError& error) {
      return std::string(error.what());
    } catch (const UserError& error) {
      return std::string(error.what());
    }
    return std::string("none");
  };
  const std::string line = R"({"frame": 1, "stage": "camera", "loss": 1, "losses": {}, "seconds": 1})";
  CHECK_THAT(error_of(line + "\n"), Contains("run/frames/0001_target.png: "));
  write_images(folder, 1);
  CHECK(error_of(line + "\n") == "none");
  CHECK(error_of(line + "\n" + R"({"frame": 1, "stage": "a", "loss": "b"})" + "\n") ==
        "run/metrics.jsonl:2: /loss: \"b\" is a string, not a number");
  CHECK(error_of(R"({"frame": 1, "stage": "a", "loss": 1, "losses": {}})") ==
        "run/metrics.jsonl:1: there is no \"seconds\"");
}

TEST_CASE("a run whose start is not known has no events") {
  const TemporaryFolder here;
  { const RunFolder folder("run", identity(), false); }
  here.write("run/status.json", R"({"state": "running", "started": "yesterday"})");
  RunFolder folder("run", identity(), true);
  CHECK_THROWS_MATCHES(RunEvents(folder, {}, 1, 1), DataError,
                       Message("run/status.json: /started: \"yesterday\" is no time like \"2024-05-01T12:00:00Z\""));
}

}  // namespace run_events_test
