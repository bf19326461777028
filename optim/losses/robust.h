// Robust functions of squared distances that terms share.
#pragma once

namespace hsi4d {

/// s² r² / (s² + r²): nearly r² where that is small, never more than s². [Geman and McClure 1987]
/// @param limit  s²
template <class T>
T geman_mcclure(T squared, float limit) {
  return limit * squared / (limit + squared);
}

}  // namespace hsi4d
