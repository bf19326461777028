// The page of a report, from its data; and what other pages are made of.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/table.h"
#include "pipelines/report/data.h"

namespace hsi4d {

/// The text of report.html.
std::string report_page(const ReportData& data);

/// The section of frames: a scrubber, two images with a divider between them, a third. Empty without images.
std::string frames_section(const ReportData& data);

/// The section of the 3D view. Empty without its file.
std::string view3d_section(const ReportData& data);

/// What these two sections show, and the script that shows it.
std::string moving_data(const ReportData& data);

/// "copy_frame_0" for people: "copy frame 0". Escaped.
std::string row_label(const std::string& name);

/// A whole page in the style of reports.
std::string html_page(const std::string& title, const std::string& body);

/// A table under its title and caption; empty for one without rows or without columns after the first.
std::string table_section(const Table& table);

/// Cards side by side, each a heading and a plot, without those whose plot is empty; empty where there are none.
/// @param caption  may be empty
std::string plots_section(const std::string& title, const std::string& caption,
                          const std::vector<std::pair<std::string, std::string>>& plots);

}  // namespace hsi4d
