// NumPy arrays: numbers taken from them, and memory of ours that they look at.
#pragma once

#include <memory>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <string>
#include <utility>
#include <vector>

#include "core/camera.h"
#include "core/image.h"

namespace hsi4d::python {

namespace py = pybind11;

/// Sizes along the axes of an array; where one is asked for, −1 stands for any.
using Sizes = std::vector<py::ssize_t>;

/// Numbers of an array, row-major.
template <class T>
struct Numbers {
  Sizes shape;
  std::vector<T> values;
};

/// The numbers of an array, or of what NumPy makes one of. Rounded where T is narrower than what the array holds.
/// @param name  what messages call it
/// @param text  the allowed shape in words: "[N,3]"
/// Throws UserError: another shape, or something else than real numbers.
template <class T>
Numbers<T> numbers_of(py::handle object, const Sizes& shape, const std::string& name, const std::string& text);

/// "[5,2]"
std::string shape_text(const Sizes& shape);

/// An array [3] as a vector.
Vector3<double> vector_of(py::handle object, const std::string& name);
/// An array [4,4] as a rigid transform. Throws as rigid_from_matrix.
Rigid<double> rigid_of(py::handle object, const std::string& name);

py::array_t<double> array_of(const Vector3<double>& vector);
py::array_t<double> array_of(const Rigid<double>& transform);

/// An array that takes over numbers, without a copy.
template <class T>
py::array_t<T> array_of(std::vector<T> values, Sizes shape) {
  auto kept = std::make_unique<std::vector<T>>(std::move(values));
  T* const data = kept->data();
  const py::capsule owner(kept.release(), [](void* numbers) { delete static_cast<std::vector<T>*>(numbers); });
  return py::array_t<T>(std::move(shape), data, owner);
}

/// As above, of doubles that are floats where `is_float` says so.
py::array rounded_array(const std::vector<double>& values, Sizes shape, bool is_float);

/// An array that looks at numbers of `owner` and keeps it alive. Writing to it writes to them.
template <class T>
py::array_t<T> view_of(std::vector<T>& values, Sizes shape, py::handle owner) {
  return py::array_t<T>(std::move(shape), values.data(), owner);
}
/// As above; it cannot be written.
template <class T>
py::array_t<T> view_of(const std::vector<T>& values, Sizes shape, py::handle owner) {
  py::array_t<T> view(std::move(shape), values.data(), owner);
  py::detail::array_proxy(view.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return view;
}

/// [H,W,C] of an image.
py::array_t<float> array_of(const Image& image);
/// The image of an array [H,W] or [H,W,C].
Image image_of(py::handle object, const std::string& name);

extern template Numbers<float> numbers_of(py::handle, const Sizes&, const std::string&, const std::string&);
extern template Numbers<double> numbers_of(py::handle, const Sizes&, const std::string&, const std::string&);

}  // namespace hsi4d::python
