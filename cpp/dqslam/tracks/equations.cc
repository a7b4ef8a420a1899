#include "dqslam/tracks/equations.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace dqslam::tracks {
namespace {

using RowVector6 = Eigen::Matrix<double, 1, 6>;

// The ground's error is that of another place after so long [s]; where the ground is unknown,
// things rise or sink by so much at most, m / sqrt(s).
constexpr double kForgottenAfterS = 5, kMostDrift = 0.5;

// Density of the height above the ground, in sigmas / sqrt(s), with the median one of these.
double Drift(const std::vector<TrackImage>& images) {
  std::vector<double> units;
  for (const TrackImage& image : images) units.push_back(image.ground.unit);
  std::sort(units.begin(), units.end());
  const std::size_t half = units.size() / 2;
  const double median = units.size() % 2 ? units[half] : 0.5 * (units[half - 1] + units[half]);
  return std::min(1 / std::sqrt(kForgottenAfterS), kMostDrift / median);
}

// How a ground that follows the camera rises at a foot with the motion of the camera.
RowVector6 Rise(const TrackImage& image, const Eigen::Vector3d& foot) {
  const Eigen::Vector3d normal(-image.ground.plane[1], -image.ground.plane[2], 1);
  const Eigen::Vector3d lever = (foot - image.view.position).cross(normal);
  RowVector6 rise;
  rise << normal.transpose() * image.view.rotation, lever.transpose() * image.view.rotation;
  return rise;
}

// Edges that only bound the thing, and are kept by what is predicted: those that something cuts,
// and of a box with such an edge also those whose corner is outside of the image, for the thing may
// reach beyond them.  Where a part of it is beside or behind the camera, it reaches beyond the
// edges that are cut.
EdgeFlags OnlyBounds(const Camera& camera, const TrackImage& image, const UprightBox& seen) {
  EdgeFlags bounds;
  const bool is_cut = image.truncated.any();
  for (int edge = 0; edge < kBoxSize; ++edge) {
    const bool outside =
        !seen.is_whole || !camera.Shows(seen.corner(edge, 0), seen.corner(edge, 1));
    const bool cut = image.truncated[edge] || (is_cut && outside);
    const double beyond = (seen.box[edge] - image.box[edge]) * (edge < 2 ? -1 : 1);
    bounds[edge] = (cut && beyond > 0) || (image.truncated[edge] && !seen.is_whole);
  }
  return bounds;
}

Equations MakeZero(Eigen::Index count) {
  Equations zero;
  zero.diagonal.setZero(6 * count, 6);
  zero.below.setZero(6 * (count - 1), 6);
  zero.of_boxes.setZero(count, 6);
  zero.border.setZero(6 * count, 3);
  zero.corner.setZero();
  zero.gradient.setZero(count, 6);
  zero.gradient_size.setZero();
  zero.by_camera.setZero(9 * count, 6);
  zero.of_camera.setZero(6 * count, 6);
  zero.gradient_camera.setZero(count, 6);
  zero.rest_by_state.setZero(count - 1, 12);
  zero.rest_by_camera.setZero(count - 1, 12);
  zero.chi2.setZero(count);
  return zero;
}

// Adds the box of an image; false where that is undefined.
bool AddBox(const TrackProblem& problem,
            const Trajectory& at,
            double information,
            Eigen::Index row,
            RowVector6* rise,
            Equations* sum) {
  const TrackImage& image = problem.images[row];
  const State state = at.state.row(row);
  const Eigen::Vector3d foot(state[kX], state[kY], image.ground.FootHeight(state));
  const Eigen::Vector3d half = at.log_half.array().exp();
  const UprightBox seen = PredictBox(problem.camera, image.view, {foot, state[kHeading], half});
  if (!seen.is_whole && !(seen.in_front && image.truncated.any())) return false;
  *rise = problem.ground_follows ? Rise(image, foot) : RowVector6::Zero();

  const EdgeFlags bounds = OnlyBounds(problem.camera, image, seen);
  const Eigen::Array4d counts = (!bounds).cast<double>();
  Eigen::Vector4d error =
      (counts * (seen.box - image.box).array() / image.variance.array().sqrt()).matrix();
  const double chi2 = error.squaredNorm();
  const double root = std::sqrt(information * (kFreedom + 4) / (kFreedom + chi2));
  error *= root;
  const Eigen::Vector4d scale = (root * counts / image.variance.array().sqrt()).matrix();
  const Eigen::Vector4d by_height = seen.by_place.col(2);
  Eigen::Matrix<double, 4, kStateSize + 3> by_both;  // by the state and the size
  by_both.setZero();
  by_both.leftCols<2>() =
      seen.by_place.leftCols<2>() + by_height * image.ground.plane.tail<2>().transpose();
  by_both.col(kAbove) = by_height * image.ground.unit;
  by_both.col(kHeading) = seen.by_place.col(3);
  by_both.rightCols<3>() = seen.by_size;
  by_both = scale.asDiagonal() * by_both;
  const Eigen::Matrix<double, 4, 6> by_camera =
      scale.asDiagonal() * (seen.by_camera + by_height * *rise);

  const Eigen::Matrix<double, 9, 9> both = by_both.transpose() * by_both;
  const Eigen::Matrix<double, 9, 1> pull = by_both.transpose() * error;
  sum->diagonal.middleRows<6>(6 * row) += both.topLeftCorner<6, 6>();
  sum->of_boxes.row(row) = both.diagonal().head<6>();
  sum->border.middleRows<6>(6 * row) = both.topRightCorner<6, 3>();
  sum->corner += both.bottomRightCorner<3, 3>();
  sum->gradient.row(row) += pull.head<6>();
  sum->gradient_size += pull.tail<3>();
  sum->by_camera.middleRows<9>(9 * row) = by_both.transpose() * by_camera;
  sum->of_camera.middleRows<6>(6 * row) = by_camera.transpose() * by_camera;
  sum->gradient_camera.row(row) += error.transpose() * by_camera;
  sum->chi2[row] = chi2;
  sum->cost += 0.5 * information * (kFreedom + 4) * std::log1p(chi2 / kFreedom);
  return true;
}

// Adds the motion from an image to the next one, with how the ground rises in both.
void AddStep(const TrackProblem& problem,
             const Trajectory& at,
             const Mask& moves,
             double drift,
             Eigen::Index row,
             const std::vector<RowVector6>& rise,
             Equations* sum) {
  const TrackImage &before = problem.images[row], &after = problem.images[row + 1];
  // The first state has its own prior.
  const bool stops = !moves[row] && row > 0 && moves[row - 1];
  const MotionStep step =
      CompareStates(at.state.row(row),
                    at.state.row(row + 1),
                    after.seconds - before.seconds,
                    moves[row] ? StepKind::kMoves : (stops ? StepKind::kStops : StepKind::kRests),
                    problem.noise,
                    drift,
                    before.ground,
                    after.ground);
  sum->diagonal.middleRows<6>(6 * row) += step.by_from.transpose() * step.by_from;
  sum->diagonal.middleRows<6>(6 * row + 6) += step.by_to.transpose() * step.by_to;
  sum->below.middleRows<6>(6 * row) = step.by_to.transpose() * step.by_from;
  sum->gradient.row(row) += step.error.transpose() * step.by_from;
  sum->gradient.row(row + 1) += step.error.transpose() * step.by_to;
  sum->cost += 0.5 * step.error.squaredNorm();
  sum->log_density += step.log_density;
  sum->rest_by_state.row(row) << step.by_from.row(kAbove), step.by_to.row(kAbove);
  if (moves[row]) return;
  // Where the ground follows the cameras, the height in the world of what rests does, too.
  const double to_rise = step.by_to(kAbove, kAbove) / after.ground.unit;
  sum->rest_by_camera.row(row) << -to_rise * rise[row], to_rise * rise[row + 1];
  sum->gradient_camera.row(row) -= to_rise * step.error[kAbove] * rise[row];
  sum->gradient_camera.row(row + 1) += to_rise * step.error[kAbove] * rise[row + 1];
}

}  // namespace

