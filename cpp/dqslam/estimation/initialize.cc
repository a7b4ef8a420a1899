#include "dqslam/estimation/initialize.h"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <array>
#include <cmath>
#include <stdexcept>

namespace dqslam {
namespace {

using Eigen::Vector3d;
using Eigen::Vector4d;

// Outward normal of the plane behind an edge, in the camera frame: (-+1, 0, +-x), (0, -+1, +-y).
Vector3d EdgeNormal(const Camera& camera, const Vector4d& box, int edge) {
  const int axis = edge % 2;
  const double outward = edge < 2 ? -1 : 1;
  const double focal = axis == 0 ? camera.fx : camera.fy;
  const double principal = axis == 0 ? camera.cx : camera.cy;
  Vector3d normal = Vector3d::Zero();
  normal[axis] = outward;
  normal.z() = -outward * (box[edge] - principal) / focal;
  return normal;
}

Vector3d RayInWorld(const Camera& camera, const View& view) {
  const Vector3d ray((0.5 * (view.box[0] + view.box[2]) - camera.cx) / camera.fx,
                     (0.5 * (view.box[1] + view.box[3]) - camera.cy) / camera.fy,
                     1);
  return view.camera.camera_from_world.transpose() * ray;
}

double DepthOf(const View& view, const Vector3d& point) {
  return view.camera.camera_from_world.row(2).dot(point - view.camera.position);
}

// Point closest to the rays through the middles of the boxes.
Vector3d TriangulateMiddles(const Camera& camera, const std::vector<View>& views) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Vector3d b = Vector3d::Zero();
  for (const View& view : views) {
    const Vector3d ray = RayInWorld(camera, view).normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - ray * ray.transpose();
    A += across;
    b += across * view.camera.position;
  }
  return A.completeOrthogonalDecomposition().solve(b);
}

}  // namespace

SvdFit FitSvd(const Camera& camera, const std::vector<View>& views) {
  if (views.size() < 3) {
    throw std::invalid_argument("the SVD start needs 3 views of an object, it has " +
                                std::to_string(views.size()));
  }
  const Vector3d origin = TriangulateMiddles(camera, views);
  double scale = 0;
  for (const View& view : views) scale += (view.camera.position - origin).norm() / views.size();
  // If all views are from one place, the rays meet in the camera.  There is no distance to scale
  // by, and the fit is degenerate at any scale.
  if (scale < 1e-9 * (1 + origin.norm())) scale = 1;

  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(std::max<size_t>(4 * views.size(), 10), 10);
  Eigen::Index row = 0;
  for (const View& view : views) {
    for (int edge = 0; edge < 4; ++edge, ++row) {
      if (view.truncated[edge]) continue;
      const Vector3d n =
          (view.camera.camera_from_world.transpose() * EdgeNormal(camera, view.box, edge))
              .normalized();
      const double d = -n.dot(view.camera.position - origin) / scale;
      A.row(row) << n[0] * n[0], 2 * n[0] * n[1], 2 * n[0] * n[2], 2 * n[0] * d, n[1] * n[1],
          2 * n[1] * n[2], 2 * n[1] * d, n[2] * n[2], 2 * n[2] * d, d * d;
    }
  }
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(A, Eigen::ComputeThinV);
  const Eigen::Matrix<double, 10, 1> q = svd.matrixV().col(9);

  SvdFit fit;
  fit.singular_values = svd.singularValues();
  // The null space has one dimension if the gap between the last two singular values is clear.
  const auto& s = fit.singular_values;
  fit.degenerate = s[8] < 1e-8 * s[0] || s[8] < 3 * s[9] || std::abs(q[9]) < 1e-12;
  const Vector9d local = q.head<9>() / (fit.degenerate && q[9] == 0 ? 1e-12 : q[9]);
  Surface<double> surface = DualQuadricModel::Unpack(local.data());
  surface.center = origin + scale * surface.center;
  surface.shape *= scale * scale;
  fit.quadric = DualQuadricFromSurface(surface);
  return fit;
}

Vector9d IdentityQuadric() {
  return (Vector9d() << 1, 0, 0, 0, 1, 0, 0, 1, 0).finished();
}

Vector9d BackProject(const Camera& camera, const std::vector<View>& views, const SizePrior& prior) {
  const double radius = std::exp(prior.log_mean);
  Vector3d center = Vector3d::Zero();
  for (const View& view : views) {
    const double width = (view.box[2] - view.box[0]) / camera.fx;
    const double height = (view.box[3] - view.box[1]) / camera.fy;
    // A side that the border cut is too short.  The other side is used, or the longer one if both
    // are cut.
    const bool width_cut = view.truncated[0] || view.truncated[2];
    const bool height_cut = view.truncated[1] || view.truncated[3];
    const double side = width_cut && height_cut ? std::max(width, height)
                        : width_cut             ? height
                        : height_cut            ? width
                                                : std::sqrt(width * height);
    const double depth = 2 * radius / side;
    // The camera must be outside the sphere, even if the box is as wide as the image.
    const Vector3d in_world =
        view.camera.position + std::max(depth, 1.5 * radius) * RayInWorld(camera, view);
    center += in_world / views.size();
  }
  return Sphere(center, radius);
}

Vector9d FitSphere(const Camera& camera, const std::vector<View>& views, const SizePrior& prior) {
  const double expected_radius = std::exp(prior.log_mean);
  const Vector9d fallback = BackProject(camera, views, prior);
  std::vector<double> depth(views.size());
  for (size_t i = 0; i < views.size(); ++i) {
    depth[i] = std::max(DepthOf(views[i], fallback.head<3>()), expected_radius);
  }
  Vector4d solution = Vector4d::Zero();  // center, radius
  for (int pass = 0; pass < 3; ++pass) {
    const double prior_weight = 1 / (expected_radius * prior.log_sigma);
    Eigen::Matrix4d A = Eigen::Matrix4d::Zero();
    Vector4d b = Vector4d::Zero();
    A(3, 3) = prior_weight * prior_weight;
    b[3] = A(3, 3) * expected_radius;
    for (size_t i = 0; i < views.size(); ++i) {
      const View& view = views[i];
      Eigen::Matrix4d rows;
      Vector4d offsets;
      for (int edge = 0; edge < 4; ++edge) {
        const Vector3d normal = EdgeNormal(camera, view.box, edge);
        const double focal = edge % 2 == 0 ? camera.fx : camera.fy;
        const double weight = view.truncated[edge] ? 0 : focal / depth[i];
        rows.row(edge) << weight * (view.camera.camera_from_world.transpose() * normal).transpose(),
            weight * normal.norm();
        offsets[edge] = rows.row(edge).head<3>().dot(view.camera.position);
      }
      rows = view.sqrt_information * rows;
      offsets = view.sqrt_information * offsets;
      A += rows.transpose() * rows;
      b += rows.transpose() * offsets;
    }
    solution = A.ldlt().solve(b);
    if (!solution.allFinite() || solution[3] <= 0) return fallback;
    for (size_t i = 0; i < views.size(); ++i) {
      depth[i] = DepthOf(views[i], solution.head<3>());
      if (depth[i] <= solution[3]) return fallback;
    }
  }
  return Sphere(solution.head<3>(), solution[3]);
}

}  // namespace dqslam
