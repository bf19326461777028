#include "pipelines/report_published.h"

#include <array>
#include <optional>
#include <span>

#include "pipelines/report_plots.h"

namespace hsi4d {
namespace {

/// A figure of another method.
struct OtherFigure {
  std::string_view method;
  double value;
};

/// A row: means over the paper's static clips (a person and the scene) or dynamic ones (who moves an object too).
struct PublishedFigure {
  std::string_view clips, label, metric;  ///< metric: ours in summary.json, "" where there is none
  double value;
  int decimals;
  int better;                         ///< as in MetricFacts
  std::array<OtherFigure, 2> others;  ///< an empty name: none
  std::string_view summary;
};

// Li et al., ZeroHSI (arXiv 2412.18600), the tables of results and of the ablation.
constexpr std::array<PublishedFigure, 6> kPublished = {{
    {"static",
     "penetration of the scene",
     "penetration_share",
     0.019,
     3,
     -1,
     {{{"TRUMANS", 0.046}, {"LINGO", 0.058}}},
     "Share of the body's vertices inside the scene"},
    {"static", "the same without optimising the body", "", 0.025, 3, -1, {}, "The paper's ablation"},
    {"static", "CLIP score", "", 23.52, 2, 1, {}, "Agreement of the rendered motion with its text"},
    {"dynamic",
     "contact",
     "contact_share",
     0.835,
     3,
     1,
     {{{"CHOIS", 0.687}, {"LINGO", 0.699}}},
     "Share of frames in which a hand joint is nearer than 5 cm to the object"},
    {"dynamic", "penetration of the object", "", 0.033, 3, -1, {}, "Share of the body's vertices inside the object"},
    {"dynamic", "CLIP score", "", 24.01, 2, 1, {}, "Agreement of the rendered motion with its text"},
}};

const double* own_value(const RunSummary& summary, std::string_view metric) {
  if (metric.empty() || summary.metrics.empty()) return nullptr;
  return find_metric(summary.metrics.back().values, metric);
}

std::string row_of(const PublishedFigure& figure, const RunSummary& summary) {
  const double* const own = own_value(summary, figure.metric);
  std::string others;
  for (const OtherFigure& other : figure.others) {
    if (!other.method.empty())
      others +=
          (others.empty() ? "" : ", ") + std::string(other.method) + " " + fixed_number(other.value, figure.decimals);
  }
  return "<tr><th scope=\"row\" title=\"" + html_escape(std::string(figure.summary)) + "\">" +
         std::string(figure.label) + (figure.better > 0 ? " ↑" : " ↓") + "</th><td>" + std::string(figure.clips) +
         "</td>" +
         (own == nullptr ? "<td class=\"none\">–</td>"
                         : "<td class=\"own\">" + fixed_number(*own, figure.decimals) + "</td>") +
         "<td>" + fixed_number(figure.value, figure.decimals) + "</td>" +
         (others.empty() ? "<td class=\"none\">–</td>" : "<td>" + others + "</td>") + "</tr>\n";
}

}  // namespace

std::string published_section(const RunSummary& summary) {
  std::string rows;
  for (const PublishedFigure& figure : kPublished) rows += row_of(figure, summary);
  return "<section id=\"published\">\n<h2>Beside the paper</h2>\n<div class=\"card wide\"><table class=\"published\">\n"
         "<thead><tr><th>metric</th><th>the paper's clips</th><th>this run</th><th>ZeroHSI, published</th>"
         "<th>others, as published there</th></tr></thead>\n<tbody>\n" +
         rows +
         "</tbody></table></div>\n<p class=\"caption\">The paper's figures are means over its own clips, which are not "
         "public: 11 static ones (a person in a scene) and 9 dynamic ones (with an object that moves), at 10 frames a "
         "second and without refinement. This run is of another clip. What can be compared is the order of magnitude "
         "of "
         "a metric defined alike, not who is better; a dash is what this run did not measure.</p>\n</section>\n";
}

}  // namespace hsi4d
