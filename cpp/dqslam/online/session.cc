#include "dqslam/online/session.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dqslam/dispatch.h"
#include "dqslam/online/checks.h"
#include "dqslam/online/recover.h"
#include "dqslam/online/region.h"
#include "dqslam/online/start.h"
#include "dqslam/online/to_graph.h"
#include "dqslam/whitening.h"

namespace dqslam::online {
namespace {

constexpr double kFirstDamping = 1e-4;
constexpr double kMostDamping = 1e-2;  // that a window takes over from the one before
constexpr double kLapObjects = 40;     // in the front of a lap of full length, at most
// A young session minimises a lap whenever it has grown by this share, after so many steps.
constexpr int kLapGrowth = 4, kSoonestLap = 16;
// An object is started again when it has so many sights.
constexpr int kTryAgainAt[] = {4, 8, 16, 32};
// What lies before the window is linearised anew when it has grown by this share.
constexpr double kGrowth = 1.25;
constexpr int kSettleIterations = 6;

template <typename Pose>
class SessionOf : public Session {
 public:
  using Storage = typename History<Pose>::Storage;
  using Square = typename History<Pose>::Square;
  using Past = typename Region<Pose>::Past;

  SessionOf(const Camera& camera, const ScenePriors& scene, const OnlineOptions& options)
      : options_(options), model_(camera, scene, options.loss_scale), region_(model_) {}

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
    Object object;
    object.chart = ChartFromEllipsoid(ellipsoid);
    object.size = size;
    object.map.origin = object.chart;
    const Matrix9d W = SqrtInformation<9>(covariance);
    object.map.H = InformationInChart(object.chart, W.transpose() * W);
    // The prior on its size is in that covariance already.
    Quadratic size_prior;
    AddPriors(model_, object, object.chart, &size_prior);
    object.map.g = -(size_prior.g - GradientOf(object.map, object.chart));
    object.map.H -= size_prior.H - object.map.H;
    history_.objects.push_back(object);
  }

  std::unique_ptr<Session> Clone() const override {
    auto copy = std::make_unique<SessionOf>(model_.camera, model_.scene, options_);
    copy->history_ = history_;
    copy->damping_ = damping_;
    copy->next_lap_ = next_lap_;
    copy->lap_objects_ = lap_objects_;
    copy->next_recovery_ = next_recovery_;
    copy->loop_begin_ = loop_begin_;
    copy->loop_until_ = loop_until_;
    copy->loop_misfits_ = loop_misfits_;
    copy->loop_credit_ = loop_credit_;
    return copy;
  }

