#include "pipelines/cli/program.h"

#include <cstdio>

#include "core/version.h"

namespace hsi4d::cli {

int run_program(int, const char* const*) {
  std::printf("hsi4d %s\n", version());
  return 0;
}

}  // namespace hsi4d::cli