void RequireFit(const TrackProblem& problem, const Trajectory& at, const Mask& moves) {
  const Eigen::Index count = problem.images.size();
  if (count < 2 || at.state.rows() != count || moves.size() != count - 1) {
    throw std::invalid_argument("a track needs two images, a state for each, a move between them");
  }
}

std::optional<Equations> Linearize(const TrackProblem& problem,
                                   const Trajectory& at,
                                   const Mask& moves,
                                   const State& first,
                                   double information) {
  RequireFit(problem, at, moves);
  const Eigen::Index count = at.state.rows();
  Equations sum = MakeZero(count);
  std::vector<RowVector6> rise(count);
  for (Eigen::Index row = 0; row < count; ++row) {
    if (!AddBox(problem, at, information, row, &rise[row], &sum)) return std::nullopt;
  }
  const double drift = Drift(problem.images);
  for (Eigen::Index row = 0; row + 1 < count; ++row) {
    AddStep(problem, at, moves, drift, row, rise, &sum);
  }

  const State sigmas = FirstSigmas(moves[0], problem.noise);
  State off = at.state.row(0).transpose() - first;
  for (const int row : {kAbove, kSpeed, kTurn}) off[row] = at.state(0, row);
  off = off.cwiseQuotient(sigmas);
  for (int row = 0; row < kStateSize; ++row) {
    sum.diagonal(row, row) += 1 / (sigmas[row] * sigmas[row]);
    sum.gradient(0, row) += off[row] / sigmas[row];
  }
  const Eigen::Vector3d off_size = at.log_half - problem.log_half;
  const Eigen::Vector3d pull = problem.size_precision * off_size;
  sum.corner += problem.size_precision;
  sum.gradient_size += pull;
  sum.cost += 0.5 * (off.squaredNorm() + off_size.dot(pull));
  sum.log_density +=
      0.5 * std::log(problem.size_precision.determinant()) - sigmas.array().log().sum();
  return sum;
}

}  // namespace dqslam::tracks
