#include "optim/solid/volume_library.h"

#include "core/loaded_library.h"

namespace hsi4d {

const VolumeLibrary& volume_library() {
  static const auto function = reinterpret_cast<const VolumeLibrary* (*)()>(
      function_of_library("libhsi4d_volumes.so", "hsi4d_volume_library", "surfaces of grids cannot be made"));
  return *function();
}

}  // namespace hsi4d
