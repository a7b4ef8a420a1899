// How well a box fits the projection of an object.  Inliers of a solve, the gates of an association
// and the misfits of a report all come from this number.
#pragma once

#include "dqslam/geometry/objects_in_camera.h"

namespace dqslam {

/// Chi-square of an observed box, of 4 degrees of freedom where all edges count: what BoxCost comes
/// to when its one-sided edges are those of this surface.  Infinite unless strictly in front.
double BoxChiSquare(const Surface<double>& in_camera,
                    const Camera& camera,
                    const Eigen::Vector4d& observed,
                    const EdgeFlags& truncated,
                    const Eigen::Matrix4d& sqrt_information);
double BoxChiSquare(const Body<double>& in_camera,
                    const Camera& camera,
                    const Eigen::Vector4d& observed,
                    const EdgeFlags& truncated,
                    const Eigen::Matrix4d& sqrt_information);

/// Chi-square of box i for object i from pose i, shape (n).  Boxes (n, 4) [undistorted px] with
/// their covariances (n, 16) [px^2] and the edges that the image border cut (n, 4).
/// Throws std::invalid_argument naming the table, and the row of a covariance that is none.
Eigen::VectorXd BoxChiSquareRows(PoseModel model,
                                 const Camera& camera,
                                 const RowMatrix& poses,
                                 const RowMatrix& ellipsoids,
                                 const RowMatrix& boxes,
                                 const RowMatrix& covariances,
                                 const BoolTable& truncated);
Eigen::VectorXd BoxChiSquareRows(PoseModel model,
                                 const Camera& camera,
                                 const RowMatrix& poses,
                                 const BodyTable& bodies,
                                 const RowMatrix& boxes,
                                 const RowMatrix& covariances,
                                 const BoolTable& truncated);

}  // namespace dqslam
