// Kernels of directions.h, and the numbers as they want them. Not a public header.
#pragma once

#include "body/directions.h"
#include "core/buffer.h"
#include "core/simd.h"

namespace hsi4d::detail {

inline constexpr Index kTileVertices = 32;
inline constexpr Index kTileRows = 3 * kTileVertices;
inline constexpr Index kDirectionGrain = 64 * kTileVertices;  ///< vertices of a parallel chunk
inline constexpr Index kDirectionLanes = 16;                  ///< of any instruction set, in float

/// Columns [column, column + columns) of one block: [columns, kTileRows] numbers at `offset` of the table's numbers or
/// packed numbers.
struct DirectionTile {
  std::int32_t column;
  std::int32_t columns;
  bool is_packed;
  double scale;  // 1 where not packed
  Index offset;
};

template <class S>
struct DirectionTiles {
  Index vertices = 0, columns = 0;
  Buffer<S> numbers;
  Buffer<std::int16_t> packed;
  std::vector<DirectionTile> tiles;  // by block, then by column
  std::vector<Index> block_begin;    // [blocks + 1], into tiles
  double largest_error = 0;

  Index blocks() const { return static_cast<Index>(block_begin.size()) - 1; }
};

/// Kernels of one instruction set, for blocks [begin, end).
template <class S>
struct DirectionKernels {
  using Tiles = const DirectionTiles<S>&;
  void (*add)(Tiles, const S* coefficients, const S* points, S* result, Index begin, Index end);
  /// `partial` [C,kDirectionLanes] is overwritten with sums of the blocks, lane by lane.
  void (*gather)(Tiles, const S* d_result, S* partial, Index begin, Index end);
};

template <class S>
DirectionKernels<S> direction_kernels(Isa isa);

}  // namespace hsi4d::detail
