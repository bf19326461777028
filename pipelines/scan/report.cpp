#include "pipelines/scan/report.h"

#include "core/config_value.h"
#include "core/formatted.h"
#include "core/json_text.h"
#include "core/progress.h"
#include "core/text.h"
#include "pipelines/report/figure.h"
#include "pipelines/report/page.h"

namespace hsi4d {

namespace {

ConfigValue score_value(const ScanScore& score) {
  ConfigValue value = ConfigValue::make_object();
  value.add("pictures", ConfigValue::make_integer(score.pictures));
  value.add("psnr_db", ConfigValue::make_number(score.psnr_db));
  value.add("ssim", ConfigValue::make_number(score.ssim));
  return value;
}

/// A name that a file can have: folders become part of it.
std::string flat_name(const std::string& name) {
  std::string flat = std::filesystem::path(name).replace_extension().generic_string();
  for (char& c : flat) {
    if (c == '/' || c == '\\' || c == ' ') c = '_';
  }
  while (flat.starts_with('.') || flat.starts_with('_')) flat.erase(0, 1);
  return flat;
}

std::string stem_of(std::size_t photo, const std::string& name) {
  return four_digits(static_cast<std::int64_t>(photo)) + "_" + flat_name(name);
}

Table figures_of(const ScanSummary& summary) {
  Table table{.title = "Pictures", .caption = "Means over pictures", .head = {"", "pictures", "PSNR [dB]", "SSIM"}};
  for (const auto& [name, score] : {std::pair{"learnt from", &summary.learnt}, {"held back", &summary.held}}) {
    if (score->pictures > 0)
      table.rows.push_back(
          {name, std::to_string(score->pictures), fixed_number(score->psnr_db, 2), fixed_number(score->ssim, 4)});
  }
  return table;
}

std::string curve_section(const ScanSummary& summary) {
  Plot plot{.title = "PSNR",
            .x_label = "iteration",
            .unit = "dB",
            .series = {{.label = "PSNR", .color = "var(--result)", .points = {}}},
            .width = 760};
  for (std::size_t i = 0; i < summary.curve.size(); ++i)
    plot.series[0].points.emplace_back(static_cast<double>(kCurveEvery) * static_cast<double>(i + 1), summary.curve[i]);
  if (plot.series[0].points.empty()) return "";
  return plots_section("Pictures that are learnt from", "", {{"PSNR, dB", plot_svg(plot)}});
}

std::string pictures_section(const ScanSummary& summary) {
  std::string text;
  for (std::size_t i = 0; i < summary.pictures.size(); ++i) {
    const ScanPicture& picture = summary.pictures[i];
    if (!picture.held) continue;
    const std::string& name = summary.names[picture.photo];
    const auto image = [](const std::string& file) {
      return "<img loading=\"lazy\" style=\"width:49%\" src=\"views/" + html_escape(file) + "\" alt=\"\">";
    };
    text += "<figure><figcaption>" + html_escape(name) + ": " + fixed_number(picture.psnr_db, 2) + " dB, SSIM " +
            fixed_number(picture.ssim, 4) + "</figcaption>\n" + image(photo_file(picture.photo, name)) + "\n" +
            image(view_file(picture.photo, name)) + "</figure>\n";
  }
  if (text.empty()) return "";
  return "<section><h2>Pictures that were held back</h2>\n<p>Left: the picture. Right: the result.</p>\n" + text +
         "</section>\n";
}

}  // namespace

std::string view_file(std::size_t photo, const std::string& name) { return stem_of(photo, name) + ".png"; }
std::string photo_file(std::size_t photo, const std::string& name) { return stem_of(photo, name) + "_photo.png"; }

std::string scan_summary_json(const ScanSummary& summary) {
  ConfigValue file = ConfigValue::make_object();
  file.add("name", ConfigValue::make_string(summary.name));
  file.add("gaussians", ConfigValue::make_integer(summary.gaussians));
  file.add("iterations", ConfigValue::make_integer(summary.iterations));
  file.add("width", ConfigValue::make_integer(summary.width));
  file.add("height", ConfigValue::make_integer(summary.height));
  file.add("seconds", ConfigValue::make_number(summary.seconds));
  file.add("learnt", score_value(summary.learnt));
  if (summary.held.pictures > 0) file.add("held", score_value(summary.held));
  ConfigValue curve = ConfigValue::make_array();
  for (const double psnr : summary.curve) curve.items.push_back(ConfigValue::make_number(psnr));
  file.add("curve_psnr_db", std::move(curve));
  ConfigValue pictures = ConfigValue::make_array();
  for (const ScanPicture& picture : summary.pictures) {
    ConfigValue value = ConfigValue::make_object();
    value.add("name", ConfigValue::make_string(summary.names[picture.photo]));
    value.add("held", ConfigValue::make_boolean(picture.held));
    value.add("psnr_db", ConfigValue::make_number(picture.psnr_db));
    value.add("ssim", ConfigValue::make_number(picture.ssim));
    pictures.items.push_back(std::move(value));
  }
  file.add("pictures", std::move(pictures));
  return to_json(file);
}

std::string scan_report_page(const ScanSummary& summary) {
  return html_page(summary.name,
                   "<header><h1>" + html_escape(summary.name) +
                       "</h1><span class=\"badge done\">done</span></header>\n<p>" + std::to_string(summary.gaussians) +
                       " Gaussians, " + std::to_string(summary.iterations) + " iterations at " +
                       std::to_string(summary.width) + " × " + std::to_string(summary.height) + " pixels, " +
                       html_escape(duration_text(summary.seconds)) + "</p>\n" + table_section(figures_of(summary)) +
                       curve_section(summary) + pictures_section(summary));
}

}  // namespace hsi4d
