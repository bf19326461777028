// libFuzzer's way into a target.
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  hsi4d::fuzz::accepts(std::span(data, size));
  return 0;
}
