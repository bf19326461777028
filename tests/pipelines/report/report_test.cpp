#include "pipelines/report/report.h"

#include <algorithm>
#include <fstream>
#include <limits>
#include <set>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "body/motion_io.h"
#include "core/check.h"
#include "core/compression.h"
#include "core/image_io.h"
#include "pipelines/input/state.h"
#include "pipelines/record/folder.h"
#include "pipelines/report/figure.h"
#include "pipelines/report/view3d.h"
#include "tests/support/markup.h"
#include "tests/support/program.h"
#include "tests/support/small_clip.h"
#include "tests/support/temporary_folder.h"

namespace report_test {

using namespace hsi4d;
using namespace hsi4d::test;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

std::set<std::string> ids_of(const std::string& page) {
  std::set<std::string> ids;
  for (size_t at = page.find(" id=\""); at != std::string::npos; at = page.find(" id=\"", at + 1)) {
    const size_t begin = at + 5;
    CHECK(ids.insert(page.substr(begin, page.find('"', begin) - begin)).second);  // each once
  }
  return ids;
}

/// What stands between the first `begin` and the next `end`.
std::string text_between(const std::string& page, const std::string& begin, const std::string& end) {
  const size_t at = page.find(begin);
  REQUIRE(at != std::string::npos);
  const size_t from = at + begin.size();
  return page.substr(from, page.find(end, from) - from);
}

Bytes from_base64(const std::string& text) {
  CHECK(text.size() % 4 == 0);
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  Bytes bytes;
  unsigned bits = 0, count = 0;
  for (const char c : text) {
    if (c == '=') break;
    bits = (bits << 6U) | static_cast<unsigned>(digits.find(c));
    count += 6;
    if (count < 8) continue;
    count -= 8;
    bytes.push_back(static_cast<std::uint8_t>(bits >> count));
  }
  return bytes;
}

RunSummary summary_named(const std::string& name) {
  RunSummary summary;
  summary.name = name;
  summary.frames = 2;
  summary.seconds = 20;
  summary.metrics = {
      {"camera", 2, 60, {{"camera_translation_cm", 0.25}}},
      {"interaction",
       12,
       600,
       {{"mpjpe_mm", 20}, {"psnr_db", 31}, {"contact_share", 0.75}, {"jitter", 9.5}, {"fragments", 1234567}}}};
  summary.baselines = {
      {"start", {{"mpjpe_mm", 60}, {"psnr_db", 20}}, {{1, {{"mpjpe_mm", 50}}}, {2, {{"mpjpe_mm", 70}}}}},
      {"copy_frame_0", {{"mpjpe_mm", 45}}, {}}};
  summary.per_frame = {{1, {{"mpjpe_mm", 12.34}, {"psnr_db", 30}}}, {2, {{"mpjpe_mm", 27.66}, {"psnr_db", 32}}}};
  return summary;
}

/// A whole run folder, named `path`.
void make_run(const std::string& path, const std::string& name) {
  RunFolder folder(path, {"{\n  \"seed\": 3\n}\n", 3, 0, "float"}, false);
  Image image(3, 4, 5);
  for (int frame = 1; frame <= 2; ++frame) {
    for (const char* stage : {"camera", "interaction"})
      for (int i = 0; i < 300; ++i)
        folder.append_metrics({frame, stage, i, 0.5 / (i + frame), {{"photometric", 0.5 / (i + frame)}}, 0.01});
    for (const char* kind : {"target", "render", "difference", "side"}) {
      image(0, 1, 1) += 0.1F;
      write_image(folder.paths().frame_image(frame, kind), image);
    }
  }
  const Clip clip = small_clip(32, 24, 20);
  view3d_file(clip, {clip.first, clip.first, clip.first}, nullptr).write(folder.paths().view3d());
  folder.write_summary(summary_named(name));
  folder.set_state(RunState::kDone);
}

}  // namespace

