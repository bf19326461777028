// The style and the script of report.html.
#pragma once

#include <string_view>

namespace hsi4d {

/// CSS, for light and dark.
std::string_view report_style();

/// JavaScript: slides through the frames and compares two images. It reads the arrays `frames` and `kinds`.
std::string_view report_script();

}  // namespace hsi4d
