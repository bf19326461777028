// The version, from CMakeLists.txt.
#pragma once

namespace hsi4d {

/// "major.minor.patch" of the library.
const char* version();

}  // namespace hsi4d