TEST_CASE("the checker of tags finds what is wrong") {
  CHECK(tag_fault("<!DOCTYPE html><a b=\"x > y\"><c/>text</a><script>if (1 < 2) a();</script>").empty());
  CHECK(tag_fault("<a><b></a></b>") == "</a> closes b");
  CHECK(tag_fault("<a>") == "a is not closed");
  CHECK(tag_fault("<a x=<b>></a>") != "");
  CHECK(tag_fault("1 > 0") != "");
}

TEST_CASE("a report has every section, well formed, and asks for nothing from outside") {
  const TemporaryFolder here;
  make_run("a", "a walk");
  CHECK(write_report("a") == "a/report.html");
  const std::string page = file_text("a/report.html");
  CHECK(tag_fault(page) == "");
  const std::set<std::string> ids = ids_of(page);
  for (const char* id : {"errors", "frames", "errors-by-frame", "losses", "time", "config", "compare", "edge",
                         "published", "view3d", "view3d-canvas", "frames-data", "view3d-data"}) {
    INFO(id);
    CHECK(ids.contains(id));
  }
  CHECK_FALSE(ids.contains("notes"));  // nothing is missing
  for (const char* outside : {"http", "src=\"//", "@import", "url(", "<link", "fetch("}) {
    INFO(outside);
    CHECK(page.find(outside) == std::string::npos);
  }
  CHECK_THAT(page, Contains("<h1>a walk</h1><span class=\"badge done\">done</span>"));
  CHECK_THAT(page, Contains("<dt>seed</dt><dd>3</dd>") && Contains("<dt>threads</dt><dd>one a core</dd>") &&
                       Contains("<dt>precision</dt><dd>float</dd>") && Contains("<dt>version</dt>") &&
                       Contains("<dt>time</dt><dd>20 s</dd>"));
  // The table: the best is marked, what was not measured is a dash.
  CHECK_THAT(page, Contains("<th class=\"baseline\">start</th><th class=\"baseline\">copy frame 0</th><th>camera</th>"
                            "<th>interaction</th></tr></thead>"));
  CHECK_THAT(page,
             Contains("MPJPE <span class=\"unit\">mm ↓</span></th><td class=\"baseline\">60.0</td>"
                      "<td class=\"baseline\">45.0</td><td class=\"none\">–</td><td class=\"best\">20.0</td></tr>"));
  CHECK_THAT(page, Contains("jitter <span class=\"unit\">m/s³ ↓</span></th><td class=\"none\">–</td>"
                            "<td class=\"none\">–</td><td class=\"none\">–</td><td>9.5</td></tr>"));
  CHECK_THAT(page, Contains("from 60.0 <span class=\"better\">−67\u00A0%</span>"));
  CHECK(page.find("Worse than the start") == std::string::npos);
  // Errors by frame, with tooltips; the baseline without frames is a dashed mean.
  CHECK_THAT(page, Contains("<title>result, frame 2: 27.7 mm</title>"));
  CHECK_THAT(page, Contains("<title>start, frame 1: 50.0 mm</title>"));
  CHECK_THAT(page, Contains("<title>copy_frame_0 (mean)</title>"));
  CHECK(count_of(page, "<svg class=\"plot timed\" data-from=\"1.0\" data-to=\"2.0\" data-left=\"") == 2);
  CHECK(count_of(page, "<line class=\"now\" visibility=\"hidden\"") == 2);
  // A loss curve for each frame of each stage.
  CHECK(count_of(page, "<title>frame 1</title>") == 2);
  CHECK(count_of(page, "<title>frame 2</title>") == 2);
  // Time, with what no stage took, and counters.
  CHECK_THAT(page, Contains("</span>other</th><td>6.00</td><td>30.0 %</td>"));
  CHECK_THAT(page, Contains("1\xE2\x80\xAF"
                            "234\xE2\x80\xAF"
                            "567"));
  // Three kinds of images, each once, as PNG files in base64; the frame's errors beside them.
  CHECK(count_of(page, "data:image/png;base64,iVBORw0KGgo") == 6);
  CHECK_THAT(page, Contains("{\"frame\": 2, \"errors\": \"MPJPE 27.7 mm · PSNR 32.00 dB\", \"files\": {"));
  CHECK_THAT(page, Contains("{\"rate\": 10.000, \"gain\": 4, \"frames3d\": 3, \"images\": ["));
  CHECK_THAT(page, Contains(">difference ×4</option>") && Contains(">another side</option>"));
  CHECK(page.find(">start</option>") == std::string::npos);  // there is no such image
  // The paper's figures, and the run's where it has them.
  CHECK_THAT(page, Contains("penetration of the scene ↓</th><td>static</td><td class=\"none\">–</td><td>0.019</td>"
                            "<td>TRUMANS 0.046, LINGO 0.058</td>"));
  CHECK_THAT(page, Contains("contact ↑</th><td>dynamic</td><td class=\"own\">0.750</td><td>0.835</td>"
                            "<td>CHOIS 0.687, LINGO 0.699</td>"));
}

