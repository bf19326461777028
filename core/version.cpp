#include "core/version.h"

namespace hsi4d {

const char* version() { return HSI4D_VERSION; }

}  // namespace hsi4d
