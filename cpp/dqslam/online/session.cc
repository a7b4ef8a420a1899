#include "dqslam/online/session.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dqslam/dispatch.h"
#include "dqslam/online/checks.h"
#include "dqslam/online/close_loop.h"
#include "dqslam/online/merge.h"
#include "dqslam/online/recover.h"
#include "dqslam/online/region.h"
#include "dqslam/online/schedule.h"
#include "dqslam/online/start.h"
#include "dqslam/online/to_graph.h"
#include "dqslam/whitening.h"

namespace dqslam::online {
namespace {

// What a long chain of poses does as a whole weighs little beside the diagonal of its normal
// equations: with more damping than this it only creeps.
constexpr double kFirstDamping = 1e-8;
constexpr double kMostDamping = 1e-2;  // that a window takes over from the one before
// An object is started again when it has so many sights.
constexpr int kTryAgainAt[] = {4, 8, 16, 32};
constexpr int kSettleIterations = 6;

// The object of a map, with the prior on its size that all objects have: the covariance has it too.
Object ObjectOfMap(const Model& model,
                   const Vector9d& ellipsoid,
                   const Matrix9d& covariance,
                   const SizePrior& size) {
  Object object;
  object.chart = ChartFromEllipsoid(ellipsoid);
  object.size = size;
  object.map.origin = object.chart;
  const Matrix9d W = SqrtInformation<9>(covariance);
  object.map.H = InformationInChart(object.chart, W.transpose() * W);
  Quadratic size_prior;
  AddPriors(model, object, object.chart, &size_prior);
  object.map.g = -(size_prior.g - GradientOf(object.map, object.chart));
  object.map.H -= size_prior.H - object.map.H;
  return object;
}

template <typename Pose>
class SessionOf : public Session {
 public:
  using Storage = typename History<Pose>::Storage;
  using Square = typename History<Pose>::Square;
  using Past = typename Region<Pose>::Past;

  SessionOf(const Camera& camera, const ScenePriors& scene, const OnlineOptions& options)
      : options_(options),
        model_(camera, scene, options.loss_scale),
        region_(model_),
        schedule_(options) {}

  StepReport Add(const Eigen::VectorXd& relative,
                 const RowMatrix& covariance,
                 const NewSights& given) override {
    const int pose = num_poses(), objects = num_objects();
    const bool first_is_known = pose == 0 && covariance.size() == 0;
    const typename History<Pose>::Step step =
        CheckedStep<Pose>(relative, covariance, first_is_known);
    const std::vector<Sight> sights = CheckedSights(given, pose, objects);

    // From here on nothing throws but for want of memory.
    if (pose == 0) history_.first_pose_is_known = first_is_known;
    Storage at = step.relative;
    if (pose > 0) {
      Pose::Compose(history_.poses.back().data(), step.relative.data(), at.data());
      Pose::Normalize(at.data());
    }
    history_.poses.push_back(at);
    history_.steps.push_back(step);
    history_.steps.back().first_sight = static_cast<int>(history_.sights.size());
    for (Eigen::Index row = 0; row < given.log_size_mean.size(); ++row) {
      history_.objects.emplace_back();
      history_.objects.back().size = {given.log_size_mean[row], given.log_size_sigma[row]};
    }
    for (const Sight& sight : sights) See(sight);
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
    for (const Relabelled& changed : online::Relabel(labels, &history_)) {
      const Object& object = history_.objects[changed.object];
      if (object.sights.empty()) continue;
      const int seen = history_.sights[object.sights.back()].pose;
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
    const Work work = region_.Minimize(&history_, begin, Past::kAnew, iterations, &damping);
    MarkStale(begin, &history_);
    return work.cost;
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
      EllipsoidFromChart(history_.objects[row].chart.data(), table.row(row).data());
    }
    return table;
  }
  IndexVector Observations() const override {
    IndexVector counts = IndexVector::Zero(num_objects());
    for (const Sight& sight : history_.sights) {
      if (!sight.Waits()) counts[sight.object] += sight.is_box;
    }
    return counts;
  }