TEST_CASE("a report shows shares of the gradient and the time of chosen starts where there are any") {
  const TemporaryFolder here;
  make_run("a", "a walk");
  CHECK_FALSE(ids_of(report_html("a")).contains("shares"));
  RunSummary summary = summary_named("a walk");
  summary.metrics[1].gradient_shares = {{"transl", "photometric", 0.75, 0.98, 4},
                                        {"body_pose", "pose_prior", 0.5, -0.25, 4}};
  summary.start = {1.5, {{"objects", {{"previous", 1}, {"estimate", 0}, {"velocity", 1}}}}};
  std::ofstream("a/summary.json") << summary_json(summary);
  const std::string page = report_html("a");
  CHECK(tag_fault(page) == "");
  CHECK_THAT(page,
             Contains("<h3>interaction</h3><table>\n<thead><tr><th>group</th><th>photometric</th><th>pose prior</th>"
                      "</tr></thead>\n<tbody>\n<tr><th scope=\"row\">transl</th><td>75.0 % (0.98)</td>"
                      "<td class=\"none\">–</td></tr>\n<tr><th scope=\"row\">body pose</th>"
                      "<td class=\"none\">–</td><td>50.0 % (-0.25)</td></tr>\n</tbody></table>"));
  CHECK_THAT(page, Contains("</span>start</th><td>1.50</td><td>7.5 %</td>") &&
                       Contains("</span>other</th><td>4.50</td><td>22.5 %</td>"));
}

TEST_CASE("a report opens on the middle frame") {
  const TemporaryFolder here;
  make_run("a", "a walk");  // with frames 0 to 2 in the 3D view
  for (const char* name : {"0003", "0004"})
    fs::copy("a/frames/0001_render.png", std::string("a/frames/") + name + "_render.png");
  CHECK_THAT(report_html("a"), Contains("min=\"0\" max=\"4\" value=\"2\""));
}

TEST_CASE("a report tells first what became worse than the start, in few digits") {
  const TemporaryFolder here;
  make_run("a", "a walk");
  RunSummary summary = summary_named("a walk");
  summary.metrics[1].values = {{"mpjpe_mm", 483000}, {"world_mpjpe_mm", 12}, {"psnr_db", 19.5}};
  summary.baselines[0].values.emplace_back("world_mpjpe_mm", 12.001);  // the same in the digits that are shown
  here.write("a/summary.json", summary_json(summary));
  const std::string page = report_html("a");
  CHECK(tag_fault(page) == "");
  CHECK_THAT(page, Contains("<p class=\"message\">Worse than the start: MPJPE; PSNR.</p>"));
  CHECK_THAT(page, Contains("from 60.0 <span class=\"worse\">&gt; +999\u00A0%</span>"));
  CHECK_THAT(page, Contains("from 12.0, unchanged"));
  CHECK(count_of(page, "class=\"card figure harmed\"") == 1);  // PSNR has no card
}

