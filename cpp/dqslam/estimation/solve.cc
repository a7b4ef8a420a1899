#include "dqslam/estimation/solve.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>

#include "dqslam/estimation/graduated.h"
#include "dqslam/estimation/grow.h"
#include "dqslam/estimation/misfits.h"
#include "dqslam/estimation/repair.h"
#include "dqslam/estimation/shapes.h"
#include "dqslam/estimation/start_object.h"
#include "dqslam/geometry/body.h"
#include "dqslam/geometry/dispatch.h"
#include "dqslam/problem/checks.h"

namespace dqslam {
namespace {

constexpr int kAttempts = 3;
constexpr int kMaxRounds = 10;
// The largest share of boxes that may not fit: without a loss, or where another attempt can confirm
// that they are outliers, and where a robust loss is believed that they are.
constexpr double kMostMisfits = 0.05, kMostOutliers = 0.5;
constexpr double kSameCost = 10;  // half squared sigmas
// More than half of the boxes of an object with so many must fit, or its place is not certain.
constexpr int kSomeBoxes = 6;

void ValidateOptions(const SolveOptions& options) {
  const auto require = [](bool good, const char* what) {
    if (!good) throw std::invalid_argument(what);
  };
  require(options.algebraic_sigma > 0, "algebraic_sigma must be positive");
  require(options.loss_scale > 0, "loss_scale must be positive");
  require(options.outlier_chi_square > 0, "outlier_chi_square must be positive");
  require(options.max_iterations > 0, "max_iterations must be positive");
  require(options.function_tolerance > 0, "function_tolerance must be positive");
  require(options.grow_poses > 0, "grow_poses must be positive");
  require(options.grow_angle >= 0, "grow_angle must not be negative");
  require(options.grow_iterations > 0, "grow_iterations must be positive");
  require(options.grow_min_views > 0, "grow_min_views must be positive");
  require(options.threads > 0, "threads must be positive");
}

void ValidateShapes(const SolveOptions& options, const std::vector<Shape>& shapes) {
  if (AreEllipsoids(shapes) || (options.landmark_model == LandmarkModel::kEllipsoid &&
                                options.residual == Residual::kTangentThenBox)) {
    return;
  }
  throw std::invalid_argument(
      "shapes: cuboids and cylinders need the ellipsoid model and the residual TANGENT_THEN_BOX");
}

void ValidateStart(const Graph& graph, const State& start) {
  CheckState("start", graph, start);
  if (graph.pose_model == PoseModel::kSe3 &&
      ((start.poses.rightCols<4>().rowwise().norm().array() - 1).abs() > 1e-6).any()) {
    throw std::invalid_argument("start: the quaternions of the poses must be unit");
  }
}

class Solver {
 public:
  explicit Solver(const SolveContext& context)
      : context_(context),
        prepared_(context.prepared),
        graph_(context.graph()),
        options_(context.options) {}

  /// Why a state cannot be the answer, in words; empty if nothing speaks against it.  At most the
  /// given share of the boxes may be beyond the 99.9 % quantile.
  std::string Objection(const State& state, double most_misfits) const {
    if (IsAlgebraic(options_.residual)) return "";
    const Mask inliers = FitsAt(state, kBoxChiSquare999);
    const double misfits = 1.0 - inliers.cast<double>().mean();
    if (misfits > most_misfits) {
      return std::to_string(static_cast<int>(std::round(100 * misfits))) +
             " % of the boxes do not fit";
    }
    if (IsTorn(prepared_, state)) return "the path does not fit the odometry";
    if (IsRobust(options_.loss)) return "";
    const std::vector<bool> stuck = StuckObjects(context_, BatchStage(context_), state);
    const auto count = std::count(stuck.begin(), stuck.end(), true);
    return count > 0 ? std::to_string(count) + " objects do not fit their boxes" : "";
  }

  /// The cost by which attempts are compared: that of the boxes that fit, and the threshold for
  /// each of the others.
  double TruncatedCost(const State& state, const Summary& summary) const {
    return Graduates() ? dqslam::TruncatedCost(context_, state, summary.final_cost)
                       : summary.final_cost;
  }

  /// Singular values of every object's SVD fit at the initial poses; NaN for fewer than 3 views.
  RowMatrix SvdSingularValues() const {
    State state{graph_.initial_poses, RowMatrix()};
    RowMatrix values = RowMatrix::Constant(graph_.num_objects(), 10, std::nan(""));
    for (int object = 0; object < graph_.num_objects(); ++object) {
      const std::vector<View> views = ViewsOf(prepared_, state, prepared_.boxes_of_object[object]);
      if (views.size() >= 3) values.row(object) = FitSvd(graph_.camera, views).singular_values;
    }
    return values;
  }

  Mask Inliers(const State& state) const { return FitsAt(state, options_.outlier_chi_square); }

