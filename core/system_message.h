// What the system says of its errors.
#pragma once

#include <string>
#include <system_error>

namespace hsi4d {

/// The text of an error number (errno): "No such file or directory".
inline std::string system_message(int error) { return std::generic_category().message(error); }

}  // namespace hsi4d
