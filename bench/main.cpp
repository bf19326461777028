// The program `hsi4d-bench`, which `hsi4d bench` starts.
#include "bench/command_line.h"

int main(int argc, char** argv) {
  using namespace hsi4d;
  return cli::run_command_program("bench", argc, argv,
                                  [] { return std::make_unique<cli::BenchCommands>(loss_terms()); });
}
