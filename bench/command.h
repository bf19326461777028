// `hsi4d bench`: a command with a command a topic.
#pragma once

#include <string>

#include "bench/topic.h"

namespace hsi4d::cli {

/// `hsi4d bench` without a topic: the tables of all kernels, each with all its workloads; the tape on one thread.
std::string bench_kernels_command(const BenchOptions& options);

/// Adds `bench` with its topics.
void add_bench(CLI::App& app, Program& program);

}  // namespace hsi4d::cli