TEST_CASE("a report compares with frame 0 copied too, and judges penetration by share and depth together") {
  const TemporaryFolder here;
  make_run("a", "a walk");
  RunSummary summary = summary_named("a walk");
  const auto page_of = [&](double share, double depth) {
    summary.baselines[0].values = {{"mpjpe_mm", 60}, {"penetration_share", 0.004}, {"penetration_depth_mm", 13.3}};
    summary.baselines[1].values = {{"mpjpe_mm", 15}, {"jitter", 0}};
    summary.metrics[1].values = {
        {"mpjpe_mm", 20}, {"penetration_share", share}, {"penetration_depth_mm", depth}, {"jitter", 9}};
    here.write("a/summary.json", summary_json(summary));
    return report_html("a");
  };
  const std::string page = page_of(0.005, 4.1);  // more of the body inside, but less deep
  CHECK_THAT(page, Contains("<p class=\"message\">Worse than frame 0 copied: MPJPE.</p>"));  // which never trembles
  CHECK_THAT(page, !Contains("Worse than the start"));
  CHECK_THAT(page_of(0.003, 20), !Contains("Worse than the start"));
  CHECK_THAT(page_of(0.005, 13.3), Contains("Worse than the start: penetration.</p>"));
  CHECK_THAT(page_of(0.004, 15), Contains("Worse than the start: penetration depth.</p>"));
  CHECK_THAT(page_of(0.005, 15), Contains("Worse than the start: penetration; penetration depth.</p>"));
}

TEST_CASE("a start that stands still is not better for it, one that moves may be") {
  const TemporaryFolder here;
  make_run("a", "a walk");
  RunSummary summary = summary_named("a walk");
  summary.baselines.resize(1);
  summary.metrics[1].values = {{"mpjpe_mm", 20}, {"foot_sliding_mm", 5}, {"jitter", 9}};
  const auto page_with = [&](double jitter) {
    summary.baselines[0].values = {{"mpjpe_mm", 60}, {"foot_sliding_mm", 0}, {"jitter", jitter}};
    here.write("a/summary.json", summary_json(summary));
    return report_html("a");
  };
  CHECK_THAT(page_with(0), !Contains("Worse than"));
  CHECK_THAT(page_with(3), Contains("Worse than the start: foot sliding; jitter.</p>"));
}

TEST_CASE("a report says that the scene is a plate") {
  const TemporaryFolder here;
  make_run("a", "a walk");
  RunSummary summary = summary_named("a walk");
  CHECK_THAT(report_html("a"), !Contains("<dt>scene</dt>"));
  summary.is_on_plate = true;
  here.write("a/summary.json", summary_json(summary));
  CHECK_THAT(report_html("a"), Contains("<dt>scene</dt><dd>a plate: the background of the video"));
}

TEST_CASE("the same run gives the same bytes, and reporting twice changes nothing") {
  const TemporaryFolder here;
  make_run("a", "a walk");
  const std::string page = report_html("a");
  write_report("a");
  CHECK(report_html("a") == page);
}

TEST_CASE("images and the 3D view come out of the page as they went in") {
  const TemporaryFolder here;
  make_run("a", "a");
  const std::string page = report_html("a");
  CHECK(from_base64(text_between(page, "\"render\": \"data:image/png;base64,", "\"")) ==
        read_file("a/frames/0001_render.png"));
  const Bytes packed = from_base64(text_between(page, "id=\"view3d-data\">", "<")),
              view = read_file("a/view3d.safetensors");
  GzipReader reader(packed, "the page");
  Bytes unpacked(view.size());
  reader.read(unpacked);
  reader.expect_end();
  CHECK(unpacked == view);
}

TEST_CASE("the page's data is JSON") {
  const TemporaryFolder here;
  make_run("a", "a");
  const nlohmann::json data = nlohmann::json::parse(text_between(report_html("a"), "id=\"frames-data\">", "</script>"));
  REQUIRE(data["images"].size() == 2);
  CHECK(data["images"][0]["frame"] == 1);
  for (const char* kind : {"target", "render", "side"}) CHECK(data["images"][1]["files"].contains(kind));
  CHECK(data["images"][1]["files"].size() == 3);
}