  void Relabel(const NewLabels& labels) override {
    CheckLabels(labels, history_);
    for (const Relabelled& changed : online::Relabel(labels, &history_)) {
      const Object& object = history_.objects[changed.object];
      if (object.sights.empty()) continue;
      const int seen = history_.sights[object.sights.back()].pose;
      if (seen < num_poses() - options_.recent_poses) continue;
      if (CloseLoop(changed.last, changed.back)) loop_misfits_ = loop_misfits_ || Misfits(object);
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
    MarkStale(begin);
    return work.cost;
  }

  void Merge(const RowMatrix& poses, const RowMatrix& ellipsoids) override {
    const int merged = static_cast<int>(poses.rows()),
              objects = static_cast<int>(ellipsoids.rows());
    if (merged < 1 || merged > num_poses() || objects > num_objects() ||
        poses.cols() != Pose::kSize || (objects > 0 && ellipsoids.cols() != kLandmarkSize) ||
        !poses.allFinite() || !ellipsoids.allFinite()) {
      throw std::invalid_argument("merge: expected finite poses and objects of this session");
    }
    const Storage old = history_.poses[merged - 1];
    const Rigid<double> before = Pose::WorldFromRobot(old.data());
    for (int row = 0; row < merged; ++row) history_.poses[row] = poses.row(row).transpose();
    const Storage now = history_.poses[merged - 1];
    const Rigid<double> after = Pose::WorldFromRobot(now.data());
    for (int row = merged; row < num_poses(); ++row) {
      Storage relative, moved;
      Pose::Between(old.data(), history_.poses[row].data(), relative.data());
      Pose::Compose(now.data(), relative.data(), moved.data());
      Pose::Normalize(moved.data());
      history_.poses[row] = moved;
    }
    const Eigen::Matrix3d turn = after.rotation * before.rotation.transpose();
    for (int row = 0; row < num_objects(); ++row) {
      Object& object = history_.objects[row];
      object.is_stale = true;
      if (row < objects) {
        object.chart = ChartFromEllipsoid(ellipsoids.row(row).transpose());
        continue;
      }
      Surface<double> surface = SurfaceOf(object.chart);
      surface.center = turn * (surface.center - before.translation) + after.translation;
      surface.shape = turn * surface.shape * turn.transpose();
      object.chart = ChartFromSurface(surface);
    }
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
      CloseLoop(history_.sights[object.sights.back()].pose, sight.pose);
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

  // Whether an object that was back after an absence closes a loop: the window is watched for it.
  bool CloseLoop(int last, int back) {
    if (back - last <= options_.loop_absence) return false;
    const int now = num_poses() - 1;
    if (loop_until_ < now) {
      loop_begin_ = last;
      loop_misfits_ = false;
    }
    loop_begin_ = std::min(loop_begin_, last);
    loop_until_ = now + options_.window_poses;
    return true;
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
    report.linearized = KeepPast(begin);
    damping_ = std::min(damping_, kMostDamping);
    const Work window =
        region_.Minimize(&history_, begin, Past::kKept, options_.window_iterations, &damping_);
    report.window_poses = window.poses;
    report.window_objects = window.objects;
    report.linearized += window.linearized;
    report.undefined = window.undefined;
    report.chi_square = window.residuals > 0 ? window.chi_square / window.residuals : 0;
    if (DoesNotFit(window)) StartYoungAgain(&report);
    const int smooth_from = ChooseSmoothing(window, begin, &report);
    if (smooth_from < begin) {
      const int iterations =
          report.closed_loop ? options_.loop_iterations : options_.smoothing_iterations;
      SmoothFrom(smooth_from, iterations, &report);
    }
    return report;
  }

  int FirstFree() const { return history_.first_pose_is_known ? 1 : 0; }

  bool DoesNotFit(const Work& window) {
    return num_poses() >= next_recovery_ &&
           (window.undefined > 0 ||
            window.chi_square > options_.misfit_chi_square * window.residuals);
  }

  void StartYoungAgain(StepReport* report) {
    next_recovery_ = num_poses() + options_.recover_every;
    const int begin = std::max(num_poses() - options_.recent_poses, FirstFree());
    report->smoothed_sights += Recover(model_, begin, options_, &region_, &history_);
    report->smoothed_poses = num_poses() - begin;
    report->recovered = true;
    MarkStale(begin);
  }

  // Objects in a wrong place are started again, and all is minimised once more.
  void SmoothFrom(int begin, int iterations, StepReport* report) {
    double damping = kFirstDamping;
    for (int round = 0; round < 2; ++round) {
      const Work work = region_.Minimize(&history_, begin, Past::kAnew, iterations, &damping);
      MarkStale(begin);
      if (work.poses > options_.recent_poses) lap_objects_ = work.front;
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

  // Work is square in the objects: where there are many, a lap is shorter.
  int LapPoses() const {
    const double square = lap_objects_ * lap_objects_ / (kLapObjects * kLapObjects);
    const int poses = static_cast<int>(options_.lap_poses / std::max(square, 1.0));
    return std::max(poses, std::min(options_.recent_poses, options_.lap_poses));
  }

  // The first pose to minimise beside the window's; the window's begin for none.
  int ChooseSmoothing(const Work& window, int begin, StepReport* report) {
    const int end = num_poses();
    loop_credit_ = std::min(loop_credit_ + 1.0 / options_.lap_every, 3.0);
    const bool loop_is_near = loop_until_ >= end - 1;
    if (loop_is_near && loop_credit_ >= 1 &&
        (loop_misfits_ || window.chi_square > options_.loop_chi_square * window.residuals)) {
      loop_credit_ -= 1;
      loop_until_ = -1;
      loop_misfits_ = false;
      report->closed_loop = true;
      return std::min(loop_begin_, begin);
    }
    if (end >= next_lap_) {
      next_lap_ = end + std::clamp(end / kLapGrowth, kSoonestLap, options_.lap_every);
      return std::max(end - LapPoses(), 0);
    }
    if (end % options_.recent_every == 0) return std::max(end - options_.recent_poses, 0);
    return begin;
  }

  // What the objects of the window keep of the sights before it; counts sights linearised.
  int KeepPast(int begin) {
    int linearized = 0;
    const int first = history_.SightsBefore(begin);
    for (int row = first; row < static_cast<int>(history_.sights.size()); ++row) {
      if (history_.sights[row].Waits()) continue;
      Object& object = history_.objects[history_.sights[row].object];
      const int known = object.is_stale ? 0 : object.past_sights;
      const int count = CountPast(history_, object, begin, known);
      if (!object.is_stale && count == object.past_sights) continue;
      int from = object.past_sights;
      if (object.is_stale || count > kGrowth * object.linearized) {
        object.past = Quadratic();
        object.past.origin = object.chart;
        object.linearized = count;
        object.is_stale = false;
        from = 0;
      }
      AddPast(model_, history_, object, from, count, &object.past);
      object.past_sights = count;
      linearized += count - from;
    }
    return linearized;
  }

  // The objects that poses from `begin` on saw have moved, and so have these poses.
  void MarkStale(int begin) {
    for (int row = history_.SightsBefore(begin); row < static_cast<int>(history_.sights.size());
         ++row) {
      const Sight& sight = history_.sights[row];
      if (!sight.Waits()) history_.objects[sight.object].is_stale = true;
    }
  }

  OnlineOptions options_;
  Model model_;
  Region<Pose> region_;
  History<Pose> history_;
  double damping_ = kFirstDamping;  // of the window
  int loop_begin_ = 0;              // the pose that last saw what has come back
  int loop_until_ = -1;             // until when the window is watched for it
  bool loop_misfits_ = false;       // it was told late, and needs no watching
  int next_lap_ = kSoonestLap;
  int next_recovery_ = 0;
  double lap_objects_ = 0;  // in the front of the last lap
  double loop_credit_ = 1;  // loops that may be closed now
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
                    options.loop_absence > 0 && options.loop_chi_square > 0 &&
                    options.loop_iterations > 0 && options.loss_scale >= 0;
  if (!good) throw std::invalid_argument("online options: all must be positive");
  return Dispatch(pose_model, [&](auto pose) -> std::unique_ptr<Session> {
    return std::make_unique<SessionOf<decltype(pose)>>(camera, scene, options);
  });
}

}  // namespace dqslam::online
