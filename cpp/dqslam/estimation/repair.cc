#include "dqslam/estimation/repair.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <thread>

#include "dqslam/estimation/start_object.h"
#include "dqslam/geometry/dispatch.h"
#include "dqslam/linear/parallel.h"

namespace dqslam {
namespace {

// An object is stuck if the median of its boxes is beyond this, or the mean beyond twice as much.
constexpr double kImpossibleBox = kBoxChiSquare99;
constexpr double kImpossibleMean = 2 * kImpossibleBox;
constexpr double kImpossibleSize = 21.1;  // chi-square of 3 degrees of freedom, 99.99 %
constexpr double kTorn = 5;               // chi-square of odometry, per degree of freedom
constexpr int kMaxRestarts = 2;
constexpr int kFewBoxes = 3;
// A mixed object is started from some successive boxes at different parts of the path.
constexpr double kMixed = 0.25;
constexpr int kSomeBoxes = 4;
constexpr int kParts = 6;
constexpr double kSameCost = 1e-6;  // relative: the same minimum, reached from two sides

// Replaces the state by an attempt if that has a lower cost.
bool KeepIfBetter(const State& attempt, const Summary& total, State* state, Summary* summary) {
  const bool better = total.final_cost < summary->final_cost * (1 - 1e-9);
  if (!better) return false;
  *summary = total;
  *state = attempt;
  return true;
}

// Whether the prior excludes an object's size.  Such an object may be at a wrong depth, where a
// very thin ellipsoid fits the boxes.
bool HasImpossibleSize(const SolveContext& context, const State& state, int object) {
  if (context.options.landmark_model != LandmarkModel::kEllipsoid) return false;
  const SizePrior prior = SizePriorOf(context.graph(), state, object);
  const Eigen::Array3d semi_axes = AxesFromEllipsoid(state.landmarks.row(object)).semi_axes;
  const Eigen::Array3d error = semi_axes.log() - prior.log_mean;
  return error.square().sum() > kImpossibleSize * std::pow(prior.log_sigma, 2);
}

double WeightOf(const Stage& stage, size_t i) {
  return stage.weights.empty() ? 1 : stage.weights[i];
}

// The rows of the boxes of a batch stage that have a weight, by object and in the order of poses.
std::vector<std::vector<int>> WeightedBoxes(const SolveContext& context, const Stage& stage) {
  std::vector<std::vector<int>> result;
  for (const std::vector<int>& rows : context.prepared.boxes_of_object) {
    result.emplace_back();
    std::copy_if(rows.begin(), rows.end(), std::back_inserter(result.back()), [&](int row) {
      return WeightOf(stage, row) > 0;
    });
  }
  return result;
}

// From cameras at one height, an ellipsoid that is tilted the other way looks almost the same.  The
// two are minima of their own.
bool CanTiltEitherWay(const SolveContext& context) {
  return context.graph().pose_model == PoseModel::kSe2 &&
         context.options.landmark_model == LandmarkModel::kEllipsoid;
}

// Starts from which an object may reach a better minimum than the one it is in; none where nothing
// speaks against that one.
std::vector<Vector9d> OtherStarts(const SolveContext& context,
                                  const Stage& all,
                                  bool from_parts,
                                  const State& state,
                                  const Eigen::VectorXd& costs,
                                  int object,
                                  const std::vector<int>& boxes) {
  SolveOptions options = context.options;
  options.start = Start::kSizePrior;
  const SolveContext by_size{context.prepared, options, context.monitor};
  const int count = static_cast<int>(boxes.size());
  const auto misfits = std::count_if(
      boxes.begin(), boxes.end(), [&](int row) { return !(2 * costs[row] <= kImpossibleBox); });
  const bool is_mixed = from_parts && IsMixed(misfits, count);
  std::vector<Vector9d> starts;
  if (count <= kFewBoxes || is_mixed || HasImpossibleSize(context, state, object)) {
    starts.push_back(StartObject(by_size, state, object, boxes));
  }
  if (all.loss == Loss::kNone && CanTiltEitherWay(context)) {
    Vector9d tilted = state.landmarks.row(object);
    tilted.tail<2>() *= -1;
    starts.push_back(tilted);
  }
  for (int part = 0; is_mixed && part < kParts; ++part) {
    const auto first = boxes.begin() + part * (count - kSomeBoxes) / (kParts - 1);
    starts.push_back(StartObject(context, state, object, {first, first + kSomeBoxes}));
  }
  return starts;
}

// The parameters of an object in the best minimum that it reaches, with all else as in the state.
// The trial is a copy of the state for use here.
Vector9d BestStart(const SolveContext& context,
                   const Stage& all,
                   bool from_parts,
                   const State& state,
                   const Eigen::VectorXd& costs,
                   int object,
                   const std::vector<int>& boxes,
                   State* trial) {
  const Vector9d present = state.landmarks.row(object);
  if (boxes.empty()) return present;
  const std::vector<Vector9d> starts =
      OtherStarts(context, all, from_parts, state, costs, object, boxes);
  if (starts.empty()) return present;
  const Stage alone = StageOfObject(all, boxes, context.graph());
  const auto optimize_from = [&](const Vector9d& start) {
    trial->landmarks.row(object) = start;
    // The switches of one trial are not those of the next one.
    for (const int row : boxes) trial->switches[row] = state.switches[row];
    return Optimize(context, alone, trial).final_cost;
  };
  Vector9d best = present;
  double lowest = optimize_from(present) * (1 - kSameCost);
  for (const Vector9d& start : starts) {
    const double cost = optimize_from(start);
    if (!(cost < lowest)) continue;
    lowest = cost;
    best = trial->landmarks.row(object);
  }
  return best;
}

}  // namespace

bool IsMixed(std::ptrdiff_t misfits, std::ptrdiff_t boxes) {
  return boxes > kSomeBoxes && misfits > kMixed * boxes;
}

Stage StageOfObject(const Stage& all, const std::vector<int>& boxes, const Graph& graph) {
  Stage stage;  // not a copy: `all` has the rows of all boxes
  stage.boxes = boxes;
  stage.end_pose = stage.first_free_pose = graph.boxes.pose[boxes.back()] + 1;
  stage.moves_shared = false;
  stage.residual = all.residual;
  stage.loss = all.loss;
  stage.minimizer = all.minimizer;
  stage.max_iterations = all.max_iterations;
  stage.function_tolerance = all.function_tolerance;
  return stage;
}

std::vector<bool> StuckObjects(const SolveContext& context,
                               const Stage& stage,
                               const State& state) {
  const Eigen::VectorXd costs = BoxCosts(context, state);
  std::vector<bool> stuck;
  for (const std::vector<int>& rows : WeightedBoxes(context, stage)) {
    std::vector<double> chi_squares;
    for (const int row : rows) chi_squares.push_back(2 * costs[row]);
    if (chi_squares.empty()) {
      stuck.push_back(false);
      continue;
    }
    const auto middle = chi_squares.begin() + chi_squares.size() / 2;
    std::nth_element(chi_squares.begin(), middle, chi_squares.end());
    const double sum = std::accumulate(chi_squares.begin(), chi_squares.end(), 0.0);
    stuck.push_back(*middle > kImpossibleBox || sum > kImpossibleMean * chi_squares.size());
  }
  return stuck;
}

Eigen::VectorXd OdometryChiSquares(const PreparedGraph& prepared, const State& state) {
  const OdometryTable& odometry = prepared.graph.odometry;
  Eigen::VectorXd chi_squares(odometry.size());
  Dispatch(prepared.graph.pose_model, [&](auto model) {
    using Pose = decltype(model);
    for (int row = 0; row < odometry.size(); ++row) {
      Eigen::Matrix<double, Pose::kSize, 1> predicted;
      Eigen::Matrix<double, Pose::kTangentSize, 1> error;
      Pose::Compose(state.poses.row(odometry.from[row]).data(),
                    odometry.relative.row(row).data(),
                    predicted.data());
      Minus<Pose>(predicted.data(), state.poses.row(odometry.to[row]).data(), error.data());
      chi_squares[row] = (prepared.odometry_sqrt_information[row] * error).squaredNorm();
    }
  });
  return chi_squares;
}

bool IsTorn(const PreparedGraph& prepared, const State& state) {
  const Eigen::VectorXd chi_squares = OdometryChiSquares(prepared, state);
  return chi_squares.sum() >
         kTorn * static_cast<double>(chi_squares.size()) * prepared.graph.tangent_size();
}

Stage BatchStage(const SolveContext& context) {
  Stage stage;
  stage.first_free_pose = context.options.mode == Mode::kMapping ? context.graph().num_poses() : 1;
  stage.end_pose = context.graph().num_poses();
  stage.boxes.resize(context.graph().boxes.size());
  std::iota(stage.boxes.begin(), stage.boxes.end(), 0);
  stage.residual = context.options.residual == Residual::kTangentThenBox ? Residual::kBox
                                                                         : context.options.residual;
  stage.loss = context.options.loss;
  stage.minimizer = context.options.minimizer;
  stage.max_iterations = context.options.max_iterations;
  stage.function_tolerance = context.options.function_tolerance;
  return stage;
}

void RestartStuckObjects(const SolveContext& context,
                         const Stage& all,
                         State* state,
                         Summary* summary) {
  const std::vector<std::vector<int>> boxes_of_object = WeightedBoxes(context, all);
  for (int restart = 0; restart < kMaxRestarts; ++restart) {
    const std::vector<bool> stuck = StuckObjects(context, all, *state);
    if (std::none_of(stuck.begin(), stuck.end(), [](bool is_stuck) { return is_stuck; })) return;

    State attempt = *state;
    Stage rest = all;
    rest.weights.clear();
    for (size_t i = 0; i < all.boxes.size(); ++i) {
      const bool is_stuck = stuck[context.graph().boxes.object[all.boxes[i]]];
      rest.weights.push_back(is_stuck ? 0 : WeightOf(all, i));
    }
    Summary total = *summary;
    Append(Optimize(context, rest, &attempt), &total);
    for (int object = 0; object < context.graph().num_objects(); ++object) {
      if (!stuck[object]) continue;
      attempt.landmarks.row(object) =
          StartObject(context, attempt, object, boxes_of_object[object]);
    }
    Stage towards = all;
    towards.residual = Residual::kTangent;
    towards.minimizer = Minimizer::kLevenbergMarquardt;
    Append(Optimize(context, towards, &attempt), &total);
    Append(Optimize(context, all, &attempt), &total);
    if (!KeepIfBetter(attempt, total, state, summary)) return;
  }
}

void Recover(const SolveContext& context, const Stage& all, State* state, Summary* summary) {
  if (summary->converged || all.loss == Loss::kCauchy) return;
  Stage robust = all;
  robust.loss = Loss::kCauchy;
  State attempt = *state;
  Summary total = *summary;
  Append(Optimize(context, robust, &attempt), &total);
  Append(Optimize(context, all, &attempt), &total);
  KeepIfBetter(attempt, total, state, summary);
}

void TryOtherStarts(const SolveContext& context,
                    const Stage& all,
                    bool from_parts,
                    State* state,
                    Summary* summary) {
  const std::vector<std::vector<int>> boxes_of_object = WeightedBoxes(context, all);
  const Eigen::VectorXd costs = BoxCosts(context, *state);
  // Where the path is fixed, objects do not depend on each other.  Only the calling thread may ask
  // whether to stop.
  const auto caller = std::this_thread::get_id();
  const Monitor monitor = [&] {
    return std::this_thread::get_id() != caller || !context.monitor || context.monitor();
  };
  const SolveContext apart{context.prepared, context.options, monitor};
  const int threads = context.options.threads, num_objects = context.graph().num_objects();
  State attempt = *state;
  const auto try_each = [&](std::ptrdiff_t begin, std::ptrdiff_t end) {
    State trial = *state;
    for (auto object = static_cast<int>(begin); object < end; ++object) {
      const std::vector<int>& boxes = boxes_of_object[object];
      attempt.landmarks.row(object) =
          BestStart(apart, all, from_parts, *state, costs, object, boxes, &trial);
    }
  };
  ParallelForParts(threads, num_objects, num_objects / (4 * threads) + 1, try_each);
  if (attempt.landmarks == state->landmarks) return;
  Summary total = *summary;
  Append(Optimize(context, all, &attempt), &total);
  KeepIfBetter(attempt, total, state, summary);
}

}  // namespace dqslam
