// Costs of the tape itself, as `hsi4d bench tape` has them: a node, a lambda loss.
#include <benchmark/benchmark.h>

#include "bench/goals.h"
#include "pipelines/bench_tape.h"

namespace hsi4d::bench {
namespace {

const AtStart tape([] {
  for (const TapeWork& work : tape_work()) {
    benchmark::RegisterBenchmark(work.name.c_str(), [run = work.run](benchmark::State& state) {
      for (auto _ : state) run();
    });
  }
  for (const TapeWork& work : tape_work()) {
    if (!work.goal) continue;
    if (work.against.empty()) {
      ask_time(work.name + ": a node", work.name, *work.goal, static_cast<double>(work.nodes));
    } else {
      ask_ratio(work.name + " / " + work.against, work.name, work.against, *work.goal);
    }
  }
});

}  // namespace
}  // namespace hsi4d::bench
