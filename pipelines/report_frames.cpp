// The frames of a report: images as data URIs in a script, so that each is there once, whatever shows it.
#include <algorithm>

#include "core/config_value.h"
#include "pipelines/report_page.h"
#include "pipelines/report_plots.h"
#include "pipelines/report_style.h"

namespace hsi4d {
namespace {

constexpr size_t kStart = 3;  // in kFrameKinds

/// RFC 4648, section 4.
std::string base64(const Bytes& bytes) {
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    const size_t left = std::min<size_t>(3, bytes.size() - i);
    unsigned group = static_cast<unsigned>(bytes[i]) << 16U;
    if (left > 1) group |= static_cast<unsigned>(bytes[i + 1]) << 8U;
    if (left > 2) group |= static_cast<unsigned>(bytes[i + 2]);
    for (size_t k = 0; k < 4; ++k) text += k <= left ? kDigits[(group >> (18 - 6 * k)) & 63U] : '=';
  }
  return text;
}

/// "joints 12.3 mm, object place 1.20 cm": the errors of a frame of the result.
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

/// A script's data may hold no "</script>": "<" is written as an escape.
std::string script_string(const std::string& text) {
  std::string out;
  for (const char c : json_string(text)) out += c == '<' ? std::string("\\u003c") : std::string(1, c);
  return out;
}

std::string frames_script(const ReportData& data) {
  std::string text = "const kinds = [\"target\", \"render\", \"difference\"];\nconst frames = [\n";
  for (const FrameImages& frame : data.frames) {
    text += "{frame: " + std::to_string(frame.frame) +
            ", errors: " + script_string(frame_errors_text(data, frame.frame)) + ", images: {";
    for (size_t k = 0; k < kFrameKinds.size(); ++k) {
      if (!frame.files[k].empty())
        text += "\n " + std::string(kFrameKinds[k]) + ": \"data:image/png;base64," + base64(frame.files[k]) + "\",";
    }
    text += "}},\n";
  }
  return text + "];";
}

bool has_start(const ReportData& data) {
  return std::any_of(data.frames.begin(), data.frames.end(),
                     [](const FrameImages& frame) { return !frame.files[kStart].empty(); });
}

/// What a kind of image is called; a difference tells how much it is enlarged.
std::string kind_label(std::string_view kind) {
  return std::string(kind) + (kind == "difference" ? " ×" + std::to_string(kDifferenceGain) : "");
}

std::string image_choice(const std::string& id, const std::string& label, std::string_view chosen, bool with_start) {
  std::string text = "<label>" + label + " <select id=\"" + id + "\">";
  for (size_t k = 0; k < kFrameKinds.size(); ++k) {
    if (k == kStart && !with_start) continue;
    const std::string kind(kFrameKinds[k]);
    text += "<option value=\"" + kind + "\"" + (kind == chosen ? " selected=\"selected\"" : "") + ">" +
            kind_label(kind) + "</option>";
  }
  return text + "</select></label>\n";
}

/// Two images of a frame, one over the other up to where the reader puts their edge.
std::string compare_figure(bool with_start) {
  return "<figure><div class=\"compare\" id=\"compare\"><img id=\"under\" alt=\"left image\"/>"
         "<img class=\"over\" id=\"over\" alt=\"right image\"/><div class=\"edge\" id=\"edge\"></div></div>\n"
         "<div class=\"absent\" id=\"compare-absent\" hidden=\"hidden\">This frame lacks one of the two images.</div>\n"
         "<figcaption class=\"controls\">" +
         image_choice("left", "left", with_start ? "start" : "target", with_start) +
         "<input type=\"range\" id=\"split\" aria-label=\"where the two images meet\" min=\"0\" max=\"100\" "
         "step=\"0.5\" value=\"50\"/>\n" +
         image_choice("right", "right", "render", with_start) + "</figcaption></figure>\n";
}

}  // namespace

std::string frames_section(const ReportData& data) {
  if (data.frames.empty()) return "";
  // The middle frame stands for a run better than the last, which is the farthest from what was given.
  const size_t first = data.frames.size() / 2;
  std::string text =
      "<section id=\"frames\">\n<h2>Frames</h2>\n<noscript><p class=\"nothing\">The images need "
      "JavaScript.</p></noscript>\n"
      "<div class=\"card\">\n<div class=\"controls\"><button id=\"previous\" aria-label=\"previous frame\">‹</button>"
      "<button id=\"play\">play</button><button id=\"next\" aria-label=\"next frame\">›</button>"
      "<span class=\"frame-name\" id=\"frame-name\"></span>"
      "<input type=\"range\" id=\"slider\" aria-label=\"frame\" min=\"0\" max=\"" +
      std::to_string(data.frames.size() - 1) + "\" value=\"" + std::to_string(first) +
      "\"/></div>\n<p class=\"frame-errors\" id=\"frame-errors\"></p>\n<div class=\"images\">\n";
  for (size_t k = 0; k < kStart; ++k) {
    const std::string kind(kFrameKinds[k]);
    text += "<figure><img id=\"image-" + kind + "\" alt=\"" + kind +
            "\" hidden=\"hidden\"/><div class=\"absent\" id=\"image-" + kind + "-absent\">no image</div><figcaption>" +
            kind_label(kind) + "</figcaption></figure>\n";
  }
  text += compare_figure(has_start(data)) + "</div>\n</div>\n</section>\n<script>\n";
  return text + frames_script(data) + std::string(report_script()) + "</script>\n";
}

}  // namespace hsi4d
