#include "dqslam/online/session.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dqslam/costs/whitening.h"
#include "dqslam/geometry/dispatch.h"
#include "dqslam/online/checks.h"
#include "dqslam/online/initialize_object.h"
#include "dqslam/online/loop_closing.h"
#include "dqslam/online/merge.h"
#include "dqslam/online/reinitialize.h"
#include "dqslam/online/relabel.h"
#include "dqslam/online/schedule.h"
#include "dqslam/online/to_graph.h"
#include "dqslam/online/window.h"

namespace dqslam::online {
namespace {

// What a long chain of poses does as a whole weighs little beside the diagonal of its normal
// equations: with more damping than this it only creeps.
constexpr double kFirstDamping = 1e-8;
constexpr double kMostDamping = 1e-2;  // that a window takes over from the one before
// An object is started again when it has so many observations.
constexpr int kReinitializeAt[] = {4, 8, 16, 32};
constexpr int kRefineIterations = 6;

// The object of a map, with the prior on its size that all objects have: the covariance has it too.
Object ObjectOfMap(const Model& model,
                   const Vector9d& ellipsoid,
                   const Matrix9d& covariance,
                   const SizePrior& size) {
  Object object;
  object.center_shape = CenterShapeFromEllipsoid(ellipsoid);
  object.size = size;
  object.map.origin = object.center_shape;
  const Matrix9d W = SqrtInformation<9>(covariance);
  object.map.H = InformationInCenterShape(object.center_shape, W.transpose() * W);
  GaussianPrior size_prior;
  AddPriors(model, object, object.center_shape, &size_prior);
  object.map.g = -(size_prior.g - GradientOf(object.map, object.center_shape));
  object.map.H -= size_prior.H - object.map.H;
  return object;
}

template <typename Pose>
class SessionOf : public Session {
 public:
  using Storage = typename History<Pose>::Storage;
  using Square = typename History<Pose>::Square;
  using MarginalPriors = typename Window<Pose>::MarginalPriors;

  SessionOf(const Camera& camera, const ScenePriors& scene, const OnlineOptions& options)
      : options_(options),
        model_(camera, scene, options.loss_scale),
        window_(model_),
        schedule_(options) {}

  StepReport Add(const Eigen::VectorXd& relative,
                 const RowMatrix& covariance,
                 const StepObservations& given) override {
    const int pose = num_poses(), objects = num_objects();
    const bool first_is_known = pose == 0 && covariance.size() == 0;
    const typename History<Pose>::Step step =
        CheckedStep<Pose>(relative, covariance, first_is_known);
    const std::vector<Observation> observations = CheckedObservations(given, pose, objects);

    // From here on nothing throws but for want of memory.
    if (pose == 0) history_.first_pose_is_known = first_is_known;
    Storage at = step.relative;
    if (pose > 0) {
      Pose::Compose(history_.poses.back().data(), step.relative.data(), at.data());
      Pose::Normalize(at.data());
    }
    history_.poses.push_back(at);
    history_.steps.push_back(step);
    history_.steps.back().first_observation = static_cast<int>(history_.observations.size());
    for (Eigen::Index row = 0; row < given.log_size_mean.size(); ++row) {
      history_.objects.emplace_back();
      history_.objects.back().size = {given.log_size_mean[row], given.log_size_sigma[row]};
    }
    for (const Observation& observation : observations) See(observation);
    return Update();
  }

  void AddMapObject(const Vector9d& ellipsoid,
                    const Matrix9d& covariance,
                    const SizePrior& size) override {
    history_.objects.push_back(ObjectOfMap(model_, ellipsoid, covariance, size));
  }

  std::unique_ptr<Session> Clone() const override {
    auto copy = std::make_unique<SessionOf>(model_.camera, model_.scene, options_);
    copy->history_ = history_;
    copy->damping_ = damping_;
    copy->schedule_ = schedule_;
    return copy;
  }

  void Relabel(const NewLabels& labels) override {
    CheckLabels(labels, history_);
    for (const Relabeled& changed : online::Relabel(labels, &history_)) {
      const Object& object = history_.objects[changed.object];
      if (object.observations.empty()) continue;
      const int seen = history_.observations[object.observations.back()].pose;
      if (seen < num_poses() - options_.recent_poses) continue;
      const bool is_watched = schedule_.WatchLoop(changed.last, changed.back, num_poses() - 1);
      if (is_watched && Misfits(object)) schedule_.LoopDoesNotFit();
    }
  }

