#include "core/finite_numbers.h"

#include <cmath>
#include <string>

#include "core/check.h"

namespace hsi4d {

template <class T>
std::vector<T> finite_numbers(const NpyArray& array, std::initializer_list<int64_t> shape) {
  std::vector<T> numbers = array.require_shape(shape).template as<T>();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (std::isfinite(numbers[i])) continue;
    const bool has_rows = array.shape().size() > 1;
    const std::size_t width = numbers.size() / (has_rows ? static_cast<std::size_t>(array.shape().front()) : 1);
    throw DataError(array.source() + ": " + (has_rows ? "row " + std::to_string(i / width) + ", " : "") + "number " +
                    std::to_string(i % width) + " is not finite");
  }
  return numbers;
}

template std::vector<float> finite_numbers(const NpyArray&, std::initializer_list<int64_t>);
template std::vector<double> finite_numbers(const NpyArray&, std::initializer_list<int64_t>);

}  // namespace hsi4d
