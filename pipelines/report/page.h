// The page of a report, from its data.
#pragma once

#include <string>

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

}  // namespace hsi4d
