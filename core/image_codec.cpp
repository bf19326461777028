#include "core/image_codec.h"

#include <dlfcn.h>

#include "core/check.h"

namespace hsi4d {

namespace {

// The program that links this library has the folder in its run path (CMakeLists.txt).
constexpr const char* kModule = "libhsi4d_images.so";

ReadByCodec load() {
  const auto reason = [] {
    const char* const text = dlerror();
    return std::string(text == nullptr ? "no reason given" : text);
  };
  void* const module = dlopen(kModule, RTLD_NOW | RTLD_LOCAL);  // for as long as the program runs
  if (module == nullptr) throw InternalError("images of this kind cannot be read: " + reason());
  const auto codec = reinterpret_cast<ReadByCodec (*)()>(dlsym(module, "hsi4d_image_codec"));
  if (codec == nullptr) throw InternalError("images of this kind cannot be read: " + reason());
  return codec();
}

}  // namespace

ReadByCodec image_codec() {
  static const ReadByCodec codec = load();
  return codec;
}

}  // namespace hsi4d
