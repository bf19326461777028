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

/// Small valid files, from which mutations start.
std::vector<Bytes> corpus();

/// Whether the reader takes these bytes. Any exception but UserError and DataError leaves it, and is a finding.
bool accepts(std::span<const uint8_t> file);

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
