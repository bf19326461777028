#include "pipelines/record/published.h"

#include <catch2/catch.hpp>

#include "pipelines/report/published.h"

namespace published_test {

using namespace hsi4d;
using Catch::Matchers::Contains;

TEST_CASE("published figures are the paper's") {
  const std::vector<PublishedFigure>& figures = published_figures();
  const auto figure = [&figures](bool is_dynamic, std::string_view label) -> const PublishedFigure& {
    for (const PublishedFigure& one : figures) {
      if (one.is_dynamic == is_dynamic && one.label == label) return one;
    }
    throw std::runtime_error("there is no such figure");
  };
  const Table table = published_table({}, {});
  const auto others = [&](bool is_dynamic, const std::string& label) {
    for (const auto& row : table.rows)
      if (row[0].text.starts_with(label) && (row[1].text == "dynamic") == is_dynamic) return row.back().text;
    return std::string("no such row");
  };
  CHECK(figures.size() == 6);
  CHECK(figure(false, "penetration of the scene").value == 0.019);
  CHECK(others(false, "penetration of the scene") == "TRUMANS 0.046, LINGO 0.058");
  CHECK(figure(false, "the same without optimising the body").value == 0.025);
  CHECK(figure(false, "CLIP score").value == 23.52);
  CHECK(figure(true, "contact").value == 0.835);
  CHECK(others(true, "contact") == "CHOIS 0.687, LINGO 0.699");
  CHECK(figure(true, "penetration of the object").value == 0.033);
  CHECK(figure(true, "CLIP score").value == 24.01);
  for (const PublishedFigure& one : figures) {
    if (!one.metric.empty()) CHECK(find_metric_facts(one.metric) != nullptr);
  }
}

TEST_CASE("our figures stand beside those of clips of their kind alone") {
  const MetricValues still = {{"penetration_share", 0.02}, {"clip_score", 22}};
  MetricValues moving = still;
  moving.emplace_back("contact_share", 0.5);
  CHECK_FALSE(is_of_objects(still));
  CHECK(is_of_objects(moving));
  int of_still = 0, of_moving = 0;
  for (const PublishedFigure& figure : published_figures()) {
    const double* const a = own_figure(figure, still, false);
    const double* const b = own_figure(figure, moving, true);
    CHECK_FALSE((a != nullptr && b != nullptr));
    of_still += a != nullptr ? 1 : 0;
    of_moving += b != nullptr ? 1 : 0;
    if (figure.is_dynamic) CHECK(a == nullptr);
    if (!figure.is_dynamic) CHECK(b == nullptr);
  }
  CHECK(of_still == 2);   // penetration and CLIP
  CHECK(of_moving == 2);  // contact and CLIP
  // A motion in the scene of an object of which nothing is measured is of a dynamic clip all the same.
  for (const PublishedFigure& figure : published_figures())
    CHECK((figure.is_dynamic || own_figure(figure, still, true) == nullptr));
  RunSummary summary;
  summary.metrics.push_back({"refinement", 1, 1, moving});
  const std::string section = published_section(summary);
  CHECK_THAT(section, Contains("<td class=\"own\">0.500</td><td>0.835</td><td>CHOIS 0.687, LINGO 0.699</td>"));
  CHECK_THAT(section, !Contains("<td class=\"own\">0.020</td>") && Contains("arXiv 2412.18600"));
}

}  // namespace published_test
