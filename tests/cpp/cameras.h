// A plain camera, for tests that need no more of it than round numbers.
#pragma once

#include "dqslam/geometry/camera.h"

namespace dqslam {

inline Camera MakeCamera() {
  Camera camera;
  camera.fx = 500;
  camera.fy = 400;
  camera.cx = 320;
  camera.cy = 240;
  camera.width = 640;
  camera.height = 480;
  return camera;
}

}  // namespace dqslam
