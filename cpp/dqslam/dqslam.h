// All of the library but the Ceres costs, whose headers are included one by one: costs/*.h.
#pragma once

#include "dqslam/estimation/covariance.h"
#include "dqslam/estimation/solve.h"
#include "dqslam/geometry/batch.h"
#include "dqslam/geometry/blocks.h"
#include "dqslam/geometry/camera.h"
#include "dqslam/geometry/ellipsoid.h"
#include "dqslam/geometry/pose.h"
#include "dqslam/geometry/shape.h"
#include "dqslam/online/observations.h"
#include "dqslam/online/options.h"
#include "dqslam/online/relocalize.h"
#include "dqslam/online/session.h"
#include "dqslam/problem/graph.h"
#include "dqslam/problem/options.h"
