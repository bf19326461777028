#include "tests/support/allocation_counter.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstddef>

#include "core/parallel.h"

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define HSI4D_COUNT_ALLOCATIONS 1
#endif

namespace {
std::atomic<std::int64_t> count = 0;
}

#if defined(HSI4D_COUNT_ALLOCATIONS)

extern "C" {
// glibc's own functions under their second names.
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t n, std::size_t size);
void* __libc_realloc(void* old, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  ++count;
  return __libc_malloc(size);
}
void* calloc(std::size_t n, std::size_t size) {
  ++count;
  return __libc_calloc(n, size);
}
void* realloc(void* old, std::size_t size) {
  ++count;
  return __libc_realloc(old, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  ++count;
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  ++count;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** result, std::size_t alignment, std::size_t size) {
  ++count;
  *result = __libc_memalign(alignment, size);
  return *result == nullptr ? ENOMEM : 0;
}
}

#endif

namespace hsi4d::test {

bool allocations_are_counted() {
#if defined(HSI4D_COUNT_ALLOCATIONS)
  return true;
#else
  return false;
#endif
}

std::int64_t allocation_count() { return count; }

std::int64_t steady_allocations(FunctionRef<void()> round) {
  round();
  std::int64_t least = INT64_MAX;
  const int rounds = thread_count() == 1 ? 1 : 10;
  for (int i = 0; i < rounds && least > 0; ++i) {
    const std::int64_t before = allocation_count();
    round();
    least = std::min(least, allocation_count() - before);
  }
  return least;
}

}  // namespace hsi4d::test
