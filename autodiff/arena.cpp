#include "autodiff/arena.h"

#include "core/huge_pages.h"

namespace hsi4d {

namespace {

/// In large pages: every frame has a new tape, and to be given a page takes longer than to fill it.
void add_block(std::vector<Buffer<std::byte>>& blocks, Index bytes) {
  blocks.emplace_back();
  blocks.back().resize(bytes);
  advise_huge_pages(blocks.back().data(), bytes);
}

}  // namespace

void* Arena::allocate(Index bytes) {
  const Index wanted = round_up(bytes, kAlignment);
  while (position_.block < blocks_.size() && position_.offset + wanted > blocks_[position_.block].size()) {
    ++position_.block;
    position_.offset = 0;
  }
  if (position_.block == blocks_.size()) {
    const Index size = std::max(next_block_bytes_, wanted);
    add_block(blocks_, size);
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
  add_block(blocks_, total);
}

Index Arena::capacity_bytes() const {
  Index total = 0;
  for (const auto& block : blocks_) total += block.capacity_bytes();
  return total;
}

}  // namespace hsi4d
