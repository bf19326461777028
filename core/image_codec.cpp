#include "core/image_codec.h"

#include "core/loaded_library.h"

namespace hsi4d {

ReadByCodec image_codec() {
  static const auto function = reinterpret_cast<ReadByCodec (*)()>(
      function_of_library("libhsi4d_images.so", "hsi4d_image_codec", "images of this kind cannot be read"));
  return function();
}

}  // namespace hsi4d
