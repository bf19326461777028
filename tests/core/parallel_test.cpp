#include "core/parallel.h"

#include <atomic>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <vector>

#include <catch2/catch.hpp>

namespace parallel_test {

using namespace hsi4d;

TEST_CASE("every element is visited once, whatever the number of threads", "[parallel]") {
  for (const int threads : {1, 2, 3, 8}) {
    with_threads(threads, [&] {
      for (const Index n : {0, 1, 7, 64, 1000}) {
        std::vector<int> visits(static_cast<std::size_t>(n), 0);
        parallel_for(n, 16, [&](Index begin, Index end) {
          for (Index i = begin; i < end; ++i) ++visits[static_cast<std::size_t>(i)];
        });
        for (const int count : visits) REQUIRE(count == 1);
      }
    });
  }
}

TEST_CASE("a sum has the same bits for 1, 2, 3 and 8 threads", "[parallel]") {
  std::vector<double> terms(100003);
  for (std::size_t i = 0; i < terms.size(); ++i) terms[i] = std::sin(static_cast<double>(i)) * 1e6;
  std::set<double> results;
  for (const int threads : {1, 2, 3, 8}) {
    with_threads(threads, [&] {
      for (int repeat = 0; repeat < 5; ++repeat) {
        results.insert(parallel_sum(static_cast<Index>(terms.size()), 100, [&](Index begin, Index end) {
          double sum = 0;
          for (Index i = begin; i < end; ++i) sum += terms[static_cast<std::size_t>(i)];
          return sum;
        }));
      }
    });
  }
  CHECK(results.size() == 1);
}

TEST_CASE("the exception of the lowest chunk is reported and the other chunks still run", "[parallel]") {
  for (const int threads : {1, 3}) {
    with_threads(threads, [&] {
      for (int repeat = 0; repeat < 20; ++repeat) {
        std::atomic<int> ran = 0;
        CHECK_THROWS_WITH(run_chunks(50,
                                     [&](Index chunk) {
                                       ++ran;
                                       if (chunk % 10 == 7) throw std::runtime_error("chunk " + std::to_string(chunk));
                                     }),
                          "chunk 7");
        CHECK(ran == 50);
      }
    });
  }
}

TEST_CASE("F4: denormals are flushed inside a chunk on every thread, and only there", "[parallel]") {
  volatile double tiny = std::numeric_limits<double>::min();
  const auto denormal_survives = [&] { return tiny * 0.25 != 0; };
  REQUIRE(denormal_survives());
  for (const int threads : {1, 2}) {
    with_threads(threads, [&] {
      std::atomic<int> survivors = 0;
      for (const Index chunks : {1, 200}) {
        run_chunks(chunks, [&](Index) { survivors += denormal_survives() ? 1 : 0; });
      }
      CHECK(survivors == 0);
    });
  }
  CHECK(denormal_survives());
}

TEST_CASE("the number of threads is bounded and nested loops keep it", "[parallel]") {
  with_threads(3, [] {
    CHECK(thread_count() == 3);
    with_threads(1, [] {
      CHECK(thread_count() == 1);
      with_threads(16, [] { CHECK(thread_count() == 1); });  // no more than the scope around it
    });
    with_threads(16, [] { CHECK(thread_count() == 3); });
  });
  CHECK_THROWS_AS(with_threads(0, [] {}), std::logic_error);
}

TEST_CASE("pairwise summation of many equal terms is exact to rounding") {
  const std::vector<double> terms(1 << 20, 0.1);
  CHECK(pairwise_sum(terms.data(), static_cast<Index>(terms.size())) == Approx(0.1 * (1 << 20)).epsilon(1e-15));
}

}  // namespace parallel_test
