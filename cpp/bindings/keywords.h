// Plain structs in Python: made from keywords, and shown by what is not the default.
#pragma once

#include <pybind11/pybind11.h>

#include <string>

namespace dqslam {

/// A struct whose attributes are those that keywords name, the others being the defaults.
template <typename Struct>
Struct FromKeywords(const pybind11::kwargs& values) {
  pybind11::object made = pybind11::cast(Struct());
  for (const auto& [name, value] : values) pybind11::setattr(made, name, value);
  return made.cast<Struct>();
}

/// Shows the attributes that are not the default, as in "SolveOptions(loss=CAUCHY)".
template <typename Struct>
std::string ShowChanges(const pybind11::object& shown) {
  namespace py = pybind11;
  const py::object type = py::type::of(shown);
  const py::object plain = py::cast(Struct());
  std::string text;
  for (const auto& [name, member] : py::dict(type.attr("__dict__"))) {
    if (!PyObject_TypeCheck(member.ptr(), &PyProperty_Type)) continue;
    py::object value = shown.attr(name);
    if (py::hasattr(value, "ndim") && value.attr("ndim").cast<int>() > 1) continue;  // takes lines
    if (py::repr(value).equal(py::repr(plain.attr(name)))) continue;
    if (py::hasattr(value, "name")) value = value.attr("name");  // of an enumeration
    if (py::isinstance<py::float_>(value)) value = py::str("{:g}").format(value);
    text += (text.empty() ? "" : ", ") + std::string(py::str("{}={}").format(name, value));
  }
  return std::string(py::str(type.attr("__name__"))) + "(" + text + ")";
}

}  // namespace dqslam
