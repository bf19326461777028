// Parallel loops and reductions whose results are bitwise the same for any number of threads.
//
// Work is cut into chunks by (n, grain) alone, never by the number of threads; a chunk's result goes to the chunk's own
// slot; slots are combined in a fixed order. Each chunk runs with denormals flushed to zero and restores the mode
// after.
#pragma once

#include <algorithm>
#include <array>

#include "core/types.h"

namespace hsi4d {

/// Cut of [0, n) into chunks of `grain` elements (the last may be shorter).
struct Partition {
  Index n = 0;
  Index grain = 1;

  Index chunks() const { return n <= 0 ? 0 : (n + grain - 1) / grain; }
  Index begin(Index chunk) const { return chunk * grain; }
  Index end(Index chunk) const { return std::min(n, (chunk + 1) * grain); }
};

/// Runs `body(chunk)` for chunk = 0 … chunks−1, in any order, on the threads of the current scope. A chunk that throws
/// does not stop the others; afterwards the exception of the lowest chunk is thrown. One chunk runs in place.
void run_chunks(Index chunks, FunctionRef<void(Index)> body);

/// Runs `body(begin, end)` over the chunks of [0, n).
template <class F>
void parallel_for(Index n, Index grain, F&& body) {
  const Partition part{n, grain};
  run_chunks(part.chunks(), [&](Index chunk) { body(part.begin(chunk), part.end(chunk)); });
}

/// Runs `body(chunk, begin, end)` over the chunks of `part`, for results kept in a slot per chunk.
template <class F>
void parallel_chunks(const Partition& part, F&& body) {
  run_chunks(part.chunks(), [&](Index chunk) { body(chunk, part.begin(chunk), part.end(chunk)); });
}

/// Sum of `values` by a pairwise tree: error grows with log n, order fixed.
double pairwise_sum(const double* values, Index n);

/// Most slots that a reduction uses; the grain is widened until the chunks fit.
inline constexpr Index kReductionSlots = 256;

/// The cut that reductions over n elements use: `grain`, or wider to stay within kReductionSlots chunks.
inline Partition reduction_partition(Index n, Index grain) {
  return {n, std::max(grain, (n + kReductionSlots - 1) / kReductionSlots)};
}

/// Sum over [0, n) of `partial(begin, end)` (a double), combined by a pairwise tree.
template <class F>
double parallel_sum(Index n, Index grain, F&& partial) {
  std::array<double, kReductionSlots> slots;
  const Partition part = reduction_partition(n, grain);
  parallel_chunks(
      part, [&](Index chunk, Index begin, Index end) { slots[static_cast<std::size_t>(chunk)] = partial(begin, end); });
  return pairwise_sum(slots.data(), part.chunks());
}

/// Number of threads that loops started from here may use.
int thread_count();

/// Runs `body` on at most `threads` threads (≥ 1; not bounded by cores, but by a scope around). Exceptions pass
/// through.
void with_threads(int threads, FunctionRef<void()> body);

/// Flushes denormal numbers to zero (results and inputs) while it lives; restores the thread's mode at the end.
/// Denormals in gradients and moments cost time and carry no information [docs/numerics.md].
class FlushDenormals {
 public:
  FlushDenormals();
  ~FlushDenormals();
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned saved_;
};

}  // namespace hsi4d
