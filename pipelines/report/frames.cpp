// What of a report moves: the frames, and the 3D view. Images and the view's file stand in the page as data, so that
// each is there once, whatever shows it.
#include <algorithm>
#include <set>

#include "core/base64.h"
#include "core/compression.h"
#include "core/config_value.h"
#include "pipelines/report/assets.h"
#include "pipelines/report/figure.h"
#include "pipelines/report/page.h"

namespace hsi4d {
namespace {

// ---- Data ----

/// "MPJPE 12.3 mm · PSNR 30.00 dB": the errors of a frame of the result.
std::string frame_errors_text(const ReportData& data, int frame) {
  if (!data.summary) return "";
  std::string text;
  for (const FrameMetrics& metrics : data.summary->per_frame) {
    if (metrics.frame != frame) continue;
    for (const MetricFacts& facts : metric_facts()) {
      const double* const value = find_metric(metrics.values, facts.name);
      if (value == nullptr) continue;
      text += (text.empty() ? "" : " · ") + std::string(facts.label) + " " + fixed_number(*value, facts.decimals);
      if (!facts.unit.empty()) text += " " + std::string(facts.unit);
    }
  }
  return text;
}

/// JSON text in a script element, which may hold no "</script>": "<" is written as an escape.
std::string script_string(const std::string& text) {
  std::string out;
  for (const char c : json_string(text)) out += c == '<' ? std::string("\\u003c") : std::string(1, c);
  return out;
}

std::string files_json(const FrameImages& frame) {
  std::string text;
  for (size_t k = 0; k < kFrameKinds.size(); ++k) {
    if (frame.files[k].empty()) continue;
    text += (text.empty() ? "" : ",") + ("\n \"" + std::string(kFrameKinds[k])) +
            "\": \"data:" + std::string(image_mime(frame.files[k])) + ";base64," + base64(frame.files[k]) + "\"";
  }
  return "{" + text + "}";
}

std::string data_elements(const ReportData& data) {
  constexpr double kUsualRate = 10;
  const double rate = data.view3d.file.empty() ? kUsualRate : data.view3d.frame_rate;
  std::string text = "<script type=\"application/json\" id=\"frames-data\">{\"rate\": " + fixed_number(rate, 3) +
                     ", \"gain\": " + std::to_string(kDifferenceGain) +
                     ", \"frames3d\": " + std::to_string(data.view3d.frames) + ", \"images\": [";
  for (size_t i = 0; i < data.frames.size(); ++i) {
    const FrameImages& frame = data.frames[i];
    text += (i == 0 ? "\n" : ",\n") + ("{\"frame\": " + std::to_string(frame.frame)) +
            ", \"errors\": " + script_string(frame_errors_text(data, frame.frame)) +
            ", \"files\": " + files_json(frame) + "}";
  }
  text += "]}</script>\n";
  if (data.view3d.file.empty()) return text;
  return text + "<script type=\"text/plain\" id=\"view3d-data\">" + base64(compress_gzip(data.view3d.file)) +
         "</script>\n";
}

// ---- What one sees ----

/// Every frame that has an image or is in the 3D view.
std::set<int> frame_numbers(const ReportData& data) {
  std::set<int> numbers;
  for (const FrameImages& frame : data.frames) numbers.insert(frame.frame);
  for (Index t = 0; t < data.view3d.frames; ++t) numbers.insert(static_cast<int>(t));
  return numbers;
}

/// Buttons and a slider through the frames. Every one of a page shows the same frame.
std::string scrubber(const ReportData& data) {
  // The middle frame stands for a run better than the last, which is the farthest from what was given.
  const size_t count = frame_numbers(data).size();
  return "<div class=\"controls scrubber\"><button class=\"previous\" aria-label=\"previous frame\">‹</button>"
         "<button class=\"play\">play</button><button class=\"next\" aria-label=\"next frame\">›</button>"
         "<span class=\"frame-name\"></span><input type=\"range\" aria-label=\"frame\" min=\"0\" max=\"" +
         std::to_string(count - 1) + "\" value=\"" + std::to_string(count / 2) + "\"/></div>\n";
}

bool has_kind(const ReportData& data, std::string_view kind) {
  const auto at = static_cast<size_t>(std::find(kFrameKinds.begin(), kFrameKinds.end(), kind) - kFrameKinds.begin());
  return std::any_of(data.frames.begin(), data.frames.end(),
                     [at](const FrameImages& frame) { return !frame.files[at].empty(); });
}

/// What a kind of image is called; a difference tells how much it is enlarged.
std::string kind_label(std::string_view kind) {
  if (kind == "target") return "input";
  if (kind == "render") return "reconstruction";
  if (kind == "side") return "another side";
  if (kind == "difference") return "difference ×" + std::to_string(kDifferenceGain);
  return std::string(kind);
}

std::string image_choice(const ReportData& data, const std::string& id, const std::string& label,
                         std::string_view chosen) {
  std::string text = "<label>" + label + " <select id=\"" + id + "\">";
  for (const std::string_view kind : {"target", "render", "side", "difference", "start"}) {
    if ((kind == "side" || kind == "start") && !has_kind(data, kind)) continue;
    text += "<option value=\"" + std::string(kind) + "\"" + (kind == chosen ? " selected=\"selected\"" : "") + ">" +
            kind_label(kind) + "</option>";
  }
  return text + "</select></label>\n";
}

/// Two images of a frame, one over the other up to where the reader drags their edge.
std::string compare_figure(const ReportData& data) {
  return "<figure><div class=\"compare frame-box\" id=\"compare\"><canvas id=\"compare-canvas\" role=\"img\" "
         "aria-label=\"two images of the frame\"></canvas>"
         "<span class=\"tag\" id=\"tag-left\"></span><span class=\"tag\" id=\"tag-right\"></span>"
         "<div class=\"edge\" id=\"edge\" role=\"slider\" tabindex=\"0\" aria-label=\"where the two images meet\" "
         "aria-valuemin=\"0\" aria-valuemax=\"100\" aria-valuenow=\"50\"></div></div>\n"
         "<div class=\"absent\" id=\"compare-absent\" hidden=\"hidden\">This frame lacks one of the two images.</div>\n"
         "<figcaption class=\"controls\">" +
         image_choice(data, "left", "left", "target") + image_choice(data, "right", "right", "render") +
         "</figcaption></figure>\n";
}

std::string beside_figure(const ReportData& data) {
  return "<figure><div class=\"frame-box\" id=\"other\"><canvas id=\"other-canvas\" role=\"img\" "
         "aria-label=\"another image of the frame\"></canvas></div>\n"
         "<div class=\"absent\" id=\"other-absent\" hidden=\"hidden\">This frame lacks this image.</div>\n"
         "<figcaption class=\"controls\">" +
         image_choice(data, "beside", "beside it", has_kind(data, "side") ? "side" : "difference") +
         "</figcaption></figure>\n";
}

/// A box to tick: whether a part of the 3D view is shown.
std::string layer(const std::string& name, const std::string& label, const std::string& color, bool is_shown) {
  return "<label><input type=\"checkbox\" id=\"show-" + name + "\"" + (is_shown ? " checked=\"checked\"" : "") + "/>" +
         (color.empty() ? "" : "<span class=\"box\" style=\"background:" + color + "\"></span>") + label + "</label>\n";
}

}  // namespace

std::string frames_section(const ReportData& data) {
  if (data.frames.empty()) return "";
  return "<section id=\"frames\">\n<h2>Frames</h2>\n<noscript><p class=\"nothing\">The images need "
         "JavaScript.</p></noscript>\n<div class=\"card\">\n" +
         scrubber(data) + "<p class=\"frame-errors\" id=\"frame-errors\"></p>\n<div class=\"images\">\n" +
         compare_figure(data) + beside_figure(data) + "</div>\n</div>\n</section>\n";
}

std::string view3d_section(const ReportData& data) {
  if (data.view3d.file.empty()) return "";
  return "<section id=\"view3d\">\n<h2>3D view</h2>\n<div class=\"card\">\n<div class=\"stage\"><canvas "
         "id=\"view3d-canvas\" tabindex=\"0\" aria-label=\"the reconstruction in space: arrow keys turn it, plus and "
         "minus come nearer and go away\"></canvas><p id=\"view3d-message\">The 3D view needs JavaScript.</p></div>\n" +
         scrubber(data) + "<div class=\"layers\">\n" + layer("scene", "scene", "", true) +
         layer("objects", "objects", "", true) + layer("body", "body", "#c2cce0", true) +
         layer("truth", "true body", "#40d98c", false) + layer("camera", "camera and its path", "#ffd94d", true) +
         layer("skeleton", "skeleton", "#59bfff", false) + layer("cut", "cut the front away", "", false) +
         "<span class=\"buttons\"><button id=\"view3d-follow\">through the camera</button><button "
         "id=\"view3d-reset\">reset</button></span></div>\n" +
         "<p class=\"caption\">Drag to turn; drag with the right button, shift or two fingers to move; wheel (after a "
         "click) or pinch to come nearer. Of the scene there is a sample of its Gaussians, in the colours they have "
         "from "
         "everywhere; the body is a mesh.</p>\n</div>\n</section>\n";
}

std::string moving_data(const ReportData& data) {
  if (data.frames.empty() && data.view3d.file.empty()) return "";
  return data_elements(data) + "<script>\n" + report_script() + "</script>\n";
}

}  // namespace hsi4d
