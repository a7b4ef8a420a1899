#include "dqslam/estimation/misfits.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "dqslam/estimation/bend_path.h"
#include "dqslam/estimation/graduated.h"
#include "dqslam/estimation/pair_starts.h"
#include "dqslam/estimation/repair.h"
#include "dqslam/geometry/dispatch.h"

namespace dqslam {
namespace {

constexpr double kBetter = 0.05;  // another minimum is lower by this, in half squared sigmas
constexpr double kNormal999 = 3.0902;
constexpr int kMaxRounds = 10;
// Objects with a larger share of boxes that do not fit are started again, and those with a much
// larger one take no part in the path meanwhile.
constexpr double kMixed = 0.25, kDoubtful = 0.4;
constexpr size_t kSomeBoxes = 4;  // fewer fit some ellipsoid even if all of them are wrong

// The 99.9 % quantile of chi-square, by Wilson and Hilferty: within 2 % of it.
double Quantile999(int freedom) {
  const double variance = 2.0 / (9.0 * freedom);
  return freedom * std::pow(1 - variance + kNormal999 * std::sqrt(variance), 3);
}

// How much larger the chi-squares of the steps are than they should be, by their median; 1 or more.
double NoiseLevel(Eigen::VectorXd chi_squares, int freedom) {
  if (chi_squares.size() == 0) return 1;
  const auto middle = chi_squares.begin() + chi_squares.size() / 2;
  std::nth_element(chi_squares.begin(), middle, chi_squares.end());
  const double expected = freedom * std::pow(1 - 2.0 / (9.0 * freedom), 3);
  return std::max(1.0, *middle / expected);
}

// Minimizes the boxes that fit until the same ones fit as before.
void SettleInliers(const SolveContext& context, Stage* last, State* state, Summary* summary) {
  for (int round = 0; round < kMaxRounds; ++round) {
    Stage next = InlierStage(context, *state);
    if (round > 0 && next.weights == last->weights) return;
    *last = std::move(next);
    Append(Optimize(context, *last, state), summary);
  }
}

// Puts the poses of a run where the odometry from the pose before it to the pose behind it has
// them, bent so that both ends stay.
void PlaceBetweenNeighbors(const SolveContext& context, PoseRun run, State* state) {
  const PreparedGraph& prepared = context.prepared;
  const bool is_open = run.last + 1 == context.graph().num_poses();
  Dispatch(context.graph().pose_model, [&](auto model) {
    using Pose = decltype(model);
    constexpr int k = Pose::kTangentSize;
    using Square = Eigen::Matrix<double, k, k>;
    if (is_open) {
      DeadReckon(prepared, run.first, run.last + 1, state);
      return;
    }
    const int end = run.last + 1;
    const Eigen::Matrix<double, Pose::kSize, 1> target = state->poses.row(end).transpose();
    DeadReckon(prepared, run.first, end + 1, state);
    std::vector<Square> covariances;
    for (int pose = run.first; pose <= end; ++pose) {
      covariances.emplace_back(Eigen::Map<const Eigen::Matrix<double, k, k, Eigen::RowMajor>>(
          context.graph().odometry.covariance.row(prepared.odometry_into[pose]).data()));
    }
    RowMatrix poses = state->poses.middleRows(run.first - 1, end - run.first + 2);
    BendPath<Pose>(covariances, target, &poses);
    state->poses.middleRows(run.first - 1, end - run.first + 2) = poses;
    state->poses.row(end) = target.transpose();
  });
}

// One object by itself under the truncated loss; the poses are constant.
class ObjectAlone {
 public:
  ObjectAlone(const SolveContext& context, int object)
      : context_(context),
        boxes_(context.prepared.boxes_of_object[object]),
        stage_(StageOfObject(BatchStage(context), boxes_, context.graph())) {}

