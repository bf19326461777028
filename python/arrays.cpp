#include "python/arrays.h"

#include <algorithm>
#include <limits>

#include "core/check.h"

namespace hsi4d::python {

namespace {

bool has_shape(const py::array& array, const Sizes& shape) {
  if (array.ndim() != std::ssize(shape)) return false;
  for (py::ssize_t i = 0; i < array.ndim(); ++i) {
    const py::ssize_t wanted = shape[static_cast<std::size_t>(i)];
    if (wanted >= 0 && array.shape(i) != wanted) return false;
  }
  return true;
}

Sizes shape_of_array(const py::array& array) { return Sizes(array.shape(), array.shape() + array.ndim()); }

/// What the object is as an array. Throws UserError for what NumPy takes for no array of real numbers.
py::array real_array(py::handle object, const std::string& name, const std::string& text) {
  const py::array array = py::module_::import("numpy").attr("asarray")(object);
  const char kind = array.dtype().kind();
  if (kind == 'f' || kind == 'i' || kind == 'u') return array;
  throw UserError(name + ": an array " + shape_text(shape_of_array(array)) + " of " +
                  std::string(py::str(array.dtype())) + "; allowed: " + text + " of real numbers");
}

}  // namespace

std::string shape_text(const Sizes& shape) {
  std::string text = "[";
  for (const py::ssize_t size : shape) text += (text.size() > 1 ? "," : "") + std::to_string(size);
  return text + "]";
}

template <class T>
Numbers<T> numbers_of(py::handle object, const Sizes& shape, const std::string& name, const std::string& text) {
  const py::array array = real_array(object, name, text);
  if (!has_shape(array, shape))
    throw UserError(name + ": an array " + shape_text(shape_of_array(array)) + "; allowed: " + text);
  const auto dense = py::array_t<T, py::array::c_style | py::array::forcecast>::ensure(array);
  if (!dense) throw UserError(name + ": the array cannot be read");
  return {shape_of_array(array), std::vector<T>(dense.data(), dense.data() + dense.size())};
}

template Numbers<float> numbers_of(py::handle, const Sizes&, const std::string&, const std::string&);
template Numbers<double> numbers_of(py::handle, const Sizes&, const std::string&, const std::string&);

Vector3<double> vector_of(py::handle object, const std::string& name) {
  return Vector3<double>(numbers_of<double>(object, {3}, name, "[3]").values.data());
}

Rigid<double> rigid_of(py::handle object, const std::string& name) {
  const std::vector<double> values = numbers_of<double>(object, {4, 4}, name, "[4,4]").values;
  Matrix4<double> matrix;
  for (int i = 0; i < 16; ++i) matrix(i / 4, i % 4) = values[static_cast<std::size_t>(i)];
  return rigid_from_matrix(matrix, name);
}

py::array_t<double> array_of(const Vector3<double>& vector) {
  return array_of(std::vector<double>(vector.data(), vector.data() + 3), {3});
}

py::array_t<double> array_of(const Rigid<double>& transform) {
  const Matrix4<double> matrix = matrix_from_rigid(transform);
  std::vector<double> values(16);
  for (int i = 0; i < 16; ++i) values[static_cast<std::size_t>(i)] = matrix(i / 4, i % 4);
  return array_of(std::move(values), {4, 4});
}

py::array rounded_array(const std::vector<double>& values, Sizes shape, bool is_float) {
  if (is_float) return array_of(std::vector<float>(values.begin(), values.end()), std::move(shape));
  return array_of(std::vector<double>(values), std::move(shape));
}

py::array_t<float> array_of(const Image& image) {
  return array_of(to_interleaved(image), {image.height(), image.width(), image.channels()});
}

Image image_of(py::handle object, const std::string& name) {
  const std::string text = "[H,W] or [H,W,C]";
  const py::array array = real_array(object, name, text);
  const Numbers<float> pixels = numbers_of<float>(array, Sizes(array.ndim() == 2 ? 2 : 3, -1), name, text);
  const py::ssize_t channels = pixels.shape.size() == 3 ? pixels.shape[2] : 1;
  constexpr py::ssize_t kMost = std::numeric_limits<int>::max();
  if (channels < 1 || channels > kMost || pixels.shape[0] > kMost || pixels.shape[1] > kMost)
    throw UserError(name + ": an array " + shape_text(pixels.shape) + "; allowed: " + text + " with C of 1 or more");
  return from_interleaved(pixels.values, static_cast<int>(pixels.shape[0]), static_cast<int>(pixels.shape[1]),
                          static_cast<int>(channels));
}

}  // namespace hsi4d::python
