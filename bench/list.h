// The topics of `hsi4d bench`, a line each, in the order of its `--help`. HSI4D_BENCH_TOPIC(name) stands for
// `BenchTopic name_topic()` in the topic's own file. Those that are kernels are measured by `hsi4d bench` alone too.
#pragma once

#include "bench/topic.h"

// clang-format off
#define HSI4D_BENCH_TOPICS        \
  HSI4D_BENCH_TOPIC(rasterize)    \
  HSI4D_BENCH_TOPIC(skinning)     \
  HSI4D_BENCH_TOPIC(color_net)    \
  HSI4D_BENCH_TOPIC(tape)         \
  HSI4D_BENCH_TOPIC(pixel_filter) \
  HSI4D_BENCH_TOPIC(stages)       \
  HSI4D_BENCH_TOPIC(scaling)      \
  HSI4D_BENCH_TOPIC(pareto)
// clang-format on

namespace hsi4d::cli {

#define HSI4D_BENCH_TOPIC(name) BenchTopic name##_topic();
HSI4D_BENCH_TOPICS
#undef HSI4D_BENCH_TOPIC

}  // namespace hsi4d::cli