  // Minimizes from the state and returns the truncated cost.
  double Minimize(bool robust_first, State* state) {
    if (robust_first) {
      stage_.loss = Loss::kCauchy;
      stage_.weights.clear();
      Optimize(context_, stage_, state);
    }
    stage_.loss = Loss::kNone;
    double cost = std::numeric_limits<double>::infinity();
    std::vector<double> weights = Weights(*state);
    for (int round = 0; round < kMaxRounds; ++round) {
      stage_.weights = weights;
      cost = Optimize(context_, stage_, state).final_cost;
      weights = Weights(*state);
      if (weights == stage_.weights) break;
    }
    const auto misfits = std::count(weights.begin(), weights.end(), 0.0);
    return cost + 0.5 * context_.options.outlier_chi_square * static_cast<double>(misfits);
  }

 private:
  std::vector<double> Weights(const State& state) const {
    const Eigen::VectorXd costs = BoxCosts(context_, state);
    std::vector<double> weights;
    for (const int row : boxes_) {
      weights.push_back(2 * costs[row] <= context_.options.outlier_chi_square ? 1 : 0);
    }
    return weights;
  }

  const SolveContext& context_;
  const std::vector<int>& boxes_;
  Stage stage_;
};

// Starts an object at places that some of its boxes suggest and moves it if it reaches a lower cost
// by itself.  Returns whether it did.
bool RestartObject(const SolveContext& context, int object, State* state) {
  ObjectAlone alone(context, object);
  State trial = *state;
  double lowest = alone.Minimize(false, &trial) - kBetter;
  bool moved = false;
  for (const Vector9d& start : StartsFromPairs(context, *state, object)) {
    trial.landmarks.row(object) = start;
    const double cost = alone.Minimize(true, &trial);
    if (!(cost < lowest)) continue;
    lowest = cost;
    state->landmarks.row(object) = trial.landmarks.row(object);
    moved = true;
  }
  return moved;
}

// The objects a share of whose boxes has no weight in the last stage.
std::vector<int> ObjectsWithMisfits(const SolveContext& context, const Stage& last, double share) {
  std::vector<int> objects;
  for (int object = 0; object < context.graph().num_objects(); ++object) {
    const std::vector<int>& boxes = context.prepared.boxes_of_object[object];
    const auto misfits =
        std::count_if(boxes.begin(), boxes.end(), [&](int row) { return last.weights[row] == 0; });
    if (boxes.size() > kSomeBoxes && misfits > share * boxes.size()) objects.push_back(object);
  }
  return objects;
}

// Minimizes the boxes that fit without those of one object, which may have bent the path.
void MinimizeOthers(
    const SolveContext& context, const Stage& last, int object, State* state, Summary* summary) {
  Stage others = last;
  others.function_tolerance = context.options.grow_tolerance;
  for (const int row : context.prepared.boxes_of_object[object]) others.weights[row] = 0;
  const Vector9d landmark = state->landmarks.row(object);
  Append(Optimize(context, others, state), summary);
  state->landmarks.row(object) = landmark;
}

// Replaces the state by an attempt if that has a lower truncated cost.
bool KeepIfBetter(const SolveContext& context,
                  const std::pair<State, Stage>& attempt,
                  const Summary& total,
                  Stage* last,
                  State* state,
                  Summary* summary) {
  const double before = TruncatedCost(context, *state, summary->final_cost);
  const double after = TruncatedCost(context, attempt.first, total.final_cost);
  if (!(after < before - kBetter)) return false;
  *state = attempt.first;
  *last = attempt.second;
  *summary = total;
  return true;
}

// Behind the last pose with boxes that fit, nothing but odometry holds the path.  Boxes there may
// have been left out although a path that fits the odometry as well leads to them.  Tries to admit
// those of one object at a time.
void AdmitLastBoxes(const SolveContext& context, Stage* last, State* state, Summary* summary) {
  const BoxTable& boxes = context.graph().boxes;
  int first = 0;  // the first pose of the run without boxes that fit
  for (int row = 0; row < boxes.size(); ++row) {
    if (last->weights[row] > 0) first = std::max(first, boxes.pose[row] + 1);
  }
  for (const std::vector<int>& rows : context.prepared.boxes_of_object) {
    if (rows.empty() || boxes.pose[rows.back()] < first) continue;
    State attempt = *state;
    Summary total = *summary;
    Stage stage = *last;
    for (const int row : rows)
      stage.weights[row] = stage.weights[row] > 0 || boxes.pose[row] >= first;
    Append(Optimize(context, stage, &attempt), &total);
    SettleInliers(context, &stage, &attempt, &total);
    KeepIfBetter(context, {attempt, stage}, total, last, state, summary);
  }
}

}  // namespace

double TruncatedCost(const SolveContext& context, const State& state, double cost) {
  const std::vector<bool> inliers = InlierBoxes(context, state);
  const auto misfits = std::count(inliers.begin(), inliers.end(), false);
  return cost + 0.5 * context.options.outlier_chi_square * static_cast<double>(misfits);
}

std::vector<PoseRun> MisplacedPoses(const SolveContext& context, const State& state) {
  const Graph& graph = context.graph();
  const int count = graph.num_poses(), k = graph.tangent_size();
  std::vector<int> boxes(count, 0), fit(count, 0);
  const std::vector<bool> inliers = InlierBoxes(context, state);
  for (int row = 0; row < graph.boxes.size(); ++row) {
    ++boxes[graph.boxes.pose[row]];
    fit[graph.boxes.pose[row]] += inliers[row];
  }
  std::vector<PoseRun> runs;
  if (std::accumulate(fit.begin(), fit.end(), 0) == graph.boxes.size()) return runs;
  const Eigen::VectorXd chi_squares = OdometryChiSquares(context.prepared, state);
  const double level = NoiseLevel(chi_squares, k);
  for (int first = 1; first < count;) {
    if (fit[first] > 0) {
      ++first;
      continue;
    }
    int end = first, unfit = 0;
    double chi_square = 0;
    for (; end < count && fit[end] == 0; ++end) {
      unfit += boxes[end];
      chi_square += chi_squares[context.prepared.odometry_into[end]];
    }
    int steps = end - first;
    if (end < count) {
      chi_square += chi_squares[context.prepared.odometry_into[end]];
      ++steps;
    }
    if (unfit > 0 && chi_square > level * Quantile999(k * steps)) runs.push_back({first, end - 1});
    first = end;
  }
  return runs;
}

void RestartMisfits(const SolveContext& context, Stage* last, State* state, Summary* summary) {
  std::vector<PoseRun> runs;
  if (context.options.mode == Mode::kSlam) runs = MisplacedPoses(context, *state);
  if (!runs.empty()) {
    State attempt = *state;
    Summary total = *summary;
    for (const PoseRun& run : runs) PlaceBetweenNeighbors(context, run, &attempt);
    Stage robust = BatchStage(context);
    robust.loss = Loss::kCauchy;
    robust.function_tolerance = context.options.grow_tolerance;
    Append(Optimize(context, robust, &attempt), &total);
    Stage stage;
    SettleInliers(context, &stage, &attempt, &total);
    KeepIfBetter(context, {attempt, stage}, total, last, state, summary);
  }
  if (context.options.mode == Mode::kSlam) AdmitLastBoxes(context, last, state, summary);
  if (context.options.landmark_model != LandmarkModel::kEllipsoid) return;
  const auto restart = [&](const std::vector<int>& objects, State attempt, Summary total) {
    bool moved = false;
    for (const int object : objects) moved = RestartObject(context, object, &attempt) || moved;
    if (!moved) return;
    Stage stage;
    SettleInliers(context, &stage, &attempt, &total);
    KeepIfBetter(context, {attempt, stage}, total, last, state, summary);
  };
  restart(ObjectsWithMisfits(context, *last, kMixed), *state, *summary);
  for (const int object : ObjectsWithMisfits(context, *last, kDoubtful)) {
    State attempt = *state;
    Summary total = *summary;
    MinimizeOthers(context, *last, object, &attempt, &total);
    restart({object}, attempt, total);
  }
}

}  // namespace dqslam
