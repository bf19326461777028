// The parts of a study's page: the files of study_assets/, which the build makes part of the program.
#pragma once

#include <string_view>

namespace hsi4d {

/// CSS, for light and dark.
std::string_view study_style();

/// What is in the page's body.
std::string_view study_body();

/// JavaScript, as one scope. It reads the element `study-data` (JSON) and works on those of study_body.
std::string_view study_script();

}  // namespace hsi4d
