// The version and the commit, from CMakeLists.txt.
#pragma once

namespace hsi4d {

/// "major.minor.patch" of the library.
const char* version();

/// The commit that was built, twelve digits, with "-modified" behind it where the sources were changed since; "unknown"
/// outside of a git checkout.
const char* git_commit();

}  // namespace hsi4d
