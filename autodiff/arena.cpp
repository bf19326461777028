#include "autodiff/arena.h"

namespace hsi4d {

void* Arena::allocate(Index bytes) {
  const Index wanted = round_up(bytes, kAlignment);
  while (position_.block < blocks_.size() && position_.offset + wanted > blocks_[position_.block].size()) {
    ++position_.block;
    position_.offset = 0;
  }
  if (position_.block == blocks_.size()) {
    const Index size = std::max(next_block_bytes_, wanted);
    blocks_.emplace_back();
    blocks_.back().resize(size);
    next_block_bytes_ = size + size / 2;
  }
  void* memory = blocks_[position_.block].data() + position_.offset;
  position_.offset += wanted;
  return memory;
}

void Arena::reset() {
  position_ = {};
  if (blocks_.size() < 2) return;
  const Index total = capacity_bytes();
  blocks_.clear();
  blocks_.emplace_back();
  blocks_.back().resize(total);
}

Index Arena::capacity_bytes() const {
  Index total = 0;
  for (const auto& block : blocks_) total += block.capacity_bytes();
  return total;
}

}  // namespace hsi4d
