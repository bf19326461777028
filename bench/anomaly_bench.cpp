// What anomaly mode costs: the same iteration with and without it.
#include <cmath>

#include <benchmark/benchmark.h>

#include "autodiff/difference.h"
#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "autodiff/ssim.h"
#include "bench/goals.h"
#include "body/skinning.h"
#include "core/parallel.h"

namespace hsi4d::bench {
namespace {

constexpr Index kSide = 512;
constexpr Index kVertices = 10475, kJoints = 55;

SkinWeights<float> mesh_weights() {
  SparseWeights weights{kVertices, kJoints, 4, {}, {}};
  for (Index v = 0; v < kVertices; ++v) {
    for (Index k = 0; k < 4; ++k) {
      weights.indices.push_back(static_cast<std::int32_t>((v * kJoints / kVertices + k) % kJoints));
      weights.weights.push_back(0.25);
    }
  }
  return SkinWeights<float>(weights);
}

void fill(const Array<float>& array, double phase) {
  for (Index r = 0; r < array.total_rows(); ++r) {
    for (Index c = 0; c < array.shape.cols; ++c) {
      array.row(r)[c] =
          static_cast<float>(0.5 + 0.4 * std::sin(0.01 * static_cast<double>(r * array.shape.cols + c) + phase));
    }
  }
}

/// One iteration of photometric loss on an image and a body fitted to points.
void iteration(benchmark::State& state, bool anomaly) {
  with_threads(1, [&] {
    Tape<float> tape;
    tape.set_anomaly(anomaly);
    const auto image = tape.parameter("image", image_shape<float>(3, kSide, kSide));
    const auto frame = tape.constant("frame", image_shape<float>(3, kSide, kSide));
    const auto transforms = tape.parameter("transforms", shape_of(kJoints, 12));
    const auto rest = tape.parameter("rest", shape_of(kVertices, 3));
    const auto points = tape.constant("points", shape_of(kVertices, 3));
    for (const auto& leaf : {image, frame, transforms, rest, points}) fill(tape.write(leaf), leaf.id);
    const auto photometric = l1(image, frame) * 0.9 + d_ssim(image, frame) * 0.1;
    const auto loss = photometric + l2(skin_points(mesh_weights(), transforms, rest), points);
    for (auto _ : state) {
      tape.write(image);
      tape.write(transforms);
      tape.forward(loss);
      tape.backward(loss);
      benchmark::DoNotOptimize(tape.gradient(image).data);
    }
  });
}

void plain(benchmark::State& state) { iteration(state, false); }
void anomaly(benchmark::State& state) { iteration(state, true); }
BENCHMARK(plain)->Name("anomaly/off")->Unit(benchmark::kMillisecond);
BENCHMARK(anomaly)->Name("anomaly/on")->Unit(benchmark::kMillisecond);

const AtStart goals([] { ask_ratio("anomaly mode on / off, an iteration", "anomaly/on", "anomaly/off", 1.3); });

}  // namespace
}  // namespace hsi4d::bench
