#include "dqslam/online/session.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dqslam/costs/whitening.h"
#include "dqslam/geometry/dispatch.h"
#include "dqslam/online/checked.h"
#include "dqslam/online/initialize_object.h"
#include "dqslam/online/loop_closing.h"
#include "dqslam/online/pose_covariances.h"
#include "dqslam/online/relabel.h"
#include "dqslam/online/schedule.h"
#include "dqslam/online/window.h"
#include "dqslam/problem/checks.h"

namespace dqslam::online {
namespace {

constexpr double kMostDamping = 1e-2;  // that a window takes over from the one before
// An object is started again when it has so many observations.
constexpr int kReinitializeAt[] = {4, 8, 16, 32};

// The object of a map, with the prior on its size that all objects have: the covariance has it too.
Object ObjectOfMap(const Model& model,
                   const Vector9d& ellipsoid,
                   const Matrix9d& covariance,
                   const SizePrior& size) {
  Object object;
  object.center_shape = CenterShapeFromEllipsoid(ellipsoid);
  object.size = size;
  GaussianPrior size_prior;
  AddPriors(model, object, object.center_shape, &size_prior);
  const Matrix9d W = SqrtInformation<9>(covariance);
  object.map.origin = object.center_shape;
  object.map.H = InformationInCenterShape(object.center_shape, W.transpose() * W) - size_prior.H;
  object.map.g = -size_prior.g;
  return object;
}

template <typename Pose>
class SessionOf : public Session {
 public:
  SessionOf(const Camera& camera, const ScenePriors& scene, const OnlineOptions& options)
      : options_(options),
        history_(Model(camera, scene, options.loss_scale)),
        window_(&history_),
        loops_(&history_, &window_, options),
        schedule_(options) {
    history_.settling = options.long_smoothing.poses;
  }

  StepReport Add(const Eigen::VectorXd& relative,
                 const RowMatrix& covariance,
                 const StepObservations& given) override {
    const int pose = num_poses();
    const bool first_is_known = pose == 0 && covariance.size() == 0;
    auto step = CheckedStep<Pose>(relative, covariance, first_is_known);
    const std::vector<Observation> observations = CheckedObservations(given, pose, num_objects());

    // From here on nothing throws but for want of memory.
    if (pose == 0) history_.first_pose_is_known = first_is_known;
    step.first_observation = history_.num_observations();
    history_.steps.push_back(step);
    history_.poses.push_back(step.relative);
    history_.DeadReckon(pose);
    covariances_.DeadReckon(history_, pose);
    for (Eigen::Index row = 0; row < given.log_size_mean.size(); ++row) {
      history_.objects.emplace_back();
      history_.objects.back().size = {given.log_size_mean[row], given.log_size_sigma[row]};
    }
    if (pose > 0) loops_.Drift();
    for (const Observation& observation : observations) Observe(observation);
    StepReport report = Update();
    report.covariance = LastCovariance();
    return report;
  }

  void AddMapObject(const Vector9d& ellipsoid,
                    const Matrix9d& covariance,
                    const SizePrior& size) override {
    history_.objects.push_back(ObjectOfMap(history_.model, ellipsoid, covariance, size));
  }

  std::unique_ptr<Session> Clone() const override {
    const Model& model = history_.model;
    auto copy = std::make_unique<SessionOf>(model.camera, model.scene, options_);
    copy->history_ = history_;
    copy->covariances_ = covariances_;
    copy->damping_ = damping_;
    copy->schedule_ = schedule_;
    copy->loops_.set_progress(loops_.progress());
    return copy;
  }

