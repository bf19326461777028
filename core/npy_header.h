// The header of a .npy file.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace hsi4d {

/// What a .npy file's header says.
struct NpyHeader {
  std::string dtype;  ///< "<f4"; "structured" where numpy wrote a list of fields
  bool fortran_order = false;
  std::vector<int64_t> shape;
  int64_t data_begin = 0;  ///< bytes from the file's start
};

/// Reads the magic bytes, the version and the Python dict literal, which must have exactly the keys that numpy writes.
/// Throws DataError naming the source and the byte.
NpyHeader parse_npy_header(std::span<const uint8_t> file, const std::string& source);

}  // namespace hsi4d