  Summary Run(const std::optional<State>& start, State* state) {
    state->switches = Eigen::VectorXd::Ones(graph_.boxes.size());
    Summary summary;
    if (start) {
      state->shapes = start->shapes;
      state->poses = start->poses;
      state->landmarks = start->landmarks;
      state->shared = start->shared;
    } else {
      const auto begin = std::chrono::steady_clock::now();
      summary = ReachStart(state);
      const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
      summary.start_seconds = elapsed.count();
    }
    Stage last = BatchStage(context_);
    const bool nearly_all_fit = Graduates() && Refines() && NearlyAllFit(context_, *state);
    if (!nearly_all_fit && (ThrowsBoxesOut(options_.loss) || (!start && Refines() && Grows()))) {
      Stage robust = last;
      robust.loss = Loss::kCauchy;
      if (!ThrowsBoxesOut(options_.loss)) robust.function_tolerance = options_.grow_tolerance;
      Append(Batch(robust, state), &summary);
      if (!start && Refines()) {
        RestartStuckObjects(context_, robust, state, &summary);
        TryOtherStarts(context_, robust, true, state, &summary);
      }
    }
    if (nearly_all_fit) {
      // Which boxes fit shows long before the last digits of the estimate.
      Stage all = last;
      all.loss = Loss::kNone;
      all.function_tolerance = options_.grow_tolerance;
      Append(Batch(all, state), &summary);
    } else if (Graduates()) {
      Append(GraduateNonConvexity(context_, state), &summary);
    }
    if (Graduates()) last = InlierStage(context_, *state);
    if (options_.loss == Loss::kSwitchable) SetSwitches(state);
    Append(Batch(last, state), &summary);
    // Each round can only lower the truncated cost, and ends when the same boxes fit as before.
    for (int round = 0; Graduates() && round < kMaxRounds; ++round) {
      const Stage next = InlierStage(context_, *state);
      if (next.weights == last.weights) break;
      last = next;
      Append(Batch(last, state), &summary);
    }
    if (Refines()) {
      if (Graduates() && !start) RestartMisfits(context_, &last, state, &summary);
      Recover(context_, last, state, &summary);
      RestartStuckObjects(context_, last, state, &summary);
      TryOtherStarts(context_, last, false, state, &summary);
      FitShapes(context_, last, state, &summary);
    }
    return summary;
  }

 private:
  bool Refines() const { return options_.residual == Residual::kTangentThenBox; }
  bool Graduates() const { return options_.loss == Loss::kGncTls || options_.loss == Loss::kGncGm; }
  bool Grows() const {
    return options_.schedule == Schedule::kGrow && options_.mode == Mode::kSlam;
  }

  Mask FitsAt(const State& state, double chi_square) const {
    return 2 * BoxCosts(context_, state).array() <= chi_square;
  }

  Summary ReachStart(State* state) {
    state->poses = graph_.initial_poses;
    state->landmarks = RowMatrix::Zero(graph_.num_objects(), kLandmarkSize);
    if (Grows()) return Grow(context_, state);
    StartAll(state);
    if (!Refines()) return Summary();
    Stage stage = BatchStage(context_);
    stage.residual = Residual::kTangent;
    stage.loss = IsRobust(options_.loss) ? Loss::kCauchy : Loss::kNone;
    return Batch(stage, state);
  }

  // Sets each switch to the minimum of s^2 chi^2 + phi (1 - s)^2.  If all switches were 1, the
  // first steps would leave the solution that the Cauchy loss has reached.
  void SetSwitches(State* state) const {
    const double phi = options_.outlier_chi_square;
    state->switches = phi / (phi + 2 * BoxCosts(context_, *state).array());
  }

  void StartAll(State* state) {
    for (int object = 0; object < graph_.num_objects(); ++object) {
      state->landmarks.row(object) =
          StartObject(context_, *state, object, prepared_.boxes_of_object[object]);
    }
  }

  Summary Batch(const Stage& stage, State* state) {
    const bool all_defined =
        stage.residual != Residual::kBox || BoxCosts(context_, *state).allFinite();
    Summary summary = Optimize(context_, stage, state);
    // Boxes that were undefined at the start of the stage have used the tangent residual so far.
    if (!all_defined) Append(Optimize(context_, stage, state), &summary);
    return summary;
  }

