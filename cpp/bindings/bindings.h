// One function per file of bindings.
#pragma once

#include <pybind11/pybind11.h>

namespace dqslam {

void BindGeometry(pybind11::module_& m);
void BindGraph(pybind11::module_& m);
void BindSolve(pybind11::module_& m);
void BindCovariance(pybind11::module_& m);
void BindOnline(pybind11::module_& m);
void BindTracks(pybind11::module_& m);

}  // namespace dqslam