 private:
  void See(const Sight& sight) {
    history_.sights.push_back(sight);
    if (sight.Waits()) return;
    Object& object = history_.objects[sight.object];
    if (!object.sights.empty()) {
      schedule_.WatchLoop(history_.sights[object.sights.back()].pose, sight.pose, sight.pose);
    }
    object.sights.push_back(static_cast<int>(history_.sights.size()) - 1);
    if (object.chart.isZero(0)) object.chart = Birth(model_, history_, object);
    const int count = static_cast<int>(object.sights.size());
    const bool again =
        std::find(std::begin(kTryAgainAt), std::end(kTryAgainAt), count) != std::end(kTryAgainAt);
    if (again && object.map.H.isZero(0)) {
      TryAgain(model_, history_, &object);
      object.is_stale = true;
    }
  }

  // Whether no place of an object fits all its sights.  Of one that was told late the window may
  // show nothing: its poses have followed it away.
  bool Misfits(const Object& object) const {
    Vector9d anywhere = object.chart;
    const double cost = Settle(model_, history_, object, kSettleIterations, &anywhere);
    return 2 * cost > options_.loop_chi_square * 4 * static_cast<double>(object.sights.size());
  }

  StepReport Update() {
    StepReport report;
    const int end = num_poses();
    report.pose = end - 1;
    report.first_sight = history_.steps.back().first_sight;
    const int begin = std::max(end - options_.window_poses, FirstFree());
    if (begin >= end) return report;
    report.linearized = KeepPast(model_, begin, &history_);
    damping_ = std::min(damping_, kMostDamping);
    const Work window =
        region_.Minimize(&history_, begin, Past::kKept, options_.window_iterations, &damping_);
    report.window_poses = window.poses;
    report.window_objects = window.objects;
    report.linearized += window.linearized;
    report.undefined = window.undefined;
    report.chi_square = window.residuals > 0 ? window.chi_square / window.residuals : 0;
    const WindowFit fit{begin, end, report.chi_square, window.undefined};
    if (schedule_.Recovers(fit)) StartYoungAgain(&report);
    const Smoothing smoothing = schedule_.Choose(fit);
    report.closed_loop = smoothing.closes_loop;
    if (smoothing.begin < begin) SmoothRegion(smoothing, &report);
    return report;
  }

  int FirstFree() const { return history_.first_pose_is_known ? 1 : 0; }

  void StartYoungAgain(StepReport* report) {
    const int begin = std::max(num_poses() - options_.recent_poses, FirstFree());
    report->smoothed_sights += Recover(model_, begin, options_, &region_, &history_);
    report->smoothed_poses = num_poses() - begin;
    report->recovered = true;
    MarkStale(begin, &history_);
  }

  // Objects in a wrong place are started again, and all is minimised once more.
  void SmoothRegion(const Smoothing& smoothing, StepReport* report) {
    const int from = std::max(smoothing.begin, FirstFree());
    const int window_begin = num_poses() - report->window_poses;
    double damping = kFirstDamping;
    for (int round = 0; round < smoothing.rounds; ++round) {
      const Work work =
          round == 0 && smoothing.closes_loop
              ? CloseLoop(model_, from, window_begin, options_, &region_, &history_)
              : region_.Minimize(&history_, from, Past::kAnew, smoothing.iterations, &damping);
      MarkStale(from, &history_);
      schedule_.SmoothedWith(work.poses, work.front);
      report->smoothed_poses = work.poses;
      report->smoothed_sights += work.linearized;
      bool changed = false;
      for (const int row : work.misfits) {
        Object& object = history_.objects[row];
        if (!object.map.H.isZero(0)) continue;
        const Vector9d before = object.chart;
        TryAgain(model_, history_, &object);
        changed = changed || object.chart != before;
      }
      if (!changed) break;
    }
  }

  OnlineOptions options_;
  Model model_;
  Region<Pose> region_;
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