  void ScaleOdometry(double translation, double rotation) override {
    for (const double factor : {translation, rotation}) {
      if (!std::isfinite(factor) || !(factor > 0)) {
        throw std::invalid_argument("odometry: expected positive, finite factors");
      }
    }
    Eigen::Matrix<double, Pose::kTangentSize, 1> factor;
    factor.setConstant(translation);
    // Tangents are (x, y | theta) in the plane, (x, y, z | rotation vector) in space.
    factor.template tail<Pose::kTangentSize / 2>().setConstant(rotation);
    for (int pose = 1; pose < num_poses(); ++pose) {
      auto& step = history_.steps[pose];
      step.covariance = factor.asDiagonal() * step.covariance * factor.asDiagonal();
      step.sqrt_information = step.sqrt_information * factor.cwiseInverse().asDiagonal();
    }
  }

  double Smooth(int iterations, int begin) override {
    if (begin < 0 || begin > num_poses()) {
      throw std::invalid_argument("begin: there is no pose " + std::to_string(begin));
    }
    double damping = kFirstDamping;
    const WindowResult result =
        window_.Minimize(&history_, begin, MarginalPriors::kRelinearize, iterations, &damping);
    MarkStale(begin, &history_);
    return result.cost;
  }

  void Merge(const RowMatrix& poses, const RowMatrix& ellipsoids) override {
    online::Merge(poses, ellipsoids, &history_);
  }

  Graph ToGraph(std::vector<int>* rows) const override {
    return online::ToGraph(model_, history_, rows);
  }

  int num_poses() const override { return history_.num_poses(); }
  int num_objects() const override { return static_cast<int>(history_.objects.size()); }
  Eigen::VectorXd PoseAt(int row) const override { return history_.poses.at(row); }
  RowMatrix Poses() const override {
    RowMatrix table(num_poses(), Pose::kSize);
    for (int row = 0; row < num_poses(); ++row) table.row(row) = history_.poses[row].transpose();
    return table;
  }
  RowMatrix PosesAt(const IndexVector& rows) const override {
    RowMatrix table(rows.size(), Pose::kSize);
    for (Eigen::Index i = 0; i < rows.size(); ++i) {
      if (rows[i] < 0 || rows[i] >= num_poses()) {
        throw std::out_of_range("row " + std::to_string(i) + ": there is no pose " +
                                std::to_string(rows[i]));
      }
      table.row(i) = history_.poses[rows[i]].transpose();
    }
    return table;
  }
  RowMatrix Ellipsoids() const override {
    RowMatrix table(num_objects(), kLandmarkSize);
    for (int row = 0; row < num_objects(); ++row) {
      EllipsoidFromCenterShape(history_.objects[row].center_shape.data(), table.row(row).data());
    }
    return table;
  }
  IndexVector Observations() const override {
    IndexVector counts = IndexVector::Zero(num_objects());
    for (const Observation& observation : history_.observations) {
      if (!observation.Waits()) counts[observation.object] += observation.is_box;
    }
    return counts;
  }

 private:
  void See(const Observation& observation) {
    history_.observations.push_back(observation);
    if (observation.Waits()) return;
    Object& object = history_.objects[observation.object];
    if (!object.observations.empty()) {
      schedule_.WatchLoop(history_.observations[object.observations.back()].pose,
                          observation.pose,
                          observation.pose);
    }
    object.observations.push_back(static_cast<int>(history_.observations.size()) - 1);
    if (object.center_shape.isZero(0))
      object.center_shape = InitializeObject(model_, history_, object);
    const int count = static_cast<int>(object.observations.size());
    const bool again = std::find(std::begin(kReinitializeAt), std::end(kReinitializeAt), count) !=
                       std::end(kReinitializeAt);
    if (again && object.map.H.isZero(0)) {
      ReinitializeIfBetter(model_, history_, &object);
      object.is_stale = true;
    }
  }

