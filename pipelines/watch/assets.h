// The page of `hsi4d watch`: the files of assets/, which the build makes part of the library.
#pragma once

#include <string_view>

namespace hsi4d {

/// HTML, which names /watch.css and /watch.js.
std::string_view watch_page();

/// CSS behind that of reports, which has the colours, for light and dark.
std::string_view watch_style();

/// JavaScript.
std::string_view watch_script();

}  // namespace hsi4d
