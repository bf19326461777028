#include "core/parallel.h"

#include <algorithm>
#include <exception>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "core/check.h"

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

namespace hsi4d {

namespace {

/// Keeps the exception of the lowest chunk.
class FirstError {
 public:
  void keep(Index chunk, std::exception_ptr error) {
    const std::lock_guard lock(mutex_);
    if (!error_ || chunk < chunk_) {
      chunk_ = chunk;
      error_ = std::move(error);
    }
  }
  void rethrow() const {
    if (error_) std::rethrow_exception(error_);
  }

 private:
  std::mutex mutex_;
  Index chunk_ = 0;
  std::exception_ptr error_;
};

#if defined(__SANITIZE_THREAD__)
// Debian's TBB is not instrumented, so ThreadSanitizer can not see what orders its tasks and finds races in all of
// them. Under it chunks run on plain threads instead: what is tested is the code of the chunks.
template <class F>
void run_on_threads(Index chunks, const F& run) {
  const Index count = std::min<Index>(chunks, thread_count());
  std::vector<std::thread> threads;
  for (Index t = 0; t < count; ++t) {
    threads.emplace_back([&, t] {
      for (Index chunk = t; chunk < chunks; chunk += count) run(chunk);
    });
  }
  for (std::thread& thread : threads) thread.join();
}
#else
template <class F>
void run_on_threads(Index chunks, const F& run) {
  tbb::parallel_for(Index(0), chunks, run);
}
#endif

}  // namespace

void run_chunks(Index chunks, FunctionRef<void(Index)> body) {
  if (chunks <= 0) return;
  if (chunks == 1) {
    const FlushDenormals flush;
    body(0);
    return;
  }
  FirstError first_error;
  const auto run = [&](Index chunk) {
    const FlushDenormals flush;
    try {
      body(chunk);
    } catch (...) {
      first_error.keep(chunk, std::current_exception());
    }
  };
  if (thread_count() == 1) {
    for (Index chunk = 0; chunk < chunks; ++chunk) run(chunk);
  } else {
    run_on_threads(chunks, run);
  }
  first_error.rethrow();
}

double pairwise_sum(const double* values, Index n) {
  if (n <= 0) return 0;
  if (n == 1) return values[0];
  const Index half = n / 2;
  return pairwise_sum(values, half) + pairwise_sum(values + half, n - half);
}

int thread_count() { return tbb::this_task_arena::max_concurrency(); }

void with_threads(int threads, FunctionRef<void()> body) {
  HSI4D_CHECK(threads >= 1, "threads = " + std::to_string(threads));
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads));
  // Beyond what a scope around this one allows, TBB would get no workers and print a warning.
  const std::size_t allowed = tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
  tbb::task_arena arena(static_cast<int>(std::min(allowed, static_cast<std::size_t>(threads))));
  arena.execute([&] { body(); });
}

#if defined(__SSE2__)
namespace {
constexpr unsigned kFlushToZero = 0x8000;       // results
constexpr unsigned kDenormalsAreZero = 0x0040;  // inputs
}  // namespace

FlushDenormals::FlushDenormals() : saved_(_mm_getcsr()) {
  const unsigned wanted = saved_ | kFlushToZero | kDenormalsAreZero;
  if (wanted != saved_) _mm_setcsr(wanted);
}
FlushDenormals::~FlushDenormals() {
  // The status bits that arithmetic raised meanwhile stay; only the two modes go back.
  const unsigned now = _mm_getcsr();
  constexpr unsigned kModes = kFlushToZero | kDenormalsAreZero;
  const unsigned restored = (now & ~kModes) | (saved_ & kModes);
  if (restored != now) _mm_setcsr(restored);
}
#elif defined(__aarch64__)
namespace {
constexpr std::uint64_t kFlushBit = std::uint64_t(1) << 24;
std::uint64_t control_register() {
  std::uint64_t value;
  asm volatile("mrs %0, fpcr" : "=r"(value));
  return value;
}
void set_control_register(std::uint64_t value) { asm volatile("msr fpcr, %0" ::"r"(value)); }
}  // namespace

FlushDenormals::FlushDenormals() : saved_((control_register() & kFlushBit) != 0) {
  set_control_register(control_register() | kFlushBit);
}
FlushDenormals::~FlushDenormals() {
  if (!saved_) set_control_register(control_register() & ~kFlushBit);
}
#else
FlushDenormals::FlushDenormals() : saved_(0) {}
FlushDenormals::~FlushDenormals() = default;
#endif

}  // namespace hsi4d
