// What a fuzz target of a reader provides. The same file serves libFuzzer and the ordinary test of driver.cpp.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/check.h"
#include "core/file.h"

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv);
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

namespace hsi4d::fuzz {

/// A reader that is tried. Each READER_fuzz.cpp defines one, which adds itself to the program's list.
struct Target {
  Target(const char* target_name, std::vector<Bytes> (*target_corpus)(),
         bool (*target_accepts)(std::span<const uint8_t>));

  const char* name;
  std::vector<Bytes> (*corpus)();                  ///< small valid files, from which mutations start
  bool (*accepts)(std::span<const uint8_t> file);  ///< whether the reader takes these bytes; any exception but
                                                   ///< UserError and DataError leaves it, and is a finding
};

/// The program's targets: a layer's, or libFuzzer's one.
std::vector<const Target*>& targets();

/// Whether `read` ends without one of the errors that a file may cause.
template <class Read>
bool is_read(Read&& read) {
  try {
    read();
    return true;
  } catch (const UserError&) {
    return false;
  } catch (const DataError&) {
    return false;
  }
}

}  // namespace hsi4d::fuzz
