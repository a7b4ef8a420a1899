#if __has_include(<glog/logging.h>)
#include <glog/logging.h>
#endif

#include "bindings.h"

PYBIND11_MODULE(_core, m) {
  m.doc() = "Geometry, costs and solvers of dqslam, in C++.";
#ifdef GOOGLE_STRIP_LOG  // glog's own, not its substitute in a Ceres without glog
  // Ceres reports every rejected step at length on stderr; the summary says it in a number.
  FLAGS_minloglevel = google::GLOG_FATAL;
#endif
  dqslam::BindGeometry(m);
  dqslam::BindGraph(m);
  dqslam::BindSolve(m);
  dqslam::BindCovariance(m);
  dqslam::BindOnline(m);
  dqslam::BindTracks(m);
}
