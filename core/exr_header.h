// What OpenEXR takes on its word: the sizes of attributes in a file's headers.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace hsi4d {

/// Walks over the attributes of all headers of an OpenEXR file, each a name, a type, a size and as many bytes. OpenEXR
/// takes memory for a size of up to 2 GB before it looks whether the file goes on, and reads those types that have a
/// length of their own by that length, whatever the size says. Throws DataError where an attribute does not end within
/// the file, or has another length than its type.
void check_exr_attributes(std::span<const std::uint8_t> file, const std::string& name);

}  // namespace hsi4d
