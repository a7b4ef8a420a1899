#include "dqslam/estimation/shape_fitter.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dqslam/costs/box_chi_square.h"
#include "dqslam/estimation/graduated.h"
#include "dqslam/estimation/repair.h"
#include "dqslam/geometry/body.h"

namespace dqslam {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// At first, a shape other than an ellipsoid must explain the boxes of an object better by this, in
// half squared sigmas.
constexpr double kEvidence = 5;
// Another candidate must be better by this.
constexpr double kBetter = 0.05;
constexpr int kYaws = 6;   // rotations about the vertical, within a quarter turn
constexpr int kTries = 4;  // starts that are minimized from, of all that are compared
constexpr int kIterations = 30;
// Minima of a body by itself that differ by less are the same; those that are higher by up to kNear
// may be lower when all bodies and poses move.
constexpr double kSameMinimum = 1e-3, kNear = 300;
constexpr size_t kAlternatives = 2;
// Half-lengths over the widths of the ellipsoid that fits the same boxes.
constexpr double kShares[] = {0.75, 0.9};

// Rotations world_from_object from which a body may reach its minimum: along the axes of the
// ellipsoid, and about the vertical.
std::vector<Matrix3d> Rotations(const Matrix3d& shape, const Vector3d& up, bool is_cylinder) {
  const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(shape);
  Matrix3d axes = eigen.eigenvectors();
  if (axes.determinant() < 0) axes.col(0) *= -1;
  const Matrix3d upright = Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), up).matrix();
  std::vector<Matrix3d> rotations{axes};
  if (is_cylinder) {
    for (const int first : {1, 2}) {
      Matrix3d turned;
      for (int i = 0; i < 3; ++i) turned.col(i) = axes.col((i + first) % 3);
      rotations.push_back(turned);
    }
    rotations.push_back(upright);
    return rotations;
  }
  for (int yaw = 0; yaw < kYaws; ++yaw) {
    const double angle = M_PI / 2 * yaw / kYaws;
    rotations.push_back(upright * Eigen::AngleAxisd(angle, Vector3d::UnitZ()).matrix());
  }
  return rotations;
}

Matrix3d RotationOf(const Vector9d& parameters) {
  Matrix3d rotation;
  ceres::AngleAxisToRotationMatrix(parameters.data() + 6, rotation.data());
  return rotation;
}

}  // namespace

ShapeFitter::ShapeFitter(const SolveContext& context, const Stage& all, State* state)
    : context_(context),
      all_(all),
      state_(*state),
      ellipsoids_(state->landmarks),
      handicap_{0, kEvidence, kEvidence} {
  all_.loss = IsRobust(context.options.loss) ? Loss::kCauchy : Loss::kNone;
  all_.max_iterations = kIterations;
  all_.minimizer = Minimizer::kLevenbergMarquardt;
  all_.function_tolerance = 1e-5;
}

void ShapeFitter::CountShapes(const std::vector<Shape>& wanted) {
  std::array<double, 3> counts = {1, 1, 1};
  for (size_t object = 0; object < wanted.size(); ++object) {
    if (wanted[object] == Shape::kAuto) ++counts[static_cast<int>(state_.shapes[object])];
  }
  const double total = counts[0] + counts[1] + counts[2];
  for (int shape = 0; shape < 3; ++shape) handicap_[shape] = -std::log(counts[shape] / total);
}

bool ShapeFitter::Improve(int object, const std::vector<Shape>& shapes) {
  const ShapeCandidate now = Minimized(object, Now(object));
  const ShapeCandidate ellipsoid =
      now.shape == Shape::kEllipsoid
          ? now
          : Minimized(object, {Shape::kEllipsoid, ellipsoids_.row(object)});
  ellipsoids_.row(object) = ellipsoid.parameters;
  ShapeCandidate best;
  for (const Shape shape : shapes) {
    ShapeCandidate found = shape == now.shape ? now : ShapeCandidate();
    if (shape == Shape::kEllipsoid) {
      found = ellipsoid;
    } else {
      for (const ShapeCandidate& start : Starts(object, shape)) {
        const ShapeCandidate reached = Minimized(object, start);
        if (reached.cost < found.cost) found = reached;
      }
    }
    if (found.cost + HandicapOf(shape) < best.cost + HandicapOf(best.shape)) best = found;
  }
  const bool may_stay = std::find(shapes.begin(), shapes.end(), now.shape) != shapes.end();
  const double before = now.cost + HandicapOf(now.shape) - kBetter;
  if (!std::isfinite(best.cost) || (may_stay && best.cost + HandicapOf(best.shape) > before)) {
    return false;
  }
  Set(object, best);
  return true;
}

std::vector<ShapeCandidate> ShapeFitter::Alternatives(int object) {
  const ShapeCandidate now = Minimized(object, Now(object));
  std::vector<ShapeCandidate> found;
  for (const ShapeCandidate& start : Starts(object, now.shape)) {
    const ShapeCandidate reached = Minimized(object, start);
    const auto is_same = [&](const ShapeCandidate& one) {
      return std::abs(one.cost - reached.cost) < kSameMinimum;
    };
    if (!(reached.cost < now.cost + kNear) || is_same(now) ||
        std::any_of(found.begin(), found.end(), is_same)) {
      continue;
    }
    found.push_back(reached);
  }
  std::sort(
      found.begin(), found.end(), [](const auto& a, const auto& b) { return a.cost < b.cost; });
  if (found.size() > kAlternatives) found.resize(kAlternatives);
  return found;
}

