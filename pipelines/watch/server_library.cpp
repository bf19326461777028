#include "pipelines/watch/server_library.h"

#include "core/loaded_library.h"

namespace hsi4d {

const ServerLibrary& server_library() {
  static const auto function = reinterpret_cast<const ServerLibrary* (*)()>(
      function_of_library("libhsi4d_server.so", "hsi4d_server_library", "runs cannot be watched"));
  return *function();
}

}  // namespace hsi4d
