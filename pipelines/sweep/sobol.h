// Points that fill a cube evenly, however many of them are taken: Sobol's sequence.
#pragma once

#include <cstdint>

namespace hsi4d {

/// The most dimensions that there are direction numbers for.
inline constexpr int kMostSobolDimensions = 20;

/// A coordinate of a point, times 2³².
///
///   x_i = ⊕_k i_k v_k,   v_k = m_k / 2ᵏ,   m_k = 2 a_1 m_{k−1} ⊕ … ⊕ 2^{s−1} a_{s−1} m_{k−s+1} ⊕ 2^s m_{k−s} ⊕ m_{k−s}
///                                            [Sobol' 1967; numbers of Joe and Kuo 2008, new-joe-kuo-6.21201]
///
/// i_k are the binary digits of the index, the lowest first. Each of the first two dimensions, and both together, are
/// (0, 2)-sequences: of 2^m points from a multiple of 2^m on, each box of size 2^−a × 2^−b with a + b = m holds one.
/// Further dimensions are worse by the degrees of their polynomials less 1.
/// @param dimension  0 to kMostSobolDimensions − 1; throws InternalError for others
std::uint32_t sobol_point(std::uint32_t index, int dimension);

}  // namespace hsi4d
