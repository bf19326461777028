// Libraries of this project that are loaded when they are first needed: what they link to takes long to load.
#pragma once

#include <string>

namespace hsi4d {

/// The address of a function of a library beside the program, which it loads at the first call and keeps.
///
/// @param library   "libhsi4d_images.so": the program that links this has its folder in its run path (cmake/)
/// @param function  of C linkage
/// @param without   what cannot be done without it: "images of this kind cannot be read"
/// Throws InternalError: `without`, and why.
void* function_of_library(const char* library, const char* function, const std::string& without);

}  // namespace hsi4d
