#include "dqslam/estimation/shapes.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
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
constexpr int kRounds = 8;
constexpr int kYaws = 6;   // rotations about the vertical, within a quarter turn
constexpr int kTries = 4;  // starts that are minimized from, of all that are compared
constexpr int kIterations = 30;
// Half-lengths over the widths of the ellipsoid that fits the same boxes.
constexpr double kShares[] = {0.75, 0.9};

struct Candidate {
  Shape shape = Shape::kEllipsoid;
  Vector9d parameters = Vector9d::Zero();
  double cost = std::numeric_limits<double>::infinity();
};

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

class ShapeFitter {
 public:
  ShapeFitter(const SolveContext& context, const Stage& all, State* state)
      : context_(context), all_(all), state_(*state), ellipsoids_(state->landmarks) {
    all_.loss = IsRobust(context.options.loss) ? Loss::kCauchy : Loss::kNone;
    all_.max_iterations = kIterations;
    all_.minimizer = Minimizer::kLevenbergMarquardt;
    all_.function_tolerance = 1e-5;
  }

  // Counts the shapes of the objects among which a shape is chosen: a shape that many have is
  // likely for the others.
  void CountShapes(const std::vector<Shape>& wanted) {
    std::array<double, 3> counts = {1, 1, 1};
    for (size_t object = 0; object < wanted.size(); ++object) {
      if (wanted[object] == Shape::kAuto) ++counts[static_cast<int>(state_.shapes[object])];
    }
    const double total = counts[0] + counts[1] + counts[2];
    for (int shape = 0; shape < 3; ++shape) handicap_[shape] = -std::log(counts[shape] / total);
  }

  // Changes an object to the best candidate, if that is better than what it is.
  bool Improve(int object, const std::vector<Shape>& shapes) {
    const Candidate now = Minimized(object, {state_.shapes[object], state_.landmarks.row(object)});
    const Candidate ellipsoid =
        now.shape == Shape::kEllipsoid
            ? now
            : Minimized(object, {Shape::kEllipsoid, ellipsoids_.row(object)});
    ellipsoids_.row(object) = ellipsoid.parameters;
    Candidate best;
    for (const Shape shape : shapes) {
      Candidate found = shape == now.shape ? now : Candidate();
      if (shape == Shape::kEllipsoid) {
        found = ellipsoid;
      } else {
        for (const Candidate& start : Starts(object, shape)) {
          const Candidate reached = Minimized(object, start);
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

 private:
  double HandicapOf(Shape shape) const { return handicap_[static_cast<int>(shape)]; }

  void Set(int object, const Candidate& candidate) {
    state_.shapes[object] = candidate.shape;
    state_.landmarks.row(object) = candidate.parameters;
  }

  // Minimizes an object by itself, and leaves the state as it was.
  Candidate Minimized(int object, Candidate candidate) {
    const Candidate kept{state_.shapes[object], state_.landmarks.row(object)};
    Set(object, candidate);
    const std::vector<int>& boxes = context_.prepared.boxes_of_object[object];
    const Summary summary =
        Optimize(context_, StageOfObject(all_, boxes, context_.graph()), &state_);
    candidate.parameters = state_.landmarks.row(object);
    candidate.cost = std::isfinite(summary.final_cost) ? summary.final_cost
                                                       : std::numeric_limits<double>::infinity();
    Set(object, kept);
    return candidate;
  }

  // The best start at each of some rotations, and of these the ones with the lowest costs.
  std::vector<Candidate> Starts(int object, Shape shape) const {
    const Surface<double> ellipsoid = EllipsoidModel::Unpack(ellipsoids_.row(object).data());
    const Vector3d& up = context_.graph().scene_priors.up;
    const double height = std::sqrt(up.dot(ellipsoid.shape * up));
    std::vector<Candidate> starts;
    for (const Matrix3d& rotation : Rotations(ellipsoid.shape, up, shape == Shape::kCylinder)) {
      const Vector3d widths =
          (rotation.transpose() * ellipsoid.shape * rotation).diagonal().cwiseSqrt();
      Candidate best;
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
    return starts;
  }

  // The object as it is, turned about each of its axes.
  void AddTurned(int object, std::vector<Candidate>* starts) const {
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
  double CostOf(int object, Shape shape, const Vector9d& parameters) const {
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

  const SolveContext& context_;
  Stage all_;
  State& state_;
  RowMatrix ellipsoids_;                                        // that fit the same boxes
  std::array<double, 3> handicap_ = {0, kEvidence, kEvidence};  // of each shape
};

// The stage without the boxes of objects that they do not fit; it has no weights if all fit.
Stage WithoutStuckObjects(const SolveContext& context, const Stage& all, const State& state) {
  Stage others = all;
  others.loss = Loss::kNone;
  others.weights.clear();
  const std::vector<bool> stuck = StuckObjects(context, others, state);
  if (std::none_of(stuck.begin(), stuck.end(), [](bool is_stuck) { return is_stuck; })) {
    return others;
  }
  for (const int row : others.boxes) {
    others.weights.push_back(stuck[context.graph().boxes.object[row]] ? 0 : 1);
  }
  return others;
}

std::vector<Shape> ShapesToTry(Shape wanted) {
  if (wanted != Shape::kAuto) return {wanted};
  return {Shape::kEllipsoid, Shape::kCuboid, Shape::kCylinder};
}

}  // namespace

void FitShapes(const SolveContext& context, const Stage& all, State* state, Summary* summary) {
  const Graph& graph = context.graph();
  if (AreEllipsoids(graph.shapes)) return;
  State attempt = *state;
  if (attempt.shapes.empty()) attempt.shapes.assign(graph.num_objects(), Shape::kEllipsoid);
  ShapeFitter fitter(context, all, &attempt);
  Stage last = all;
  bool any = false;
  for (int round = 0; round < kRounds; ++round) {
    bool changed = false;
    for (int object = 0; object < graph.num_objects(); ++object) {
      if (graph.shapes[object] != Shape::kEllipsoid) {
        changed |= fitter.Improve(object, ShapesToTry(graph.shapes[object]));
      }
    }
    if (!changed) break;
    fitter.CountShapes(graph.shapes);
    any = true;
    const bool graduates =
        context.options.loss == Loss::kGncTls || context.options.loss == Loss::kGncGm;
    // An object that is still turned wrongly must not bend the path.
    Stage robust = all;
    robust.weights.clear();
    robust.loss = Loss::kCauchy;
    robust.function_tolerance = 1e-4;
    Append(Optimize(context, robust, &attempt), summary);
    const Stage others = WithoutStuckObjects(context, all, attempt);
    if (!others.weights.empty()) Append(Optimize(context, others, &attempt), summary);
    last = graduates ? InlierStage(context, attempt) : all;
  }
  if (!any) return;
  Append(Optimize(context, last, &attempt), summary);
  if (!summary->converged) {
    // Where an edge of a body is seen at its end, the dog-leg may step from side to side.
    last.minimizer = Minimizer::kLevenbergMarquardt;
    Append(Optimize(context, last, &attempt), summary);
  }
  *state = attempt;
}

}  // namespace dqslam