  // Whether no place of an object fits all its observations.  Of one that was told late the window
  // may show nothing: its poses have followed it away.
  bool Misfits(const Object& object) const {
    Vector9d anywhere = object.center_shape;
    const double cost = RefineObject(model_, history_, object, kRefineIterations, &anywhere);
    return 2 * cost >
           options_.loop_chi_square * 4 * static_cast<double>(object.observations.size());
  }

  StepReport Update() {
    StepReport report;
    const int end = num_poses();
    report.pose = end - 1;
    report.first_observation = history_.steps.back().first_observation;
    const int begin = std::max(end - options_.window_poses, FirstFree());
    if (begin >= end) return report;
    report.linearized = UpdateMarginalPriors(model_, begin, &history_);
    damping_ = std::min(damping_, kMostDamping);
    const WindowResult window = window_.Minimize(
        &history_, begin, MarginalPriors::kKeep, options_.window_iterations, &damping_);
    report.window_poses = window.poses;
    report.window_objects = window.objects;
    report.linearized += window.linearized;
    report.undefined = window.undefined;
    report.chi_square = window.residuals > 0 ? window.chi_square / window.residuals : 0;
    const WindowFit fit{begin, end, report.chi_square, window.undefined};
    if (schedule_.Recovers(fit)) StartYoungAgain(&report);
    const Smoothing smoothing = schedule_.Choose(fit);
    report.closed_loop = smoothing.closes_loop;
    if (smoothing.begin < begin) SmoothWindow(smoothing, &report);
    return report;
  }

  int FirstFree() const { return history_.first_pose_is_known ? 1 : 0; }

  void StartYoungAgain(StepReport* report) {
    const int begin = std::max(num_poses() - options_.recent_poses, FirstFree());
    report->smoothed_observations += Recover(model_, begin, options_, &window_, &history_);
    report->smoothed_poses = num_poses() - begin;
    report->recovered = true;
    MarkStale(begin, &history_);
  }

  // Objects in a wrong place are started again, and all is minimized once more.
  void SmoothWindow(const Smoothing& smoothing, StepReport* report) {
    const int from = std::max(smoothing.begin, FirstFree());
    const int window_begin = num_poses() - report->window_poses;
    double damping = kFirstDamping;
    for (int round = 0; round < smoothing.rounds; ++round) {
      const WindowResult result =
          round == 0 && smoothing.closes_loop
              ? CloseLoop(model_, from, window_begin, options_, &window_, &history_)
              : window_.Minimize(
                    &history_, from, MarginalPriors::kRelinearize, smoothing.iterations, &damping);
      MarkStale(from, &history_);
      schedule_.SmoothedWith(result.poses, result.front);
      report->smoothed_poses = result.poses;
      report->smoothed_observations += result.linearized;
      bool changed = false;
      for (const int row : result.misfits) {
        Object& object = history_.objects[row];
        if (!object.map.H.isZero(0)) continue;
        const Vector9d before = object.center_shape;
        ReinitializeIfBetter(model_, history_, &object);
        changed = changed || object.center_shape != before;
      }
      if (!changed) break;
    }
  }

  OnlineOptions options_;
  Model model_;
  Window<Pose> window_;
  History<Pose> history_;
  Schedule schedule_;
  double damping_ = kFirstDamping;  // of the window
};

}  // namespace

std::unique_ptr<Session> Session::Make(PoseModel pose_model,
                                       const Camera& camera,
                                       const ScenePriors& scene,
                                       const OnlineOptions& options) {
  camera.Validate();
  const bool good = options.window_poses > 0 && options.window_iterations > 0 &&
                    options.recent_poses > 0 && options.recent_every > 0 && options.lap_poses > 0 &&
                    options.lap_every > 0 && options.smoothing_iterations > 0 &&
                    options.tour_poses > 0 && options.tour_every > 0 && options.loop_absence > 0 &&
                    options.loop_chi_square > 0 && options.loop_iterations > 0 &&
                    options.loss_scale >= 0;
  if (!good) throw std::invalid_argument("online options: all must be positive");
  return Dispatch(pose_model, [&](auto pose) -> std::unique_ptr<Session> {
    return std::make_unique<SessionOf<decltype(pose)>>(camera, scene, options);
  });
}

}  // namespace dqslam::online
