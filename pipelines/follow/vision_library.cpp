#include "pipelines/follow/vision_library.h"

#include "core/loaded_library.h"

namespace hsi4d {

const VisionLibrary& vision_library() {
  static const auto function = reinterpret_cast<const VisionLibrary* (*)()>(
      function_of_library("libhsi4d_vision.so", "hsi4d_vision_library", "objects cannot be followed"));
  return *function();
}

}  // namespace hsi4d
