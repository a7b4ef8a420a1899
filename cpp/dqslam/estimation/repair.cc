#include "dqslam/estimation/repair.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "dqslam/estimation/grow.h"
#include "dqslam/geometry/dispatch.h"

namespace dqslam {
namespace {

// An object is stuck if the median of its boxes is beyond this, or the mean beyond twice as much.
constexpr double kImpossibleBox = kBoxChiSquare99;
constexpr double kImpossibleMean = 2 * kImpossibleBox;
constexpr double kImpossibleSize = 21.1;  // chi-square of 3 degrees of freedom, 99.99 %
constexpr double kTorn = 5;               // chi-square of odometry, per degree of freedom
constexpr int kMaxRestarts = 2;
constexpr int kFewBoxes = 3;

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
  const SizePriorTable& prior = context.graph().size_prior;
  const Eigen::Array3d semi_axes = AxesFromEllipsoid(state.landmarks.row(object)).semi_axes;
  const Eigen::Array3d error = semi_axes.log() - prior.log_mean[object];
  return error.square().sum() > kImpossibleSize * std::pow(prior.log_sigma[object], 2);
}

// The stage of one object by itself: all its boxes, with constant poses.
Stage StageOfObject(const SolveContext& context, int object) {
  Stage stage = BatchStage(context);
  stage.boxes = context.prepared.boxes_of_object[object];
  stage.end_pose = stage.first_free_pose = context.graph().boxes.pose[stage.boxes.back()] + 1;
  return stage;
}

}  // namespace

std::vector<bool> StuckObjects(const SolveContext& context, const State& state) {
  const Eigen::VectorXd costs = BoxCosts(context, state);
  std::vector<bool> stuck;
  for (const std::vector<int>& rows : context.prepared.boxes_of_object) {
    std::vector<double> chi_squares;
    for (const int row : rows) chi_squares.push_back(2 * costs[row]);
    const auto middle = chi_squares.begin() + chi_squares.size() / 2;
    std::nth_element(chi_squares.begin(), middle, chi_squares.end());
    const double sum = std::accumulate(chi_squares.begin(), chi_squares.end(), 0.0);
    stuck.push_back(*middle > kImpossibleBox || sum > kImpossibleMean * chi_squares.size());
  }
  return stuck;
}

bool IsTorn(const PreparedGraph& prepared, const State& state) {
  const OdometryTable& odometry = prepared.graph.odometry;
  double chi_square = 0;
  Dispatch(prepared.graph.pose_model, [&](auto model) {
    using Pose = decltype(model);
    for (int row = 0; row < odometry.size(); ++row) {
      Eigen::Matrix<double, Pose::kSize, 1> predicted;
      Eigen::Matrix<double, Pose::kTangentSize, 1> error;
      Pose::Compose(state.poses.row(odometry.from[row]).data(),
                    odometry.relative.row(row).data(),
                    predicted.data());
      Minus<Pose>(predicted.data(), state.poses.row(odometry.to[row]).data(), error.data());
      chi_square += (prepared.odometry_sqrt_information[row] * error).squaredNorm();
    }
  });
  return chi_square > kTorn * odometry.size() * prepared.graph.tangent_size();
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

void RestartStuckObjects(const SolveContext& context, State* state, Summary* summary) {
  const Stage all = BatchStage(context);
  for (int restart = 0; restart < kMaxRestarts; ++restart) {
    const std::vector<bool> stuck = StuckObjects(context, *state);
    if (std::none_of(stuck.begin(), stuck.end(), [](bool is_stuck) { return is_stuck; })) return;

    State attempt = *state;
    Stage rest = all;
    rest.boxes.clear();
    for (const int row : all.boxes) {
      if (!stuck[context.graph().boxes.object[row]]) rest.boxes.push_back(row);
    }
    Summary total = *summary;
    Append(Optimize(context, rest, &attempt), &total);
    for (int object = 0; object < context.graph().num_objects(); ++object) {
      if (!stuck[object]) continue;
      attempt.landmarks.row(object) =
          StartObject(context, attempt, object, context.prepared.boxes_of_object[object]);
    }
    Stage towards = all;
    towards.residual = Residual::kTangent;
    towards.minimizer = Minimizer::kLevenbergMarquardt;
    Append(Optimize(context, towards, &attempt), &total);
    Append(Optimize(context, all, &attempt), &total);
    if (!KeepIfBetter(attempt, total, state, summary)) return;
  }
}

void TryOtherDepths(const SolveContext& context, State* state, Summary* summary) {
  SolveOptions options = context.options;
  options.start = Start::kSizePrior;
  const SolveContext by_size{context.prepared, options, context.monitor};
  State attempt = *state;
  Summary total = *summary;
  bool any = false;
  for (int object = 0; object < context.graph().num_objects(); ++object) {
    const std::vector<int>& boxes = context.prepared.boxes_of_object[object];
    const bool is_few = static_cast<int>(boxes.size()) <= kFewBoxes;
    if (!is_few && !HasImpossibleSize(context, *state, object)) continue;
    const Stage alone = StageOfObject(context, object);
    State moved = attempt;
    moved.landmarks.row(object) = StartObject(by_size, moved, object, boxes);
    const Summary there = Optimize(context, alone, &moved);
    State stayed = attempt;
    const Summary here = Optimize(context, alone, &stayed);
    if (!(there.final_cost < here.final_cost)) continue;
    attempt.landmarks.row(object) = moved.landmarks.row(object);
    any = true;
  }
  if (!any) return;
  Append(Optimize(context, BatchStage(context), &attempt), &total);
  KeepIfBetter(attempt, total, state, summary);
}

}  // namespace dqslam