TEST_CASE("hostile names do no harm") {
  const TemporaryFolder here;
  const std::string hostile = "</title><script>alert('&\"')</script>";
  make_run("a", hostile);
  RunSummary summary = summary_named(hostile);
  summary.metrics[0].stage = "</script><b>";
  summary.metrics[1].values.emplace_back("<i onload=x>", 1);
  summary.baselines[1].name = "\"><img src=x onerror=y>";
  here.write("a/summary.json", summary_json(summary));
  here.write("a/metrics.jsonl", "{\"frame\": 1, \"stage\": \"<u>\", \"iteration\": 0, \"loss\": 1}\n");
  here.write("a/status.json",
             "{\"state\": \"<s>\", \"message\": \"<q>\", \"host\": \"<h>\", \"seed\": \"\\u0007<d>\"}");
  here.write("a/config.resolved.json", "{\"</pre><script>\": 1}");
  const std::string page = report_html("a");
  CHECK(tag_fault(page) == "");
  CHECK(count_of(page, "<script>") == 1);   // ours
  CHECK(count_of(page, "</script>") == 3);  // and of the data
  for (const char* bad : {"<b>", "<i ", "<img src=x", "<u>", "<s>", "<q>", "<h>", "<d>", "alert('", "\a"}) {
    INFO(bad);
    CHECK(page.find(bad) == std::string::npos);
  }
  CHECK_THAT(page, Contains("&lt;/title&gt;&lt;script&gt;alert(&#39;&amp;&quot;&#39;)&lt;/script&gt;"));
}

TEST_CASE("text is escaped, and what is no text is replaced") {
  CHECK(html_escape("a<b & \"c\" 'd' > é €") == "a&lt;b &amp; &quot;c&quot; &#39;d&#39; &gt; é €");
  CHECK(html_escape("\xFF"
                    "a\xC3"
                    "b\x01\xE2\x82") ==
        "\xEF\xBF\xBD"
        "a\xEF\xBF\xBD"
        "b\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBD");
}

TEST_CASE("what is missing is told, and is no error") {
  const TemporaryFolder here;
  here.write("a/config.resolved.json", "{}");
  const std::string page = report_html("a");
  CHECK(tag_fault(page) == "");
  for (const char* note : {"status.json is missing", "summary.json is missing", "metrics.jsonl is missing",
                           "view3d.safetensors is missing", "There are no images in frames/."})
    CHECK_THAT(page, Contains(note));
  CHECK_THAT(page, Contains("<span class=\"badge unknown\">unknown</span>") && Contains("No errors were measured."));
  CHECK(count_of(page, "<script>") == 0);

  make_run("b", "b");
  fs::remove("b/config.resolved.json");
  fs::remove("b/frames/0002_render.png");
  here.write("b/frames/0001_target.png", "no image");
  here.write("b/metrics.jsonl", file_text("b/metrics.jsonl") + "{\"frame\": 3, \"sta");
  const std::string partial = report_html("b");
  CHECK(tag_fault(partial) == "");
  for (const char* note :
       {"config.resolved.json is missing", "Of 2 frames 1 have no image of the kind &quot;render&quot;.",
        "frames/0001_target.png is not a PNG image.", "The last line of metrics.jsonl was cut short and is left out."})
    CHECK_THAT(partial, Contains(note));
  CHECK(count_of(partial, "data:image/png;base64,") == 4);  // of six: one is missing, one no image

  make_run("c", "c");
  fs::remove("c/summary.json");  // time comes from the lines then
  CHECK_THAT(report_html("c"), Contains("</span>camera</th><td>6.00</td><td>50.0 %</td><td>600</td><td>10.00</td>"));
}

TEST_CASE("a run that was killed is told from one that runs") {
  const TemporaryFolder here;
  {
    RunFolder folder("a", {"{}\n", 0, 1, "float"}, false);
    folder.append_metrics({1, "camera", 0, 0.0, {}, 0.1});  // a loss of 0 has no place on a logarithmic scale
    IterationRecord undone{1, "camera", 1, 0.5, {}, 0.1, true};
    undone.loss = std::numeric_limits<double>::infinity();
    folder.append_metrics(undone);
    const std::string page = report_html("a");
    CHECK_THAT(page, Contains("<span class=\"badge running\">running</span>"));
    CHECK_THAT(page, Contains("There is nothing to plot.") && Contains("1 of 2 steps were rolled back"));
    CHECK(tag_fault(page) == "");
  }
  CHECK_THAT(report_html("a"), Contains("stopped without a word"));
  RunFolder folder("a", {"{}\n", 0, 1, "float"}, true);
  folder.set_state(RunState::kFailed, "no mask for frame 2");
  CHECK_THAT(report_html("a"), Contains("<p class=\"message\">no mask for frame 2</p>"));
}

