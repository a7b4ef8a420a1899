#include "dqslam/estimation/solve.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "dqslam/estimation/graduated.h"
#include "dqslam/estimation/grow.h"
#include "dqslam/estimation/repair.h"
#include "dqslam/geometry/dispatch.h"
#include "dqslam/problem/checks.h"

namespace dqslam {
namespace {

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
  require(options.grow_rotation >= 0, "grow_rotation must not be negative");
  require(options.grow_iterations > 0, "grow_iterations must be positive");
  require(options.grow_min_views > 0, "grow_min_views must be positive");
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

  /// Whether objects remain that are impossible given their boxes.
  bool LeavesObjectsStuck(const State& state) const {
    const std::vector<bool> stuck = StuckObjects(context_, state);
    return std::any_of(stuck.begin(), stuck.end(), [](bool is_stuck) { return is_stuck; });
  }

  bool LeavesPathTorn(const State& state) const { return IsTorn(prepared_, state); }

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

  Mask Inliers(const State& state) const {
    const std::vector<bool> inliers = InlierBoxes(context_, state);
    Mask mask(inliers.size());
    std::copy(inliers.begin(), inliers.end(), mask.begin());
    return mask;
  }

  Summary Run(const std::optional<State>& start, State* state) {
    state->switches = Eigen::VectorXd::Ones(graph_.boxes.size());
    Summary summary;
    if (start) {
      state->poses = start->poses;
      state->landmarks = start->landmarks;
    } else {
      const auto begin = std::chrono::steady_clock::now();
      summary = ReachStart(state);
      const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
      summary.start_seconds = elapsed.count();
    }
    if (ThrowsBoxesOut(options_.loss)) {
      Append(Batch(BatchStage(context_).residual, Loss::kCauchy, state), &summary);
    }
    if (options_.loss == Loss::kGncTls || options_.loss == Loss::kGncGm) {
      Append(GraduateNonConvexity(context_, state), &summary);
      return summary;
    }
    if (options_.loss == Loss::kSwitchable) SetSwitches(state);
    Append(Batch(BatchStage(context_).residual, options_.loss, state), &summary);
    if (Refines()) {
      RestartStuckObjects(context_, state, &summary);
      TryOtherDepths(context_, state, &summary);
    }
    return summary;
  }

 private:
  bool Refines() const { return options_.residual == Residual::kTangentThenBox; }

  Summary ReachStart(State* state) {
    state->poses = graph_.initial_poses;
    state->landmarks = RowMatrix::Zero(graph_.num_objects(), kLandmarkSize);
    if (options_.schedule == Schedule::kGrow && options_.mode == Mode::kSlam) {
      return Grow(context_, state);
    }
    StartAll(state);
    const Loss loss = IsRobust(options_.loss) ? Loss::kCauchy : Loss::kNone;
    return Refines() ? Batch(Residual::kTangent, loss, state) : Summary();
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

  Summary Batch(Residual residual, Loss loss, State* state) {
    Stage stage = BatchStage(context_);
    stage.residual = residual;
    stage.loss = loss;
    const bool all_defined = residual != Residual::kBox || BoxCosts(context_, *state).allFinite();
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

// Grows again in smaller steps, up to two times, if objects are stuck, the path is torn or the last
// stage did not converge.  Keeps the result with the lowest cost.  With a robust loss, all boxes of
// an object may be outliers, so these tests do not apply: it grows once, in smaller steps.
Summary SolveInAttempts(const SolveContext& context,
                        const std::optional<State>& start,
                        State* state) {
  const SolveOptions& options = context.options;
  const bool repeats = !start && options.mode == Mode::kSlam && options.loss == Loss::kNone &&
                       options.schedule == Schedule::kGrow &&
                       options.residual == Residual::kTangentThenBox;
  SolveOptions variant = options;
  Summary best;
  for (int attempt = 0; attempt < (repeats ? 3 : 1); ++attempt) {
    const int halvings = 2 * (IsRobust(options.loss) ? 1 : attempt);
    variant.grow_poses = std::max(options.grow_poses >> halvings, 1);
    variant.grow_rotation = options.grow_rotation / (1 << halvings);
    Solver solver({context.prepared, variant, context.monitor});
    State reached;
    const Summary summary = solver.Run(start, &reached);
    if (attempt == 0 || summary.final_cost < best.final_cost) {
      best = summary;
      *state = reached;
    }
    if (best.converged && !solver.LeavesObjectsStuck(*state) && !solver.LeavesPathTorn(*state)) {
      break;
    }
  }
  return best;
}

}  // namespace

Solution Solve(const Graph& graph,
               const SolveOptions& options,
               const std::optional<State>& start,
               const Monitor& monitor) {
  const auto begin = std::chrono::steady_clock::now();
  ValidateOptions(options);
  if (start) ValidateStart(graph, *start);
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
  solution.landmarks = state.landmarks;
  solution.dual_quadrics = state.landmarks;
  if (options.landmark_model == LandmarkModel::kEllipsoid) {
    for (Eigen::Index row = 0; row < state.landmarks.rows(); ++row) {
      solution.dual_quadrics.row(row) =
          DualQuadricFromEllipsoid(state.landmarks.row(row).transpose());
    }
  }
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  solution.summary.seconds = elapsed.count();
  return solution;
}

}  // namespace dqslam
