// The program `hsi4d-bench`, which `hsi4d bench` starts.
#include "bench/command.h"

int main(int argc, char** argv) {
  using namespace hsi4d;
  return cli::run_command_program("bench", argc, argv, cli::add_bench, loss_terms());
}
