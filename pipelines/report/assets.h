// The style and the script of report.html: the files of report_assets/, which the build makes part of the program.
#pragma once

#include <string>
#include <string_view>

namespace hsi4d {

/// CSS, for light and dark.
std::string_view report_style();

/// JavaScript of the frames, the divider and the 3D view, as one scope. It reads the elements `frames-data` (JSON) and
/// `view3d-data`, and works on those of frames_section and view3d_section.
std::string report_script();

}  // namespace hsi4d
