// The one file that compiles Catch2's main (about 15 s).
#define CATCH_CONFIG_RUNNER
#include <exception>
#include <iostream>

#include <catch2/catch.hpp>

#include "core/simd.h"

int main(int argc, char** argv) {
  try {
    hsi4d::best_isa();  // before any kernel runs, so that HSI4D_ISA holds for all of them
  } catch (const std::exception& e) {
    std::cerr << e.what() << '\n';
    return 2;
  }
  return Catch::Session().run(argc, argv);
}
