// Memory of a tape: blocks with stable addresses, given back in the reverse order of asking.
#pragma once

#include <vector>

#include "core/buffer.h"
#include "core/types.h"

namespace hsi4d {

/// Bump allocator over aligned blocks. Addresses stay valid until `rewind` to an earlier position.
class Arena {
 public:
  struct Position {
    std::size_t block = 0;
    Index offset = 0;
  };

  explicit Arena(Index first_block_bytes = Index(1) << 16) : next_block_bytes_(first_block_bytes) {}

  /// `bytes` of uninitialised memory, aligned to kAlignment.
  void* allocate(Index bytes);
  template <class T>
  T* allocate(Index count) {
    return static_cast<T*>(allocate(count * static_cast<Index>(sizeof(T))));
  }
  Position position() const { return position_; }
  /// Gives back everything allocated after `position`; the blocks are kept for later.
  void rewind(Position position) { position_ = position; }
  /// Gives everything back; several blocks become one that holds all of them, so that the next round needs no new one.
  void reset();
  /// Bytes held from the system.
  Index capacity_bytes() const;

 private:
  std::vector<Buffer<std::byte>> blocks_;
  Position position_;
  Index next_block_bytes_;
};

}  // namespace hsi4d
