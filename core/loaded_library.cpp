#include "core/loaded_library.h"

#include <dlfcn.h>

#include "core/check.h"

namespace hsi4d {

void* function_of_library(const char* library, const char* function, const std::string& without) {
  void* const module = dlopen(library, RTLD_NOW | RTLD_LOCAL);  // for as long as the program runs
  void* const address = module == nullptr ? nullptr : dlsym(module, function);
  if (address != nullptr) return address;
  const char* const reason = dlerror();
  throw InternalError(without + ": " + (reason == nullptr ? "no reason given" : reason));
}

}  // namespace hsi4d
