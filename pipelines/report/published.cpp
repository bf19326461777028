#include "pipelines/report/published.h"

#include "pipelines/record/published.h"

namespace hsi4d {

std::string published_section(const RunSummary& summary) {
  const MetricValues values = summary.metrics.empty() ? MetricValues{} : summary.metrics.back().values;
  const Table table = published_table({"this run"}, [&](const PublishedFigure& figure, std::size_t) {
    const double* const own = own_figure(figure, values, is_of_objects(values));
    return own == nullptr ? std::nullopt : std::optional<double>(*own);
  });
  return "<section id=\"published\">\n<h2>Beside the paper</h2>\n<div class=\"card wide\">" +
         table_html(table, "published") +
         "</div>\n<p class=\"caption\">The paper's figures are means over its own clips, which are not "
         "public: 11 static ones (a person in a scene) and 9 dynamic ones (with an object that moves), at 10 frames a "
         "second and without refinement. This run is of another clip, and stands only beside those of its kind. What "
         "can be compared is the order of magnitude of a metric defined alike, not who is better; a dash is what this "
         "run did not measure. " +
         html_escape(std::string(kPublishedSource)) + ".</p>\n</section>\n";
}

}  // namespace hsi4d
