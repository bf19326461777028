// Gaussians as arrays, and their files.
#include "splat/gaussians.h"

#include <algorithm>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "core/check.h"
#include "pipelines/draw/image_of_scene.h"
#include "python/arrays.h"
#include "python/parts.h"
#include "splat/files/splat_file.h"

namespace hsi4d::python {

namespace {

namespace fs = std::filesystem;

/// Gaussians of which some may be bent by a body: what renders take (PosedGaussians).
using Splats = PosedGaussians;

/// Degree of harmonics of K coefficients. Throws UserError.
int degree_of(py::ssize_t coefficients) {
  for (int degree = 0; degree <= kHighestShDegree; ++degree) {
    if ((degree + 1) * (degree + 1) == coefficients) return degree;
  }
  throw UserError("sh: " + std::to_string(coefficients) + " coefficients a Gaussian; allowed: 1, 4, 9 or 16");
}

Splats splats_of(py::handle means, py::handle quats, py::handle log_scales, py::handle opacity_logits, py::handle sh,
                 py::handle origin_world) {
  Splats splats;
  Gaussians& g = splats.gaussians;
  Numbers<float> harmonics = numbers_of<float>(sh, {-1, -1, 3}, "sh", "[N,K,3]");
  const py::ssize_t count = harmonics.shape[0];
  g.sh_degree = degree_of(harmonics.shape[1]);
  g.sh = std::move(harmonics.values);
  const std::string n = std::to_string(count);
  g.means = numbers_of<float>(means, {count, 3}, "means", "[" + n + ",3], as sh has " + n + " rows").values;
  g.quats = numbers_of<float>(quats, {count, 4}, "quats", "[" + n + ",4], as sh has " + n + " rows").values;
  g.log_scales =
      numbers_of<float>(log_scales, {count, 3}, "log_scales", "[" + n + ",3], as sh has " + n + " rows").values;
  g.opacity_logits =
      numbers_of<float>(opacity_logits, {count}, "opacity_logits", "[" + n + "], as sh has " + n + " rows").values;
  g.origin_world = vector_of(origin_world, "origin_world");
  return splats;
}

Sizes shape_of_member(const Gaussians& g, py::ssize_t width) { return {g.count(), width}; }

/// A property that looks at a member, and is written number by number: views stay where they are.
template <class Shape>
void add_array(py::class_<Splats>& type, const char* name, std::vector<float> Gaussians::*member, Shape shape,
               const char* text) {
  type.def_property(
      name,
      [member, shape](const py::object& self) {
        Gaussians& g = self.cast<Splats&>().gaussians;
        return view_of(g.*member, shape(g), self);
      },
      [name, member, shape](Splats& splats, py::handle values) {
        const Sizes wanted = shape(splats.gaussians);
        const Numbers<float> read = numbers_of<float>(values, wanted, name, shape_text(wanted));
        std::copy(read.values.begin(), read.values.end(), (splats.gaussians.*member).begin());
      },
      text);
}

Splats read(const fs::path& path, py::handle origin_world) {
  const Vector3<double> origin = vector_of(origin_world, "origin_world");
  const Released released;
  return {read_splats_with_warnings(path.string(), origin).gaussians, {}};
}

void check_unposed(const Splats& splats, const char* doing) {
  if (!splats.transforms.empty())
    throw UserError(std::string("gaussians: they are bent by a body's pose; what ") + doing + " takes is not");
}

std::vector<std::pair<std::string, Index>> write(const fs::path& path, const Splats& splats, int spz_version,
                                                 bool antialiased) {
  check_unposed(splats, "a file");
  SplatWriteOptions options;
  options.spz.version = spz_version;
  options.spz.antialiased = antialiased;
  return write_splats(path.string(), splats.gaussians, options);
}

Splats select(const Splats& splats, py::handle rows) {
  const py::array array = py::module_::import("numpy").attr("asarray")(rows);
  const char kind = array.dtype().kind();
  if (array.ndim() != 1 || (kind != 'i' && kind != 'u' && array.size() > 0))
    throw UserError("rows: an array of " + std::string(py::str(array.dtype())) + " with " +
                    std::to_string(array.ndim()) + " axes; allowed: [M] of whole numbers");
  const auto numbers = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>::ensure(array);
  std::vector<Index> chosen(numbers.data(), numbers.data() + numbers.size());
  for (const Index row : chosen) {
    if (row < 0 || row >= splats.gaussians.count())
      throw UserError("rows: " + std::to_string(row) + "; allowed: 0 to " +
                      std::to_string(splats.gaussians.count() - 1));
  }
  Splats result{selected(splats.gaussians, chosen), {}};
  if (splats.transforms.empty()) return result;
  for (const Index row : chosen)
    result.transforms.insert(result.transforms.end(), splats.transforms.begin() + 12 * row,
                             splats.transforms.begin() + 12 * (row + 1));
  return result;
}

Splats with_degree(const Splats& splats, int degree) {
  if (degree < 0 || degree > kHighestShDegree)
    throw UserError("degree: " + std::to_string(degree) + "; allowed: 0 to " + std::to_string(kHighestShDegree));
  return {with_sh_degree(splats.gaussians, degree), splats.transforms};
}

std::string text_of(const Splats& splats) {
  return "<hsi4d.Gaussians, " + std::to_string(splats.gaussians.count()) + " of degree " +
         std::to_string(splats.gaussians.sh_degree) + (splats.transforms.empty() ? ">" : ", posed>");
}

}  // namespace

void add_gaussians(py::module_& module) {
  py::class_<Splats> type(module, "Gaussians",
                          "N Gaussians, the numbers as files hold them: before exp, sigmoid and normalisation. The\n"
                          "arrays are views: what is written to them is the Gaussians', and they keep it alive.");
  type.def(py::init(&splats_of), py::arg("means"), py::arg("quats"), py::arg("log_scales"), py::arg("opacity_logits"),
           py::arg("sh"), py::arg("origin_world") = py::make_tuple(0, 0, 0));
  add_array(
      type, "means", &Gaussians::means, [](const Gaussians& g) { return shape_of_member(g, 3); },
      "[N,3] float32, metres, relative to origin_world.");
  add_array(
      type, "quats", &Gaussians::quats, [](const Gaussians& g) { return shape_of_member(g, 4); },
      "[N,4] float32, wxyz, of any length.");
  add_array(
      type, "log_scales", &Gaussians::log_scales, [](const Gaussians& g) { return shape_of_member(g, 3); },
      "[N,3] float32, natural logarithm of metres.");
  add_array(
      type, "opacity_logits", &Gaussians::opacity_logits, [](const Gaussians& g) { return Sizes{g.count()}; },
      "[N] float32.");
  add_array(
      type, "sh", &Gaussians::sh,
      [](const Gaussians& g) {
        return Sizes{g.count(), g.sh_coefficients(), 3};
      },
      "[N,K,3] float32, spherical harmonics, K = (sh_degree + 1)^2.");
  type.def_property_readonly(
          "sh_degree", [](const Splats& splats) { return splats.gaussians.sh_degree; }, "0 to 3.")
      .def_property_readonly(
          "origin_world", [](const Splats& splats) { return array_of(splats.gaussians.origin_world); },
          "[3] what the means are relative to, metres.")
      .def_property_readonly(
          "transforms",
          [](const py::object& self) -> py::object {
            const Splats& splats = self.cast<const Splats&>();
            if (splats.transforms.empty()) return py::none();
            return view_of(splats.transforms, {splats.gaussians.count(), 3, 4}, self);
          },
          "[N,3,4] how a body's pose bends each Gaussian, in the world; None: not at all. It cannot be written.")
      .def("__len__", [](const Splats& splats) { return splats.gaussians.count(); })
      .def("__repr__", &text_of)
      .def(
          "copy", [](const Splats& splats) { return splats; }, "The same numbers in memory of their own.")
      .def("selected", &select, py::arg("rows"), "The Gaussians of these rows [M], in this order.")
      .def("with_sh_degree", &with_degree, py::arg("degree"),
           "The same with harmonics of another degree, 0 to 3: those above it left out, or zeros added.");
  module.def("read_gaussians", &read, py::arg("path"), py::arg("origin_world") = py::make_tuple(0, 0, 0),
             "Gaussians of a file in any format (docs/formats.md): .ply of INRIA's and compressed, .splat, .spz.\n\n"
             "origin_world: [3] what means become relative to, metres, before they are rounded to float32. What the\n"
             "reader leaves out or puts right is told in the log.");
  module.def("write_gaussians", &write, py::arg("path"), py::arg("gaussians"), py::arg("spz_version") = 3,
             py::arg("antialiased") = false, WhileReleased(),
             "Writes Gaussians in the format of the path's ending. Returns what it could not hold beyond rounding: a\n"
             "list of (reason, numbers).");
}

}  // namespace hsi4d::python