  void Relabel(const NewLabels& labels) override {
    for (const Relabeled& changed : online::Relabel(labels, &history_)) {
      const Object& object = history_.objects[changed.object];
      if (object.observations.empty()) continue;
      const int seen = history_.observations[object.observations.back()].pose;
      if (seen < num_poses() - options_.short_smoothing.poses) continue;
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
        window_.Minimize(begin, MarginalPriors::kRelinearize, iterations, &damping);
    if (result.poses > 0) TakeSmoothing();
    return result.cost;
  }

  void Merge(const RowMatrix& poses, const RowMatrix& ellipsoids) override {
    history_.Merge(poses, ellipsoids);
  }

  Graph ToGraph(std::vector<int>* rows) const override { return history_.ToGraph(rows); }

  int num_poses() const override { return history_.num_poses(); }
  int num_objects() const override { return history_.num_objects(); }

  Eigen::VectorXd PoseAt(int row) const override { return history_.poses.at(row); }

  RowMatrix LastCovariance() const override {
    if (num_poses() == 0) throw std::out_of_range("there is no pose yet");
    return covariances_.last();
  }

  RowMatrix Poses() const override {
    return PosesAt(IndexVector::LinSpaced(num_poses(), 0, num_poses() - 1));
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

  IndexVector Observations() const override { return history_.BoxCounts(); }

 private:
  void Observe(const Observation& observation) {
    history_.observations.push_back(observation);
    if (observation.object < 0) return;
    Object& object = history_.objects[observation.object];
    if (loops_.MustWait(object, observation)) {
      object.observations.push_back(history_.num_observations() - 1);
      history_.Defer(history_.num_observations() - 1);
      return;
    }
    if (!object.observations.empty()) {
      const int last = history_.observations[object.observations.back()].pose;
      const int first = history_.observations[object.observations.front()].pose;
      if (observation.pose - first > options_.loop_absence) loops_.Known();
      schedule_.WatchLoop(last, observation.pose, observation.pose);
    }
    object.observations.push_back(history_.num_observations() - 1);
    if (object.center_shape.isZero(0))
      object.center_shape = ObjectProblem(history_, object).Initialize();
    const int count = static_cast<int>(object.observations.size());
    const bool again =
        std::count(std::begin(kReinitializeAt), std::end(kReinitializeAt), count) > 0;
    if (again && !object.IsOfMap()) {
      object.center_shape = ObjectProblem(history_, object).ReinitializeIfBetter();
      object.is_stale = true;
    }
  }

  // Whether no place of an object fits all its observations.  Where labels come late the window may
  // show nothing of that: its poses have followed the object away.
  bool Misfits(const Object& object) const {
    Vector9d anywhere = object.center_shape;
    const double cost = ObjectProblem(history_, object).Refine(&anywhere);
    const double residuals = 4 * static_cast<double>(object.observations.size());
    return 2 * cost > options_.loop_chi_square * residuals;
  }

  StepReport Update() {
    StepReport report;
    report.pose = num_poses() - 1;
    report.first_observation = history_.steps.back().first_observation;
    const int begin = FirstOfLast(options_.window_poses);
    if (begin > report.pose) return report;
    damping_ = std::min(damping_, kMostDamping);
    const WindowResult window =
        window_.Minimize(begin, MarginalPriors::kKeep, options_.window_iterations, &damping_);
    if (const auto conditional = window_.CovarianceOfLastPose()) {
      covariances_.TakeWindow(history_, begin, *conditional);
    }
    report.window_poses = window.poses;
    report.window_objects = window.objects;
    report.linearized = window.linearized;
    report.undefined = window.undefined;
    report.chi_square = window.residuals > 0 ? window.chi_square / window.residuals : 0;
    if (const auto closed = loops_.Realign()) {
      TakeSmoothing();
      report.closed_loop = true;
      report.smoothed_poses = closed->poses;
      report.smoothed_observations = closed->linearized;
      return report;
    }
    const WindowFit fit{begin, num_poses(), report.chi_square, window.undefined};
    if (schedule_.Recovers(fit)) Recover(&report);
    const Smoothing smoothing = schedule_.Choose(fit);
    report.closed_loop = smoothing.closes_loop;
    if (smoothing.begin < begin) SmoothBeyond(begin, smoothing, &report);
    return report;
  }

  void TakeSmoothing() {
    if (const auto conditional = window_.CovarianceOfLastPose()) {
      covariances_.TakeSmoothing(history_, window_.begin(), *conditional);
    }
  }

  // The first pose that is free among so many last ones.
  int FirstOfLast(int poses) const {
    return std::max(num_poses() - poses, history_.first_pose_is_known ? 1 : 0);
  }

  void Recover(StepReport* report) {
    const SmoothingLevel& level = options_.short_smoothing;
    const WindowResult result = window_.Reinitialize(FirstOfLast(level.poses), level.iterations);
    report->smoothed_poses = result.poses;
    report->smoothed_observations += result.linearized;
    report->recovered = true;
  }

  // Objects in a wrong place are started again, and all is minimized once more.
  void SmoothBeyond(int window_begin, const Smoothing& smoothing, StepReport* report) {
    int begin = std::max(smoothing.begin, FirstOfLast(num_poses()));
    if (smoothing.closes_loop) begin = std::min(loops_.Begin(begin), window_begin);
    double damping = kFirstDamping;
    bool has_changed = true, is_kept = true;
    for (int round = 0; round < smoothing.rounds && has_changed; ++round) {
      const WindowResult result =
          round == 0 && smoothing.closes_loop
              ? loops_.Minimize(begin, window_begin)
              : window_.Minimize(
                    begin, MarginalPriors::kRelinearize, smoothing.iterations, &damping);
      report->smoothed_poses = result.poses;
      report->smoothed_observations += result.linearized;
      is_kept = round > 0 || !smoothing.closes_loop || LoopClosing<Pose>::IsClosed(result);
      has_changed = false;
      for (const int row : result.misfits) {
        Object& object = history_.objects[row];
        if (object.IsOfMap()) continue;
        const Vector9d before = object.center_shape;
        object.center_shape = ObjectProblem(history_, object).ReinitializeIfBetter();
        has_changed = has_changed || object.center_shape != before;
      }
    }
    if (is_kept) {
      TakeSmoothing();
    } else {
      covariances_.DeadReckon(history_, window_begin);
    }
  }

  OnlineOptions options_;
  History<Pose> history_;
  Window<Pose> window_;
  LoopClosing<Pose> loops_;
  Schedule schedule_;
  PoseCovariances<Pose> covariances_;
  double damping_ = kFirstDamping;  // of the window
};

}  // namespace

std::unique_ptr<Session> Session::Make(PoseModel pose_model,
                                       const Camera& camera,
                                       const ScenePriors& scene,
                                       const OnlineOptions& options) {
  camera.Validate();
  CheckScenePriors(scene);
  bool is_good = options.window_poses > 0 && options.window_iterations > 0 &&
                 options.loop_absence > 0 && options.loop_chi_square > 0 &&
                 options.loop_iterations > 0 && options.loss_scale >= 0;
  for (const SmoothingLevel& level :
       {options.short_smoothing, options.medium_smoothing, options.long_smoothing}) {
    is_good = is_good && level.poses > 0 && level.every > 0 && level.iterations > 0;
  }
  if (!is_good) throw std::invalid_argument("online options: all must be positive");
  return Dispatch(pose_model, [&](auto pose) -> std::unique_ptr<Session> {
    return std::make_unique<SessionOf<decltype(pose)>>(camera, scene, options);
  });
}

}  // namespace dqslam::online
