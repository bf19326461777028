// libFuzzer's way into a target. PROGRAM corpus FOLDER writes the files that mutations start from.
#include <cstdlib>
#include <string>
#include <string_view>

#include "tests/fuzz/fuzz.h"

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  if (*argc != 3 || std::string_view((*argv)[1]) != "corpus") return 0;
  int number = 0;
  for (const hsi4d::Bytes& file : hsi4d::fuzz::targets().front()->corpus())
    hsi4d::write_file(std::string((*argv)[2]) + "/corpus" + std::to_string(number++), file);
  std::exit(0);
}

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  hsi4d::fuzz::targets().front()->accepts(std::span(data, size));
  return 0;
}
