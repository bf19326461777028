// The page of a report, from its data.
#pragma once

#include <string>

#include "pipelines/report_data.h"

namespace hsi4d {

/// The text of report.html.
std::string report_page(const ReportData& data);

/// The section of frames: sliders, images, comparison.
std::string frames_section(const ReportData& data);

/// "copy_frame_0" for people: "copy frame 0". Escaped.
std::string row_label(const std::string& name);

}  // namespace hsi4d