TEST_CASE("a report is headed by the config's name and tells its folder, however the run stands") {
  const TemporaryFolder here;
  {
    const RunFolder folder("first/run", {"{\"name\": \"a walk\"}\n", 0, 1, "float"}, false);
    CHECK_THAT(report_html("first/run"), Contains("<h1>a walk</h1><span class=\"badge running\">") &&
                                             Contains("<dt>folder</dt><dd>first/run</dd>"));
  }
  CHECK_THAT(report_html("first/run/"), Contains("<h1>a walk</h1>") && Contains("<dd>first/run</dd>"));
  const RunFolder nameless("second/run", {"{}\n", 0, 1, "float"}, false);
  CHECK_THAT(report_html("second/run"), Contains("<h1>run</h1>") && Contains("<dd>second/run</dd>"));
}

TEST_CASE("damaged files are told with file and line") {
  const TemporaryFolder here;
  const auto message_of = [&here](const std::string& file, const std::string& text) {
    fs::remove_all("a");
    make_run("a", "a");
    here.write("a/" + file, text);
    try {
      report_html("a");
    } catch (const DataError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  CHECK_THAT(message_of("view3d.safetensors", "12345678"), Catch::Matchers::StartsWith("a/view3d.safetensors: "));
  CHECK_THAT(message_of("status.json", "{\n\"state\": }"), Catch::Matchers::StartsWith("a/status.json:2:"));
  CHECK_THAT(message_of("config.resolved.json", "{"), Catch::Matchers::StartsWith("a/config.resolved.json:1:"));
  CHECK_THAT(message_of("summary.json", "{\n\n\"metrics\": 1}"), Catch::Matchers::StartsWith("a/summary.json:3:"));
  const std::string good = "{\"frame\": 1, \"stage\": \"a\", \"iteration\": 0, \"loss\": 1}\n";
  CHECK_THAT(message_of("metrics.jsonl", good + good + "{]\n" + good),
             Catch::Matchers::StartsWith("a/metrics.jsonl:3:"));
  CHECK_THAT(
      message_of("metrics.jsonl", good + "{\"frame\": 1, \"stage\": \"a\", \"iteration\": 0, \"loss\": \"x\"}\n"),
      Catch::Matchers::StartsWith("a/metrics.jsonl:2:") && Contains("/loss: \"x\" is a string, not a number"));
  CHECK_THAT(message_of("metrics.jsonl", good + "{\"frame\": 1, \"iteration\": 0, \"loss\": 1}\n"),
             Catch::Matchers::StartsWith("a/metrics.jsonl:2:") && Contains("there is no \"stage\""));
}

TEST_CASE("a folder that holds no run is the user's mistake") {
  const TemporaryFolder here;
  CHECK_THROWS_MATCHES(write_report("a"), UserError, Catch::Matchers::Message("a: there is no such run folder"));
  here.write("a/notes.txt", "x");
  CHECK_THROWS_WITH(write_report("a"), Contains("a: holds no run"));
  CHECK_THROWS_MATCHES(write_report("a/notes.txt"), UserError,
                       Catch::Matchers::Message("a/notes.txt: is not a folder; give the folder of a run"));
  CHECK_FALSE(fs::exists("a/report.html"));
  here.write("a/run/status.json", "{}");
  CHECK_THROWS_WITH(write_report("a"), "a: holds no run; did you mean a/run?");
}

TEST_CASE("plots survive flat, single and extreme values") {
  for (const bool is_log : {false, true}) {
    for (const std::vector<std::pair<double, double>>& points : {std::vector<std::pair<double, double>>{{0, 1}},
                                                                 {{0, 2}, {1, 2}},
                                                                 {{0, 1e-300}, {1, 1e300}},
                                                                 {{0, 1e-150}, {1, 1e150}},
                                                                 {{3, 0}, {4, 0}},
                                                                 {{0, -1.7e308}, {1, 1.7e308}},
                                                                 {{0, -5}, {10, 5}},
                                                                 {{0, 1.00001}, {1, 1.00002}},
                                                                 {{0, 1e-12}, {1e6, 2e-12}}}) {
      const Plot plot{.title = "",
                      .x_label = "",
                      .unit = "",
                      .series = {{.label = "a", .color = "red", .points = points, .dots = 3}},
                      .is_log = is_log};
      const std::string svg = plot_svg(plot);
      INFO(svg);
      CHECK(tag_fault(svg) == "");
      CHECK(svg.find("nan") == std::string::npos);
      CHECK(svg.find("not finite") == std::string::npos);
      CHECK(svg.size() < 20000);
    }
  }
}

TEST_CASE("how sure a run says that it is is shaded under its errors") {
  const TemporaryFolder here;
  make_run("a", "first");
  CHECK(report_html("a").find("claimed sigma") == std::string::npos);
  RunSummary summary = summary_named("first");
  for (FrameMetrics& frame : summary.per_frame) {
    for (const auto& [name, value] : {std::pair{"world_mpjpe_image_mm", 4.0},
                                      {"world_mpjpe_depth_mm", 10.0},
                                      {"object_translation_cm", 2.0},
                                      {"sigma_image_mm", 3.0},
                                      {"sigma_depth_mm", 10.0},
                                      {"object_sigma_image_cm", 0.4},
                                      {"object_sigma_depth_cm", 2.0}})
      frame.values.emplace_back(name, value);
  }
  RunFolder folder("b", {"{}\n", 0, 1, "float"}, false);
  folder.append_metrics({1, "camera", 0, 0.5, {}, 0.001});
  folder.write_summary(summary);
  const std::string page = report_html("b");
  CHECK(tag_fault(page) == "");
  CHECK(count_of(page, "<polygon ") == 3);
  CHECK(count_of(page, "<title>claimed sigma</title>") == 3);
  // The band of the depth ends where the error, which is as large, has its line.
  const std::string depth = text_between(page, "world, in depth by frame", "</svg>");
  const std::string line = text_between(depth, "<polyline points=\"", "\"");
  CHECK_THAT(text_between(depth, "<polygon points=\"", "\""), Contains(line));
}

TEST_CASE("errors by frame of the first pass stand beside those of the result") {
  const TemporaryFolder here;
  make_run("a", "first");
  CHECK(report_html("a").find("first pass") == std::string::npos);
  RunSummary summary = summary_named("first");
  summary.first_pass = {{1, {{"mpjpe_mm", 15}}}, {2, {{"mpjpe_mm", 31.25}}}};
  RunFolder folder("b", {"{}\n", 0, 1, "float"}, false);
  folder.append_metrics({1, "camera", 0, 0.5, {}, 0.001});
  folder.write_summary(summary);
  const std::string page = report_html("b");
  CHECK(tag_fault(page) == "");
  CHECK_THAT(page, Contains("></span>first pass</span>"));
  CHECK_THAT(page, Contains("<title>first pass, frame 2: 31.2 mm</title>"));
}

TEST_CASE("how sure joints and objects are is a table where the run says it") {
  const TemporaryFolder here;
  make_run("a", "first");
  CHECK_FALSE(ids_of(report_html("a")).contains("places"));
  // Three frames, the first of which was given. The wrist is known in one of the others.
  constexpr std::size_t kPelvis = 0, kWrist = 20, kUnknownJoint = 21;
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  std::vector<PlaceSigmas> sigmas = {no_sigmas(1), no_sigmas(1), no_sigmas(1)};
  sigmas[1].joints[kPelvis] = {0.002, 0.010};
  sigmas[2].joints[kPelvis] = {0.004, 0.030};
  sigmas[1].joints[kWrist] = {0.0125, 0.05};
  sigmas[2].joints[kWrist] = {0.5, 1.5};
  sigmas[1].joints[kUnknownJoint] = sigmas[2].joints[kUnknownJoint] = {kInfinite, kInfinite};
  sigmas[1].objects[0] = {0.001, 0.0200};
  sigmas[2].objects[0] = {0.003, 0.0206};
  const Motion motion{.poses = {3, rest_pose(55)}};
  const RunPaths paths{"a"};
  write_motion(paths.motion(), motion, joint_sigmas_of(sigmas));
  const SceneState state{{}, {ObjectPose()}, rest_pose(55)};
  write_object_tracks(paths.objects(), {"red_cup"}, {state, state, state}, sigmas);
  const std::string page = report_html("a");
  CHECK(tag_fault(page) == "");
  const std::string section = text_between(page, "<section id=\"places\">", "</section>");
  CHECK_THAT(section, Contains("<th>place</th><th>across the view</th><th>along it</th><th>unsure</th></tr>"));
  const std::string rows = text_between(section, "<tbody>\n", "</tbody>");
  const std::string expected =
      "<tr><th scope=\"row\">red cup</th><td>2.0</td><td>20.3</td><td>0 of 2</td></tr>\n"
      "<tr><th scope=\"row\">pelvis</th><td>3.0</td><td>20.0</td><td>0 of 2</td></tr>\n"
      "<tr><th scope=\"row\">left wrist</th><td>12.5</td><td>50.0</td><td>1 of 2</td></tr>\n"
      "<tr><th scope=\"row\">right wrist</th><td class=\"none\">–</td><td class=\"none\">–</td><td>2 of 2</td></tr>\n";
  CHECK(rows == expected);  // and none of the joints at which nobody looked
  // Without an object, and without what is unsure.
  fs::remove(paths.objects());
  sigmas[2].joints[kWrist] = {0.0125, 0.05};
  sigmas[1].joints[kUnknownJoint] = sigmas[2].joints[kUnknownJoint] = {0.1, 0.2};
  write_motion(paths.motion(), motion, joint_sigmas_of(sigmas));
  const std::string surer = text_between(report_html("a"), "<section id=\"places\">", "</section>");
  CHECK(surer.find("unsure") == std::string::npos);
  CHECK(count_of(surer, "<tr>") == 4);
}

TEST_CASE("many iterations keep their smallest and largest losses") {
  const TemporaryFolder here;
  RunFolder folder("a", {"{}\n", 0, 1, "float"}, false);
  for (int i = 0; i < 5000; ++i) folder.append_metrics({1, "camera", i, i == 2500 ? 100.0 : 0.01, {}, 0.001});
  const std::string page = report_html("a");
  const size_t at = page.find("<polyline points=\"");
  REQUIRE(at != std::string::npos);
  const std::string points = page.substr(at, page.find("\" style", at) - at);
  CHECK(count_of(points, ",") <= 160);
  double least_y = 1e9;  // the page's y counts down
  for (size_t comma = points.find(','); comma != std::string::npos; comma = points.find(',', comma + 1))
    least_y = std::min(least_y, std::stod(points.substr(comma + 1)));
  CHECK(least_y < 30);  // the spike reaches the top
}

TEST_CASE("the program reports runs and prints their errors") {
  const TemporaryFolder here;
  make_run("a", "first");
  make_run("b", "second");
  fs::remove("b/summary.json");
  const ProgramResult result = run_hsi4d({"report", "a", "b"});
  CHECK(result.status == 0);
  CHECK(result.err.empty());
  CHECK_THAT(result.out, Catch::Matchers::StartsWith("a/report.html\n") &&
                             Contains(error_text(summary_named("first"))) &&
                             Contains("\nb/report.html\nnote: summary.json is missing"));
  CHECK(file_text("a/report.html") == report_html("a"));
  const ProgramResult mistake = run_hsi4d({"report", "nowhere"});
  CHECK(mistake.status == 2);
  CHECK(mistake.err == "nowhere: there is no such run folder\n");
}

}  // namespace report_test
