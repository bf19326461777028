// Arrays of files in which every number has to be one.
#pragma once

#include <initializer_list>
#include <vector>

#include "core/npy.h"

namespace hsi4d {

/// The numbers of an array of this shape (−1: any length), all of them finite. T is float or double.
/// Throws DataError as NpyArray::require_shape and NpyArray::as, and naming the first number that is not finite: by its
/// place, or by row and place in the row where the array has rows.
template <class T>
std::vector<T> finite_numbers(const NpyArray& array, std::initializer_list<int64_t> shape);

extern template std::vector<float> finite_numbers(const NpyArray&, std::initializer_list<int64_t>);
extern template std::vector<double> finite_numbers(const NpyArray&, std::initializer_list<int64_t>);

}  // namespace hsi4d