  const SolveContext context_;
  const PreparedGraph& prepared_;
  const Graph& graph_;
  const SolveOptions& options_;
};

// Solves up to three times, by growing in smaller steps each time, as long as something speaks
// against the result, and keeps the result with the lowest cost.  Two attempts that come to the
// same cost confirm each other, however many boxes do not fit.
Summary SolveInAttempts(const SolveContext& context,
                        const std::optional<State>& start,
                        State* state) {
  const SolveOptions& options = context.options;
  const bool repeats = !start && options.mode == Mode::kSlam &&
                       (options.loss == Loss::kNone || options.loss == Loss::kGncTls ||
                        options.loss == Loss::kGncGm) &&
                       options.schedule == Schedule::kGrow &&
                       options.residual == Residual::kTangentThenBox;
  SolveOptions variant = options;
  Summary best;
  double lowest = std::numeric_limits<double>::infinity();
  for (int attempt = 0; attempt < (repeats ? kAttempts : 1); ++attempt) {
    variant.grow_poses = std::max(options.grow_poses >> (2 * attempt), 1);
    variant.grow_angle = options.grow_angle / (1 << (2 * attempt));
    Solver solver({context.prepared, variant, context.monitor});
    State reached;
    Summary summary = solver.Run(start, &reached);
    const bool doubts = options.loss == Loss::kNone || repeats;
    const std::string objection = solver.Objection(reached, doubts ? kMostMisfits : kMostOutliers);
    const double cost = solver.TruncatedCost(reached, summary);
    const bool confirmed = options.loss != Loss::kNone && std::abs(cost - lowest) < kSameCost;
    if (summary.converged && !objection.empty() && !confirmed) {
      summary.converged = false;
      summary.message = objection;
    }
    if (confirmed && cost >= lowest) {
      best.converged = summary.converged;
      best.message = summary.message;
      break;
    }
    if (attempt == 0 || cost < lowest) {
      best = summary;
      *state = reached;
      lowest = cost;
    }
    if (best.converged) break;
  }
  return best;
}

// What speaks against objects and poses under a robust loss.  Wrong ids look like the first.
std::string ObjectionToMisfits(const SolveContext& context,
                               const State& state,
                               const Mask& inliers) {
  int misfits = 0;
  for (const std::vector<int>& rows : context.prepared.boxes_of_object) {
    const auto fit = std::count_if(rows.begin(), rows.end(), [&](int row) { return inliers[row]; });
    if (static_cast<int>(rows.size()) >= kSomeBoxes &&
        2 * fit < static_cast<std::ptrdiff_t>(rows.size()))
      ++misfits;
  }
  if (misfits > 0) {
    return "most boxes of " + std::to_string(misfits) + (misfits == 1 ? " object" : " objects") +
           " do not fit";
  }
  if (context.options.mode == Mode::kMapping) return "";
  const std::vector<PoseRun> runs = MisplacedPoses(context, state);
  if (runs.empty()) return "";
  const std::string first = std::to_string(runs[0].first), last = std::to_string(runs[0].last);
  return runs[0].first == runs[0].last
             ? "pose " + first + " fits neither its odometry nor its boxes"
             : "poses " + first + " to " + last + " fit neither their odometry nor their boxes";
}

}  // namespace

Solution Solve(const Graph& graph,
               const SolveOptions& options,
               const std::optional<State>& start,
               const Monitor& monitor) {
  const auto begin = std::chrono::steady_clock::now();
  ValidateOptions(options);
  ValidateShapes(options, graph.shapes);
  if (start) {
    ValidateStart(graph, *start);
    ValidateShapes(options, start->shapes);
  }
  const PreparedGraph prepared(graph, options.mode == Mode::kMapping);
  State state;
  Solution solution;
  const SolveContext context{prepared, options, monitor};
  solution.summary = SolveInAttempts(context, start, &state);
  const Solver solver(context);
  solution.svd_singular_values = options.start == Start::kSvd
                                     ? solver.SvdSingularValues()
                                     : RowMatrix::Constant(graph.num_objects(), 10, std::nan(""));
  Dispatch(graph.pose_model, [&state](auto pose) {
    for (int row = 0; row < state.poses.rows(); ++row) pose.Normalize(state.poses.row(row).data());
  });
  solution.poses = state.poses;
  solution.inliers = solver.Inliers(state);
  const std::string objection = ObjectionToMisfits(context, state, solution.inliers);
  if (IsRobust(options.loss) && solution.summary.converged && !objection.empty()) {
    solution.summary.converged = false;
    solution.summary.message = objection;
  }
  solution.landmarks = state.landmarks;
  solution.shapes = state.shapes;
  solution.shared = state.shared;
  solution.dual_quadrics = state.landmarks;
  if (options.landmark_model == LandmarkModel::kEllipsoid) {
    for (Eigen::Index row = 0; row < state.landmarks.rows(); ++row) {
      const double* parameters = state.landmarks.row(row).data();
      const Shape shape = ShapeOf(state.shapes, static_cast<int>(row));
      solution.dual_quadrics.row(row) = DualQuadricFromSurface(
          shape == Shape::kEllipsoid ? EllipsoidModel::Unpack(parameters)
                                     : EquivalentEllipsoid(BodyModel{shape}.Unpack(parameters)));
    }
  }
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  solution.summary.seconds = elapsed.count();
  return solution;
}

}  // namespace dqslam
