// The version and the commit, from CMakeLists.txt.
#pragma once

namespace hsi4d {

/// "major.minor.patch" of the library.
const char* version();

/// The commit that the build was configured from, twelve digits; "unknown" outside of a git checkout.
const char* git_commit();

}  // namespace hsi4d
