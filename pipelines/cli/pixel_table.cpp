#include "pipelines/cli/pixel_table.h"

#include <algorithm>
#include <array>
#include <charconv>

#include "core/check.h"
#include "pipelines/cli/text.h"

namespace hsi4d::cli {
namespace {

constexpr int kDigits = 6;

std::string digits(double value) { return rounded(value, kDigits); }

std::string color_text(const double* rgb) { return digits(rgb[0]) + " " + digits(rgb[1]) + " " + digits(rgb[2]); }

struct FileRow {
  std::string file, row;
};

FileRow file_row(Index index, std::span<const FileRows> files) {
  const auto part = std::find_if(files.begin(), files.end(),
                                 [index](const FileRows& f) { return index >= f.begin && index < f.end; });
  HSI4D_CHECK(part != files.end(), std::to_string(index));
  const Index row = index - part->begin;
  return {part->file, std::to_string(part->row_of.empty() ? row : part->row_of[static_cast<std::size_t>(row)])};
}

std::string name_of(const PixelSplat& splat, std::span<const FileRows> files) {
  const FileRow from = file_row(splat.index, files);
  return "row " + from.row + " of " + from.file;
}

std::string composited_table(const PixelTrace& trace, std::span<const FileRows> files) {
  Table table{.head = {"#", "file", "row", "depth", "alpha uncapped", "alpha", "T before", "weight", "colour",
                       "sum of weight x colour", ""}};
  for (std::size_t i = 0; i < trace.composited.size(); ++i) {
    const PixelSplat& s = trace.composited[i];
    const FileRow from = file_row(s.index, files);
    const bool last = trace.stopped && !trace.refused && i + 1 == trace.composited.size();
    table.rows.push_back({i + 1, from.file, from.row, digits(s.depth), digits(s.full), digits(s.alpha),
                          digits(s.transmittance), digits(s.weight()), color_text(s.color.data()),
                          color_text(s.so_far.data()), std::string(s.capped ? "capped" : "") + (last ? " stop" : "")});
  }
  if (files.size() == 1) {
    table.head.erase(table.head.begin() + 1);
    for (auto& row : table.rows) row.erase(row.begin() + 1);
  }
  return trace.composited.empty() ? std::string() : table_text(table);
}

std::string skipped_text(const PixelTrace& trace, const RenderSettings& settings, std::span<const FileRows> files) {
  std::string text =
      "skipped, alpha below render.alpha_min " + digits(settings.alpha_min) + ": " + std::to_string(trace.skipped);
  if (trace.nearest_miss) {
    const PixelSplat& miss = *trace.nearest_miss;
    text +=
        "; nearest miss: " + name_of(miss, files) + ", depth " + digits(miss.depth) + ", alpha " + digits(miss.full);
  }
  return text + "\n";
}

std::string stop_text(const PixelTrace& trace, const RenderSettings& settings, std::span<const FileRows> files) {
  const std::string threshold = "render.transmittance_stop " + digits(settings.transmittance_stop);
  if (!trace.stopped)
    return "not stopped by " + threshold + ": T behind the last is " + digits(trace.transmittance) + "\n";
  std::string text;
  if (trace.refused) {
    const PixelSplat& refused = *trace.refused;
    text = "stopped by " + threshold + " before " + name_of(refused, files) + ", depth " + digits(refused.depth) +
           ", alpha " + digits(refused.alpha) + ", behind which T would be " +
           digits(refused.transmittance * (1 - refused.alpha));
  } else {
    text = "stopped by " + threshold + " after #" + std::to_string(trace.composited.size()) + ", behind which T is " +
           digits(trace.transmittance);
  }
  return text + "; not looked at behind it: " + std::to_string(trace.behind_stop) + "\n";
}

std::string sums_text(const PixelTrace& trace, const SceneImage& rendered, const SceneView& view) {
  const double weights = trace.weight_sum();
  std::array<double, 3> total = trace.color();
  for (std::size_t c = 0; c < 3; ++c) total[c] += trace.transmittance * view.background[c];
  const std::size_t pixel = static_cast<std::size_t>(trace.place.row) * static_cast<std::size_t>(rendered.width) +
                            static_cast<std::size_t>(trace.place.column);
  return "sum: " + color_text(trace.color().data()) + " + T " + digits(trace.transmittance) + " x background " +
         color_text(view.background.data()) + " = " + color_text(total.data()) + "; alpha " +
         digits(1 - trace.transmittance) + ", depth " + digits(weights > 0 ? trace.depth_sum / weights : 0) +
         "\nimage: " + color_text(&rendered.image[3 * pixel]) + "; alpha " + digits(rendered.alpha[pixel]) +
         ", depth " + digits(rendered.depth[pixel]) + "\n";
}

}  // namespace

PixelPlace parse_pixel(const std::string& text, const Camera& camera, const std::string& where) {
  PixelPlace place;
  const char* const end = text.data() + text.size();
  const auto column = std::from_chars(text.data(), end, place.column);
  const bool comma = column.ec == std::errc() && column.ptr != end && *column.ptr == ',';
  const auto row = std::from_chars(comma ? column.ptr + 1 : end, end, place.row);
  const std::string allowed =
      "; allowed: column,row from 0,0 to " + std::to_string(camera.width - 1) + "," + std::to_string(camera.height - 1);
  if (!comma || row.ec != std::errc() || row.ptr != end)
    throw UserError(where + ": \"" + text + "\" is no pixel" + allowed);
  if (place.column < 0 || place.column >= camera.width || place.row < 0 || place.row >= camera.height)
    throw UserError(where + ": pixel " + text + " is not in the image" + allowed);
  return place;
}

std::string pixel_table(const PixelTrace& trace, const SceneImage& rendered, const SceneView& view,
                        std::span<const FileRows> files) {
  return "pixel column " + std::to_string(trace.place.column) + ", row " + std::to_string(trace.place.row) + ": " +
         count_text(std::ssize(trace.composited), "Gaussian") + " composited, front to back\n" +
         composited_table(trace, files) + skipped_text(trace, view.settings, files) +
         stop_text(trace, view.settings, files) + sums_text(trace, rendered, view);
}

}  // namespace hsi4d::cli
