#include "core/version.h"

namespace hsi4d {

const char* version() { return HSI4D_VERSION; }

const char* git_commit() { return HSI4D_GIT_COMMIT; }

}  // namespace hsi4d
