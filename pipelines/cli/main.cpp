#include "optim/loss_term.h"
#include "pipelines/cli/program.h"

int main(int argc, char** argv) { return hsi4d::cli::run_program(argc, argv, hsi4d::loss_terms()); }
