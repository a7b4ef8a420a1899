#include "dqslam/online/session.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dqslam/dispatch.h"
#include "dqslam/online/region.h"
#include "dqslam/online/start.h"
#include "dqslam/whitening.h"

namespace dqslam::online {
namespace {

constexpr double kFirstDamping = 1e-4;
constexpr double kMostDamping = 1e-2;  // that a window takes over from the one before
constexpr int kRecoverIterations = 10;
// What a sight costs beside its tangent residual while its object is not in front.
constexpr double kUndefinedCost = 50;
// A young session minimises a lap whenever it has grown by this share, after so many steps.
constexpr int kLapGrowth = 4, kSoonestLap = 16;
// An object is started again when it has so many sights.
constexpr int kTryAgainAt[] = {4, 8, 16, 32};
// What lies before the window is linearised anew when it has grown by this share.
constexpr double kGrowth = 1.25;

[[noreturn]] void Fail(const std::string& table, Eigen::Index row, const std::string& what) {
  throw std::invalid_argument(table + " row " + std::to_string(row) + ": " + what);
}

template <int n>
Eigen::Matrix<double, n, n> Whitening(const std::string& table,
                                      const RowMatrix& covariances,
                                      Eigen::Index row) {
  using Square = Eigen::Matrix<double, n, n, Eigen::RowMajor>;
  try {
    return SqrtInformation<n>(Eigen::Map<const Square>(covariances.row(row).data()));
  } catch (const std::invalid_argument& error) {
    Fail(table, row, error.what());
  }
}

void CheckShape(const char* table, const RowMatrix& values, Eigen::Index rows, int columns) {
  if (values.rows() == rows && (rows == 0 || values.cols() == columns)) return;
  throw std::invalid_argument(std::string(table) + ": expected " + std::to_string(rows) +
                              " rows of " + std::to_string(columns));
}

// Sights of a pose that is not there yet; new objects have rows from `objects` on.
std::vector<Sight> CheckedSights(const NewSights& given, int pose, int objects) {
  const Eigen::Index boxes = given.object.size(), positions = given.position_object.size();
  CheckShape("boxes", given.box, boxes, kBoxSize);
  CheckShape("box_covariance", given.covariance, boxes, 16);
  CheckShape("positions", given.position, positions, 3);
  CheckShape("position_covariance", given.position_covariance, positions, 9);
  if (given.truncated.rows() != boxes || (boxes > 0 && given.truncated.cols() != kBoxSize)) {
    throw std::invalid_argument("box_truncated: expected a row of 4 for each box");
  }
  const Eigen::Index born = given.log_size_mean.size();
  for (Eigen::Index row = 0; row < born; ++row) {
    if (!std::isfinite(given.log_size_mean[row]) || !(given.log_size_sigma[row] > 0)) {
      Fail("log_size_sigma", row, "expected a finite mean and a positive sigma");
    }
  }
  std::vector<bool> seen(born, false);
  std::vector<Sight> sights;
  for (Eigen::Index row = 0; row < boxes + positions; ++row) {
    const bool is_box = row < boxes;
    const Eigen::Index own = is_box ? row : row - boxes;
    const char* table = is_box ? "boxes" : "positions";
    Sight sight;
    sight.pose = pose;
    sight.object = is_box ? given.object[own] : given.position_object[own];
    sight.is_box = is_box;
    if (sight.object < 0 || sight.object >= objects + born) Fail(table, own, "no such object");
    if (sight.object >= objects) seen[sight.object - objects] = true;
    if (is_box) {
      sight.value = given.box.row(own).transpose();
      sight.sqrt_information = Whitening<4>("box_covariance", given.covariance, own);
      sight.truncated = given.truncated.row(own);
      if (sight.value[0] >= sight.value[2] || sight.value[1] >= sight.value[3]) {
        Fail(table, own, "inverted or empty box");
      }
    } else {
      sight.value << given.position.row(own).transpose(), 0;
      sight.sqrt_information.setZero();
      sight.sqrt_information.topLeftCorner<3, 3>() =
          Whitening<3>("position_covariance", given.position_covariance, own);
    }
    if (!sight.value.allFinite()) Fail(table, own, "NaN or infinite number");
    sights.push_back(sight);
  }
  for (Eigen::Index row = 0; row < born; ++row) {
    if (!seen[row]) Fail("log_size_mean", row, "the new object is not seen");
  }
  return sights;
}

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
    const typename History<Pose>::Step step = CheckedStep(relative, covariance, first_is_known);
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
    copy->next_recovery_ = next_recovery_;
    copy->loop_begin_ = loop_begin_;
    copy->loop_until_ = loop_until_;
    copy->loop_credit_ = loop_credit_;
    return copy;
  }

