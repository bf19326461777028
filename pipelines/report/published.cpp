#include "pipelines/report/published.h"

#include "pipelines/record/published.h"
#include "pipelines/report/plots.h"

namespace hsi4d {
namespace {

std::string row_of(const PublishedFigure& figure, const RunSummary& summary) {
  const MetricValues values = summary.metrics.empty() ? MetricValues{} : summary.metrics.back().values;
  const double* const own = own_figure(figure, values, is_of_objects(values));
  const std::string others = other_figures_text(figure);
  return "<tr><th scope=\"row\" title=\"" + html_escape(std::string(figure.summary)) + "\">" +
         std::string(figure.label) + (figure.better > 0 ? " ↑" : " ↓") + "</th><td>" +
         (figure.is_dynamic ? "dynamic" : "static") + "</td>" +
         (own == nullptr ? "<td class=\"none\">–</td>"
                         : "<td class=\"own\">" + fixed_number(*own, figure.decimals) + "</td>") +
         "<td>" + fixed_number(figure.value, figure.decimals) + "</td>" +
         (others.empty() ? "<td class=\"none\">–</td>" : "<td>" + others + "</td>") + "</tr>\n";
}

}  // namespace

std::string published_section(const RunSummary& summary) {
  std::string rows;
  for (const PublishedFigure& figure : published_figures()) rows += row_of(figure, summary);
  return "<section id=\"published\">\n<h2>Beside the paper</h2>\n<div class=\"card wide\"><table class=\"published\">\n"
         "<thead><tr><th>metric</th><th>the paper's clips</th><th>this run</th><th>ZeroHSI, published</th>"
         "<th>others, as published there</th></tr></thead>\n<tbody>\n" +
         rows +
         "</tbody></table></div>\n<p class=\"caption\">The paper's figures are means over its own clips, which are not "
         "public: 11 static ones (a person in a scene) and 9 dynamic ones (with an object that moves), at 10 frames a "
         "second and without refinement. This run is of another clip, and stands only beside those of its kind. What "
         "can be compared is the order of magnitude of a metric defined alike, not who is better; a dash is what this "
         "run did not measure. " +
         html_escape(std::string(kPublishedSource)) + ".</p>\n</section>\n";
}

}  // namespace hsi4d
