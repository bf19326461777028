// Memory that the chunks of a parallel loop share: as many pieces as chunks can run at the same time.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>

#include "core/parallel.h"

namespace hsi4d::detail {

/// Hands out pieces of workspace by number. Which chunk gets which changes no result: a chunk writes a piece before it
/// reads it.
class Workspaces {
 public:
  static constexpr Index kMost = 256;

  /// @param chunks  of the loop
  explicit Workspaces(Index chunks) : count_(std::clamp<Index>(std::min<Index>(thread_count(), chunks), 1, kMost)) {}
  Index count() const { return count_; }

  /// A piece, held while this lives.
  class Held {
   public:
    explicit Held(Workspaces& all) : all_(all), number_(all.take()) {}
    ~Held() { all_.busy_[static_cast<std::size_t>(number_)].store(false, std::memory_order_release); }
    Held(const Held&) = delete;
    Held& operator=(const Held&) = delete;
    Index number() const { return number_; }

   private:
    Workspaces& all_;
    Index number_;
  };

 private:
  Index take() {
    for (Index i = 0;; i = (i + 1) % count_) {
      if (!busy_[static_cast<std::size_t>(i)].exchange(true, std::memory_order_acquire)) return i;
    }
  }
  Index count_;
  std::array<std::atomic<bool>, kMost> busy_{};
};

}  // namespace hsi4d::detail