  double Smooth(int iterations) override {
    double damping = kFirstDamping;
    const Work work = region_.Minimize(&history_, 0, Past::kAnew, iterations, &damping);
    MarkStale(0);
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

  Graph ToGraph(std::vector<int>* rows) const override;

  int num_poses() const override { return history_.num_poses(); }
  int num_objects() const override { return static_cast<int>(history_.objects.size()); }
  Eigen::VectorXd PoseAt(int row) const override { return history_.poses.at(row); }
  RowMatrix Poses() const override {
    RowMatrix table(num_poses(), Pose::kSize);
    for (int row = 0; row < num_poses(); ++row) table.row(row) = history_.poses[row].transpose();
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
    for (const Sight& sight : history_.sights) counts[sight.object] += sight.is_box;
    return counts;
  }

 private:
  typename History<Pose>::Step CheckedStep(const Eigen::VectorXd& relative,
                                           const RowMatrix& covariance,
                                           bool first_is_known) const {
    constexpr int k = Pose::kTangentSize;
    if (relative.size() != Pose::kSize || !relative.allFinite()) {
      throw std::invalid_argument("odometry: expected " + std::to_string(Pose::kSize) +
                                  " finite numbers");
    }
    if (Pose::kModel == PoseModel::kSe3 && std::abs(relative.tail<4>().norm() - 1) > 1e-6) {
      throw std::invalid_argument("odometry: the quaternion is not unit");
    }
    typename History<Pose>::Step step;
    step.relative = relative;
    step.covariance.setIdentity();
    step.sqrt_information.setIdentity();
    step.first_sight = 0;
    if (first_is_known) return step;
    if (covariance.rows() != k || covariance.cols() != k) {
      throw std::invalid_argument("odometry_covariance: expected shape (" + std::to_string(k) +
                                  ", " + std::to_string(k) + ")");
    }
    step.covariance = covariance;
    try {
      step.sqrt_information = SqrtInformation<k>(step.covariance);
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(std::string("odometry_covariance: ") + error.what());
    }
    return step;
  }

  void See(const Sight& sight) {
    Object& object = history_.objects[sight.object];
    if (!object.sights.empty()) {
      const int last = history_.sights[object.sights.back()].pose;
      if (sight.pose - last > options_.loop_absence) {
        loop_begin_ = loop_until_ < sight.pose ? last : std::min(loop_begin_, last);
        loop_until_ = sight.pose + options_.window_poses;
      }
    }
    object.sights.push_back(static_cast<int>(history_.sights.size()));
    history_.sights.push_back(sight);
    if (object.sights.size() == 1 && object.map.H.isZero(0)) {
      object.chart = Birth(model_, history_, object);
    }
    const int count = static_cast<int>(object.sights.size());
    const bool again =
        std::find(std::begin(kTryAgainAt), std::end(kTryAgainAt), count) != std::end(kTryAgainAt);
    if (again && object.map.H.isZero(0)) {
      TryAgain(model_, history_, &object);
      object.is_stale = true;
    }
  }

  StepReport Update() {
    StepReport report;
    const int end = num_poses();
    report.pose = end - 1;
    const int begin = std::max(end - options_.window_poses, history_.first_pose_is_known ? 1 : 0);
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
    if (DoesNotFit(window)) Recover(&report);
    const int smooth_from = ChooseSmoothing(window, begin, &report);
    if (smooth_from < begin) {
      const int iterations =
          report.closed_loop ? options_.loop_iterations : options_.smoothing_iterations;
      SmoothFrom(smooth_from, iterations, &report);
    }
    return report;
  }

  bool DoesNotFit(const Work& window) {
    return num_poses() >= next_recovery_ &&
           (window.undefined > 0 ||
            window.chi_square > options_.misfit_chi_square * window.residuals);
  }

  // Boxes reject most places far from the right one, so that a window cannot leave a wrong one.
  // The recent poses go back to their odometry and the young objects that they saw to their starts:
  // the tangent residual leads from there to what the boxes then refine, as in Grow().
  void Recover(StepReport* report) {
    const int end = num_poses();
    next_recovery_ = end + options_.recover_every;
    const int begin = std::max(end - options_.recent_poses, history_.first_pose_is_known ? 1 : 0);
    std::vector<int> objects;
    for (int row = history_.SightsBefore(begin); row < static_cast<int>(history_.sights.size());
         ++row) {
      const int object = history_.sights[row].object;
      const bool is_young = history_.objects[object].sights.front() >= history_.SightsBefore(begin);
      if (is_young && history_.objects[object].map.H.isZero(0) &&
          std::find(objects.begin(), objects.end(), object) == objects.end()) {
        objects.push_back(object);
      }
    }
    double damping = kFirstDamping;
    double best = Cost(
        region_.Minimize(&history_, begin, Past::kAnew, options_.smoothing_iterations, &damping));
    for (const bool by_size : {false, true}) {
      const std::vector<Storage> poses(history_.poses.begin() + begin, history_.poses.end());
      std::vector<Vector9d> charts;
      for (const Object& object : history_.objects) charts.push_back(object.chart);
      for (int pose = std::max(begin, 1); pose < end; ++pose) {
        Pose::Compose(history_.poses[pose - 1].data(),
                      history_.steps[pose].relative.data(),
                      history_.poses[pose].data());
      }
      for (const int row : objects) {
        history_.objects[row].chart = StartAgain(model_, history_, history_.objects[row], by_size);
      }
      damping = kFirstDamping;
      region_.Minimize(
          &history_, begin, Past::kAnew, kRecoverIterations, &damping, Edges::kTangent);
      const Work work =
          region_.Minimize(&history_, begin, Past::kAnew, kRecoverIterations, &damping);
      report->smoothed_sights += work.linearized;
      if (Cost(work) < best) {
        best = Cost(work);
        continue;
      }
      std::copy(poses.begin(), poses.end(), history_.poses.begin() + begin);
      for (int row = 0; row < num_objects(); ++row) history_.objects[row].chart = charts[row];
    }
    MarkStale(begin);
    report->recovered = true;
    report->smoothed_poses = end - begin;
  }

  static double Cost(const Work& work) { return work.cost + kUndefinedCost * work.undefined; }

  // Objects in a wrong place are started again, and all is minimised once more.
  void SmoothFrom(int begin, int iterations, StepReport* report) {
    double damping = kFirstDamping;
    for (int round = 0; round < 2; ++round) {
      const Work work = region_.Minimize(&history_, begin, Past::kAnew, iterations, &damping);
      MarkStale(begin);
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

  // The first pose to minimise beside the window's; the window's begin for none.
  int ChooseSmoothing(const Work& window, int begin, StepReport* report) {
    const int end = num_poses();
    loop_credit_ = std::min(loop_credit_ + 1.0 / options_.lap_every, 3.0);
    const bool loop_is_near = loop_until_ >= end - 1;
    if (loop_is_near && loop_credit_ >= 1 &&
        window.chi_square > options_.loop_chi_square * window.residuals) {
      loop_credit_ -= 1;
      loop_until_ = -1;
      report->closed_loop = true;
      return std::min(loop_begin_, begin);
    }
    if (end >= next_lap_) {
      next_lap_ = end + std::clamp(end / kLapGrowth, kSoonestLap, options_.lap_every);
      return std::max(end - options_.lap_poses, 0);
    }
    if (end % options_.recent_every == 0) return std::max(end - options_.recent_poses, 0);
    return begin;
  }

  // What the objects of the window keep of the sights before it; counts sights linearised.
  int KeepPast(int begin) {
    int linearized = 0;
    const int first = history_.SightsBefore(begin);
    for (int row = first; row < static_cast<int>(history_.sights.size()); ++row) {
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
      history_.objects[history_.sights[row].object].is_stale = true;
    }
  }

  OnlineOptions options_;
  Model model_;
  Region<Pose> region_;
  History<Pose> history_;
  double damping_ = kFirstDamping;  // of the window
  int loop_begin_ = 0;              // the pose that last saw what has come back
  int loop_until_ = -1;             // until when the window is watched for it
  int next_lap_ = kSoonestLap;
  int next_recovery_ = 0;
  double loop_credit_ = 1;  // loops that may be closed now
};

template <typename Pose>
Graph SessionOf<Pose>::ToGraph(std::vector<int>* rows) const {
  constexpr int k = Pose::kTangentSize;
  Graph graph;
  graph.pose_model = Pose::kModel;
  graph.camera = model_.camera;
  graph.scene_priors = model_.scene;
  graph.initial_poses.resize(num_poses(), Pose::kSize);
  const int steps = std::max(num_poses() - 1, 0);
  graph.odometry.from = IndexVector::LinSpaced(steps, 0, steps - 1);
  graph.odometry.to = IndexVector::LinSpaced(steps, 1, steps);
  graph.odometry.relative.resize(steps, Pose::kSize);
  graph.odometry.covariance.resize(steps, k * k);
  for (int pose = 0; pose < num_poses(); ++pose) {
    const auto& step = history_.steps[pose];
    Storage at = step.relative;
    if (pose > 0) {
      Pose::Compose(graph.initial_poses.row(pose - 1).data(), step.relative.data(), at.data());
      Pose::Normalize(at.data());
      graph.odometry.relative.row(pose - 1) = step.relative.transpose();
      Eigen::Map<Eigen::Matrix<double, k, k, Eigen::RowMajor>>(
          graph.odometry.covariance.row(pose - 1).data()) = step.covariance;
    }
    graph.initial_poses.row(pose) = at.transpose();
  }
  rows->clear();
  std::vector<int> row_of_object(num_objects(), -1);
  for (int object = 0; object < num_objects(); ++object) {
    const std::vector<int>& own = history_.objects[object].sights;
    const bool has_box = std::any_of(
        own.begin(), own.end(), [this](int row) { return history_.sights[row].is_box; });
    if (!has_box) continue;
    row_of_object[object] = static_cast<int>(rows->size());
    rows->push_back(object);
  }
  graph.size_prior.log_mean.resize(rows->size());
  graph.size_prior.log_sigma.resize(rows->size());
  for (size_t row = 0; row < rows->size(); ++row) {
    graph.size_prior.log_mean[row] = history_.objects[(*rows)[row]].size.log_mean;
    graph.size_prior.log_sigma[row] = history_.objects[(*rows)[row]].size.log_sigma;
  }
  const auto takes_part = [&](const Sight& sight) { return row_of_object[sight.object] >= 0; };
  int boxes = 0, positions = 0;
  for (const Sight& sight : history_.sights) {
    if (takes_part(sight)) ++(sight.is_box ? boxes : positions);
  }
  graph.boxes = {IndexVector(boxes),
                 IndexVector(boxes),
                 RowMatrix(boxes, kBoxSize),
                 RowMatrix(boxes, 16),
                 BoolTable(boxes, kBoxSize)};
  graph.positions = {IndexVector(positions),
                     IndexVector(positions),
                     RowMatrix(positions, 3),
                     RowMatrix(positions, 9)};
  boxes = positions = 0;
  for (const Sight& sight : history_.sights) {
    if (!takes_part(sight)) continue;
    const int object = row_of_object[sight.object];
    if (sight.is_box) {
      const Eigen::Matrix4d& W = sight.sqrt_information;
      const Eigen::Matrix4d covariance = (W.transpose() * W).inverse();
      graph.boxes.pose[boxes] = sight.pose;
      graph.boxes.object[boxes] = object;
      graph.boxes.box.row(boxes) = sight.value.transpose();
      graph.boxes.covariance.row(boxes) =
          Eigen::Map<const Eigen::Matrix<double, 1, 16>>(covariance.data());
      graph.boxes.truncated.row(boxes++) = sight.truncated.transpose();
    } else {
      const Eigen::Matrix3d W = sight.sqrt_information.topLeftCorner<3, 3>();
      const Eigen::Matrix3d covariance = (W.transpose() * W).inverse();
      graph.positions.pose[positions] = sight.pose;
      graph.positions.object[positions] = object;
      graph.positions.object_in_robot.row(positions) = sight.value.head<3>().transpose();
      graph.positions.covariance.row(positions++) =
          Eigen::Map<const Eigen::Matrix<double, 1, 9>>(covariance.data());
    }
  }
  return graph;
}

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
