// SSIM: forward, and forward with backward, of whole images and of a region, single precision unless named otherwise.
#include <random>
#include <string>

#include <benchmark/benchmark.h>

#include "autodiff/ssim.h"
#include "bench/goals.h"
#include "core/parallel.h"

namespace {

using namespace hsi4d;

constexpr Index kChannels = 3;

template <class S>
void fill(Array<S> image, unsigned seed) {
  std::minstd_rand random(seed);
  std::uniform_real_distribution<S> uniform(0, 1);
  for (Index r = 0; r < image.total_rows(); ++r) {
    for (Index c = 0; c < image.shape.cols; ++c) image.row(r)[c] = uniform(random);
  }
}

void report(benchmark::State& state, Index rows, Index cols) {
  state.counters["pixels"] = static_cast<double>(rows * cols);
  state.counters["values/s"] =
      benchmark::Counter(static_cast<double>(rows * cols * kChannels), benchmark::Counter::kIsIterationInvariantRate);
}

/// Multiplications and fused multiply-adds of the sweep, value and gradient, counted in the kernel.
constexpr double kMultipliesPerValue = 122;

/// d_ssim on a tape; arguments: rows, cols, threads, with backward.
template <class S>
void whole(benchmark::State& state) {
  const Index rows = state.range(0), cols = state.range(1);
  const bool with_backward = state.range(3) != 0;
  with_threads(static_cast<int>(state.range(2)), [&] {
    Tape<S> tape;
    const Shape shape{kChannels, rows, cols, cols + 16};
    const auto image = tape.parameter("image", shape), target = tape.constant("target", shape);
    fill(tape.write(image), 1);
    fill(tape.write(target), 2);
    const auto loss = d_ssim(image, target);
    if (!with_backward) tape.freeze(image);
    for (auto _ : state) {
      tape.write(image);
      tape.forward(loss);
      if (with_backward) tape.backward(loss);
    }
  });
  report(state, rows, cols);
  if (with_backward) state.counters["fma"] = kMultipliesPerValue * static_cast<double>(rows * cols * kChannels);
}
BENCHMARK(whole<float>)
    ->Name("d_ssim")
    ->ArgNames({"rows", "cols", "threads", "backward"})
    ->Args({1024, 1024, 1, 0})
    ->Args({1024, 1024, 1, 1})
    ->Args({1024, 1024, 2, 1})
    ->Args({512, 512, 1, 1})
    ->Args({1080, 1920, 1, 1})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK(whole<double>)
    ->Name("d_ssim_double")
    ->ArgNames({"rows", "cols", "threads", "backward"})
    ->Args({1024, 1024, 1, 1})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

/// An image that is the same outside of a rectangle, which it tells.
struct Rectangle {
  static constexpr const char* kName = "rectangle";
  static constexpr bool kPersistentOutputs = true;
  TileMask squares = {};

  void forward(NodeIo<float>& io) {
    const bool is_new = squares.rows() == 0;
    if (is_new) std::fill_n(io.out().data, io.out().shape.memory(), 1.0f);
    if (is_new) squares.clear(io.out().shape.rows, io.out().shape.cols);
    const Index rows = static_cast<Index>(io.in(0)(0, 0)), cols = static_cast<Index>(io.in(0)(0, 1));
    for (Index r = 160; r < 160 + rows; ++r) {
      for (Index c = 160; c < 160 + cols; ++c) squares.add(r / kMaskSquare, c / kMaskSquare);
    }
    io.tell_squares(0, is_new ? nullptr : &squares, &squares);
  }
  void backward(NodeIo<float>&) {}
};

/// d_ssim with a rectangle inside 1024 × 1024; arguments: rows, cols of the rectangle, threads.
void region(benchmark::State& state) {
  constexpr Index kSide = 1024;
  const Index rows = state.range(0), cols = state.range(1);
  with_threads(static_cast<int>(state.range(2)), [&] {
    Tape<float> tape;
    const Shape shape{kChannels, kSide, kSide, kSide + 16};
    const auto size = tape.parameter("size", shape_of(1, 2));
    const auto target = tape.constant("target", shape);
    fill(tape.write(target), 2);
    const auto loss = d_ssim(tape.record(Rectangle{}, {size}, shape, Source::current()), target);
    for (auto _ : state) {
      const Array<float> numbers = tape.write(size);
      numbers(0, 0) = static_cast<float>(rows);
      numbers(0, 1) = static_cast<float>(cols);
      tape.forward(loss);
      tape.backward(loss);
    }
  });
  report(state, rows, cols);
}
BENCHMARK(region)
    ->Name("d_ssim_rectangle")
    ->ArgNames({"rows", "cols", "threads"})
    ->Args({256, 670, 1})
    ->Args({670, 256, 1})
    ->Args({670, 256, 2})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

const bench::AtStart goals([] {
  const std::string whole_image = "d_ssim/rows:1024/cols:1024/threads:1/backward:1/real_time";
  bench::ask_time("D-SSIM of 1024 x 1024 x 3, forward + backward", whole_image, 16e6);
  bench::ask_time("  the same, for each pixel", whole_image, 16e6 / (1024.0 * 1024.0), 1024.0 * 1024.0);
});

}  // namespace