std::vector<ShapeCandidate> ShapeFitter::FreshStarts(int object) const {
  std::vector<ShapeCandidate> starts;
  for (int yaw = 0; yaw < kYaws; ++yaw) {
    starts.push_back(Upright(object, state_.shapes[object], M_PI / 2 * yaw / kYaws));
  }
  return starts;
}

void ShapeFitter::Set(int object, const ShapeCandidate& candidate) {
  state_.shapes[object] = candidate.shape;
  state_.landmarks.row(object) = candidate.parameters;
}

ShapeCandidate ShapeFitter::Now(int object) const {
  return {state_.shapes[object], state_.landmarks.row(object)};
}

// Minimizes an object by itself, and leaves the state as it was.
ShapeCandidate ShapeFitter::Minimized(int object, ShapeCandidate candidate) {
  const ShapeCandidate kept = Now(object);
  Set(object, candidate);
  const std::vector<int>& boxes = context_.prepared.boxes_of_object[object];
  const Summary summary = Optimize(context_, StageOfObject(all_, boxes, context_.graph()), &state_);
  candidate.parameters = state_.landmarks.row(object);
  candidate.cost = std::isfinite(summary.final_cost) ? summary.final_cost
                                                     : std::numeric_limits<double>::infinity();
  Set(object, kept);
  return candidate;
}

// The best start at each of some rotations, and of these the ones with the lowest costs.
std::vector<ShapeCandidate> ShapeFitter::Starts(int object, Shape shape) const {
  const Surface<double> ellipsoid = EllipsoidModel::Unpack(ellipsoids_.row(object).data());
  const Vector3d& up = context_.graph().scene_priors.up;
  const double height = std::sqrt(up.dot(ellipsoid.shape * up));
  std::vector<ShapeCandidate> starts;
  for (const Matrix3d& rotation : Rotations(ellipsoid.shape, up, shape == Shape::kCylinder)) {
    const Vector3d widths =
        (rotation.transpose() * ellipsoid.shape * rotation).diagonal().cwiseSqrt();
    ShapeCandidate best;
    for (const double share : kShares) {
      // The ellipsoid may be much too long or too short along a side that no box shows.
      for (const Vector3d& sides : {widths, Vector3d(Vector3d::Constant(height))}) {
        const Vector9d parameters = BodyParameters(ellipsoid.center, share * sides, rotation);
        const double cost = CostOf(object, shape, parameters);
        if (cost < best.cost) best = {shape, parameters, cost};
      }
    }
    starts.push_back(best);
  }
  if (state_.shapes[object] == shape) AddTurned(object, &starts);
  const auto end = starts.begin() + std::min<std::ptrdiff_t>(kTries, starts.size());
  std::partial_sort(starts.begin(), end, starts.end(), [](const auto& a, const auto& b) {
    return a.cost < b.cost;
  });
  starts.erase(end, starts.end());
  // Upright, with equal sides: from there, most bodies that many boxes show are reached.
  for (const double yaw : {0.0, M_PI / 4}) starts.push_back(Upright(object, shape, yaw));
  return starts;
}

// An upright body with equal sides.  Most bodies that many boxes show are reached from there.
ShapeCandidate ShapeFitter::Upright(int object, Shape shape, double yaw) const {
  const Surface<double> ellipsoid = EllipsoidModel::Unpack(ellipsoids_.row(object).data());
  const Matrix3d upright =
      Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), context_.graph().scene_priors.up)
          .matrix();
  const double side = 0.8 * std::cbrt(std::sqrt(ellipsoid.shape.determinant()));
  const Matrix3d rotation = upright * Eigen::AngleAxisd(yaw, Vector3d::UnitZ()).matrix();
  return {shape, BodyParameters(ellipsoid.center, Vector3d::Constant(side), rotation), 0};
}

// The object as it is, turned about each of its axes.
void ShapeFitter::AddTurned(int object, std::vector<ShapeCandidate>* starts) const {
  const Shape shape = state_.shapes[object];
  const Vector9d now = state_.landmarks.row(object);
  const Vector3d half_lengths = now.segment<3>(3).array().exp();
  for (int axis = 0; axis < 3; ++axis) {
    for (const double angle : {-M_PI / 4, -M_PI / 8, M_PI / 8, M_PI / 4}) {
      const Eigen::AngleAxisd turn(angle, Vector3d::Unit(axis));
      const Vector9d parameters =
          BodyParameters(now.head<3>(), half_lengths, RotationOf(now) * turn.matrix());
      starts->push_back({shape, parameters, CostOf(object, shape, parameters)});
    }
  }
}

// The sum of log(1 + chi-square) over the boxes: one that is far off decides nothing.
double ShapeFitter::CostOf(int object, Shape shape, const Vector9d& parameters) const {
  const Graph& graph = context_.graph();
  const Body<double> body = RoundedModel(shape).Unpack(parameters.data());
  double cost = 0;
  for (const int row : context_.prepared.boxes_of_object[object]) {
    const CameraInWorld<double> camera =
        LocateCamera(context_.prepared, state_, graph.boxes.pose[row]);
    const double chi_square = BoxChiSquare(ToCamera(camera, body),
                                           graph.camera,
                                           graph.boxes.box.row(row),
                                           graph.boxes.truncated.row(row),
                                           context_.prepared.box_sqrt_information[row]);
    cost += std::log1p(std::min(chi_square, 1e6));
  }
  return cost;
}

}  // namespace dqslam
