#include "pipelines/record/published.h"

#include <algorithm>

namespace hsi4d {

const std::vector<PublishedFigure>& published_figures() {
  static const std::vector<PublishedFigure> figures = {
      {false,
       "penetration of the scene",
       "penetration_share",
       0.019,
       3,
       -1,
       {{"TRUMANS", 0.046}, {"LINGO", 0.058}},
       "Share of the body's vertices inside the scene"},
      {false, "the same without optimising the body", "", 0.025, 3, -1, {}, "The paper's ablation"},
      {false, "CLIP score", "clip_score", 23.52, 2, 1, {}, "Agreement of the rendered motion with its text"},
      {true,
       "contact",
       "contact_share",
       0.835,
       3,
       1,
       {{"CHOIS", 0.687}, {"LINGO", 0.699}},
       "Share of frames in which a hand joint is nearer than 5 cm to the object"},
      {true,
       "penetration of the object",
       "object_penetration_share",
       0.033,
       3,
       -1,
       {},
       "Share of the body's vertices inside the object"},
      {true, "CLIP score", "clip_score", 24.01, 2, 1, {}, "Agreement of the rendered motion with its text"},
  };
  return figures;
}

bool is_of_objects(const MetricValues& values) {
  return std::any_of(values.begin(), values.end(), [](const auto& value) {
    return value.first.starts_with("object_") || value.first.starts_with("contact_");
  });
}

const double* own_figure(const PublishedFigure& figure, const MetricValues& values, bool is_dynamic) {
  if (figure.metric.empty() || figure.is_dynamic != is_dynamic) return nullptr;
  return find_metric(values, figure.metric);
}

Table published_table(
    const std::vector<std::string>& columns,
    const std::function<std::optional<double>(const PublishedFigure& figure, std::size_t column)>& own) {
  Table table{.head = {"beside the paper", "its clips"}};
  table.head.insert(table.head.end(), columns.begin(), columns.end());
  for (const char* const published : {"ZeroHSI, published", "others, as published there"})
    table.head.emplace_back(published);
  for (const PublishedFigure& figure : published_figures()) {
    std::string others;
    for (const auto& [method, value] : figure.others)
      others += (others.empty() ? "" : ", ") + std::string(method) + " " + fixed_number(value, figure.decimals);
    std::vector<Cell> row = {
        Cell(std::string(figure.label) + (figure.better > 0 ? " ↑" : " ↓"), "", std::string(figure.summary)),
        figure.is_dynamic ? "dynamic" : "static"};
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const std::optional<double> value = own(figure, i);
      row.push_back(value ? Cell(fixed_number(*value, figure.decimals), "own") : kNoCell);
    }
    row.emplace_back(figure.value, figure.decimals);
    row.push_back(others.empty() ? kNoCell : Cell(others));
    table.rows.push_back(std::move(row));
  }
  return table;
}

}  // namespace hsi4d
